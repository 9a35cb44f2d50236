//! Comparison of executors in many runs: the papers' tables.
//!
//! An [`Experiment`] is a file (`docs/reference/formats/experiment.md`): a problem with blanks and their
//! values, columns (worlds and parameters), and executors. [`run`] runs every trial with every
//! executor in the same world (common random numbers), so that differences between executors are
//! not random. Trials run in parallel. The results do not depend on the number of threads, and the
//! results of parts (shards) add up to those of the whole.

mod clairvoyant;
mod experiment;
mod initial_plans;
mod optimum;
mod plots;
mod results;
mod scenario;
mod trials;

use serde_json::Value;

pub use experiment::{Column, Experiment, LinkedParameters, Planning, Published};
pub use initial_plans::FirstPlanNote;
pub use optimum::ColumnOptimum;
pub use results::{Cell, DiscordantTrials, Invalid, TimedCounts};

use trials::Setting;

use crate::error::ExperimentError;
use crate::failures::TrialId;
use crate::results::{Counts as _, Results};
use crate::trials::{Monitor, Part, Trials};

/// Runs the trials. `observe` receives the number of finished trials, and returns `false` to stop.
/// The results of finished trials are kept.
///
/// # Errors
/// A problem cannot be read, has no plan to begin with, or a plan cannot be prepared.
pub fn run(
    experiment: &Experiment,
    part: Part,
    observe: &(dyn Fn(u64) -> bool + Sync),
) -> Result<Results<TimedCounts>, ExperimentError> {
    crate::trials::run(experiment, part, &Monitor::new(observe, None))
}

/// Repeats one trial of an executor in a column. Returns its trace (`docs/reference/formats/trace.md`), which
/// `elbowroom run --replay` plays and `elbowroom report` shows.
///
/// # Errors
/// There is no such trial, or as for [`run`].
pub fn trace(
    experiment: &Experiment,
    (row, column): (usize, usize),
    id: TrialId,
) -> Result<String, ExperimentError> {
    let wrong = || ExperimentError::other("unknown trial".to_owned());
    let executor = experiment.executors.get(row).ok_or_else(wrong)?;
    let column = experiment.columns.get(column).ok_or_else(wrong)?;
    // Plans for other executors and columns are not prepared.
    let alone = Experiment {
        executors: vec![executor.clone()],
        columns: vec![column.clone()],
        ..experiment.clone()
    };
    let mut fillings = alone.fillings().into_iter();
    let setting = Setting {
        experiment: &alone,
        problem: id.problem,
        filling: fillings.nth(id.problem).ok_or_else(wrong)?,
        piece: 0,
        pieces: 1,
        threads: 1,
    };
    setting.trace(id.trial)
}

impl Trials for Experiment {
    type Counts = TimedCounts;
    type Piece<'e> = Setting<'e>;
    type Made = TimedCounts;

    fn title(&self) -> &str {
        &self.title
    }

    fn identity(&self) -> Value {
        self.identity()
    }

    fn empty_counts(&self) -> TimedCounts {
        TimedCounts::empty(self)
    }

    fn setting_count(&self) -> usize {
        self.columns.len() * self.fillings().len()
    }

    /// Trials of one problem share data, so they run one after the other unless there are more
    /// threads than problems.
    fn pieces(&self, part: Part, threads: usize) -> Result<Vec<Setting<'_>>, ExperimentError> {
        let fillings = self.fillings();
        let pieces = threads
            .div_ceil(fillings.len().max(1))
            .min(part.numbers().count())
            .max(1);
        let threads = threads_per_piece(threads, fillings.len() * pieces);
        let settings = fillings.into_iter().enumerate();
        let settings = settings.flat_map(|(problem, filling)| {
            (0..pieces).map(move |piece| Setting {
                experiment: self,
                problem,
                filling: filling.clone(),
                piece,
                pieces,
                threads,
            })
        });
        Ok(settings.collect())
    }

    fn run_piece(
        &self,
        setting: &Setting<'_>,
        part: Part,
        monitor: &Monitor<'_>,
    ) -> Result<TimedCounts, ExperimentError> {
        setting.run(part, monitor)
    }

    fn combine(
        &self,
        made: Vec<Result<TimedCounts, ExperimentError>>,
        is_stopped: bool,
    ) -> Result<TimedCounts, ExperimentError> {
        let mut whole = self.empty_counts();
        for part in made {
            match part {
                Ok(part) => whole.add(&part),
                // An interrupted planner has no plan.
                Err(_) if is_stopped => {}
                Err(error) => return Err(error),
            }
        }
        Ok(whole)
    }

    fn finish(
        &self,
        counts: &mut TimedCounts,
        part: Part,
        monitor: &Monitor<'_>,
    ) -> Result<bool, ExperimentError> {
        if !self.optimum {
            return Ok(true);
        }
        counts.optimum = optimum::of(self, part, &|| monitor.may_continue())?;
        Ok(monitor.may_continue())
    }
}

/// Returns the number of threads for each of `pieces` pieces of work.
fn threads_per_piece(threads: usize, pieces: usize) -> usize {
    (threads / pieces.max(1)).max(1)
}

#[cfg(test)]
mod tests {
    use super::threads_per_piece;

    #[test]
    fn threads_are_assigned_to_trials_first() {
        for (threads, pieces, each) in [(1, 1, 1), (2, 1, 2), (2, 100, 1), (7, 2, 3), (4, 0, 4)] {
            assert_eq!(
                threads_per_piece(threads, pieces),
                each,
                "{threads}, {pieces}"
            );
        }
    }
}
