//! Commands to the world, and observations from it.

use std::fmt;
use std::sync::Arc;

use elbowroom_model::ground::{Action, FactId, FluentId};
use elbowroom_num::Rational;

/// One start of one action, numbered from 0 within a run.
///
/// Numbers are never used again, so that a late report of an earlier plan cannot be taken for one
/// of the present plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Ticket(pub u64);

impl fmt::Display for Ticket {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "#{}", self.0)
    }
}

/// A command to the world.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Start an action now.
    Start {
        /// By which the world's reports refer to it.
        ticket: Ticket,
        /// The action.
        action: Arc<Action>,
        /// The planned duration; `None` for an instantaneous action.
        duration: Option<Rational>,
    },
    /// Cancel an action. Its start effects remain; its end effects do not happen.
    Cancel {
        /// The ticket of its start.
        ticket: Ticket,
    },
}

/// Something the world reports.
#[derive(Clone, Debug, PartialEq)]
pub struct Observation {
    /// The time at which it happened, by the world's clock. It may be reported later.
    pub time: Rational,
    /// The event.
    pub event: Event,
}

/// An observation.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// An action has started.
    Started {
        /// The ticket of its start.
        ticket: Ticket,
        /// By how much its start really changed fluents, where that was measured.
        measured: Vec<Measured>,
    },
    /// An action has ended.
    Ended {
        /// The ticket of its start.
        ticket: Ticket,
        /// The outcome.
        ending: Ending,
        /// By how much its end really changed fluents, where that was measured.
        measured: Vec<Measured>,
    },
    /// A running action reports the part of it that is done. If that is more than before, its time-out counts from then on.
    Feedback {
        /// The ticket of its start.
        ticket: Ticket,
        /// The part that is done, from 0 to 1, if that is known.
        completion: Option<Rational>,
        /// A note from the world as text; may be empty.
        note: String,
    },
    /// A fact is seen to be true or false.
    Fact {
        /// The fact.
        fact: FactId,
        /// `true` if the fact is true.
        truth: bool,
    },
    /// A fluent is seen to have a value.
    Value {
        /// The fluent.
        fluent: FluentId,
        /// Its value.
        value: Rational,
    },
    /// People, or other programs, ask something of the run ([`Request`]).
    Asked(Request),
    /// The plan that was begun beside the run is there, or it is certain that there will be none.
    PlanMade,
    /// The plan that was being made ready beside the run is ready, or it is certain that it cannot be.
    PlanReady,
    /// The world has said something that cannot be understood.
    Unintelligible {
        /// The message, or its beginning.
        said: String,
        /// The mistake in it.
        why: String,
    },
}

/// Request from an operator to an executive ([`Run::lasting`](crate::run::Run::lasting)). Other
/// runs ignore requests, except pauses and the abandonment of the goal in
/// [attended](crate::run::Run::attended) runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Request {
    /// Add a goal. It replaces an open goal of the same name.
    Pursue {
        /// By which it is named from then on.
        name: String,
        /// The goal, as the domain's language writes it.
        goal: String,
        /// Its value and its times.
        terms: GoalTerms,
    },
    /// To reach the goal of that name no more.
    Abandon {
        /// Its name.
        name: String,
    },
    /// To cancel a running action. What its end means for the plan is found out when the world reports it.
    CancelAction {
        /// The ticket of its start.
        ticket: Ticket,
    },
    /// Stop dispatching; running actions continue.
    Pause,
    /// Resume after a pause.
    Resume,
}

/// Value and times of a goal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GoalTerms {
    /// A positive number: if not all goals can be reached together, those with the greatest sum of values are pursued.
    pub value: Rational,
    /// The time, on the run's clock, at which the goal has failed if it has not been achieved; `None` for no limit. Plans
    /// achieve it by then.
    pub deadline: Option<Rational>,
}

impl Default for GoalTerms {
    /// A value of 1, and no deadline.
    fn default() -> Self {
        Self {
            value: Rational::ONE,
            deadline: None,
        }
    }
}

/// The outcome of an action.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ending {
    /// As the domain says.
    Succeeded,
    /// Its end effects did not happen.
    Failed {
        /// The reason as text; may be empty.
        why: String,
    },
    /// It was cancelled; its end effects did not happen.
    Cancelled,
}

/// The amount by which an action's effect changed a fluent: the value of `amount` in `(increase
/// fluent amount)`, `(decrease fluent amount)` or `(assign fluent amount)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// The fluent.
    pub fluent: FluentId,
    /// The amount.
    pub amount: Rational,
}

impl Ending {
    /// One word for it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Succeeded => "succeeded",
            Self::Failed { .. } => "failed",
            Self::Cancelled => "cancelled",
        }
    }
}
