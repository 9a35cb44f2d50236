//! Comparison of executors in many runs: the papers' tables.
//!
//! An [`Experiment`] is a file (`docs/formats/experiment.md`): a problem with blanks and their
//! values, columns (worlds and parameters), and executors. [`run`] runs every trial with every
//! executor in the same world (common random numbers), so that differences between executors are
//! not random. Trials run in parallel. The results do not depend on the number of threads, and the
//! results of parts (shards) add up to those of the whole.

mod clairvoyant;
mod experiment;
mod failures;
mod initial_plans;
mod optimum;
pub(crate) mod parts;
pub(crate) mod plots;
mod results;
mod scenario;
mod trials;

use std::sync::atomic::{AtomicU64, Ordering};

use elbowroom_num::work;
use rayon::prelude::*;

pub use experiment::{Column, Experiment, LinkedParameters, Planning, Published};
pub use failures::{Failure, Failures, TrialId};
pub use initial_plans::FirstPlanNote;
pub use optimum::ColumnOptimum;
pub use results::{Cell, DiscordantTrials, Invalid, Results};

use parts::Partial;
use trials::Setting;

use crate::error::ExperimentError;
use crate::record::TrialRecords;

/// Trials to run, and the number of threads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// Number of trials of each problem and column in the whole experiment.
    pub trials: u64,
    /// Number of the part. It holds the trials whose number leaves this remainder…
    pub shard: u64,
    /// … when divided by this.
    pub shards: u64,
    /// Number of threads; 0 for one per processor.
    pub jobs: usize,
}

impl Part {
    /// Returns the numbers of the trials.
    pub(crate) fn numbers(self) -> impl Iterator<Item = u64> {
        (0..self.trials).filter(move |trial| trial % self.shards.max(1) == self.shard)
    }

    /// Creates the threads of the trials.
    pub(crate) fn thread_pool(self) -> Result<rayon::ThreadPool, ExperimentError> {
        let stop = work::Stop::current();
        rayon::ThreadPoolBuilder::new()
            .num_threads(self.jobs)
            .start_handler(move |_| stop.iter().for_each(work::Stop::install_for_thread))
            .build()
            .map_err(|error| ExperimentError::other(format!("cannot start threads: {error}")))
    }

    /// Returns the number of trials of an experiment, over all problems and columns.
    pub fn count(self, experiment: &Experiment) -> u64 {
        let settings = experiment.columns.len() * experiment.fillings().len();
        self.numbers().count() as u64 * settings as u64
    }
}

/// Runs the trials. `observe` receives the number of finished trials, and returns `false` to stop.
/// The results of finished trials are kept ([`Results::is_interrupted`]).
///
/// # Errors
/// A problem cannot be read, has no plan to begin with, or a plan cannot be prepared.
pub fn run(
    experiment: &Experiment,
    part: Part,
    observe: &(dyn Fn(u64) -> bool + Sync),
) -> Result<Results, ExperimentError> {
    run_recorded(experiment, part, None, observe)
}

/// Repeats one trial of an executor in a column. Returns its trace (`docs/formats/trace.md`), which
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
    let fillings = alone.fillings();
    let setting = Setting {
        experiment: &alone,
        problem: id.problem,
        filling: fillings.get(id.problem).ok_or_else(wrong)?,
        piece: 0,
        pieces: 1,
        threads: 1,
    };
    setting.trace(id.trial)
}

/// Runs the trials, with a record of each.
///
/// # Errors
/// As for [`run`].
pub fn run_recorded(
    experiment: &Experiment,
    part: Part,
    records: Option<&TrialRecords>,
    observe: &(dyn Fn(u64) -> bool + Sync),
) -> Result<Results, ExperimentError> {
    let pool = part.thread_pool()?;
    let fillings = experiment.fillings();
    // Trials of one problem share data, so they run one after the other unless there are more
    // threads than problems. Results are sums, and do not depend on the order.
    let threads = pool.current_num_threads();
    let pieces = threads
        .div_ceil(fillings.len().max(1))
        .min(part.numbers().count())
        .max(1);
    let planning_threads = threads_per_piece(threads, fillings.len() * pieces);
    let settings: Vec<Setting<'_>> = fillings
        .iter()
        .enumerate()
        .flat_map(|(problem, filling)| {
            (0..pieces).map(move |piece| Setting {
                experiment,
                problem,
                filling,
                piece,
                pieces,
                threads: planning_threads,
            })
        })
        .collect();
    let done = AtomicU64::new(0);
    let told = || observe(done.fetch_add(1, Ordering::Relaxed) + 1);
    let may_continue = || observe(done.load(Ordering::Relaxed));
    let parts: Vec<Result<Results, ExperimentError>> = pool.install(|| {
        settings
            .par_iter()
            .map(|setting| setting.run(part, records, &told, &may_continue))
            .collect()
    });
    // Added in the order of the settings, for reproducible results.
    let mut whole = Results::empty(experiment, part);
    whole.is_interrupted = done.load(Ordering::Relaxed) < part.count(experiment) && !may_continue();
    for part in parts {
        match part {
            Ok(part) => whole.add(&part),
            // An interrupted planner has no plan.
            Err(_) if whole.is_interrupted => {}
            Err(error) => return Err(error),
        }
    }
    if experiment.optimum && !whole.is_interrupted {
        whole.optimum = pool.install(|| optimum::of(experiment, &fillings, part, &may_continue))?;
        whole.is_interrupted = !may_continue();
    }
    Ok(whole)
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
