//! Runs that begin in the middle of an execution, for rollouts.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::agenda::Todo;
use super::{Account, News, Ports, Progression, Run, RunSettings, Ticket};
use crate::executor::Mission;
use crate::executor::StepId;
use crate::reason::Reason;

/// Initial state of such a run.
#[derive(Clone, Debug)]
pub struct Amid {
    /// The belief, at its time. All commanded actions have started.
    pub belief: Progression,
    /// News for the executor's first decision.
    pub news: Vec<News>,
    /// The running steps of the executor.
    pub running: BTreeMap<StepId, Ticket>,
    /// Number of new plans so far.
    pub replans: usize,
}

/// The first task of such a run.
#[derive(Clone, Debug)]
pub enum Beginning {
    /// The executor continues its plan.
    GoesOn,
    /// The executor adopts this plan.
    TakesUp(Box<Mission>),
    /// A new plan is requested for this reason.
    Replans(Reason),
}

impl<'a> Run<'a> {
    /// Creates a run that begins in the middle of an execution. Its task is that of the belief.
    pub fn amid(amid: Amid, beginning: Beginning, settings: RunSettings, ports: Ports<'a>) -> Self {
        let Amid {
            belief,
            news,
            running,
            replans,
        } = amid;
        let mut run = Self::new(Arc::clone(belief.task()), None, settings, ports);
        run.now.clone_from(belief.time());
        run.account = Account::amid(&belief, &running);
        run.beginning = belief.clone();
        run.belief = belief;
        run.replans = replans;
        run.news = news;
        run.agenda = match beginning {
            Beginning::GoesOn => Vec::new(),
            Beginning::TakesUp(mission) => vec![Todo::TakeUp(mission)],
            Beginning::Replans(reason) => vec![Todo::Replan(reason)],
        };
        run
    }
}
