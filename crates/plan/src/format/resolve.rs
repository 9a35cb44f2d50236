//! Conversion of the items of an STN plan file to a plan: looks up names in the task and in the
//! file.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::Task;
use elbowroom_model::ground::{Action, Body};
use elbowroom_text::{Report, nearest};

use super::syntax::{BoundText, ConstraintItem, File, InstanceItem, Limit, limit};
use super::tokens::{Span, Token};
use super::{did_you_mean, parameters};
use crate::parameter::ParametrizedPlan;
use crate::stn_plan::{Bound, Constraint, Instance, Node, NodeId, Reason, StnPlan};
use crate::unknowns;
use crate::valuation::ParameterId;

/// Returns the plan, or `None` after recording mistakes.
///
/// If there are mistakes already, unknown names that the broken items may have declared are not
/// reported. All other checks are made.
pub(super) fn resolve(
    file: &File<'_>,
    task: &Task,
    mistakes: &mut Report,
) -> Option<ParametrizedPlan> {
    let is_whole = !mistakes.is_failed();
    let instances = instances(file, task, mistakes);
    let has_all_labels = is_whole && instances.len() == file.instances.len();
    let mut plan = StnPlan::unconstrained(task, instances);
    let names = Names {
        points: time_points(&plan),
        parameters: parameter_names(file, mistakes),
        has_all_points: has_all_labels,
        has_all_parameters: is_whole,
    };
    let mut used = vec![Vec::new(); file.parameters.len()];
    for item in &file.constraints {
        let Some(constraint) = constraint(item, &names, &plan, mistakes) else {
            continue;
        };
        for bound in [&constraint.lower, &constraint.upper] {
            if let Bound::Parameter(id) = bound {
                used[id.index()].push(plan.constraints.len());
            }
        }
        plan.constraints.push(constraint);
    }
    if mistakes.is_failed() {
        return None;
    }
    let kinds = parameters::kinds(&plan, &used);
    parameters::free_durations(&mut plan, &kinds);
    let open = parameters::open_numbers(file, task, &plan, mistakes);
    let parameters = parameters::parameters(file, task, &plan, kinds, &open, mistakes)?;
    let mut goal = task.goal().clone();
    unknowns::substitute_unknowns(&mut plan, &mut goal, &open);
    let plan = ParametrizedPlan {
        plan,
        parameters,
        initial: BTreeMap::new(),
        commanded_durations: BTreeMap::new(),
        goal,
    };
    Some(plan.with_planned_durations())
}

/// Names that constraints can mention.
struct Names<'a> {
    points: BTreeMap<String, NodeId>,
    parameters: BTreeMap<&'a str, ParameterId>,
    /// `true` if no item with mistakes could have declared more of them.
    has_all_points: bool,
    has_all_parameters: bool,
}

fn constraint(
    item: &ConstraintItem<'_>,
    names: &Names<'_>,
    plan: &StnPlan,
    mistakes: &mut Report,
) -> Option<Constraint> {
    let mut point = |name: &Token<'_>| {
        let found = names.points.get(name.text).copied();
        if found.is_none() && names.has_all_points {
            let message = format!("there is no time point `{}`", name.text);
            mistakes.mistake(
                name.span,
                message,
                point_hint(name.text, plan, &names.points),
            );
        }
        found
    };
    let to = point(&item.to);
    let from = point(&item.from);
    let mut bound = |text: &BoundText<'_>, infinity: &Limit| match text {
        BoundText::Limit(Limit::Number(number), _) => Some(Bound::Finite(number.clone())),
        BoundText::Limit(limit, _) if limit == infinity => Some(Bound::Infinite),
        BoundText::Limit(_, span) => {
            let message = "infinite bound with the wrong sign: no times satisfy it";
            mistakes.mistake(*span, message, None);
            None
        }
        BoundText::Name(name) => {
            let found = names.parameters.get(name.text).copied();
            if found.is_none() && names.has_all_parameters {
                let message = format!("there is no parameter `{}`", name.text);
                let near = nearest(name.text, names.parameters.keys().copied());
                mistakes.mistake(name.span, message, did_you_mean(near));
            }
            found.map(Bound::Parameter)
        }
    };
    let lower = bound(&item.lower, &Limit::MinusInfinity);
    let upper = bound(&item.upper, &Limit::Infinity);
    if let (BoundText::Limit(Limit::Number(least), from), BoundText::Limit(Limit::Number(most), to)) =
        (&item.lower, &item.upper)
        && least > most
    {
        let message = format!(
            "empty range: the lower bound {least} is above the upper bound \
                               {most}"
        );
        let advice = "write the lower bound first".to_owned();
        mistakes.mistake(from.to(*to), message, advice);
    }
    Some(Constraint {
        from: from?,
        to: to?,
        lower: lower?,
        upper: upper?,
        reason: Reason::Given,
    })
}

