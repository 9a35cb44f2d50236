//! Everything that can be done in a world without time: [`all_actions`].

use elbowroom_model::Task;
use elbowroom_model::ground::{Action, Body, Change, Condition, SnapAction};
use elbowroom_model::problem::{ObjectId, SchemaId, TimedChange, TimedInitial};
use elbowroom_model::reachability::{self, Answer, Grounding};
use elbowroom_num::Rational;

use crate::likelihoods::Likelihoods;

/// The problem is not one for a world without time.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}; without time there are only facts, and unconditional effects on them")]
pub struct Unsupported {
    /// The unsupported feature.
    pub what: String,
}

/// All ground actions that can be reached, schema by schema in the domain's order, and in the order
/// of the objects. Conditions that no action can break are left in: the world can.
///
/// # Errors
/// When there are numbers, conditional effects, derived facts or timed initials, or too many
/// actions.
pub fn all_actions(task: &Task) -> Result<Vec<Action>, Unsupported> {
    check(task)?;
    of(task, grounding(task)?.instances())
}

/// The same, with the actions that can be reached only after a failure, because of what it leaves
/// behind.
///
/// # Errors
/// As [`all_actions`].
pub fn all_actions_under(
    task: &Task,
    likelihoods: &Likelihoods,
) -> Result<Vec<Action>, Unsupported> {
    let mut actions = all_actions(task)?;
    if !likelihoods.has_failures() {
        return Ok(actions);
    }
    // What failures leave behind comes about at some time, like what timed initials do.
    let mut problem = task.problem().clone();
    loop {
        let known = problem.timed.len();
        for change in left_behind(task, &actions, likelihoods) {
            if problem.timed.iter().all(|timed| timed.change != change) {
                let time = Rational::ONE;
                problem.timed.push(TimedInitial { time, change });
            }
        }
        if problem.timed.len() == known {
            return Ok(actions);
        }
        actions = of(task, grounding(&Task::new(problem.clone()))?.instances())?;
    }
}

/// What failures of these actions may do to facts.
fn left_behind(task: &Task, actions: &[Action], likelihoods: &Likelihoods) -> Vec<TimedChange> {
    let mut left = Vec::new();
    for action in actions {
        if likelihoods.lasts(action, 1.0) >= 1.0 {
            continue;
        }
        for aftermath in likelihoods.aftermaths(task, action) {
            for (fact, becomes) in aftermath.changes {
                let (predicate, objects) = task.atom(fact);
                left.push(if becomes {
                    TimedChange::Add(predicate, objects)
                } else {
                    TimedChange::Delete(predicate, objects)
                });
            }
        }
    }
    left
}

fn check(task: &Task) -> Result<(), Unsupported> {
    let refuse = |what: String| Err(Unsupported { what });
    if let Some(feature) = task.only_judged() {
        return refuse(format!("the problem has {feature}"));
    }
    if !task.timed().is_empty() {
        return refuse("the problem has timed initials".to_owned());
    }
    Ok(())
}

fn grounding(task: &Task) -> Result<Grounding, Unsupported> {
    let refuse = |what: &str| {
        let what = what.to_owned();
        Err(Unsupported { what })
    };
    let Answer::Complete(grounding) =
        reachability::ground(task, &reachability::Settings::default())
    else {
        return refuse("there are more actions than can be listed");
    };
    if !grounding.rules.is_empty() {
        return refuse("the domain has derived predicates");
    }
    if has_numbers(task.goal()) {
        return refuse("the goal is about numbers");
    }
    Ok(grounding)
}

fn of(task: &Task, instances: Vec<(SchemaId, Vec<ObjectId>)>) -> Result<Vec<Action>, Unsupported> {
    let refuse = |what: String| Err(Unsupported { what });
    let mut actions = Vec::new();
    for (schema, arguments) in instances {
        let name = task.action_name(schema, &arguments);
        let Ok(action) = task.instantiate(schema, &arguments) else {
            return refuse(format!("{name} cannot be instantiated"));
        };
        if let Some(what) = unsupported(&action) {
            return refuse(format!("{name} has {what}"));
        }
        actions.push(action);
    }
    Ok(actions)
}

fn unsupported(action: &Action) -> Option<&'static str> {
    let snaps: Vec<&SnapAction> = match &action.body {
        Body::Instantaneous(snap) => vec![snap],
        Body::Durative(body) => vec![&body.start, &body.end],
    };
    let mut effects = snaps.iter().flat_map(|snap| &snap.effects);
    if effects.any(|effect| !effect.guard.is_trivial()) {
        return Some("conditional effects");
    }
    let mut effects = snaps.iter().flat_map(|snap| &snap.effects);
    let is_numeric = action
        .durative()
        .is_some_and(|body| !body.continuous.is_empty() || has_numbers(&body.over_all))
        || effects.any(|effect| matches!(effect.change, Change::Update { .. }))
        || snaps.iter().any(|snap| has_numbers(&snap.condition));
    is_numeric.then_some("conditions or effects on numbers")
}

fn has_numbers(condition: &Condition) -> bool {
    match condition {
        Condition::Fact(_) => false,
        Condition::Compare(..) => true,
        Condition::Not(part) => has_numbers(part),
        Condition::And(parts) | Condition::Or(parts) => parts.iter().any(has_numbers),
    }
}
