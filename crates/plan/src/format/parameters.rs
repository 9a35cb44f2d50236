//! Kinds, values and ranges of the parameters of an STN plan file.

use std::collections::BTreeMap;

use elbowroom_model::Task;
use elbowroom_num::{End, Interval, Rational};
use elbowroom_text::Report;

use super::nominal::{self, Draft};
use super::syntax::{File, Limit, ParameterItem};
use super::tokens::Span;
use crate::parameter::{Parameter, ParameterKind};
use crate::stn_plan::{Bound, Constraint, InstanceId, StnPlan};
use crate::unknowns::{self, OpenNumber};
use crate::valuation::ParameterId;

/// Returns the kind of each declared parameter, determined from the constraints with the parameter.
pub(super) fn kinds(plan: &StnPlan, used: &[Vec<usize>]) -> Vec<ParameterKind> {
    let kind = |index: usize| {
        let id = ParameterId::from(index);
        let duration = used[index]
            .iter()
            .find_map(|&constraint| duration_set_to(plan, &plan.constraints[constraint], id));
        duration.map_or(ParameterKind::Bound, ParameterKind::Duration)
    };
    (0..used.len()).map(kind).collect()
}

/// Returns the instance whose duration the constraint sets to the parameter.
fn duration_set_to(plan: &StnPlan, constraint: &Constraint, id: ParameterId) -> Option<InstanceId> {
    if constraint.lower != Bound::Parameter(id) || constraint.upper != Bound::Parameter(id) {
        return None;
    }
    plan.duration_of(constraint)
}

/// Removes the domain's duration constraints from all instances whose duration is a parameter, even
/// if one parameter is the duration of several.
pub(super) fn free_durations(plan: &mut StnPlan, kinds: &[ParameterKind]) {
    let free: Vec<InstanceId> = plan
        .constraints
        .iter()
        .filter_map(|constraint| match constraint.lower {
            Bound::Parameter(id) if matches!(kinds[id.index()], ParameterKind::Duration(_)) => {
                duration_set_to(plan, constraint, id)
            }
            _ => None,
        })
        .collect();
    plan.free_durations(free);
}

/// Returns the parameter of each number that the domain leaves open and the file or the plan
/// mentions.
pub(super) fn open_numbers(
    file: &File<'_>,
    task: &Task,
    plan: &StnPlan,
    mistakes: &mut Report,
) -> BTreeMap<OpenNumber, ParameterId> {
    let nowhere = Span { start: 0, end: 0 };
    if unknowns::do_rules_mention_unknowns(task) {
        let message = "a derived predicate depends on `:synth-parameters`, which is not supported";
        mistakes.mistake(nowhere, message, None);
    }
    let mut declared = BTreeMap::new();
    for number in unknowns::possible(task, plan) {
        let name = number.name(task, plan);
        let position = file
            .parameters
            .iter()
            .position(|item| item.name.text.eq_ignore_ascii_case(&name));
        declared.extend(position.map(|position| (number, ParameterId::from(position))));
    }
    for number in unknowns::mentioned(task, plan) {
        if !declared.contains_key(&number) {
            let name = number.name(task, plan);
            let message = format!("the domain leaves `{name}` open");
            let expected = format!("add `parameter {name} default VALUE;`");
            mistakes.mistake(nowhere, message, expected);
        }
    }
    declared
}

pub(super) fn parameters(
    file: &File<'_>,
    task: &Task,
    plan: &StnPlan,
    mut kinds: Vec<ParameterKind>,
    open: &BTreeMap<OpenNumber, ParameterId>,
    mistakes: &mut Report,
) -> Option<Vec<Parameter>> {
    for (number, id) in open {
        if kinds[id.index()] == ParameterKind::Bound {
            kinds[id.index()] = number.kind();
        }
    }
    let drafts: Vec<Draft> = file
        .parameters
        .iter()
        .zip(kinds)
        .map(|(item, kind)| {
            let sign = item.default.clone().unwrap_or_default();
            Draft {
                kind,
                nominal: item.default.clone(),
                range: range(item, kind.natural_range(&sign)),
            }
        })
        .collect();
    for (item, draft) in file.parameters.iter().zip(&drafts) {
        check_default(item, draft, mistakes);
    }
    if mistakes.is_failed() {
        return None;
    }
    let nominal = nominal::find(task, plan, &drafts);
    let mut parameters = Vec::with_capacity(drafts.len());
    for ((item, draft), nominal) in file.parameters.iter().zip(drafts).zip(nominal) {
        let Some(nominal) = nominal else {
            let message = format!("`{}` has no nominal value", item.name.text);
            mistakes.mistake(item.name.span, message, "give `default`".to_owned());
            continue;
        };
        parameters.push(Parameter {
            name: item.name.text.to_owned(),
            kind: draft.kind,
            nominal,
            weight: item.weight.clone().unwrap_or(Rational::ONE),
            range: draft.range,
        });
    }
    (!mistakes.is_failed()).then_some(parameters)
}

/// Returns the range from `lb` and `ub`; a missing side is the natural one.
fn range(item: &ParameterItem<'_>, natural: Interval) -> Interval {
    let end = |limit: &Option<Limit>, natural: End| match limit {
        Some(Limit::Number(number)) => End::Closed(number.clone()),
        Some(_) => End::Infinite,
        None => natural,
    };
    Interval {
        lower: end(&item.lower, natural.lower),
        upper: end(&item.upper, natural.upper),
    }
}

fn check_default(item: &ParameterItem<'_>, draft: &Draft, mistakes: &mut Report) {
    let name = item.name;
    if item
        .weight
        .as_ref()
        .is_some_and(|weight| !weight.is_positive())
    {
        let message = format!("the weight of `{}` must be positive", name.text);
        mistakes.mistake(name.span, message, None);
    }
    if draft.range.is_empty() {
        let message = format!("the range {} of `{}` is empty", draft.range, name.text);
        mistakes.mistake(name.span, message, "change `lb` or `ub`".to_owned());
    } else if let Some(default) = draft.nominal.as_ref().filter(|d| !draft.range.contains(d)) {
        let message = format!(
            "the default {default} of `{}` is not in its range {}",
            name.text, draft.range
        );
        mistakes.mistake(
            name.span,
            message,
            "change `default`, `lb` or `ub`".to_owned(),
        );
    }
}
