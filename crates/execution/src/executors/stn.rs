//! `stn`: dispatch within the windows of the plan's network.

use elbowroom_num::Rational;
use elbowroom_plan::uncertain::Reading;
use elbowroom_plan::{Constraint, NodeId};

use super::Registered;
use crate::dispatch::{Dispatch, given, replan};
use crate::executor::Need;
use crate::executor::{Decided, Executor, Mission, Moment, Planned, StepId};
use crate::quantities::amounts;
use crate::reason::Reason;

pub(super) const REGISTERED: Registered = Registered {
    name: "stn",
    argument: None,
    is_optional: false,
    summary: "Dispatches on the whole network, with the durations that the domain allows, and \
              replans when something happens outside its window.",
    paper: "Dechter, Meiri & Pearl (1991); Muscettola, Morris & Tsamardinos (1998)",
    need: Need::Network,
    make: |_, _| Box::new(Stn { state: None }),
};

/// See [`REGISTERED`].
#[derive(Debug)]
struct Stn {
    state: Option<(Dispatch, Mission)>,
}

impl Executor for Stn {
    fn need(&self) -> Need {
        REGISTERED.need
    }

    fn adopt(&mut self, mission: &Mission) -> Result<(), Box<Reason>> {
        // If the domain leaves a duration open, it is contingent, provided that the network is then
        // dynamically controllable. If not, the executor commands the planned durations, or else
        // chooses durations itself.
        let attempt = |open: Open| {
            let reading = |constraint: &Constraint| reading(mission, constraint, open);
            Dispatch::controlled(mission, &reading)
        };
        let dispatch = if reads_planned_duration(mission) {
            attempt(Open::Planned)
        } else {
            attempt(Open::World).or_else(|_| attempt(Open::Planned))
        };
        let dispatch = dispatch.or_else(|_| attempt(Open::Executor));
        self.state = Some((dispatch?, mission.clone()));
        Ok(())
    }

    fn decide(&mut self, moment: &Moment<'_>) -> Decided {
        let Some((dispatch, mission)) = &mut self.state else {
            return super::without_plan();
        };
        if let Some(reason) = dispatch.take(moment) {
            return replan(*reason);
        }
        for deviation in amounts(&mission.plan, moment).deviations {
            if let Some(reason) = dispatch.surprise(moment, &deviation.fluent) {
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
fn reads_planned_duration(mission: &Mission) -> bool {
    let mut instances = mission.plan.plan.instances.iter();
    instances.any(|own| own.action.with_planned_duration(&Rational::ZERO).is_some())
}

/// The party that chooses a duration which the domain leaves open.
#[derive(Clone, Copy, Debug)]
enum Open {
    /// The world, within the bounds of the domain.
    World,
    /// The executor, which commands the planned duration at the start.
    Planned,
    /// The executor.
    Executor,
}

fn reading(mission: &Mission, constraint: &Constraint, open: Open) -> Reading {
    let plan = &mission.plan.plan;
    let (lower, upper) = given(constraint);
    let is_open = lower != upper || lower.is_none();
    let is_duration = plan.duration_of(constraint).is_some();
    match (open, &lower) {
        (Open::World, Some(least)) if is_duration && is_open && !least.is_negative() => {
            Reading::Contingent {
                lower: least.clone(),
                upper,
            }
        }
        (Open::Planned, _) if is_duration && is_open => {
            let time = |node: NodeId| &mission.nominal[node];
            let planned = time(constraint.to) - time(constraint.from);
            Reading::Requirement {
                lower: Some(planned.clone()),
                upper: Some(planned),
            }
        }
        _ => Reading::Requirement { lower, upper },
    }
}
