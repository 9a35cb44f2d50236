//! `stn`: dispatch within the windows of the plan's network.

use super::Registered;
use crate::dispatch::{Dispatch, Sight, given, replan};
use crate::executor::{Decided, Executor, Mission, Moment, Planned, StepId};
use crate::preparation::Need;
use crate::quantities::amounts;
use crate::reason::Reason;

pub(super) const REGISTERED: Registered = Registered {
    name: "stn",
    argument: None,
    is_optional: false,
    summary: "Dispatches within the windows that follow from the whole network, with the \
              durations that the domain allows, and replans when one is missed.",
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
    fn adopt(&mut self, mission: &Mission) -> Result<(), Box<Reason>> {
        let dispatch = Dispatch::new(mission, Sight::Whole, &given)?;
        self.state = Some((dispatch, mission.clone()));
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
