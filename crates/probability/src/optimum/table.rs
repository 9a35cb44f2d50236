//! Conditions as tables over states: bit `i` of a state is the truth value of the model's fact `i`.

use elbowroom_model::ground::{Condition, Expression, FactId};

use super::TabulationError;
use crate::model::{Event, Model, Requirement, Semantics, Value, evaluate};

/// Checks that the model is one of a world without numbers and time.
pub(super) fn check(model: &Model) -> Result<(), TabulationError> {
    if model.semantics() != Semantics::World {
        return Err(TabulationError::PaperSemantics);
    }
    let unsupported = |what: &str| TabulationError::Unsupported {
        what: what.to_owned(),
    };
    if !model.fluents.is_empty() {
        return Err(unsupported("actions change numbers"));
    }
    if model.has_rates() {
        return Err(unsupported(
            "facts change, or actions fail, with time, at rates per second",
        ));
    }
    if !model.task().timed().is_empty() {
        return Err(unsupported("facts change at fixed times"));
    }
    if model
        .events
        .iter()
        .any(|event| !event.guard_memories.is_empty())
    {
        return Err(unsupported(
            "effects depend on over-all conditions of an action",
        ));
    }
    let remembers = |event: &Event| event.effects.iter().any(|effect| effect.is_certain);
    if model.events.iter().any(remembers) {
        return Err(unsupported(
            "end effects depend on conditions at the start of an action",
        ));
    }
    Ok(())
}

/// Returns `true` for the states where a requirement holds.
pub(super) fn table(model: &Model, requirement: &Requirement) -> Vec<bool> {
    (0..1_usize << model.facts.len())
        .map(|state| is_satisfied(model, requirement, &|fact| state & (1 << fact) != 0))
        .collect()
}

/// Returns `true` if a requirement holds with these truth values of the model's facts.
pub(super) fn is_satisfied(
    model: &Model,
    requirement: &Requirement,
    truth: &dyn Fn(usize) -> bool,
) -> bool {
    let mut literals = requirement.literals.iter();
    let coupled = requirement.coupled.iter().map(|coupled| &coupled.condition);
    literals.all(|&(fact, wanted)| truth(fact) == wanted)
        && requirement
            .numeric
            .iter()
            .chain(coupled)
            .all(|condition| holds_in(model, condition, truth))
}

/// Returns `true` if a condition holds in a state.
pub(super) fn holds(model: &Model, condition: &Condition, state: usize) -> bool {
    holds_in(model, condition, &|fact| state & (1 << fact) != 0)
}

/// Returns `true` if a condition holds with these truth values of the model's facts.
pub(super) fn holds_in(
    model: &Model,
    condition: &Condition,
    truth: &dyn Fn(usize) -> bool,
) -> bool {
    let truth = |fact: FactId| model.position(fact).is_some_and(truth);
    // Numbers are constant here.
    let value = |leaf: &Expression| match leaf {
        Expression::Fluent(fluent) => model.task().initial().values.get(fluent).into(),
        _ => Value::TimeDependent,
    };
    evaluate(model.task(), condition, &truth, &value).unwrap_or(false)
}
