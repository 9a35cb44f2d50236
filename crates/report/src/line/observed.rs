//! Observations of a run, and remarks on them.

use elbowroom_execution::run::is_correction;
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use super::WindowLine;
use crate::exact::Exact;

/// An observation, and what was made of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObservedLine {
    /// The time of the report.
    pub now: Exact,
    /// The observation.
    pub observation: ObservationLine,
    /// When that was planned.
    pub planned: WindowLine,
    /// The objection, if the report was ignored or corrected.
    pub remark: Option<String>,
}

/// An observation, as a trace has it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum ObservationLine {
    /// An action has started.
    Started {
        /// Which start.
        ticket: u64,
        /// Amounts, by fluent.
        measured: IndexMap<String, Exact>,
        /// The time.
        time: Exact,
    },
    /// An action has ended.
    Ended {
        /// Which start.
        ticket: u64,
        /// How: `succeeded`, `failed` or `cancelled`.
        outcome: String,
        /// Amounts, by fluent.
        measured: IndexMap<String, Exact>,
        /// Why it failed; where it has.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        why: Option<String>,
        /// The time.
        time: Exact,
    },
    /// A running action says how far it has come.
    Feedback {
        /// Which start.
        ticket: u64,
        /// The part that is done, from 0 to 1; `None` if that is not known.
        completion: Option<Exact>,
        /// What there is to say about it.
        note: String,
        /// The time.
        time: Exact,
    },
    /// A fact is seen.
    Fact {
        /// Its name: `(at rover depot)`.
        fact: String,
        /// Whether it is true.
        becomes: bool,
        /// The time.
        time: Exact,
    },
    /// A fluent is seen.
    Value {
        /// Its name.
        fluent: String,
        /// Its value.
        value: Exact,
        /// The time.
        time: Exact,
    },
    /// A lasting run is to reach this goal, too.
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
        /// The time.
        time: Exact,
    },
    /// A lasting run is to reach the goal of that name no more.
    Abandon {
        /// Its name.
        name: String,
        /// The time.
        time: Exact,
    },
    /// A running action is to be cancelled.
    CancelAction {
        /// The ticket of its start.
        ticket: u64,
        /// The time.
        time: Exact,
    },
    /// A lasting run is to start nothing more.
    Pause {
        /// The time.
        time: Exact,
    },
    /// A lasting run is to go on after a pause.
    Resume {
        /// The time.
        time: Exact,
    },
    /// The plan that was made beside the run is there.
    PlanMade {
        /// The time.
        time: Exact,
    },
    /// The plan that was made ready beside the run is ready.
    PlanReady {
        /// The time.
        time: Exact,
    },
    /// Something that cannot be understood.
    Unintelligible {
        /// The message.
        said: String,
        /// The mistake in it.
        why: String,
        /// The time.
        time: Exact,
    },
}

impl ObservedLine {
    /// Returns the observation, at the latest at the time of its report; `None` if it was ignored.
    pub fn counted(&self) -> Option<ObservationLine> {
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
