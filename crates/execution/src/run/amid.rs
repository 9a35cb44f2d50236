//! Runs that begin in the middle of things: to try out what comes of a decision.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::agenda::Todo;
use super::{Account, News, Ports, Progression, Run, RunSettings, Ticket};
use crate::executor::Mission;
use crate::executor::StepId;
use crate::reason::Reason;

/// Where such a run begins.
#[derive(Clone, Debug)]
pub struct Amid {
    /// What is believed, at its time. All that was told to start has started.
    pub belief: Progression,
    /// What the executor is to be told first.
    pub news: Vec<News>,
    /// The executor's steps that are under way.
    pub running: BTreeMap<StepId, Ticket>,
    /// How many new plans have been made so far.
    pub replans: usize,
}

/// What such a run begins with.
#[derive(Clone, Debug)]
pub enum Beginning {
    /// The executor has its plan, and goes on.
    GoesOn,
    /// It takes this one up.
    TakesUp(Box<Mission>),
    /// A new plan is made, for that reason.
    Replans(Reason),
}

impl<'a> Run<'a> {
    /// A run that begins in the middle of things, of the task of the belief.
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
