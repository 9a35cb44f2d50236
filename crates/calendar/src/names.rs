//! Facts and fluents that match a pattern such as `(open _)`.

use elbowroom_model::Problem;
use elbowroom_model::problem::{ObjectId, Variable};
use elbowroom_text::nearest;

use crate::zone::TextError;

/// Kind of a pattern.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Fact,
    Fluent,
}

/// Returns the ground names, such as `(open bakery)`, that match a pattern. `_` matches any object
/// of the type.
///
/// # Errors
/// The problem has no such fact or fluent, or it is derived.
pub(crate) fn ground(text: &str, kind: Kind, problem: &Problem) -> Result<Vec<String>, TextError> {
    let inner = text.trim();
    let inner = inner.strip_prefix('(').and_then(|it| it.strip_suffix(')'));
    let inner = inner.filter(|inner| !inner.contains(['(', ')']));
    let mut words = inner
        .unwrap_or_default()
        .split_whitespace()
        .map(str::to_ascii_lowercase);
    let Some(name) = words.next() else {
        let message = format!("`{text}` is not the name of a {}", kind.word());
        return Err((
            message,
            "write it like `(open bakery)` or `(open _)`".to_owned(),
        ));
    };
    let parameters = kind.parameters(&name, problem)?;
    let arguments: Vec<String> = words.collect();
    if arguments.len() != parameters.len() {
        let message = format!(
            "`{name}` takes {} arguments, but {} are given",
            parameters.len(),
            arguments.len()
        );
        return Err((message, "`_` means any object".to_owned()));
    }
    let mut all: Vec<Vec<ObjectId>> = vec![Vec::new()];
    for (argument, parameter) in arguments.iter().zip(parameters) {
        let objects = objects(argument, parameter, problem)?;
        if all.len().saturating_mul(objects.len()) > MAX_NAMES {
            let message = format!("`{text}` matches more than {MAX_NAMES} {}s", kind.word());
            return Err((message, "name some of the objects".to_owned()));
        }
        all = all
            .iter()
            .flat_map(|begun| {
                objects
                    .iter()
                    .map(|object| [begun.as_slice(), &[*object]].concat())
            })
            .collect();
    }
    if all.is_empty() {
        let message = format!("`{text}` matches nothing: there is no object of the type");
        return Err((message, String::new()));
    }
    Ok(all
        .iter()
        .map(|arguments| problem.apply_name(&name, arguments))
        .collect())
}

/// Maximum number of names that a pattern may match.
const MAX_NAMES: usize = 10_000;

impl Kind {
    fn word(self) -> &'static str {
        match self {
            Self::Fact => "fact",
            Self::Fluent => "fluent",
        }
    }

    fn parameters<'p>(self, name: &str, problem: &'p Problem) -> Result<&'p [Variable], TextError> {
        match self {
            Self::Fact => {
                let Some(predicate) = problem.predicate(name) else {
                    let known = problem.predicates.iter().map(|it| it.name.as_str());
                    return Err(unknown("predicate", name, known));
                };
                if problem.predicates[predicate.index()].is_derived {
                    let message = format!("`{name}` is derived from other facts");
                    return Err((message, "give windows for those facts".to_owned()));
                }
                if problem.object_functions.contains(&predicate) {
                    let message = format!("`{name}` is a function whose values are objects");
                    return Err((
                        message,
                        "write timed initials for it in the problem".to_owned(),
                    ));
                }
                Ok(&problem.predicates[predicate.index()].parameters)
            }
            Self::Fluent => {
                let Some(function) = problem.function(name) else {
                    let known = problem.functions.iter().map(|it| it.name.as_str());
                    return Err(unknown("function", name, known));
                };
                Ok(&problem.functions[function.index()].parameters)
            }
        }
    }
}

fn unknown<'n>(what: &str, name: &str, known: impl Iterator<Item = &'n str> + Clone) -> TextError {
    let message = format!("the domain has no {what} `{name}`");
    let advice = match nearest(name, known.clone()) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("it has {}", known.collect::<Vec<_>>().join(", ")),
    };
    (message, advice)
}

/// Returns the objects that an argument matches.
fn objects(
    argument: &str,
    parameter: &Variable,
    problem: &Problem,
) -> Result<Vec<ObjectId>, TextError> {
    if argument == "_" {
        return Ok(problem.objects_of(&parameter.types).collect());
    }
    let Some(object) = problem.object(argument) else {
        let known = problem.objects.iter().map(|it| it.name.as_str());
        let near = nearest(argument, known).map(|near| format!("did you mean `{near}`?"));
        let message = format!("the problem has no object `{argument}`");
        return Err((
            message,
            near.unwrap_or_else(|| "`_` means any object".to_owned()),
        ));
    };
    if !problem.has_type(object, &parameter.types) {
        let message = format!(
            "the type of `{argument}` does not match that of `{}`",
            parameter.name
        );
        let types = parameter
            .types
            .iter()
            .map(|it| problem.types[it.index()].name.as_str());
        let types: Vec<&str> = types.collect();
        return Err((
            message,
            format!("give an object of type {}", types.join(" or ")),
        ));
    }
    Ok(vec![object])
}
