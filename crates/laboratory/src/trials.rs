//! The loop over the trials of an experiment, for both kinds of experiments.

use std::sync::atomic::{AtomicU64, Ordering};

use elbowroom_num::work;
use rayon::prelude::*;
use serde_json::Value;

use crate::error::ExperimentError;
use crate::record::{TrialRecord, TrialRecords};
use crate::results::{Counts, Origin, Results};

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
    /// Returns all trials of an experiment.
    pub fn whole(trials: u64, jobs: usize) -> Self {
        Self {
            trials,
            shard: 0,
            shards: 1,
            jobs,
        }
    }

    /// Returns the numbers of the trials.
    pub(crate) fn numbers(self) -> impl Iterator<Item = u64> {
        (0..self.trials).filter(move |trial| trial % self.shards.max(1) == self.shard)
    }

    fn thread_pool(self) -> Result<rayon::ThreadPool, ExperimentError> {
        let stop = work::Stop::current();
        rayon::ThreadPoolBuilder::new()
            .num_threads(self.jobs)
            .start_handler(move |_| stop.iter().for_each(work::Stop::install_for_thread))
            .build()
            .map_err(|error| ExperimentError::other(format!("cannot start threads: {error}")))
    }
}

/// Progress of the trials, the request to stop them, and the collector of their records.
pub(crate) struct Monitor<'w> {
    done: AtomicU64,
    observe: &'w (dyn Fn(u64) -> bool + Sync),
    records: Option<&'w TrialRecords>,
}

impl<'w> Monitor<'w> {
    /// Creates a monitor. `observe` receives the number of finished trials, and returns `false` to
    /// stop.
    pub(crate) fn new(
        observe: &'w (dyn Fn(u64) -> bool + Sync),
        records: Option<&'w TrialRecords>,
    ) -> Self {
        let done = AtomicU64::new(0);
        Self {
            done,
            observe,
            records,
        }
    }

    pub(crate) fn may_continue(&self) -> bool {
        (self.observe)(self.done.load(Ordering::Relaxed))
    }

    /// Counts a finished trial. Returns `false` to stop.
    pub(crate) fn count_trial(&self) -> bool {
        (self.observe)(self.done.fetch_add(1, Ordering::Relaxed) + 1)
    }

    pub(crate) fn record(&self, record: impl FnOnce() -> TrialRecord) {
        if let Some(records) = self.records {
            records.add(record());
        }
    }
}

/// Experiment as a set of pieces of work that may run in parallel.
pub(crate) trait Trials: Sync {
    /// Counts of the trials.
    type Counts: Counts + Send;
    /// Piece of work.
    type Piece<'e>: Sync
    where
        Self: 'e;
    /// Result of a piece.
    type Made: Send;

    fn title(&self) -> &str;

    /// Returns all data on which the results depend, in a fixed order.
    fn identity(&self) -> Value;

    /// Returns counts without trials.
    fn empty_counts(&self) -> Self::Counts;

    /// Returns the number of settings of each trial.
    fn setting_count(&self) -> usize;

    /// Splits the trials of a part for `threads` threads.
    fn pieces(&self, part: Part, threads: usize) -> Result<Vec<Self::Piece<'_>>, ExperimentError>;

    fn run_piece(
        &self,
        piece: &Self::Piece<'_>,
        part: Part,
        monitor: &Monitor<'_>,
    ) -> Result<Self::Made, ExperimentError>;

    /// Combines the results of all pieces, in their order. After a stop, pieces may have failed for
    /// that reason.
    fn combine(
        &self,
        made: Vec<Result<Self::Made, ExperimentError>>,
        is_stopped: bool,
    ) -> Result<Self::Counts, ExperimentError>;

    /// Adds figures about all trials, on the threads of the trials. Returns `false` if it was
    /// stopped.
    fn finish(
        &self,
        _counts: &mut Self::Counts,
        _part: Part,
        _monitor: &Monitor<'_>,
    ) -> Result<bool, ExperimentError> {
        Ok(true)
    }

    /// Returns the total number of trials of a part.
    fn count(&self, part: Part) -> u64 {
        part.numbers().count() as u64 * self.setting_count() as u64
    }
}

/// Runs the trials of a part. The results of finished trials are kept after a stop
/// ([`Origin::is_interrupted`]). They do not depend on the
/// number of threads.
pub(crate) fn run<E: Trials>(
    experiment: &E,
    part: Part,
    monitor: &Monitor<'_>,
) -> Result<Results<E::Counts>, ExperimentError> {
    let pool = part.thread_pool()?;
    let pieces = experiment.pieces(part, pool.current_num_threads())?;
    let made = pool.install(|| {
        let made = pieces.par_iter();
        made.map(|piece| experiment.run_piece(piece, part, monitor))
            .collect()
    });
    let is_whole = monitor.done.load(Ordering::Relaxed) >= experiment.count(part);
    let mut counts = experiment.combine(made, !is_whole && !monitor.may_continue())?;
    let is_finished = is_whole && pool.install(|| experiment.finish(&mut counts, part, monitor))?;
    let of_part = (part.trials, part.shard, part.shards);
    let of_experiment = (experiment.title(), &experiment.identity());
    Ok(Results {
        origin: Origin::new(E::Counts::FORMAT, of_experiment, of_part, !is_finished),
        counts,
    })
}

/// Reads results of an experiment, with any number of trials.
pub(crate) fn read_results<E: Trials>(
    text: &str,
    experiment: &E,
) -> Result<Results<E::Counts>, ExperimentError> {
    let results = Results::<E::Counts>::read(text)?;
    let is_of_it = results.origin.is_of(&experiment.identity())
        && results.counts.has_shape_of(&experiment.empty_counts());
    is_of_it
        .then_some(results)
        .ok_or(ExperimentError::WrongExperiment)
}
