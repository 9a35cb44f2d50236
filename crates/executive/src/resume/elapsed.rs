//! Time since the last record of a journal.

use elbowroom::num::Rational;
use elbowroom::report::trace::{Line, SnapshotLine, Stored};

use crate::journal::{Journal, Reading, WallTime};

/// Readings of the world's clock and of the wall clock in a journal.
pub(super) struct Elapsed {
    /// First and last reading, if records have a wall-clock time.
    readings: Option<(Reading, Reading)>,
}

impl Elapsed {
    /// Reads the journal of a run, which may begin with a snapshot.
    pub(super) fn of(journal: &Journal, stored: &Stored, snapshot: Option<&SnapshotLine>) -> Self {
        // The header comes before all of them.
        let recorded = journal.recorded.iter().skip(1);
        let times = stored.lines.iter().map(|line| match line {
            Line::Passed(line) => Some(&line.now.0),
            _ => None,
        });
        let times = snapshot.map(|it| Some(it.now())).into_iter().chain(times);
        let mut readings = times.zip(recorded).filter_map(|(world, wall)| {
            let world = world?.clone();
            Some(Reading {
                world,
                wall: (*wall)?,
            })
        });
        // Before the first answer of the world, its clock shows 0. The header is written before the world starts.
        let begun = || {
            let mut walls = journal.recorded.iter().flatten();
            let header = walls.next().filter(|_| snapshot.is_none())?;
            Some(Reading {
                world: Rational::ZERO,
                wall: *walls.next().unwrap_or(header),
            })
        };
        let first = readings.next().or_else(begun);
        let last = readings.last().or_else(|| first.clone());
        Self {
            readings: first.zip(last),
        }
    }

    /// Returns the world's time from the last record until `now`.
    ///
    /// # Errors
    /// When the time is unknown; the error is the reason.
    pub(super) fn until(&self, now: WallTime) -> Result<Rational, &'static str> {
        let Some((first, last)) = &self.readings else {
            return Err("its records have no wall-clock time");
        };
        if last.is_ahead_since(first) {
            return Err(
                "the world's time has passed faster than the wall clock, as in a simulation",
            );
        }
        let elapsed = now.seconds_since(last.wall);
        if elapsed < Rational::ZERO {
            return Err("the system clock was set back since then");
        }
        Ok(elapsed)
    }
}
