//! Names of facts and actions in likelihood files.

use elbowroom_model::problem::{ObjectId, PredicateId, Problem, SchemaId, Variable};
use elbowroom_text::nearest;

/// Error message for a name, and advice.
pub(super) type NameError = (String, Option<String>);

fn did_you_mean<'a>(name: &str, candidates: impl Iterator<Item = &'a str>) -> Option<String> {
    nearest(name, candidates).map(|name| format!("did you mean `{name}`?"))
}

/// Returns the basic predicate with that name.
pub(super) fn predicate(problem: &Problem, name: &str) -> Result<PredicateId, NameError> {
    let Some(id) = problem.predicate(name) else {
        let known = problem.predicates.iter().filter(|p| !p.is_derived);
        let suggestion = did_you_mean(name, known.map(|p| p.name.as_str()));
        return Err((format!("unknown predicate `{name}`"), suggestion));
    };
    if problem.predicates[id.index()].is_derived {
        return Err((
            format!("`{name}` is a derived predicate, so it cannot have likelihoods"),
            Some("give likelihoods of the facts that its rules read".to_owned()),
        ));
    }
    Ok(id)
}

/// Returns the action with that name.
pub(super) fn schema(problem: &Problem, name: &str) -> Result<SchemaId, NameError> {
    problem.schema(name).ok_or_else(|| {
        let known = problem.schemas.iter().map(|s| s.name.as_str());
        (
            format!("unknown action `{name}`"),
            did_you_mean(name, known),
        )
    })
}

/// Returns the objects with these names, as arguments for `parameters`.
pub(super) fn arguments<'a>(
    problem: &Problem,
    of: &str,
    parameters: &[Variable],
    names: impl Iterator<Item = &'a str>,
) -> Result<Vec<ObjectId>, NameError> {
    let mut objects = Vec::new();
    for name in names {
        let object = problem.object(name).ok_or_else(|| {
            let known = problem.objects.iter().map(|o| o.name.as_str());
            (
                format!("unknown object `{name}`"),
                did_you_mean(name, known),
            )
        })?;
        if let Some(parameter) = parameters.get(objects.len())
            && !problem.has_type(object, &parameter.types)
        {
            let types = parameter.types.iter();
            let types: Vec<_> = types
                .map(|id| problem.types[id.index()].name.as_str())
                .collect();
            return Err((
                format!(
                    "`{name}` cannot be bound to {} of `{of}`: it is not of type {}",
                    parameter.name,
                    types.join(" or ")
                ),
                None,
            ));
        }
        objects.push(object);
    }
    if objects.len() != parameters.len() {
        return Err((
            format!(
                "`{of}` takes {} arguments, not {}",
                parameters.len(),
                objects.len()
            ),
            None,
        ));
    }
    Ok(objects)
}

/// Returns two flags: the action has an effect that makes facts of the predicate true, and one that
/// makes them false.
pub(super) fn effects_on(
    problem: &Problem,
    schema: SchemaId,
    predicate: PredicateId,
) -> (bool, bool) {
    let (mut adds, mut deletes) = (false, false);
    for (affected, makes_true) in affected(problem, schema) {
        if affected == predicate {
            adds |= makes_true;
            deletes |= !makes_true;
        }
    }
    (adds, deletes)
}

/// Returns the predicates that an action has effects on, with `true` for effects that make facts
/// true.
pub(super) fn affected(problem: &Problem, schema: SchemaId) -> Vec<(PredicateId, bool)> {
    use elbowroom_model::problem::{Body, Change};
    let (first, second) = match &problem.schemas[schema.index()].body {
        Body::Instantaneous { effects, .. } => (effects.as_slice(), [].as_slice()),
        Body::Durative {
            start_effects,
            end_effects,
            ..
        } => (start_effects.as_slice(), end_effects.as_slice()),
    };
    let mut affected = Vec::new();
    for effect in first.iter().chain(second) {
        let entry = match &effect.change {
            Change::Add(atom) => (atom.predicate, true),
            Change::Delete(atom) => (atom.predicate, false),
            Change::Update { .. } => continue,
        };
        if !affected.contains(&entry) {
            affected.push(entry);
        }
    }
    affected
}

/// Returns the error for an effect that an action does not have.
pub(super) fn no_such_effect(problem: &Problem, schema: SchemaId, effect: &str) -> NameError {
    let mut names = Vec::new();
    for (predicate, _) in affected(problem, schema) {
        let name = problem.predicates[predicate.index()].name.as_str();
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let action = &problem.schemas[schema.index()].name;
    let instead = if names.is_empty() {
        "it has no effect on facts".to_owned()
    } else {
        format!("it has effects on {}", names.join(", "))
    };
    (
        format!("`{action}` has no effect `{effect}`"),
        Some(instead),
    )
}

/// Calls `visit` for each tuple of objects that fits the parameters, as long as it returns `true`.
pub(super) fn for_each_tuple(
    problem: &Problem,
    parameters: &[Variable],
    visit: &mut impl FnMut(&[ObjectId]) -> bool,
) {
    fn extend(
        problem: &Problem,
        parameters: &[Variable],
        tuple: &mut Vec<ObjectId>,
        visit: &mut impl FnMut(&[ObjectId]) -> bool,
    ) -> bool {
        let Some(next) = parameters.get(tuple.len()) else {
            return visit(tuple);
        };
        for object in problem.objects_of(&next.types) {
            tuple.push(object);
            let may_continue = extend(problem, parameters, tuple, visit);
            tuple.pop();
            if !may_continue {
                return false;
            }
        }
        true
    }
    extend(problem, parameters, &mut Vec::new(), visit);
}

/// Parses a probability.
pub(super) fn probability(text: &str) -> Result<f64, NameError> {
    let number: Option<f64> = text.parse().ok();
    match number {
        Some(number) if (0.0..=1.0).contains(&number) => Ok(number),
        Some(_) => Err((
            format!("{text} is not a probability"),
            Some("a number from 0 to 1".to_owned()),
        )),
        None => Err((
            format!("`{text}` is not a number"),
            Some("a probability, from 0 to 1".to_owned()),
        )),
    }
}
