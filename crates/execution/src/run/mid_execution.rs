//! Runs that begin in the middle of an execution, for rollouts.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::work_queue::PendingStep;
use super::{ActionHandle, ActionLog, BeliefState, PlanEvent, Ports, Run, RunSettings};
use crate::executor::PreparedPlan;
use crate::executor::StepId;
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
        run.initial_belief = belief.clone();
        run.belief = belief;
        run.replans = replans;
        run.plan_events = news;
        run.work_queue = match beginning {
            EntryPoint::Continue => Vec::new(),
            EntryPoint::Adopt(mission) => vec![PendingStep::AdoptPrepared(mission)],
            EntryPoint::Replan(reason) => vec![PendingStep::Replan(reason)],
        };
        run
    }
}
