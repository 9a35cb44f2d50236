//! Check that the amounts of a world file match effects of actions.

use elbowroom_model::Problem;
use elbowroom_model::problem::{Body, Change, Effect, FunctionId, Schema};

use super::Amount;

/// Returns the reason if no matching action changes a matching fluent at its start or end; `None`
/// if one does. Only names are compared, because objects are unknown before grounding.
pub(super) fn ineffective_amount_reason(amount: &Amount, problem: &Problem) -> Option<String> {
    let is_meant = |function: FunctionId| {
        let function = &problem.functions[function.index()];
        amount.fluent.may_match(&function.name)
    };
    let mut changes_continuously = None;
    let mut names = Vec::new();
    for schema in &problem.schemas {
        if !amount.action.may_match(&schema.name) {
            continue;
        }
        names.push(schema.name.as_str());
        if effects(schema).any(|effect| updated(effect).is_some_and(is_meant)) {
            return None;
        }
        if let Body::Durative { continuous, .. } = &schema.body {
            let mut moved = continuous.iter().map(|effect| effect.fluent.function);
            if let Some(function) = moved.find(|function| is_meant(*function)) {
                let function = problem.functions[function.index()].name.as_str();
                changes_continuously.get_or_insert((schema.name.as_str(), function));
            }
        }
    }
    Some(match changes_continuously {
        Some((action, function)) => format!(
            "`{action}` changes `{function}` only continuously, so that there is no amount to \
             draw; change a fluent of its rate in an [[event]]"
        ),
        None => format!("{} does not change this fluent", names.join(", ")),
    })
}

fn effects(schema: &Schema) -> impl Iterator<Item = &Effect> {
    let (first, second): (&[Effect], &[Effect]) = match &schema.body {
        Body::Instantaneous { effects, .. } => (effects, &[]),
        Body::Durative {
            start_effects,
            end_effects,
            ..
        } => (start_effects, end_effects),
    };
    first.iter().chain(second)
}

fn updated(effect: &Effect) -> Option<FunctionId> {
    match &effect.change {
        Change::Update { fluent, .. } => Some(fluent.function),
        Change::Add(_) | Change::Delete(_) => None,
    }
}
