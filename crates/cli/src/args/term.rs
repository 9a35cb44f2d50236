//! Arguments that are terms of the library: guarantees and objectives.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

/// Creates a parser of terms. Help lists their names and meanings.
pub(super) fn term<T: Copy + Send + Sync + 'static>(
    terms: &'static [(T, &str, &str)],
) -> impl TypedValueParser<Value = T> {
    let values = terms
        .iter()
        .map(|(_, name, meaning)| PossibleValue::new(*name).help(*meaning));
    PossibleValuesParser::new(values).try_map(move |given| {
        let found = terms.iter().find(|(_, name, _)| *name == given);
        found.map(|(term, ..)| *term).ok_or("unknown term")
    })
}
