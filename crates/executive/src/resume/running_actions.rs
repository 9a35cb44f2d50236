//! Actions that were running at the end of a journal.

use std::collections::BTreeMap;

use elbowroom::num::Rational;
use elbowroom::report::trace::line::{GivenLine, ObservationLine};
use elbowroom::report::trace::{Line, SnapshotLine, Stored};
use elbowroom::report::wire;
use serde_json::{Value, json};

/// Actions that were started and whose end is not in the journal.
#[derive(Debug, Default)]
pub(super) struct RunningActions {
    pub(super) open: BTreeMap<u64, Open>,
    /// Tickets below this one were issued.
    pub(super) given: u64,
}

/// Action without an end.
#[derive(Debug)]
pub(super) struct Open {
    action: String,
    is_instantaneous: bool,
    has_started: bool,
    pub(super) is_cancelled: bool,
}

/// Returns the tickets of the actions that were running at the snapshot.
pub(super) fn open(before: Option<&SnapshotLine>) -> impl Iterator<Item = u64> {
    let starts = before.into_iter().flat_map(|it| &it.starts);
    starts.filter(|it| it.is_open()).map(|it| it.ticket)
}

impl RunningActions {
    pub(super) fn of(stored: &Stored, before: Option<&SnapshotLine>) -> Self {
        let starts = before.iter().flat_map(|it| &it.starts);
        let open = starts.filter(|it| it.is_open()).map(|it| {
            let open = Open {
                action: it.action.clone(),
                is_instantaneous: it.duration.is_none(),
                has_started: it.started.is_some(),
                is_cancelled: it.cancelled.is_some(),
            };
            (it.ticket, open)
        });
        let mut running = Self {
            given: before.map_or(0, |it| it.started as u64),
            open: open.collect(),
        };
        for line in &stored.lines {
            match line {
                Line::Command(line) => running.note(&line.command),
                Line::Passed(line) => line.observations.iter().for_each(|it| running.observe(it)),
                Line::Looked(line) => line.observations.iter().for_each(|it| running.observe(it)),
                _ => {}
            }
        }
        running
    }

    fn note(&mut self, command: &GivenLine) {
        match command {
            GivenLine::Start {
                ticket,
                action,
                duration,
            } => {
                self.given = self.given.max(ticket + 1);
                let open = Open {
                    action: action.clone(),
                    is_instantaneous: duration.is_none(),
                    has_started: false,
                    is_cancelled: false,
                };
                self.open.insert(*ticket, open);
            }
            GivenLine::Cancel { ticket } => {
                if let Some(open) = self.open.get_mut(ticket) {
                    open.is_cancelled = true;
                }
            }
        }
    }

    fn observe(&mut self, observation: &ObservationLine) {
        match observation {
            ObservationLine::Started { ticket, .. } => match self.open.get_mut(ticket) {
                Some(open) if open.is_instantaneous => {
                    self.open.remove(ticket);
                }
                Some(open) => open.has_started = true,
                None => {}
            },
            ObservationLine::Ended { ticket, .. } => {
                self.open.remove(ticket);
            }
            _ => {}
        }
    }

    /// Returns the message about these actions for the world.
    pub(super) fn message(&self, now: &Rational) -> Value {
        let open = self.open.iter().map(|(ticket, open)| {
            json!({ "ticket": ticket, "action": open.action, "started": open.has_started })
        });
        json!({ "now": wire::number(now), "open": open.collect::<Vec<_>>() })
    }
}
