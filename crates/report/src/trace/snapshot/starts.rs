//! What was started, in a snapshot.

use std::sync::Arc;

use elbowroom_execution::run::KnownStart;
use elbowroom_execution::{Ending, Guards, Measured, Ticket, UnderwayParts};
use elbowroom_model::Task;
use elbowroom_model::ground::Action;
use elbowroom_num::Rational;
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use super::super::replay::instantiate;
use super::fluent;
use crate::exact::Exact;

/// Something that was started.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StartLine {
    /// By which the world's reports refer to it.
    pub ticket: u64,
    /// Its name: `(drive rover depot shelf)`.
    pub action: String,
    /// The planned duration; none for an instantaneous action.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub duration: Option<Exact>,
    /// When it was told to start.
    pub ordered: Exact,
    /// When it has started, if it has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub started: Option<Exact>,
    /// When it last reported progress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heard: Option<Exact>,
    /// The part that was done then, from 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub completion: Option<Exact>,
    /// When it has ended, if it has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ended: Option<Exact>,
    /// How it has ended: `succeeded`, `failed` or `cancelled`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outcome: Option<String>,
    /// Why it has failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
    /// When it was told to stop, if it was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cancelled: Option<Exact>,
    /// Its time-out, if it has reached it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timed_out: Option<Exact>,
    /// `true` if it is unknown whether it has come to its end.
    #[serde(default, skip_serializing_if = "super::is_false")]
    pub in_doubt: bool,
    /// Until when the plan could bear it when that was warned of.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub warned: Option<Exact>,
    /// The time-out that the last warning of one was about.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub warned_timeout: Option<Exact>,
    /// What was measured at its start.
    #[serde(default, skip_serializing_if = "IndexMap::is_empty")]
    pub measured_at_start: IndexMap<String, Exact>,
    /// What was measured at its end.
    #[serde(default, skip_serializing_if = "IndexMap::is_empty")]
    pub measured_at_end: IndexMap<String, Exact>,
}

/// Something under way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnderWayLine {
    /// Which start it is.
    pub ticket: u64,
    /// When it started.
    pub start: Exact,
    /// The planned duration.
    pub duration: Exact,
    /// By end effect of the action: whether it can still take place.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub end_effects: Vec<bool>,
    /// By continuous effect: whether it is at work.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub continuous: Vec<bool>,
    /// The conjuncts of the over-all condition that have not held at some moment.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub broken: Vec<usize>,
}

pub(super) fn exact(number: &Rational) -> Exact {
    Exact(number.clone())
}

pub(super) fn optional(number: Option<&Rational>) -> Option<Exact> {
    number.map(exact)
}

fn inexact(number: Option<&Exact>) -> Option<Rational> {
    number.map(|it| it.0.clone())
}

/// The action of a start.
pub(super) fn action_of(starts: &[KnownStart], ticket: Ticket) -> Option<&Arc<Action>> {
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
            ordered: exact(&start.ordered),
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
            ticket: Ticket(self.ticket),
            action: Arc::new(instantiate(&self.action, task)?),
            planned: inexact(self.duration.as_ref()),
            ordered: self.ordered.0.clone(),
            started: inexact(self.started.as_ref()),
            progress: inexact(self.heard.as_ref()).zip(inexact(self.completion.as_ref())),
            ended: inexact(self.ended.as_ref()).zip(ending),
            cancelled: inexact(self.cancelled.as_ref()),
            timed_out: inexact(self.timed_out.as_ref()),
            is_in_doubt: self.in_doubt,
            warned: inexact(self.warned.as_ref()),
            warned_timeout: inexact(self.warned_timeout.as_ref()),
            measured: [
                measured(&self.measured_at_start)?,
                measured(&self.measured_at_end)?,
            ],
        })
    }

    /// Whether it has not ended.
    pub fn is_open(&self) -> bool {
        self.ended.is_none()
    }
}

impl UnderWayLine {
    pub(super) fn of(ticket: Ticket, parts: &UnderwayParts) -> Self {
        Self {
            ticket: ticket.0,
            start: exact(&parts.start),
            duration: exact(&parts.planned),
            end_effects: parts.guards.at_end.clone(),
            continuous: parts.guards.continuous.clone(),
            broken: parts.broken.iter().copied().collect(),
        }
    }

    pub(super) fn parts(&self) -> (Ticket, UnderwayParts) {
        let parts = UnderwayParts {
            start: self.start.0.clone(),
            planned: self.duration.0.clone(),
            guards: Guards {
                at_end: self.end_effects.clone(),
                continuous: self.continuous.clone(),
            },
            broken: self.broken.iter().copied().collect(),
        };
        (Ticket(self.ticket), parts)
    }
}
