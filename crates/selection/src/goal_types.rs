//! Goals with arguments of wrong types.

use elbowroom_model::Problem;
use elbowroom_model::problem::{Condition, Term, Variable};

/// Describes a fact or fluent of a goal that the problem does not have, because an object has the
/// wrong type. Such a goal can never be reached.
///
/// The reader of problem files only warns about such a goal; requests reject it, because their
/// sender can correct it.
pub fn ill_typed_part(problem: &Problem, goal: &Condition) -> Option<String> {
    match goal {
        Condition::Atom(atom) => {
            let predicate = &problem.predicates[atom.predicate.index()];
            let of = (predicate.name.as_str(), predicate.parameters.as_slice());
            of_arguments(problem, "fact", of, &atom.arguments)
        }
        Condition::Equal(..) => None,
        Condition::Compare(_, left, right) => [left, right].into_iter().find_map(|side| {
            let mut found = None;
            side.visit_fluents(&mut |fluent| {
                let function = &problem.functions[fluent.function.index()];
                let of = (function.name.as_str(), function.parameters.as_slice());
                let wrong = of_arguments(problem, "fluent", of, &fluent.arguments);
                found = found.take().or(wrong);
            });
            found
        }),
        Condition::Not(part) | Condition::Forall(_, part) | Condition::Exists(_, part) => {
            ill_typed_part(problem, part)
        }
        Condition::And(parts) | Condition::Or(parts) => {
            parts.iter().find_map(|part| ill_typed_part(problem, part))
        }
    }
}

fn of_arguments(
    problem: &Problem,
    kind: &str,
    (name, parameters): (&str, &[Variable]),
    arguments: &[Term],
) -> Option<String> {
    let wrong = arguments
        .iter()
        .zip(parameters)
        .find_map(|(term, parameter)| match term {
            Term::Object(object) if !problem.has_type(*object, &parameter.types) => {
                Some((*object, parameter))
            }
            _ => None,
        });
    let (object, parameter) = wrong?;
    let shown = arguments
        .iter()
        .zip(parameters)
        .map(|(term, own)| match term {
            Term::Object(object) => problem.objects[object.index()].name.as_str(),
            Term::Variable(_) => own.name.as_str(),
        });
    let shown: Vec<&str> = std::iter::once(name).chain(shown).collect();
    let types = parameter.types.iter();
    let types: Vec<&str> = types
        .map(|it| problem.types[it.index()].name.as_str())
        .collect();
    Some(format!(
        "the problem has no {kind} `({})`: `{}` is not of type {}",
        shown.join(" "),
        problem.objects[object.index()].name,
        types.join(" or ")
    ))
}
