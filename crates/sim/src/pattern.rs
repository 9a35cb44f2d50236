//! Reading of patterns for actions, fluents and facts.

use elbowroom_model::Problem;
use elbowroom_model::pattern::ActionPattern;

/// The kind of name that a pattern matches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NameKind {
    Actions,
    Functions,
    Predicates,
}

/// Reads a pattern, and checks that its names exist.
///
/// # Errors
/// The mistake, in words.
pub(crate) fn read_pattern(
    text: &str,
    names: NameKind,
    problem: &Problem,
) -> Result<ActionPattern, String> {
    let text = text.trim();
    if text == "*" {
        return Ok(ActionPattern::new(None, None));
    }
    let (inner, has_arguments) = match text.strip_prefix('(').and_then(|t| t.strip_suffix(')')) {
        Some(inner) => (inner, true),
        None => (text, false),
    };
    let mut words = inner.split_whitespace().map(str::to_ascii_lowercase);
    let name = words
        .next()
        .ok_or_else(|| format!("expected a name, `(name _ object)` or `*`, found `{text}`"))?;
    let arguments: Vec<Option<String>> = words.map(|word| (word != "_").then_some(word)).collect();
    if !has_arguments && !arguments.is_empty() {
        return Err(format!("write `({text})` with parentheses"));
    }
    let expected = names.arity(&name, problem)?;
    if has_arguments && arguments.len() != expected {
        return Err(format!(
            "`{name}` takes {expected} arguments, not {}",
            arguments.len()
        ));
    }
    if let Some(unknown) = arguments
        .iter()
        .flatten()
        .find(|object| problem.object(object).is_none())
    {
        return Err(format!("unknown object `{unknown}`"));
    }
    Ok(ActionPattern::new(
        Some(name),
        has_arguments.then_some(arguments),
    ))
}

impl NameKind {
    fn arity(self, name: &str, problem: &Problem) -> Result<usize, String> {
        let same = |other: &str| other.eq_ignore_ascii_case(name);
        let (what, found, all): (_, _, Vec<&str>) = match self {
            Self::Actions => (
                "action",
                problem
                    .schemas
                    .iter()
                    .find(|s| same(&s.name))
                    .map(|s| s.parameters.len()),
                problem.schemas.iter().map(|s| s.name.as_str()).collect(),
            ),
            Self::Functions => (
                "function",
                problem
                    .functions
                    .iter()
                    .find(|f| same(&f.name))
                    .map(|f| f.parameters.len()),
                problem.functions.iter().map(|f| f.name.as_str()).collect(),
            ),
            Self::Predicates => (
                "predicate",
                problem
                    .predicates
                    .iter()
                    .find(|p| same(&p.name))
                    .map(|p| p.parameters.len()),
                problem.predicates.iter().map(|p| p.name.as_str()).collect(),
            ),
        };
        found.ok_or_else(|| {
            format!(
                "the domain has no {what} `{name}`; it has {}",
                all.join(", ")
            )
        })
    }
}
