//! Progress events and cancellation of long requests.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Duration;

use elbowroom_model::TimeTriggeredPlan;
use elbowroom_num::Rational;
use elbowroom_plan::{DecoupledEnvelope, ParametrizedPlan};
use elbowroom_report::validation::Invalid;

use super::RunProgress;

/// Receives progress events of a request, and decides when it has to end.
///
/// The library reads no clock. A caller that wants a time limit or measured times implements
/// [`elapsed`](Observer::elapsed).
pub trait Observer {
    /// Returns the time since a fixed moment. Only differences are used.
    fn elapsed(&mut self) -> Duration {
        Duration::ZERO
    }

    /// Decides whether the request continues. It is called often. After the first break, it should
    /// always break.
    fn flow(&mut self) -> ControlFlow<StopRequest>;

    /// Receives a progress event.
    fn notice(&mut self, event: &Event<'_>) {
        let _ = event;
    }
}

/// A watcher's reason to stop a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopRequest {
    /// The time limit was reached.
    TimeLimit,
    /// The memory limit was reached.
    MemoryLimit,
    /// The caller cancelled the request.
    Cancelled,
}

/// A progress event, reported to a watcher.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Event<'a> {
    /// The search for an envelope has tried a step.
    Envelope(EnvelopeProgress<'a>),
    /// A planner is running, or has found a plan.
    Plan(PlanProgress<'a>),
    /// An event of a run.
    Run(RunProgress<'a>),
    /// The validator rejects the latest entry of a run: a bug of this program. The run continues.
    Invalid(&'a Invalid),
    /// A trial of an experiment is over.
    Trials(TrialsProgress),
}

/// Progress of the search for an envelope.
#[derive(Clone, Debug)]
pub struct EnvelopeProgress<'a> {
    /// The plan with the parameters of the box.
    pub plan: &'a Arc<ParametrizedPlan>,
    /// The box so far. The plan is guaranteed to work inside it.
    pub envelope: &'a DecoupledEnvelope,
    /// Number of widenings.
    pub widenings: usize,
    /// The number of boxes checked.
    pub checks: usize,
    /// The number of steps tried.
    pub steps: usize,
}

/// Progress of a planner.
#[derive(Clone, Debug)]
pub struct PlanProgress<'a> {
    /// The new plan, if there is one. Its facts are those of the task of the request, or of a copy
    /// with its own table.
    pub plan: Option<&'a TimeTriggeredPlan>,
    /// The end time of the last action of the new plan.
    pub makespan: Option<&'a Rational>,
    /// The value of the problem's metric for the new plan, if it has one.
    pub metric: Option<&'a Rational>,
    /// The value of a new best plan, in words, if plans are not compared by metric or makespan.
    pub value: Option<&'a str>,
    /// The number of plans so far.
    pub plans: usize,
    /// The number of evaluated states; the embedded planner only.
    pub states: Option<u64>,
    /// Memory in use, in bytes; other planners only.
    pub memory: Option<u64>,
}

/// Progress of an experiment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrialsProgress {
    /// The number of completed trials.
    pub done: u64,
    /// The total number of trials.
    pub total: u64,
}

/// Watcher that ignores all events and never stops a request.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoObserver;

impl Observer for NoObserver {
    fn flow(&mut self) -> ControlFlow<StopRequest> {
        ControlFlow::Continue(())
    }
}
