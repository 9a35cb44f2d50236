//! Commands to the world, and observations from it.

use std::fmt;
use std::sync::Arc;

use elbowroom_model::ground::{Action, FactId, FluentId};
use elbowroom_num::Rational;

/// Identifier of one start of one action, numbered from 0 within a run.
///
/// Numbers are never reused, so a late report on an earlier plan cannot be mistaken for one on the
/// present plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ActionHandle(pub u64);

impl fmt::Display for ActionHandle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "#{}", self.0)
    }
}

/// A command to the world.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Start an action now.
    Start {
        /// The identifier for reports of the world.
        ticket: ActionHandle,
        /// The action.
        action: Arc<Action>,
        /// The planned duration; `None` for an instantaneous action.
        duration: Option<Rational>,
    },
    /// Cancel an action. Its start effects remain; its end effects do not happen.
    Cancel {
        /// The ticket of its start.
        ticket: ActionHandle,
    },
}

/// A report of the world.
#[derive(Clone, Debug, PartialEq)]
pub struct Observation {
    /// The time of the event, on the world's clock. The report may arrive later.
    pub time: Rational,
    /// The event.
    pub event: Event,
}

/// An event that the world reports.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// An action has started.
    Started {
        /// The ticket of its start.
        ticket: ActionHandle,
        /// Measured changes of fluents by its start.
        measured: Vec<Measured>,
    },
    /// An action has ended.
    Ended {
        /// The ticket of its start.
        ticket: ActionHandle,
        /// The outcome.
        ending: Ending,
        /// Measured changes of fluents by its end.
        measured: Vec<Measured>,
    },
    /// A running action reports its completion. If it has grown, the time-out counts from then on.
    Feedback {
        /// The ticket of its start.
        ticket: ActionHandle,
        /// The completed part, from 0 to 1, if it is known.
        completion: Option<Rational>,
        /// A note from the world as text; may be empty.
        note: String,
    },
    /// The truth of a fact was observed.
    Fact {
        /// The fact.
        fact: FactId,
        /// `true` if the fact is true.
        truth: bool,
    },
    /// The value of a fluent was observed.
    Value {
        /// The fluent.
        fluent: FluentId,
        /// Its value.
        value: Rational,
    },
    /// A request to the run from people or other programs ([`Request`]).
    Requested(Request),
    /// The plan that is made in the background is finished, or certain to fail.
    PlanMade,
    /// The plan that is prepared in the background is ready, or certain to fail.
    PlanReady,
    /// The world has sent a message that cannot be read.
    Unintelligible {
        /// The message, or its beginning.
        said: String,
        /// The mistake in it.
        why: String,
    },
}

/// Request from an operator to an executive ([`Run::persistent`](crate::run::Run::persistent)).
/// [Attended](crate::run::Run::interactive) runs do not accept goals; other runs ignore all requests.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Request {
    /// Add a goal. It replaces an open goal of the same name.
    Pursue {
        /// The name of the goal.
        name: String,
        /// The goal, in the language of the domain.
        goal: String,
        /// Its value, its times and its author.
        terms: GoalTerms,
    },
    /// Abandon the goal of this name.
    Abandon {
        /// Its name.
        name: String,
    },
    /// Cancel a running action. The plan is checked when the world reports the end of the action.
    CancelAction {
        /// The ticket of its start.
        ticket: ActionHandle,
    },
    /// Stop dispatching; running actions continue.
    Pause,
    /// Resume after a pause.
    Resume,
}

/// Kind, value, release time, deadline and author of a goal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GoalTerms {
    /// A positive number: if not all goals can be reached together, those with the greatest sum of values are pursued.
    pub value: Rational,
    /// The time, on the run's clock, at which the goal fails unless it was achieved; `None` for no
    /// limit. Plans achieve it by then.
    pub deadline: Option<Rational>,
    /// The time, on the run's clock, before which the goal is not pursued; `None` if it is pursued
    /// at once.
    pub release: Option<Rational>,
    /// `true` for a condition that is achieved again whenever it does not hold. Such a goal has no
    /// deadline, and is closed only when it is abandoned or replaced.
    pub keep: bool,
    /// Name of the client that has given the goal, if it is known.
    pub by: Option<String>,
}

impl Default for GoalTerms {
    /// A value of 1, no times, and no author.
    fn default() -> Self {
        Self {
            value: Rational::ONE,
            deadline: None,
            release: None,
            keep: false,
            by: None,
        }
    }
}

/// The outcome of an action.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ending {
    /// It ended as the domain describes.
    Succeeded,
    /// It failed; its end effects did not happen.
    Failed {
        /// The reason as text; may be empty.
        why: String,
    },
    /// It was cancelled; its end effects did not happen.
    Cancelled,
}

/// The amount of an effect on a fluent: the value of the second argument in `(increase …)`,
/// `(decrease …)` or `(assign …)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// The fluent.
    pub fluent: FluentId,
    /// The amount.
    pub amount: Rational,
}

impl Ending {
    /// Returns the name used in traces.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Succeeded => "succeeded",
            Self::Failed { .. } => "failed",
            Self::Cancelled => "cancelled",
        }
    }
}
