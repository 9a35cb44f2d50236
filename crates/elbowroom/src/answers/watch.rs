//! Watching a request that takes long.

use std::ops::ControlFlow;
use std::time::Duration;

use elbowroom_model::validate::Violation;
use elbowroom_plan::{DecoupledEnvelope, ParametrizedPlan};

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
    /// Nobody is interested any longer.
    Cancelled,
}

/// What a watcher hears of.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Event<'a> {
    /// The plan is not valid as it stands, but is with times close to its own, which are taken
    /// instead: what the judge objects to.
    Repaired(&'a Violation),
    /// The search for an envelope has tried a step.
    Envelope(EnvelopeProgress<'a>),
}

/// How far the search for an envelope has come.
#[derive(Clone, Debug)]
pub struct EnvelopeProgress<'a> {
    /// The plan whose parameters the box is about.
    pub plan: &'a ParametrizedPlan,
    /// The box so far. The plan is guaranteed to work in all of it.
    pub envelope: &'a DecoupledEnvelope,
    /// How often it has grown.
    pub widenings: usize,
    /// How many steps have been tried.
    pub steps: usize,
}

/// Nobody watches: the work goes on until it is done.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unwatched;

impl Watcher for Unwatched {
    fn flow(&mut self) -> ControlFlow<Halt> {
        ControlFlow::Continue(())
    }
}
