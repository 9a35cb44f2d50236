//! Starts with all that is needed to resume a run.

use std::sync::Arc;

use elbowroom_model::ground::Action;
use elbowroom_num::Rational;

use super::{ActionLog, StartEntry};
use crate::event::{ActionHandle, Ending, Measured};

/// A start, with all that is needed to resume the run.
#[derive(Clone, Debug, PartialEq)]
pub struct KnownStart {
    /// The identifier for reports of the world.
    pub ticket: ActionHandle,
    /// The action.
    pub action: Arc<Action>,
    /// The planned duration; `None` for an instantaneous action.
    pub planned: Option<Rational>,
    /// The time of the command.
    pub commanded: Rational,
    /// The time of its start, if it has started.
    pub started: Option<Rational>,
    /// The time and the completion of its last reported progress after its start.
    pub progress: Option<(Rational, Rational)>,
    /// The time and the outcome of its end, if it has ended.
    pub ended: Option<(Rational, Ending)>,
    /// The time of the cancellation, if it was cancelled.
    pub cancelled: Option<Rational>,
    /// Its time-out, if it has reached it.
    pub timed_out: Option<Rational>,
    /// `true` if it is unknown whether its end has happened.
    pub is_in_doubt: bool,
    /// The latest tolerable end according to the last warning of it.
    pub warned: Option<Rational>,
    /// The time-out according to the last warning of it.
    pub warned_timeout: Option<Rational>,
    /// The amounts measured at its start, and at its end.
    pub measured: [Vec<Measured>; 2],
}

impl ActionLog {
    /// Restores a log with `started` starts. Starts that are not in `known` count as long past:
    /// late reports about them are ignored.
    pub(in crate::run) fn restore(&mut self, started: usize, known: Vec<KnownStart>) {
        *self = Self {
            started,
            ..Self::default()
        };
        for it in known {
            let opened = StartEntry {
                started: it.started,
                progress: it.progress,
                ended: it.ended,
                cancelled: it.cancelled,
                timed_out: it.timed_out,
                is_in_doubt: it.is_in_doubt,
                warned: it.warned,
                warned_timeout: it.warned_timeout,
                measured: it.measured,
                ..StartEntry::new(&it.action, it.planned, it.commanded)
            };
            if opened.ended.is_none() {
                self.open.insert(it.ticket);
            }
            self.entries.insert(it.ticket, opened);
        }
    }

    /// Returns all starts that are not long past.
    pub(in crate::run) fn known_starts(&self) -> Vec<KnownStart> {
        let known = self.entries.iter().filter(|(_, it)| !it.is_past);
        let known = known.map(|(ticket, it)| KnownStart {
            ticket: *ticket,
            action: Arc::clone(&it.action),
            planned: it.planned.clone(),
            commanded: it.commanded.clone(),
            started: it.started.clone(),
            progress: it.progress.clone(),
            ended: it.ended.clone(),
            cancelled: it.cancelled.clone(),
            timed_out: it.timed_out.clone(),
            is_in_doubt: it.is_in_doubt,
            warned: it.warned.clone(),
            warned_timeout: it.warned_timeout.clone(),
            measured: it.measured.clone(),
        });
        known.collect()
    }
}
