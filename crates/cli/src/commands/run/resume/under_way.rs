//! What had been started when a run was cut off.

use std::collections::BTreeMap;

use elbowroom::num::Rational;
use elbowroom::report::trace::line::{GivenLine, ObservationLine};
use elbowroom::report::trace::{Line, Stored};
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

impl UnderWay {
    pub(super) fn of(stored: &Stored) -> Self {
        let before = stored.snapshot.as_ref().map_or(0, |it| it.started as u64);
        let mut under_way = Self {
            given: before,
            ..Self::default()
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