fn instances(file: &File<'_>, task: &Task, mistakes: &mut Report) -> Vec<Instance> {
    let mut labels: BTreeMap<&str, Span> = BTreeMap::new();
    let mut instances = Vec::with_capacity(file.instances.len());
    for item in &file.instances {
        let label = item.label;
        if label.text.starts_with('.') || limit(label.text).is_some() {
            let message = format!("`{}` cannot be a label", label.text);
            mistakes.mistake(label.span, message, "choose a name".to_owned());
        } else if labels.insert(label.text, label.span).is_some() {
            let message = format!("two instances are labelled `{}`", label.text);
            mistakes.mistake(label.span, message, "labels must differ".to_owned());
        }
        if let Some(action) = action(item, task, mistakes) {
            instances.push(Instance {
                label: label.text.to_owned(),
                action: Arc::new(action),
            });
        }
    }
    instances
}

fn action(item: &InstanceItem<'_>, task: &Task, mistakes: &mut Report) -> Option<Action> {
    let (name, arguments) = item.action.split_first()?;
    let problem = task.problem();
    let schema = problem.schema(name.text);
    if schema.is_none() {
        let message = format!("the domain has no action `{}`", name.text);
        let near = nearest(name.text, problem.schemas.iter().map(|s| s.name.as_str()));
        mistakes.mistake(name.span, message, did_you_mean(near));
    }
    let mut objects = Vec::with_capacity(arguments.len());
    for argument in arguments {
        let object = problem.object(argument.text);
        if object.is_none() {
            let message = format!("the problem has no object `{}`", argument.text);
            let near = nearest(
                argument.text,
                problem.objects.iter().map(|o| o.name.as_str()),
            );
            mistakes.mistake(argument.span, message, did_you_mean(near));
        }
        objects.extend(object);
    }
    let schema = schema?;
    if objects.len() < arguments.len() {
        return None;
    }
    let span = name
        .span
        .to(item.action.last().map_or(name.span, |last| last.span));
    let action = match task.instantiate(schema, &objects) {
        Ok(action) => action,
        Err(error) => {
            mistakes.mistake(span, error.to_string(), None);
            return None;
        }
    };
    match (&action.body, item.is_durative) {
        (Body::Instantaneous(_), true) => {
            let message = format!("`{}` is instantaneous", name.text);
            mistakes.mistake(name.span, message, "write `action instance`".to_owned());
        }
        (Body::Durative(_), false) => {
            let message = format!("`{}` takes time", name.text);
            let expected = "write `durative-action instance`".to_owned();
            mistakes.mistake(name.span, message, expected);
        }
        _ => {}
    }
    Some(action)
}

fn parameter_names<'a>(file: &File<'a>, mistakes: &mut Report) -> BTreeMap<&'a str, ParameterId> {
    let mut names = BTreeMap::new();
    for (index, item) in file.parameters.iter().enumerate() {
        let name = item.name;
        if limit(name.text).is_some() {
            let message = format!("`{}` cannot be a parameter's name", name.text);
            mistakes.mistake(name.span, message, "choose another name".to_owned());
        }
        if names.insert(name.text, ParameterId::from(index)).is_some() {
            let message = format!("two parameters have the name `{}`", name.text);
            mistakes.mistake(name.span, message, "names must differ".to_owned());
        }
    }
    names
}

/// Returns the nodes that a file can mention, by name.
fn time_points(plan: &StnPlan) -> BTreeMap<String, NodeId> {
    plan.nodes()
        .filter(|(_, node)| !matches!(node, Node::Timed(_)))
        .map(|(id, _)| (plan.node_label(id), id))
        .collect()
}

fn point_hint(name: &str, plan: &StnPlan, points: &BTreeMap<String, NodeId>) -> Option<String> {
    let label = name
        .strip_suffix(".start")
        .or_else(|| name.strip_suffix(".end"));
    if plan.instances.iter().any(|instance| instance.label == name) {
        return Some(format!(
            "`{name}` takes time: write `{name}.start` or `{name}.end`"
        ));
    }
    if let Some(label) = label
        && points.contains_key(label)
    {
        return Some(format!("`{label}` is instantaneous: write `{label}`"));
    }
    did_you_mean(nearest(name, points.keys().map(String::as_str)))
}
