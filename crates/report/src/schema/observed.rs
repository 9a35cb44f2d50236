//! Observations of a run, and remarks on them.

use elbowroom_execution::run::is_correction;
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use super::WindowLine;
use crate::exact::Exact;

/// An observation, with the remark of the run on it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObservedLine {
    /// The time of the report.
    pub now: Exact,
    /// The observation.
    pub observation: ObservationLine,
    /// Planned time.
    pub planned: WindowLine,
    /// Reason why the report was ignored or corrected; `None` if it was taken as it is.
    pub remark: Option<String>,
}

/// An observation in a trace.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum ObservationLine {
    /// An action has started.
    Started {
        /// Ticket of its start.
        ticket: u64,
        /// Amounts, by fluent.
        measured: IndexMap<String, Exact>,
        /// The time.
        time: Exact,
    },
    /// An action has ended.
    Ended {
        /// Ticket of its start.
        ticket: u64,
        /// Outcome: `succeeded`, `failed` or `cancelled`.
        outcome: String,
        /// Amounts, by fluent.
        measured: IndexMap<String, Exact>,
        /// Reason of a failure.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        why: Option<String>,
        /// The time.
        time: Exact,
    },
    /// Progress of a running action.
    Feedback {
        /// Ticket of its start.
        ticket: u64,
        /// Completed part, from 0 to 1; `None` if it is unknown.
        completion: Option<Exact>,
        /// Note for people.
        note: String,
        /// The time.
        time: Exact,
    },
    /// Observed fact.
    Fact {
        /// Its name: `(at rover depot)`.
        fact: String,
        /// Its truth value.
        becomes: bool,
        /// The time.
        time: Exact,
    },
    /// Observed fluent.
    Value {
        /// Its name.
        fluent: String,
        /// Its value.
        value: Exact,
        /// The time.
        time: Exact,
    },
    /// Request to add a goal.
    Goal {
        /// Its name.
        name: String,
        /// The goal, in PDDL.
        goal: String,
        /// Its value, if it is not 1.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        value: Option<Exact>,
        /// Its deadline on the world's clock, if there is one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        deadline: Option<Exact>,
        /// The time before which it is not pursued, if there is one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        release: Option<Exact>,
        /// `true` for a goal to keep.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        keep: bool,
        /// Name of the client that has given it, if it is known.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        by: Option<String>,
        /// The time.
        time: Exact,
    },
    /// Request to abandon the goal of that name.
    Abandon {
        /// Its name.
        name: String,
        /// The time.
        time: Exact,
    },
    /// Request to cancel a running action.
    CancelAction {
        /// The ticket of its start.
        ticket: u64,
        /// The time.
        time: Exact,
    },
    /// Request to pause.
    Pause {
        /// The time.
        time: Exact,
    },
    /// Request to end a pause.
    Resume {
        /// The time.
        time: Exact,
    },
    /// A background plan is complete.
    PlanMade {
        /// The time.
        time: Exact,
    },
    /// The preparation of a background plan is complete.
    PlanReady {
        /// The time.
        time: Exact,
    },
    /// Invalid message.
    Unintelligible {
        /// The message.
        said: String,
        /// Its mistake.
        why: String,
        /// The time.
        time: Exact,
    },
}

impl ObservedLine {
    /// Returns the observation, at the latest at the time of its report; `None` if it was ignored.
    pub fn as_processed(&self) -> Option<ObservationLine> {
        if self.remark.as_deref().is_some_and(|it| !is_correction(it)) {
            return None;
        }
        let mut observation = self.observation.clone();
        let time = observation.time_mut();
        if time.0 > self.now.0 {
            *time = self.now.clone();
        }
        Some(observation)
    }
}

impl ObservationLine {
    fn time_mut(&mut self) -> &mut Exact {
        match self {
            Self::Started { time, .. }
            | Self::Ended { time, .. }
            | Self::Feedback { time, .. }
            | Self::Fact { time, .. }
            | Self::Value { time, .. }
            | Self::Goal { time, .. }
            | Self::Abandon { time, .. }
            | Self::CancelAction { time, .. }
            | Self::Pause { time }
            | Self::Resume { time }
            | Self::PlanMade { time }
            | Self::PlanReady { time }
            | Self::Unintelligible { time, .. } => time,
        }
    }
}
