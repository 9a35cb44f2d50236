//! Actions that run in the world of a run, as far as its program knows.

use std::collections::BTreeMap;

use elbowroom::execution::{ActionHandle, Command, Event};
use elbowroom::num::Rational;
use elbowroom::report::trace::schema::{IssuedCommandLine, ObservationLine};
use elbowroom::report::trace::{Line, SnapshotLine, Stored};
use elbowroom::report::wire;
use serde_json::{Value, json};

use crate::embedded_world::StartedAction;

/// Actions that were started and whose end is not in the journal.
#[derive(Debug, Default)]
pub(crate) struct RunningActions {
    open: BTreeMap<u64, Open>,
    /// Tickets below this one were issued.
    next_ticket: u64,
}

/// Action without an end.
#[derive(Debug)]
struct Open {
    action: String,
    /// Planned duration; `None` for an instantaneous action.
    duration: Option<Rational>,
    /// Time of its command.
    ordered: Rational,
    has_started: bool,
    is_cancelled: bool,
}

/// Returns the tickets of the actions that were running at the snapshot.
pub(crate) fn open(before: Option<&SnapshotLine>) -> impl Iterator<Item = u64> {
    let starts = before.into_iter().flat_map(|it| &it.starts);
    starts.filter(|it| it.is_open()).map(|it| it.ticket)
}

impl RunningActions {
    pub(crate) fn of(stored: &Stored, before: Option<&SnapshotLine>) -> Self {
        let starts = before.iter().flat_map(|it| &it.starts);
        let open = starts.filter(|it| it.is_open()).map(|it| {
            let open = Open {
                action: it.action.clone(),
                duration: it.duration.as_ref().map(|it| it.0.clone()),
                ordered: it.ordered.0.clone(),
                has_started: it.started.is_some(),
                is_cancelled: it.cancelled.is_some(),
            };
            (it.ticket, open)
        });
        let mut running = Self {
            next_ticket: before.map_or(0, |it| it.started as u64),
            open: open.collect(),
        };
        for line in &stored.lines {
            match line {
                Line::Command(line) => running.note_line(&line.now.0, &line.command),
                Line::Passed(line) => line.observations.iter().for_each(|it| running.read(it)),
                Line::Looked(line) => line.observations.iter().for_each(|it| running.read(it)),
                _ => {}
            }
        }
        running
    }

    fn note_line(&mut self, now: &Rational, command: &IssuedCommandLine) {
        match command {
            IssuedCommandLine::Start {
                ticket,
                action,
                duration,
            } => self.start(now, *ticket, action, duration.as_ref().map(|it| &it.0)),
            IssuedCommandLine::Cancel { ticket } => self.cancel(*ticket),
        }
    }

    /// Records a command that the world receives.
    pub(crate) fn note(&mut self, now: &Rational, command: &Command) {
        match command {
            Command::Start {
                ticket,
                action,
                duration,
            } => self.start(now, ticket.0, &action.name, duration.as_ref()),
            Command::Cancel { ticket } => self.cancel(ticket.0),
        }
    }

    fn start(
        &mut self,
        ordered: &Rational,
        ticket: u64,
        action: &str,
        duration: Option<&Rational>,
    ) {
        self.next_ticket = self.next_ticket.max(ticket + 1);
        let open = Open {
            action: action.to_owned(),
            duration: duration.cloned(),
            ordered: ordered.clone(),
            has_started: false,
            is_cancelled: false,
        };
        self.open.insert(ticket, open);
    }

    fn cancel(&mut self, ticket: u64) {
        if let Some(open) = self.open.get_mut(&ticket) {
            open.is_cancelled = true;
        }
    }

    fn read(&mut self, observation: &ObservationLine) {
        match observation {
            ObservationLine::Started { ticket, .. } => self.started(*ticket),
            ObservationLine::Ended { ticket, .. } => self.ended(*ticket),
            _ => {}
        }
    }

    /// Records an observation of the world.
    pub(crate) fn observe(&mut self, event: &Event) {
        match event {
            Event::Started { ticket, .. } => self.started(ticket.0),
            Event::Ended { ticket, .. } => self.ended(ticket.0),
            _ => {}
        }
    }

    fn started(&mut self, ticket: u64) {
        match self.open.get_mut(&ticket) {
            Some(open) if open.duration.is_none() => self.ended(ticket),
            Some(open) => open.has_started = true,
            None => {}
        }
    }

    fn ended(&mut self, ticket: u64) {
        self.open.remove(&ticket);
    }

    /// Returns the tickets.
    pub(crate) fn tickets(&self) -> Vec<u64> {
        self.open.keys().copied().collect()
    }

    /// Returns the tickets, each with `true` if the action was cancelled.
    pub(crate) fn open(&self) -> impl Iterator<Item = (u64, bool)> {
        let open = self.open.iter();
        open.map(|(ticket, open)| (*ticket, open.is_cancelled))
    }

    /// Tickets below this one were issued.
    pub(crate) fn next_ticket(&self) -> u64 {
        self.next_ticket
    }

    /// Returns the actions, for a world in this process.
    pub(crate) fn actions(&self) -> Vec<StartedAction> {
        let open = self.open.iter().map(|(ticket, open)| StartedAction {
            ticket: ActionHandle(*ticket),
            action: open.action.clone(),
            duration: open.duration.clone(),
            ordered: open.ordered.clone(),
        });
        open.collect()
    }

    /// Returns the message about these actions for the world.
    pub(crate) fn message(&self, now: &Rational) -> Value {
        let open = self.open.iter().map(|(ticket, open)| {
            json!({ "ticket": ticket, "action": open.action, "started": open.has_started })
        });
        json!({ "now": wire::number(now), "open": open.collect::<Vec<_>>() })
    }
}
