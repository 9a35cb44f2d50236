//! Watching a request that takes long.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Duration;

use elbowroom_model::TimeTriggeredPlan;
use elbowroom_num::Rational;
use elbowroom_plan::{DecoupledEnvelope, ParametrizedPlan};
use elbowroom_report::validation::Invalid;

use super::RunProgress;

/// Hears how far a request has come, and says when it has to end.
///
/// The library looks at no clock: who wants a time limit, or to know how long something took,
/// brings one.
pub trait Watcher {
    /// The time since some fixed moment; only differences matter.
    fn elapsed(&mut self) -> Duration {
        Duration::ZERO
    }

    /// Whether to go on. Asked often; once it has said no, it should not change its mind.
    fn flow(&mut self) -> ControlFlow<Halt>;

    /// Something has come about.
    fn notice(&mut self, event: &Event<'_>) {
        let _ = event;
    }
}

/// Why a watcher wants no more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Halt {
    /// Time is up.
    TimeLimit,
    /// More memory would be needed.
    MemoryLimit,
    /// Nobody is interested any longer.
    Cancelled,
}

/// A progress event, reported to a watcher.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Event<'a> {
    /// The search for an envelope has tried a step.
    Envelope(EnvelopeProgress<'a>),
    /// A planner is at work, or has found a plan.
    Plan(PlanProgress<'a>),
    /// Something has happened in a run.
    Run(RunProgress<'a>),
    /// The validator rejects the latest entry of a run: a bug of this program. The run continues.
    Invalid(&'a Invalid),
    /// A trial of an experiment is over.
    Trials(TrialsProgress),
}

/// Progress of the search for an envelope.
#[derive(Clone, Debug)]
pub struct EnvelopeProgress<'a> {
    /// The plan whose parameters the box is about.
    pub plan: &'a Arc<ParametrizedPlan>,
    /// The box so far. The plan is guaranteed to work in all of it.
    pub envelope: &'a DecoupledEnvelope,
    /// How often it has grown.
    pub widenings: usize,
    /// The number of boxes checked.
    pub checks: usize,
    /// The number of steps that have been tried.
    pub steps: usize,
}

/// Progress of a planner.
#[derive(Clone, Debug)]
pub struct PlanProgress<'a> {
    /// The plan, if this is about a new one: about the task of the request, or a copy of it with a
    /// table of its own.
    pub plan: Option<&'a TimeTriggeredPlan>,
    /// The end time of the last action, if this is about a new plan.
    pub makespan: Option<&'a Rational>,
    /// The value of the problem's metric, if this is about a new plan and it has one.
    pub metric: Option<&'a Rational>,
    /// What a new best plan is worth, in words, where plans are not compared by metric or makespan.
    pub worth: Option<&'a str>,
    /// The number of plans so far.
    pub plans: usize,
    /// The number of states that have been looked at; the embedded planner only.
    pub states: Option<u64>,
    /// How much memory is used, in bytes; other planners only.
    pub memory: Option<u64>,
}

/// Progress of an experiment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrialsProgress {
    /// The number of trials that have been made.
    pub done: u64,
    /// Of how many.
    pub of: u64,
}

/// Nobody watches: the work goes on until it is done.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unwatched;

impl Watcher for Unwatched {
    fn flow(&mut self) -> ControlFlow<Halt> {
        ControlFlow::Continue(())
    }
}
