//! Everything that can be done in a world without time: [`all_actions`].

use elbowroom_model::Task;
use elbowroom_model::ground::{Action, Body, Change, Condition, SnapAction};
use elbowroom_model::reachability::{self, Answer};

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
    let refuse = |what: String| Err(Unsupported { what });
    if let Some(feature) = task.only_judged() {
        return refuse(format!("the problem has {feature}"));
    }
    if !task.timed().is_empty() {
        return refuse("the problem has timed initials".to_owned());
    }
    let Answer::Complete(grounding) =
        reachability::ground(task, &reachability::Settings::default())
    else {
        return refuse("there are more actions than can be listed".to_owned());
    };
    if !grounding.rules.is_empty() {
        return refuse("the domain has derived predicates".to_owned());
    }
    if has_numbers(task.goal()) {
        return refuse("the goal is about numbers".to_owned());
    }
    let mut actions = Vec::new();
    for (schema, arguments) in grounding.instances() {
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
