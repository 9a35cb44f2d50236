//! Look-up of names from specifications in the task and in the plan.

use elbowroom_model::Task;
use elbowroom_model::ground::{Change, FluentId};
use elbowroom_model::problem::{FunctionId, ObjectId};
use elbowroom_num::Rational;

use super::{ParametrizeError, Selection, VarySpec, nothing_matches};
use crate::stn_plan::{InstanceId, StnPlan};
use elbowroom_text::nearest;

/// Returns the selected instances; at least one.
pub(super) fn instances(
    task: &Task,
    plan: &StnPlan,
    spec: &VarySpec,
    selection: &Selection,
) -> Result<Vec<InstanceId>, ParametrizeError> {
    let problem = task.problem();
    let all = || (0..plan.instances.len()).map(InstanceId::from);
    match selection {
        Selection::Named(name) => {
            let labelled = all().find(|&id| plan.instance(id).label == *name);
            match (labelled, problem.schema(name)) {
                (Some(_), Some(_)) => Err(ParametrizeError::Ambiguous {
                    spec: spec.text.clone(),
                    choices: vec![
                        format!("the label `{name}`"),
                        format!("the action `{name}`"),
                    ],
                    advice: "write the action with its arguments in parentheses",
                }),
                (Some(id), None) => Ok(vec![id]),
                (None, Some(schema)) => {
                    let is_meant = |id: &InstanceId| plan.instance(*id).action.schema == schema;
                    some(spec, all().filter(is_meant).collect())
                }
                (None, None) => {
                    let labels = plan.instances.iter().map(|instance| instance.label.clone());
                    let actions = problem.schemas.iter().map(|schema| schema.name.clone());
                    let names = actions.chain(labels);
                    Err(unknown(spec, "action or label", name, names))
                }
            }
        }
        Selection::Exactly(words) => {
            let (name, arguments) = words.split_first().expect("a list has a first word");
            let Some(schema) = problem.schema(name) else {
                let names = problem.schemas.iter().map(|schema| schema.name.clone());
                return Err(unknown(spec, "action", name, names));
            };
            let arguments = arguments
                .iter()
                .map(|name| match name.as_str() {
                    "_" => Ok(None),
                    _ => object(task, spec, name).map(Some),
                })
                .collect::<Result<Vec<_>, _>>()?;
            let is_meant = |id: &InstanceId| {
                let action = &plan.instance(*id).action;
                let pairs = action.arguments.iter().zip(&arguments);
                action.schema == schema
                    && action.arguments.len() == arguments.len()
                    && pairs
                        .into_iter()
                        .all(|(own, asked)| asked.is_none_or(|asked| asked == *own))
            };
            some(spec, all().filter(is_meant).collect())
        }
    }
}

fn some(spec: &VarySpec, found: Vec<InstanceId>) -> Result<Vec<InstanceId>, ParametrizeError> {
    if found.is_empty() {
        return Err(nothing_matches(
            spec,
            "the plan has no such action".to_owned(),
        ));
    }
    Ok(found)
}

fn object(task: &Task, spec: &VarySpec, name: &str) -> Result<ObjectId, ParametrizeError> {
    let problem = task.problem();
    problem.object(name).ok_or_else(|| {
        let names = problem.objects.iter().map(|object| object.name.clone());
        unknown(spec, "object", name, names)
    })
}

/// Returns the function with that name.
pub(super) fn function(
    task: &Task,
    spec: &VarySpec,
    name: &str,
) -> Result<FunctionId, ParametrizeError> {
    let problem = task.problem();
    problem.function(name).ok_or_else(|| {
        let names = problem
            .functions
            .iter()
            .map(|function| function.name.clone());
        unknown(spec, "function", name, names)
    })
}

/// Returns the fluent `(function object …)`.
pub(super) fn fluent(
    task: &Task,
    spec: &VarySpec,
    atom: &[String],
) -> Result<FluentId, ParametrizeError> {
    let (name, arguments) = atom.split_first().expect("an atom has a name");
    let function = function(task, spec, name)?;
    let objects = objects(task, spec, arguments)?;
    let found = task.find_fluent(function, &objects);
    found.ok_or_else(|| nothing_matches(spec, "the problem does not use this fluent".to_owned()))
}

/// Returns the groups of timed initials that change the fact or fluent; at least one.
pub(super) fn timed(
    task: &Task,
    spec: &VarySpec,
    atom: &[String],
    only_deletions: bool,
) -> Result<Vec<usize>, ParametrizeError> {
    let (name, arguments) = atom.split_first().expect("an atom has a name");
    let problem = task.problem();
    let predicate = problem.predicate(name);
    let function = problem.function(name);
    if predicate.is_none() && function.is_none() {
        let predicates = problem.predicates.iter().map(|predicate| &predicate.name);
        let functions = problem.functions.iter().map(|function| &function.name);
        let names = predicates.chain(functions).cloned();
        return Err(unknown(spec, "predicate or function", name, names));
    }
    let objects = objects(task, spec, arguments)?;
    let fact = predicate.and_then(|predicate| task.find_fact(predicate, &objects));
    let fluent = function.and_then(|function| task.find_fluent(function, &objects));
    let is_meant = |change: &Change| match change {
        Change::Delete(other) => Some(*other) == fact,
        Change::Add(other) => Some(*other) == fact && !only_deletions,
        Change::Update { fluent: other, .. } => Some(*other) == fluent && !only_deletions,
    };
    let found: Vec<usize> = (0..task.timed().len())
        .filter(|&group| task.timed()[group].changes.iter().any(is_meant))
        .collect();
    if found.is_empty() {
        let what = if only_deletions {
            "makes it false"
        } else {
            "changes it"
        };
        return Err(nothing_matches(spec, format!("no timed initial {what}")));
    }
    Ok(found)
}

fn objects(
    task: &Task,
    spec: &VarySpec,
    names: &[String],
) -> Result<Vec<ObjectId>, ParametrizeError> {
    names.iter().map(|name| object(task, spec, name)).collect()
}

/// Returns the error for an unknown name.
pub(super) fn unknown(
    spec: &VarySpec,
    kind: &'static str,
    name: &str,
    names: impl IntoIterator<Item = String>,
) -> ParametrizeError {
    let names: Vec<String> = names.into_iter().collect();
    ParametrizeError::UnknownName {
        spec: spec.text.clone(),
        kind,
        name: name.to_owned(),
        nearest: nearest(name, names.iter().map(String::as_str)).map(str::to_owned),
    }
}

/// Returns the numbers after `prefix`, or an empty text if there are none.
pub(super) fn listed(prefix: &str, numbers: &[Rational]) -> String {
    if numbers.is_empty() {
        return String::new();
    }
    let numbers: Vec<_> = numbers.iter().map(ToString::to_string).collect();
    format!("{prefix}{}", numbers.join(" and "))
}
