//! What can be wrong with a request to leave quantities open.

/// A quantity cannot be left open as asked.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ParametrizeError {
    /// The words do not follow the grammar.
    #[error("cannot understand `--vary {spec}`: expected {expected}")]
    Syntax {
        /// The text.
        spec: String,
        /// The form that is expected.
        expected: String,
    },
    /// There is no such kind of quantity.
    #[error("`--vary {spec}`: there is no kind of quantity `{name}`{}", suggestion(.nearest.as_ref()))]
    UnknownKind {
        /// The text.
        spec: String,
        /// The word that stands where a kind is expected.
        name: String,
        /// A similar kind that there is.
        nearest: Option<String>,
    },
    /// A name means nothing in the domain, the problem or the plan.
    #[error("`--vary {spec}`: there is no {kind} `{name}`{}", suggestion(.nearest.as_ref()))]
    UnknownName {
        /// The text.
        spec: String,
        /// The kind of thing that was looked for: `action or label`, `function`, …
        kind: &'static str,
        /// The name.
        name: String,
        /// A similar name that there is.
        nearest: Option<String>,
    },
    /// Everything is known, but the plan has no such quantity.
    #[error("`--vary {spec}`: {why}")]
    NothingMatches {
        /// The text.
        spec: String,
        /// The missing part.
        why: String,
    },
    /// Several numbers could be meant.
    #[error("`--vary {spec}` could mean several things: {}; {advice}", choices.join(", "))]
    Ambiguous {
        /// The text.
        spec: String,
        /// The possible meanings.
        choices: Vec<String>,
        /// How to say which.
        advice: &'static str,
    },
    /// The domain leaves a number open, and its nominal value is not given.
    #[error("the domain leaves `{name}` open: give its nominal value with `--vary '{name}=VALUE'`")]
    NoNominal {
        /// The number.
        name: String,
    },
    /// The nominal value is outside of the range.
    #[error("`{name}` is nominally {nominal}, which is not in its range {range}")]
    OutOfRange {
        /// The parameter.
        name: String,
        /// Its nominal value.
        nominal: String,
        /// Its range.
        range: String,
    },
    /// Derived predicates are decided by rules that every schedule shares.
    #[error("a derived predicate depends on `:synth-parameters`, which is not supported")]
    OpenRule,
}

fn suggestion(nearest: Option<&String>) -> String {
    nearest.map_or_else(String::new, |name| format!("; did you mean `{name}`?"))
}
