//! `stn`: dispatch within the windows of the plan's network.

use elbowroom_num::Rational;
use elbowroom_plan::uncertain::ConstraintRole;
use elbowroom_plan::{Constraint, NodeId};

use super::{ExecutorEntry, Needs};
use crate::dispatch::{Dispatch, constant_bounds, replan};
use crate::executor::PlanForm;
use crate::executor::{Decided, DecisionContext, Executor, Planned, PreparedPlan, StepId};
use crate::measured_amounts::amounts;
use crate::reason::Reason;

pub(super) const REGISTERED: ExecutorEntry = ExecutorEntry {
    name: "stn",
    argument: None,
    is_optional: false,
    summary: "Dispatches on the whole network, with the durations that the domain allows, and \
              replans when something happens outside its window.",
    paper: "Dechter, Meiri & Pearl (1991); Muscettola, Morris & Tsamardinos (1998)",
    needs: Needs::plan(PlanForm::Network),
    roles: &[],
    make: |_, _| Box::new(Stn { state: None }),
};

/// See [`REGISTERED`].
#[derive(Debug)]
struct Stn {
    state: Option<(Dispatch, PreparedPlan)>,
}

impl Executor for Stn {
    fn need(&self) -> PlanForm {
        REGISTERED.needs.plan
    }

    fn adopt(&mut self, mission: &PreparedPlan) -> Result<(), Box<Reason>> {
        // If the domain leaves a duration open, it is contingent, provided that the network is then
        // dynamically controllable. If not, the executor commands the planned durations, or else
        // chooses durations itself.
        let attempt = |open: DurationDecider| {
            let reading = |constraint: &Constraint| reading(mission, constraint, open);
            Dispatch::with_contingent_durations(mission, &reading)
        };
        let dispatch = if reads_planned_duration(mission) {
            attempt(DurationDecider::Planned)
        } else {
            attempt(DurationDecider::World).or_else(|_| attempt(DurationDecider::Planned))
        };
        let dispatch = dispatch.or_else(|_| attempt(DurationDecider::Executor));
        self.state = Some((dispatch?, mission.clone()));
        Ok(())
    }

    fn decide(&mut self, moment: &DecisionContext<'_>) -> Decided {
        let Some((dispatch, mission)) = &mut self.state else {
            return super::without_plan();
        };
        if let Some(reason) = dispatch.process_news(moment) {
            return replan(*reason);
        }
        for deviation in amounts(&mission.plan, moment).deviations {
            if let Some(reason) = dispatch.unexpected_failure(moment, &deviation.fluent) {
                return replan(reason);
            }
        }
        dispatch.next(moment)
    }

    fn window(&self, step: StepId, is_end: bool) -> Option<Planned> {
        self.state.as_ref()?.0.planned(step, is_end)
    }
}

/// Returns `true` if an action reads its duration before it ends. Then the plan is known to work only with
/// real durations that equal the planned ones.
fn reads_planned_duration(mission: &PreparedPlan) -> bool {
    let mut instances = mission.plan.plan.instances.iter();
    instances.any(|own| own.action.with_planned_duration(&Rational::ZERO).is_some())
}

/// The party that chooses a duration which the domain leaves open.
#[derive(Clone, Copy, Debug)]
enum DurationDecider {
    /// The world, within the bounds of the domain.
    World,
    /// The executor, which commands the planned duration at the start.
    Planned,
    /// The executor.
    Executor,
}

fn reading(
    mission: &PreparedPlan,
    constraint: &Constraint,
    open: DurationDecider,
) -> ConstraintRole {
    let plan = &mission.plan.plan;
    let (lower, upper) = constant_bounds(constraint);
    let is_open = lower != upper || lower.is_none();
    let is_duration = plan.duration_of(constraint).is_some();
    match (open, &lower) {
        (DurationDecider::World, Some(least)) if is_duration && is_open && !least.is_negative() => {
            ConstraintRole::Contingent {
                lower: least.clone(),
                upper,
            }
        }
        (DurationDecider::Planned, _) if is_duration && is_open => {
            let time = |node: NodeId| &mission.nominal[node];
            let planned = time(constraint.to) - time(constraint.from);
            ConstraintRole::Requirement {
                lower: Some(planned.clone()),
                upper: Some(planned),
            }
        }
        _ => ConstraintRole::Requirement { lower, upper },
    }
}
