//! Runs that begin in the middle of an execution, for rollouts.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::action_log::ActionLog;
use super::agenda::PendingStep;
use super::history::History;
use super::replans::Replans;
use super::settings::RunSettings;
use super::{Ports, Run};
use crate::belief_state::BeliefState;
use crate::event::ActionHandle;
use crate::executor::{PlanEvent, PreparedPlan, StepId};
use crate::reason::Reason;

/// Initial state of such a run.
#[derive(Clone, Debug)]
pub struct MidExecutionStart {
    /// The belief, at its time. All commanded actions have started.
    pub belief: BeliefState,
    /// News for the executor's first decision.
    pub plan_events: Vec<PlanEvent>,
    /// The running steps of the executor.
    pub running: BTreeMap<StepId, ActionHandle>,
    /// Number of new plans so far.
    pub replans: usize,
}

/// The first task of such a run.
#[derive(Clone, Debug)]
pub enum EntryPoint {
    /// The executor continues its plan.
    Continue,
    /// The executor adopts this plan.
    Adopt(Box<PreparedPlan>),
    /// A new plan is requested for this reason.
    Replan(Reason),
}

impl<'a> Run<'a> {
    /// Creates a run that begins in the middle of an execution. Its task is that of the belief.
    pub fn amid(
        amid: MidExecutionStart,
        beginning: EntryPoint,
        settings: RunSettings,
        ports: Ports<'a>,
    ) -> Self {
        let MidExecutionStart {
            belief,
            plan_events: news,
            running,
            replans,
        } = amid;
        let mut run = Self::new(Arc::clone(belief.task()), None, settings, ports);
        run.now.clone_from(belief.time());
        run.action_log = ActionLog::mid_execution(&belief, &running);
        run.history = History::new(belief.clone());
        run.belief = belief;
        run.replans = Replans::restored(replans);
        run.plan_events = news;
        run.agenda.restart_with(match beginning {
            EntryPoint::Continue => PendingStep::Decide,
            EntryPoint::Adopt(mission) => PendingStep::AdoptPrepared(mission),
            EntryPoint::Replan(reason) => PendingStep::Replan(reason),
        });
        run
    }
}
