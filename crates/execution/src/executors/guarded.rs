//! `guarded`: paper 1's executor DREEX.

use elbowroom_num::Rational;
use elbowroom_plan::{Bound, Constraint, DecoupledEnvelope, ParameterId};

use super::Registered;
use crate::dispatch::{Bounds, Dispatch, Sight, replan};
use crate::executor::{Decided, Executor, Mission, Moment, Planned, StepId};
use crate::preparation::Need;
use crate::quantities::{Reading, amounts};
use crate::reason::{Cause, Reason};

pub(super) const REGISTERED: Registered = Registered {
    name: "guarded",
    argument: None,
    is_optional: false,
    summary: "Dispatches within the windows that follow from the plan's envelope, and replans as \
              soon as an observed quantity leaves its interval, a running action outlives its \
              upper end, or too little time is left.",
    paper: "DREEX, Algorithm 2 in Cashmore et al. (2020)",
    need: Need::Envelope,
    make: |_, _| Box::new(Guarded { state: None }),
};

/// See [`REGISTERED`].
#[derive(Debug)]
struct Guarded {
    state: Option<Guard>,
}

#[derive(Debug)]
struct Guard {
    dispatch: Dispatch,
    mission: Mission,
    envelope: DecoupledEnvelope,
}

impl Executor for Guarded {
    fn adopt(&mut self, mission: &Mission) -> Result<(), Box<Reason>> {
        let Some(envelope) = mission.envelope.clone() else {
            let about = "the plan has no envelope";
            return Err(Box::new(Reason::new(Cause::GuaranteeLost).about(about)));
        };
        let bounds = |constraint: &Constraint| bounds(constraint, &envelope);
        self.state = Some(Guard {
            dispatch: Dispatch::new(mission, Sight::Whole, &bounds)?,
            mission: mission.clone(),
            envelope,
        });
        Ok(())
    }

    fn decide(&mut self, moment: &Moment<'_>) -> Decided {
        let Some(guard) = &mut self.state else {
            return super::without_plan();
        };
        if let Some(reason) = guard.dispatch.take(moment) {
            return replan(*reason);
        }
        let amounts = amounts(&guard.mission.plan, moment);
        let outside = amounts
            .readings
            .iter()
            .find_map(|reading| guard.outside(reading, moment.now));
        if let Some(reason) = outside {
            return replan(reason);
        }
        for deviation in &amounts.deviations {
            if let Some(reason) = guard.dispatch.surprise(moment, &deviation.fluent) {
                return replan(reason);
            }
        }
        guard.dispatch.next(moment)
    }

    fn window(&self, step: StepId, is_end: bool) -> Option<Planned> {
        self.state.as_ref()?.dispatch.planned(step, is_end)
    }
}

impl Guard {
    /// Why a parameter's observed value is not guaranteed to do.
    fn outside(&self, reading: &Reading, now: &Rational) -> Option<Reason> {
        let interval = self.envelope.interval(reading.parameter);
        if interval.contains(&reading.value) {
            return None;
        }
        let name = &self.mission.plan.parameter(reading.parameter).name;
        let mut reason = Reason::new(Cause::OutsideInterval).about(name.as_str());
        reason.action = Some(reading.action.clone());
        let below = interval.lower.value().map(|lower| lower - &reading.value);
        let above = interval.upper.value().map(|upper| &reading.value - upper);
        reason.by = below.into_iter().chain(above).max();
        reason.observed = Some(reading.value.clone());
        reason.allowed = Some(interval.clone());
        Some(reason.since(now.clone()))
    }
}

/// What the network is told of a constraint. A duration, and whatever else is one parameter
/// exactly, may be anything in the parameter's interval; a constraint with a parameter on one side
/// must hold whatever the parameter is.
fn bounds(constraint: &Constraint, envelope: &DecoupledEnvelope) -> Bounds {
    let least = |id: ParameterId| envelope.interval(id).lower.value().cloned();
    let greatest = |id: ParameterId| envelope.interval(id).upper.value().cloned();
    if let (Bound::Parameter(lower), Bound::Parameter(upper)) =
        (&constraint.lower, &constraint.upper)
        && lower == upper
    {
        return (least(*lower), greatest(*upper));
    }
    let lower = match &constraint.lower {
        Bound::Infinite => None,
        Bound::Finite(value) => Some(value.clone()),
        Bound::Parameter(id) => greatest(*id),
    };
    let upper = match &constraint.upper {
        Bound::Infinite => None,
        Bound::Finite(value) => Some(value.clone()),
        Bound::Parameter(id) => least(*id),
    };
    (lower, upper)
}
