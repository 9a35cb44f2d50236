//! Durations that a plan does not give.

use std::collections::BTreeSet;

use elbowroom_model::Task;
use elbowroom_model::problem::{
    Body, Change, Comparison, Expression, Fluent, FunctionId, ObjectId, Problem, Schema, Term,
    TimedChange,
};
use elbowroom_num::Rational;

/// Returns the duration of an action if the domain gives one number, the same in every state.
///
/// # Errors
/// Returns the reason why there is no such number.
pub(super) fn only_duration(
    task: &Task,
    schema: &Schema,
    arguments: &[ObjectId],
    changing: &BTreeSet<FunctionId>,
) -> Result<Rational, String> {
    let Body::Durative { duration, .. } = &schema.body else {
        return Err("the action takes no time".to_owned());
    };
    let equal = duration
        .iter()
        .find(|constraint| constraint.comparison == Comparison::Equal)
        .ok_or("the domain allows more than one duration")?;
    let value = value(&equal.bound, &|fluent| {
        static_value(task, fluent, arguments, changing)
    })?;
    if value.is_negative() {
        return Err("its duration by the domain is negative".to_owned());
    }
    Ok(value)
}

/// Returns the functions that some effect or timed initial changes.
pub(super) fn changing_functions(problem: &Problem) -> BTreeSet<FunctionId> {
    let mut changing = BTreeSet::new();
    for schema in &problem.schemas {
        let (instant, end, continuous) = match &schema.body {
            Body::Instantaneous { effects, .. } => (effects, None, None),
            Body::Durative {
                start_effects,
                end_effects,
                continuous,
                ..
            } => (start_effects, Some(end_effects), Some(continuous)),
        };
        for effect in instant.iter().chain(end.into_iter().flatten()) {
            if let Change::Update { fluent, .. } = &effect.change {
                changing.insert(fluent.function);
            }
        }
        for effect in continuous.into_iter().flatten() {
            changing.insert(effect.fluent.function);
        }
    }
    for effect in problem.events.iter().flat_map(|event| &event.effects) {
        if let Change::Update { fluent, .. } = &effect.change {
            changing.insert(fluent.function);
        }
    }
    let processes = problem.processes.iter();
    for effect in processes.flat_map(|process| &process.effects) {
        changing.insert(effect.fluent.function);
    }
    for timed in &problem.timed {
        if let TimedChange::Assign(function, ..) = &timed.change {
            changing.insert(*function);
        }
    }
    changing
}

/// Returns the value of a fluent that never changes.
fn static_value(
    task: &Task,
    fluent: &Fluent,
    arguments: &[ObjectId],
    changing: &BTreeSet<FunctionId>,
) -> Result<Rational, String> {
    let problem = task.problem();
    let name = &problem.functions[fluent.function.index()].name;
    if changing.contains(&fluent.function) {
        return Err(format!("it depends on `{name}`, which changes"));
    }
    let objects: Vec<_> = fluent
        .arguments
        .iter()
        .map(|term| match term {
            Term::Variable(position) => arguments[*position],
            Term::Object(object) => *object,
        })
        .collect();
    task.find_fluent(fluent.function, &objects)
        .and_then(|fluent| task.initial().values.get(&fluent).cloned())
        .ok_or_else(|| {
            let fluent = problem.apply_name(name, &objects);
            format!("it depends on `{fluent}`, which has no value")
        })
}

/// Returns the value of an expression, given the values of its fluents.
fn value(
    expression: &Expression,
    of: &impl Fn(&Fluent) -> Result<Rational, String>,
) -> Result<Rational, String> {
    let mut mistake = None;
    let value = expression.evaluate(&mut |leaf| {
        let value = match leaf {
            Expression::Fluent(fluent) => of(fluent),
            _ => Err("the domain does not define it".to_owned()),
        };
        value.map_err(|text| mistake = Some(text)).ok()
    });
    value.ok_or_else(|| mistake.unwrap_or_else(|| "the domain divides by zero".to_owned()))
}
