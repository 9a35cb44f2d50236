//! Early starts of actions that can be repeated.
//!
//! Some actions must begin before another one ends, and end after it: a weld that begins while a
//! clamp closes, and ends when it is closed. If the weld begins too late, the clamp fails, and the
//! part is lost. If it begins too early, it fails itself, and can be repeated. If the plan has little
//! slack to one side, the weld therefore begins in the first half of the clamp.

use elbowroom_model::ground::{Action, Change};
use elbowroom_num::Rational;
use elbowroom_plan::{Bound, Constraint, InstanceId, Node, NodeId, ParameterId, Side};

use super::ExecutedPlan;
use crate::dispatchable_cache::DispatchableCache;
use crate::executor::{PreparedPlan, StepId};
use crate::preparation::RegionOracle;
use crate::reason::{GuaranteeLevel, Reason};

/// The slack, as a share of the planned duration, with which no early start is needed.
fn sufficient_slack() -> Rational {
    Rational::new(1, 2)
}

/// The slack to the harmless side with which a plan succeeds without a repetition in most cases.
fn slack_without_repetition() -> Rational {
    Rational::new(1, 8)
}

impl ExecutedPlan {
    /// Begins with a plan, with early starts if these are safer. Actions that fail for that reason
    /// need a new plan.
    pub(super) fn with_early_starts(
        mission: &PreparedPlan,
        region: &mut dyn RegionOracle,
    ) -> Result<Self, Box<Reason>> {
        let Some(early) = plan_with_early_starts(mission) else {
            return Self::new(mission, region);
        };
        let mut rest = Self::new(&early, region)?;
        // The region still contains the removed orders.
        rest.reads_more_than_facts = false;
        rest.guarantee = GuaranteeLevel::Luck;
        rest.guarantee_at_last_search = GuaranteeLevel::Luck;
        Ok(rest)
    }
}

/// A repeatable action that must begin before another one ends, and end after it.
struct Overlap {
    /// The index of the constraint that orders the ends.
    order: usize,
    /// The action that fails if the repeatable one begins too late.
    needing: InstanceId,
    repeatable: InstanceId,
}

/// Returns the plan without the orders that some repeatable actions need to succeed, so that these
/// start early. `None` if there are none, or if numbers depend on durations.
fn plan_with_early_starts(mission: &PreparedPlan) -> Option<PreparedPlan> {
    let constraints = mission.plan.plan.constraints.iter().enumerate();
    let overlaps: Vec<Overlap> = constraints
        .filter_map(|(index, constraint)| narrow_overlap(mission, index, constraint))
        .collect();
    if overlaps.is_empty() || mission.plan.durations_move_numbers() {
        return None;
    }
    let mut mission = mission.clone();
    for overlap in overlaps {
        let delay = earliest_start(&mission, &overlap);
        let plan = &mut mission.plan.plan;
        let starts = (plan.start(overlap.needing), plan.start(overlap.repeatable));
        let order = &mut plan.constraints[overlap.order];
        match delay {
            Some(delay) => {
                (order.from, order.to) = starts;
                order.lower = Bound::Finite(delay);
            }
            None => order.lower = Bound::Infinite,
        }
    }
    mission.dispatchable_cache = DispatchableCache::default();
    Some(mission)
}

/// Returns the overlap whose ends the constraint orders, if the plan has little slack there.
fn narrow_overlap(
    mission: &PreparedPlan,
    order: usize,
    constraint: &Constraint,
) -> Option<Overlap> {
    let plan = &mission.plan.plan;
    let node = |id: NodeId| &plan.nodes[id.index()];
    let (Node::End(needing), Node::End(repeatable)) = (node(constraint.from), node(constraint.to))
    else {
        return None;
    };
    let (needing, repeatable) = (*needing, *repeatable);
    let orders =
        |it: &Constraint| matches!(it.lower, Bound::Finite(_)) && it.upper == Bound::Infinite;
    let (start, end) = (plan.start(repeatable), constraint.from);
    let needs_start = |it: &Constraint| (it.from, it.to) == (start, end) && orders(it);
    let is_overlap = orders(constraint)
        && needing != repeatable
        && is_repeatable(&plan.instance(repeatable).action)
        && !is_repeatable(&plan.instance(needing).action)
        && !mission.running.contains_key(&StepId::from(repeatable))
        && plan.constraints.iter().any(needs_start)
        && has_little_slack(mission, [needing, repeatable]);
    is_overlap.then_some(Overlap {
        order,
        needing,
        repeatable,
    })
}

/// Returns `true` if an action can be started again after it has failed at its end: all that it has
/// done by then is to make facts true.
fn is_repeatable(action: &Action) -> bool {
    action.durative().is_some_and(|body| {
        let mut effects = body.start.effects.iter();
        let is_addition = |change: &Change| matches!(change, Change::Add(_));
        !body.is_running && body.continuous.is_empty() && effects.all(|it| is_addition(&it.change))
    })
}

/// Returns `true` if the envelope permits one of these durations to deviate by little, to one side.
fn has_little_slack(mission: &PreparedPlan, instances: [InstanceId; 2]) -> bool {
    let Some(envelope) = &mission.envelope else {
        return false;
    };
    let is_narrow = |parameter: ParameterId| {
        let planned = &mission.plan.parameter(parameter).nominal;
        Side::BOTH.into_iter().any(|side| {
            let end = side.of(envelope.interval(parameter)).value();
            end.is_some_and(|end| (end - planned).abs() < planned * sufficient_slack())
        })
    };
    let mut durations = mission.plan.open_durations();
    durations.any(|(instance, parameter)| instances.contains(&instance) && is_narrow(parameter))
}

/// Returns the earliest start of the repeatable action after the start of the one that needs it, so
/// that the first one rarely fails. `None` if it must begin too late for that.
fn earliest_start(mission: &PreparedPlan, overlap: &Overlap) -> Option<Rational> {
    let duration = |instance| {
        let mut durations = mission.plan.open_durations();
        let (_, parameter) = durations.find(|(it, _)| *it == instance)?;
        Some(mission.plan.parameter(parameter).nominal.clone())
    };
    let (needing, repeatable) = (duration(overlap.needing)?, duration(overlap.repeatable)?);
    let (one, slack) = (Rational::from(1), slack_without_repetition());
    let latest_end_of_needing = &needing * (&one + &slack);
    let earliest = latest_end_of_needing - &repeatable * (&one - &slack);
    let latest = &needing * (&one - sufficient_slack());
    (earliest <= latest).then(|| earliest.max(Rational::ZERO))
}
