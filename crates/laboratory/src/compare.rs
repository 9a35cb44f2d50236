//! Comparing executors in many runs: the papers' tables.
//!
//! An [`Experiment`] is a file (`docs/formats/experiment.md`): a problem with blanks and what to
//! fill in, columns (worlds, and what is left open), and executors. [`run`] makes every trial with
//! every executor in the same world (common random numbers), so that differences between them are
//! no accident of the dice. Trials run in parallel; the results do not depend on how many at once,
//! and the results of parts (shards) add up to those of the whole.

mod beginnings;
mod clairvoyant;
mod experiment;
mod failures;
mod optimum;
pub(crate) mod parts;
mod place;
mod plots;
mod results;
mod trials;

use std::sync::atomic::{AtomicU64, Ordering};

use elbowroom_num::work;
use rayon::prelude::*;

pub use beginnings::Beginning;
pub use experiment::{Column, Experiment, ExperimentError, Planning, Published, Together};
pub use failures::{Failure, Failures, TrialId};
pub use optimum::ColumnOptimum;
pub use results::{Cell, Invalid, Pair, Results, ResultsError};

use parts::Partial;
use trials::Setting;

use crate::record::TrialRecords;

/// The trials to make, and the number of threads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// How many trials of each problem and column the whole has.
    pub trials: u64,
    /// Which part of them: the trials whose number leaves this remainder…
    pub shard: u64,
    /// … when divided by this.
    pub shards: u64,
    /// The number of threads; 0: as many as processors.
    pub jobs: usize,
}

impl Part {
    /// The numbers of the trials.
    pub(crate) fn numbers(self) -> impl Iterator<Item = u64> {
        (0..self.trials).filter(move |trial| trial % self.shards.max(1) == self.shard)
    }

    /// How many trials that is for an experiment, all problems and columns together.
    pub fn count(self, experiment: &Experiment) -> u64 {
        let settings = experiment.columns.len() * experiment.fillings().len();
        self.numbers().count() as u64 * settings as u64
    }
}

/// Makes the trials. `observe` is told how many are done, and says whether to go on. If not, what
/// has been made until then is kept ([`Results::is_interrupted`]).
///
/// # Errors
/// When a problem cannot be read, has no plan to begin with, or a plan cannot be made ready.
pub fn run(
    experiment: &Experiment,
    part: Part,
    observe: &(dyn Fn(u64) -> bool + Sync),
) -> Result<Results, ExperimentError> {
    run_recorded(experiment, part, None, observe)
}

/// Makes one trial of an executor in a column once more: its trace (`docs/formats/trace.md`), which
/// `elbowroom run --replay` plays and `elbowroom report` shows.
///
/// # Errors
/// When there is no such trial, or as for [`run`].
pub fn trace(
    experiment: &Experiment,
    (row, column): (usize, usize),
    id: TrialId,
) -> Result<String, ExperimentError> {
    let wrong = || ExperimentError::other("there is no such trial".to_owned());
    let executor = experiment.executors.get(row).ok_or_else(wrong)?;
    let column = experiment.columns.get(column).ok_or_else(wrong)?;
    // No other plans are made ready.
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

/// The same, with a record of each trial.
///
/// # Errors
/// As for [`run`].
pub fn run_recorded(
    experiment: &Experiment,
    part: Part,
    records: Option<&TrialRecords>,
    observe: &(dyn Fn(u64) -> bool + Sync),
) -> Result<Results, ExperimentError> {
    let stop = work::Stop::of_this_thread();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(part.jobs)
        .start_handler(move |_| stop.iter().for_each(work::Stop::obey))
        .build()
        .map_err(|error| ExperimentError::other(format!("cannot start threads: {error}")))?;
    let fillings = experiment.fillings();
    // Trials of one problem have much in common; they are made one after the other unless there
    // are more threads than problems. Results are sums, and do not depend on that.
    let threads = pool.current_num_threads();
    let pieces = threads
        .div_ceil(fillings.len().max(1))
        .min(part.numbers().count())
        .max(1);
    let planning_threads = for_each(threads, fillings.len() * pieces);
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
    let goes_on = || observe(done.load(Ordering::Relaxed));
    let parts: Vec<Result<Results, ExperimentError>> = pool.install(|| {
        settings
            .par_iter()
            .map(|setting| setting.run(part, records, &told, &goes_on))
            .collect()
    });
    // In the order of the settings, whichever was ready first.
    let mut whole = Results::empty(experiment, part);
    whole.is_interrupted = done.load(Ordering::Relaxed) < part.count(experiment) && !goes_on();
    for part in parts {
        match part {
            Ok(part) => whole.add(&part),
            // A planner that was stopped has no plan.
            Err(_) if whole.is_interrupted => {}
            Err(error) => return Err(error),
        }
    }
    if experiment.optimum && !whole.is_interrupted {
        whole.optimum = pool.install(|| optimum::of(experiment, &fillings, part, &goes_on))?;
        whole.is_interrupted = !goes_on();
    }
    Ok(whole)
}

/// How many threads each of so many pieces of work may have.
fn for_each(threads: usize, pieces: usize) -> usize {
    (threads / pieces.max(1)).max(1)
}

#[cfg(test)]
mod tests {
    use super::for_each;

    #[test]
    fn threads_are_for_trials_first() {
        for (threads, pieces, each) in [(1, 1, 1), (2, 1, 2), (2, 100, 1), (7, 2, 3), (4, 0, 4)] {
            assert_eq!(for_each(threads, pieces), each, "{threads}, {pieces}");
        }
    }
}
