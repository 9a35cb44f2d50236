//! What had been started when a run was cut off.

use std::collections::BTreeMap;

use elbowroom::num::Rational;
use elbowroom::report::trace::line::{GivenLine, ObservationLine};
use elbowroom::report::trace::{Line, SnapshotLine, Stored};
use elbowroom::report::wire;
use serde_json::{Value, json};

/// What had been started, and of whose end the journal does not know.
#[derive(Debug, Default)]
pub(super) struct UnderWay {
    pub(super) open: BTreeMap<u64, Open>,
    /// The tickets below this one were given.
    pub(super) given: u64,
}

#[derive(Debug)]
pub(super) struct Open {
    action: String,
    is_instantaneous: bool,
    has_started: bool,
    pub(super) is_cancelled: bool,
}

/// The tickets of what was under way where the journal begins.
pub(super) fn open(before: Option<&SnapshotLine>) -> impl Iterator<Item = u64> {
    let starts = before.into_iter().flat_map(|it| &it.starts);
    starts.filter(|it| it.is_open()).map(|it| it.ticket)
}

impl UnderWay {
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
        let mut under_way = Self {
            given: before.map_or(0, |it| it.started as u64),
            open: open.collect(),
        };
        for line in &stored.lines {
            match line {
                Line::Command(line) => under_way.note(&line.command),
                Line::Passed(line) => line.observations.iter().for_each(|it| under_way.hear(it)),
                Line::Looked(line) => line.observations.iter().for_each(|it| under_way.hear(it)),
                _ => {}
            }
        }
        under_way
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

    fn hear(&mut self, observation: &ObservationLine) {
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

    /// What the world is told about them.
    pub(super) fn told(&self, now: &Rational) -> Value {
        let open = self.open.iter().map(|(ticket, open)| {
            json!({ "ticket": ticket, "action": open.action, "started": open.has_started })
        });
        json!({ "now": wire::number(now), "open": open.collect::<Vec<_>>() })
    }
}
