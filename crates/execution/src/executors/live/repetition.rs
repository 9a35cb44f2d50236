//! Repeated adoption of the same plan after its durations were violated.
//!
//! In the same state the planner returns the same plan, however often the world's durations have
//! violated it. If they deviate in the same way each time, its guarantee is useless. So every other
//! attempt after the second is executed by the plan's orderings, without a guarantee. The same
//! applies to a few plans that are adopted alternately.

use std::collections::BTreeMap;

use elbowroom_model::{Step, TimeTriggeredPlan};
use elbowroom_plan::{InstanceId, Node, ParameterKind};

use super::without_guarantee::{ReductionClass, UnguaranteedPlan};
use super::{ExecutedPlan, guarantee_status};
use crate::executor::{PlanEvent, PreparedPlan, StepId};
use crate::preparation::RegionOracle;
use crate::reason::Reason;

/// Number of attempts with a guarantee before the first one without.
const GUARANTEED_ATTEMPTS: usize = 2;

/// Maximum number of plans whose attempts are counted.
const MAX_PLANS: usize = 4;

/// Consecutive attempts to execute the same plans.
#[derive(Clone, Debug, Default)]
pub(super) struct Repetition {
    /// The plans since one was last not abandoned for one of these reasons, with times from their
    /// beginnings, the present one last. With each, the number of times that it was abandoned for
    /// lack of time, or after an untimely end.
    plans: Vec<(TimeTriggeredPlan, usize)>,
    /// `true` if the present attempt was abandoned for one of these reasons.
    has_ended: bool,
    /// `true` if an action of the present attempt has ended earlier or later than planned.
    is_untimely: bool,
}

impl Repetition {
    /// Records the adoption of a plan.
    pub(super) fn note_adopted(&mut self, plan: &TimeTriggeredPlan) {
        if !self.has_ended {
            self.plans.clear();
        }
        let mut known = self.plans.extract_if(.., |(known, _)| known == plan);
        let abandoned = known.next().map_or(0, |(_, abandoned)| abandoned);
        drop(known);
        if self.plans.len() == MAX_PLANS {
            self.plans.remove(0);
        }
        self.plans.push((plan.clone(), abandoned));
        self.has_ended = false;
        self.is_untimely = false;
    }

    /// Records that an action has ended earlier or later than planned. Other actions may fail for
    /// that reason.
    pub(super) fn note_untimely_end(&mut self) {
        self.is_untimely = true;
    }

    /// Records that the present plan is abandoned.
    pub(super) fn note_abandoned(&mut self, reason: &Reason) {
        if !self.has_ended && (self.is_untimely || guarantee_status::lacks_time(reason)) {
            if let Some((_, abandoned)) = self.plans.last_mut() {
                *abandoned += 1;
            }
            self.has_ended = true;
        }
    }

    /// Returns `true` if the present plan is to be executed by its orderings alone.
    pub(super) fn is_by_orderings(&self) -> bool {
        let present = self.plans.last();
        present
            .and_then(|(_, abandoned)| abandoned.checked_sub(GUARANTEED_ATTEMPTS))
            .is_some_and(|more| more.is_multiple_of(2))
    }
}

impl ExecutedPlan {
    /// Returns `true` if an action that has started ends earlier or later than planned.
    pub(super) fn has_untimely_end(&self, news: &[PlanEvent]) -> bool {
        news.iter().any(|news| {
            let PlanEvent::Ended { step, time, .. } = news else {
                return false;
            };
            let [start, _] = self.dispatch.start_and_end_nodes(step.instance());
            let planned = self.dispatch.planned(*step, true).unwrap_or_default();
            let is_early = planned.earliest.is_some_and(|earliest| *time < earliest);
            let is_late = planned.latest.is_some_and(|latest| *time > latest);
            self.dispatch.execution_time(start).is_some() && (is_early || is_late)
        })
    }

    /// Begins with a plan by its orderings, with the planned durations. Durations that the
    /// preparation has chosen instead are only useful for the guarantee.
    pub(super) fn begin_by_orderings(
        mission: &PreparedPlan,
        region: &mut dyn RegionOracle,
    ) -> Option<(Self, UnguaranteedPlan)> {
        let mut rest = Self::new(&with_planned_times(mission), region).ok()?;
        let carried_on =
            rest.continue_by_orderings(ReductionClass::AtMostHalf, &mission.now, region)?;
        Some((rest, carried_on))
    }
}

/// Returns the mission with the planner's times and durations.
fn with_planned_times(mission: &PreparedPlan) -> PreparedPlan {
    let mut planned = mission.clone();
    let steps = mission.instances.iter().zip(&mission.time_triggered.steps);
    let steps: BTreeMap<InstanceId, &Step> = steps
        .map(|(id, step)| (*id, step))
        .filter(|(id, _)| !mission.running.contains_key(&StepId::from(*id)))
        .collect();
    for (node, what) in mission.plan.plan.nodes() {
        let step = |id: InstanceId| steps.get(&id);
        let time = match what {
            Node::Start(id) | Node::Instant(id) => step(id).map(|step| step.start.clone()),
            Node::End(id) => step(id).map(|step| step.end()),
            _ => None,
        };
        if let Some(time) = time {
            planned.nominal[node] = time;
        }
    }
    for parameter in &mut planned.plan.parameters {
        if let ParameterKind::Duration(id) = parameter.kind
            && let Some(duration) = steps.get(&id).and_then(|step| step.duration.as_ref())
        {
            parameter.nominal.clone_from(duration);
        }
    }
    planned
}
