//! Started actions in a snapshot.

use std::sync::Arc;

use elbowroom_execution::run::KnownStart;
use elbowroom_execution::{ActionHandle, Ending, Guards, Measured, RunningActionParts};
use elbowroom_model::Task;
use elbowroom_model::ground::Action;
use elbowroom_num::Rational;
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use super::super::replay::action_named;
use super::fluent;
use crate::exact::Exact;

/// A started action.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StartLine {
    /// Identifier of the start in the world's reports.
    pub ticket: u64,
    /// Its name: `(drive rover depot shelf)`.
    pub action: String,
    /// The planned duration; `None` for an instantaneous action.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub duration: Option<Exact>,
    /// Time of the start command.
    pub ordered: Exact,
    /// Start time, if it has started.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub started: Option<Exact>,
    /// Time of its last progress report.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heard: Option<Exact>,
    /// Completed fraction in that report, from 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub completion: Option<Exact>,
    /// End time, if it has ended.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ended: Option<Exact>,
    /// Outcome: `succeeded`, `failed` or `cancelled`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outcome: Option<String>,
    /// Reason of a failure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
    /// Time of the cancel command, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cancelled: Option<Exact>,
    /// Its time-out, if it has reached it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timed_out: Option<Exact>,
    /// `true` if it is unknown whether it was completed.
    #[serde(default, skip_serializing_if = "super::is_false")]
    pub in_doubt: bool,
    /// Latest end that the plan tolerated at the last warning.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub warned: Option<Exact>,
    /// Time-out at the last warning about one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub warned_timeout: Option<Exact>,
    /// Amounts measured at its start.
    #[serde(default, skip_serializing_if = "IndexMap::is_empty")]
    pub measured_at_start: IndexMap<String, Exact>,
    /// Amounts measured at its end.
    #[serde(default, skip_serializing_if = "IndexMap::is_empty")]
    pub measured_at_end: IndexMap<String, Exact>,
}

/// A running action.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunningActionLine {
    /// Ticket of its start.
    pub ticket: u64,
    /// The start time.
    pub start: Exact,
    /// The planned duration.
    pub duration: Exact,
    /// For each end effect of the action, `true` if it can still take place.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub end_effects: Vec<bool>,
    /// For each continuous effect, `true` if it is active.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub continuous: Vec<bool>,
    /// Conjuncts of the over-all condition that have been violated.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub broken: Vec<usize>,
}

pub(super) fn exact(number: &Rational) -> Exact {
    Exact(number.clone())
}

pub(super) fn optional(number: Option<&Rational>) -> Option<Exact> {
    number.map(exact)
}

fn to_rational(number: Option<&Exact>) -> Option<Rational> {
    number.map(|it| it.0.clone())
}

/// Returns the action of a start.
pub(super) fn action_of(starts: &[KnownStart], ticket: ActionHandle) -> Option<&Arc<Action>> {
    let of = starts.iter().find(|it| it.ticket == ticket);
    of.map(|it| &it.action)
}

impl StartLine {
    pub(super) fn of(task: &Task, start: &KnownStart) -> Self {
        let amounts = |measured: &[Measured]| {
            let amounts = measured.iter();
            let amounts = amounts.map(|it| (task.fluent_name(it.fluent), exact(&it.amount)));
            amounts.collect()
        };
        let ending = start.ended.as_ref().map(|(_, ending)| ending);
        let why = match ending {
            Some(Ending::Failed { why }) => Some(why.clone()),
            _ => None,
        };
        Self {
            ticket: start.ticket.0,
            action: start.action.name.clone(),
            duration: optional(start.planned.as_ref()),
            ordered: exact(&start.commanded),
            started: optional(start.started.as_ref()),
            heard: optional(start.progress.as_ref().map(|(time, _)| time)),
            completion: optional(start.progress.as_ref().map(|(_, done)| done)),
            ended: optional(start.ended.as_ref().map(|(time, _)| time)),
            outcome: ending.map(|it| it.name().to_owned()),
            why,
            cancelled: optional(start.cancelled.as_ref()),
            timed_out: optional(start.timed_out.as_ref()),
            in_doubt: start.is_in_doubt,
            warned: optional(start.warned.as_ref()),
            warned_timeout: optional(start.warned_timeout.as_ref()),
            measured_at_start: amounts(&start.measured[0]),
            measured_at_end: amounts(&start.measured[1]),
        }
    }

    pub(super) fn start(&self, task: &Task) -> Result<KnownStart, String> {
        let measured = |amounts: &IndexMap<String, Exact>| {
            let amounts = amounts.iter().map(|(name, amount)| {
                let amount = amount.0.clone();
                let fluent = fluent(task, name)?;
                Ok(Measured { fluent, amount })
            });
            amounts.collect::<Result<Vec<_>, String>>()
        };
        let ending = match self.outcome.as_deref() {
            None => None,
            Some("succeeded") => Some(Ending::Succeeded),
            Some("cancelled") => Some(Ending::Cancelled),
            Some("failed") => {
                let why = self.why.clone().unwrap_or_default();
                Some(Ending::Failed { why })
            }
            Some(other) => return Err(format!("nothing ends `{other}`")),
        };
        Ok(KnownStart {
            ticket: ActionHandle(self.ticket),
            action: Arc::new(action_named(&self.action, task)?),
            planned: to_rational(self.duration.as_ref()),
            commanded: self.ordered.0.clone(),
            started: to_rational(self.started.as_ref()),
            progress: to_rational(self.heard.as_ref()).zip(to_rational(self.completion.as_ref())),
            ended: to_rational(self.ended.as_ref()).zip(ending),
            cancelled: to_rational(self.cancelled.as_ref()),
            timed_out: to_rational(self.timed_out.as_ref()),
            is_in_doubt: self.in_doubt,
            warned: to_rational(self.warned.as_ref()),
            warned_timeout: to_rational(self.warned_timeout.as_ref()),
            measured: [
                measured(&self.measured_at_start)?,
                measured(&self.measured_at_end)?,
            ],
        })
    }

    /// Returns `true` if the action has not ended.
    pub fn is_open(&self) -> bool {
        self.ended.is_none()
    }
}

impl RunningActionLine {
    pub(super) fn of(ticket: ActionHandle, parts: &RunningActionParts) -> Self {
        Self {
            ticket: ticket.0,
            start: exact(&parts.start),
            duration: exact(&parts.planned),
            end_effects: parts.guards.at_end.clone(),
            continuous: parts.guards.continuous.clone(),
            broken: parts.broken.iter().copied().collect(),
        }
    }

    pub(super) fn parts(&self) -> (ActionHandle, RunningActionParts) {
        let parts = RunningActionParts {
            start: self.start.0.clone(),
            planned: self.duration.0.clone(),
            guards: Guards {
                at_end: self.end_effects.clone(),
                continuous: self.continuous.clone(),
            },
            broken: self.broken.iter().copied().collect(),
        };
        (ActionHandle(self.ticket), parts)
    }
}
