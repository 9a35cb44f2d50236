//! Numbers that a domain leaves open: `:synth-parameters`.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use elbowroom_model::Task;
use elbowroom_model::ground::{Action, Condition, Expression};
use elbowroom_model::problem::Unknown;

use crate::parameter::ParameterKind;
use crate::stn_plan::{InstanceId, StnPlan};
use crate::valuation::ParameterId;

/// An open number of a domain, as it occurs in a plan.
///
/// It belongs to the whole domain, or (with an instance) to each instance of an action.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct OpenNumber {
    /// The instance that it belongs to, if it is an action's.
    pub(crate) instance: Option<InstanceId>,
    /// Its position among the unknowns of the domain or of the instance's schema.
    pub(crate) index: u32,
}

impl OpenNumber {
    /// Returns `?s`, or `n0.?r`.
    pub(crate) fn name(self, task: &Task, plan: &StnPlan) -> String {
        let index = self.index as usize;
        match self.instance {
            None => task.problem().unknowns[index].clone(),
            Some(id) => {
                let instance = plan.instance(id);
                let schema = &task.problem().schemas[instance.action.schema.index()];
                format!("{}.{}", instance.label, schema.unknowns[index])
            }
        }
    }

    /// Returns the kind of its parameter.
    pub(crate) fn kind(self) -> ParameterKind {
        match self.instance {
            None => ParameterKind::Domain,
            Some(id) => ParameterKind::Constant(id),
        }
    }
}

/// Returns all open numbers that this plan could mention: the domain's, then those of each
/// instance.
pub(crate) fn possible(task: &Task, plan: &StnPlan) -> Vec<OpenNumber> {
    let numbered = |instance: Option<InstanceId>, count: usize| {
        let count = u32::try_from(count).expect("fewer than 2^32 unknowns");
        (0..count).map(move |index| OpenNumber { instance, index })
    };
    let mut all: Vec<_> = numbered(None, task.problem().unknowns.len()).collect();
    for (position, instance) in plan.instances.iter().enumerate() {
        let schema = &task.problem().schemas[instance.action.schema.index()];
        let id = InstanceId::from(position);
        all.extend(numbered(Some(id), schema.unknowns.len()));
    }
    all
}

/// Returns the open numbers that the plan's actions or the goal mention, in the order of
/// [`possible`].
pub(crate) fn mentioned(task: &Task, plan: &StnPlan) -> Vec<OpenNumber> {
    let mut found = BTreeSet::new();
    for (position, instance) in plan.instances.iter().enumerate() {
        let id = InstanceId::from(position);
        visit_action(&instance.action, &mut |leaf| {
            found.extend(open_number(leaf, Some(id)));
        });
    }
    visit_condition(task.goal(), &mut |leaf| {
        found.extend(open_number(leaf, None));
    });
    found.into_iter().collect()
}

/// Returns `true` if a rule of a derived predicate mentions an open number.
pub(crate) fn do_rules_mention_unknowns(task: &Task) -> bool {
    let mut found = false;
    for rule in task.rules().iter() {
        visit_condition(&rule.body, &mut |leaf| {
            found |= open_number(leaf, None).is_some();
        });
    }
    found
}

/// Replaces the open numbers in the plan's actions and in the goal by the parameters.
pub(crate) fn substitute_unknowns(
    plan: &mut StnPlan,
    goal: &mut Condition,
    parameters: &BTreeMap<OpenNumber, ParameterId>,
) {
    let filled = |leaf: &Expression, instance: Option<InstanceId>| {
        let id = parameters.get(&open_number(leaf, instance)?)?;
        Some(Expression::Unknown(Unknown::Parameter(id.0)))
    };
    for (position, instance) in plan.instances.iter_mut().enumerate() {
        let id = InstanceId::from(position);
        let mut is_filled = false;
        let action = instance.action.map_leaves(&mut |leaf| {
            let filled = filled(leaf, Some(id));
            is_filled |= filled.is_some();
            filled
        });
        if is_filled {
            instance.action = Arc::new(action);
        }
    }
    *goal = goal.map_leaves(&mut |leaf| filled(leaf, None));
}

/// Returns the open number that a leaf of this instance's expressions denotes.
fn open_number(leaf: &Expression, instance: Option<InstanceId>) -> Option<OpenNumber> {
    match leaf {
        Expression::Unknown(Unknown::Domain(index)) => Some(OpenNumber {
            instance: None,
            index: *index,
        }),
        Expression::Unknown(Unknown::Action(index)) => Some(OpenNumber {
            instance,
            index: *index,
        }),
        _ => None,
    }
}

/// Calls `visit` for each leaf of each expression of the action.
fn visit_action(action: &Action, visit: &mut impl FnMut(&Expression)) {
    // `map_leaves` visits every leaf; the copy is dropped.
    let _ = action.map_leaves(&mut |leaf| {
        visit(leaf);
        None
    });
}

fn visit_condition(condition: &Condition, visit: &mut impl FnMut(&Expression)) {
    condition.visit_expressions(&mut |expression| expression.visit_leaves(visit));
}
