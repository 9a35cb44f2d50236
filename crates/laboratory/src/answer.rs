//! Comparison of executors: one request and one answer for both kinds of experiments.

use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};

use elbowroom::answers::{Event, Observer, TrialsProgress};
use elbowroom_report::plot::IntervalPlot;
use elbowroom_report::table::Table;
use elbowroom_text::Source;
use serde::Serialize;

use crate::compare::{self, Experiment, TimedCounts};
use crate::error::ExperimentError;
use crate::failures::{Failures, TrialId};
use crate::perturbed::{self, PerturbedExperiment, UntimedCounts};
use crate::record::TrialRecords;
use crate::results::{Origin, Results};
use crate::trials::{self, Monitor, Part, Trials as _};

/// Experiment of either kind.
#[derive(Clone, Debug)]
pub enum AnyExperiment {
    /// On a clock: `docs/reference/formats/experiment.md`.
    Timed(Box<Experiment>),
    /// In worlds without time: `docs/research/perturbed-worlds.md`.
    Untimed(Box<PerturbedExperiment>),
}

/// Request for the trials of an experiment, or for a part of them.
#[derive(Clone, Copy, Debug)]
pub struct CompareRequest<'a> {
    /// The experiment.
    pub experiment: &'a AnyExperiment,
    /// The trials to run, and the number of threads.
    pub part: Part,
}

/// Results of an experiment: `docs/reference/formats/results-json.md`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum CompareAnswer {
    /// On a clock.
    Timed(Results<TimedCounts>),
    /// In worlds without time.
    Untimed(Results<UntimedCounts>),
}

/// Row, column, and the position of a kind of failure among the most frequent ones of that cell. In
/// worlds without time, case, world and executor make the row, and the column is 0.
pub type FailurePosition = (usize, usize, usize);

/// Failed trial, as an example of its kind of failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct FailedTrial {
    /// The kind of failure.
    pub position: FailurePosition,
    /// The trial.
    pub id: TrialId,
}

impl AnyExperiment {
    /// Reads an experiment. `file` returns the text of a file that it names.
    ///
    /// # Errors
    /// The first mistake, with its place.
    pub fn read(
        source: &Source,
        file: &dyn Fn(&str) -> Result<String, String>,
    ) -> Result<Self, ExperimentError> {
        if PerturbedExperiment::is_experiment(source.text()) {
            let experiment = PerturbedExperiment::read(source, file)?;
            Ok(Self::Untimed(Box::new(experiment)))
        } else {
            let experiment = Experiment::read(source, file)?;
            Ok(Self::Timed(Box::new(experiment)))
        }
    }

    /// Returns the number of trials of each problem, case or column.
    pub fn trials(&self) -> u64 {
        match self {
            Self::Timed(experiment) => experiment.trials,
            Self::Untimed(experiment) => experiment.trials,
        }
    }

    /// Sets the random seed. Results with another seed are those of another experiment.
    pub fn set_seed(&mut self, seed: u64) {
        match self {
            Self::Timed(experiment) => experiment.seed = seed,
            Self::Untimed(experiment) => experiment.seed = seed,
        }
    }

    /// Returns `true` if a trial can be [repeated](Self::traces). It cannot if executors believe in
    /// another world, because a trace names only one.
    pub fn is_repeatable(&self, failed: &FailedTrial) -> bool {
        match self {
            Self::Timed(experiment) => {
                let column = experiment.columns.get(failed.position.1);
                column.is_some_and(|column| column.believed.is_none())
            }
            Self::Untimed(_) => true,
        }
    }

    /// Repeats trials for their traces (`docs/reference/formats/trace.md`) or, in worlds without time, their
    /// courses (`docs/reference/formats/course.md`).
    ///
    /// # Errors
    /// There is no such trial.
    pub fn traces(&self, failed: &[FailedTrial]) -> Result<Vec<String>, ExperimentError> {
        match self {
            Self::Timed(experiment) => {
                let traces = failed.iter().map(|failed| {
                    let (row, column, _) = failed.position;
                    compare::trace(experiment, (row, column), failed.id)
                });
                traces.collect()
            }
            Self::Untimed(experiment) => {
                let trials = failed
                    .iter()
                    .map(|failed| (failed.position.0, failed.id.trial));
                let trials: Vec<(usize, u64)> = trials.collect();
                perturbed::repeat_trials(experiment, &trials)
            }
        }
    }

    /// Returns the total number of trials of a part.
    fn count(&self, part: Part) -> u64 {
        match self {
            Self::Timed(experiment) => experiment.count(part),
            Self::Untimed(experiment) => experiment.count(part),
        }
    }
}

/// Runs the trials. If the watcher stops it, the answer holds the trials so far
/// ([`CompareAnswer::is_interrupted`]).
///
/// # Errors
/// A problem cannot be read, has no plan to begin with, or is of an unsupported kind.
pub fn compare(
    request: CompareRequest<'_>,
    watcher: &mut (dyn Observer + Send),
) -> Result<CompareAnswer, ExperimentError> {
    compare_recorded(request, None, watcher)
}

/// Runs the trials, with a record of each.
///
/// # Errors
/// As for [`compare()`].
pub fn compare_recorded(
    request: CompareRequest<'_>,
    records: Option<&TrialRecords>,
    watcher: &mut (dyn Observer + Send),
) -> Result<CompareAnswer, ExperimentError> {
    let CompareRequest { experiment, part } = request;
    let of = experiment.count(part);
    let shared = Mutex::new((watcher, 0));
    let observe = |done: u64| {
        let mut shared = shared.lock().unwrap_or_else(PoisonError::into_inner);
        let (watcher, told) = &mut *shared;
        if done > *told {
            *told = done;
            watcher.notice(&Event::Trials(TrialsProgress { done, total: of }));
        }
        matches!(watcher.flow(), ControlFlow::Continue(()))
    };
    let monitor = Monitor::new(&observe, records);
    Ok(match experiment {
        AnyExperiment::Timed(experiment) => {
            CompareAnswer::Timed(trials::run(&**experiment, part, &monitor)?)
        }
        AnyExperiment::Untimed(experiment) => {
            CompareAnswer::Untimed(trials::run(&**experiment, part, &monitor)?)
        }
    })
}

impl CompareAnswer {
    /// Reads results as JSON.
    ///
    /// # Errors
    /// The text does not contain results, or those of another experiment.
    pub fn read(text: &str, experiment: &AnyExperiment) -> Result<Self, ExperimentError> {
        Ok(match experiment {
            AnyExperiment::Timed(experiment) => {
                Self::Timed(trials::read_results(text, &**experiment)?)
            }
            AnyExperiment::Untimed(experiment) => {
                Self::Untimed(trials::read_results(text, &**experiment)?)
            }
        })
    }

    /// Merges parts of one experiment.
    ///
    /// # Errors
    /// There are no parts, they belong to different experiments, or a part occurs twice.
    pub fn merge_results(parts: &[Self]) -> Result<Self, ExperimentError> {
        let (mut timed, mut untimed) = (Vec::new(), Vec::new());
        for part in parts {
            match part {
                Self::Timed(results) => timed.push(results.clone()),
                Self::Untimed(results) => untimed.push(results.clone()),
            }
        }
        match (timed.is_empty(), untimed.is_empty()) {
            (_, true) => Ok(Self::Timed(Results::merge_results(&timed)?)),
            (true, false) => Ok(Self::Untimed(Results::merge_results(&untimed)?)),
            (false, false) => Err(ExperimentError::WrongExperiment),
        }
    }

    /// Returns the experiment and its parts.
    fn origin(&self) -> &Origin {
        match self {
            Self::Timed(results) => &results.origin,
            Self::Untimed(results) => &results.origin,
        }
    }

    /// Returns the first trial of each of the most frequent kinds of failure: at most `of_a_cell`
    /// for each cell, and at most `most` in total, the most frequent first.
    pub fn failed_trials(&self, of_a_cell: usize, most: usize) -> Vec<FailedTrial> {
        let mut found = Vec::new();
        let mut look = |row: usize, column: usize, failures: &Failures| {
            let kinds = failures.kinds().into_iter().take(of_a_cell);
            for (kind, failure) in kinds.enumerate() {
                let place = (row, column, kind);
                let id = failure.first;
                found.push((
                    std::cmp::Reverse(failure.runs),
                    FailedTrial {
                        position: place,
                        id,
                    },
                ));
            }
        };
        match self {
            Self::Timed(results) => {
                for (row, cells) in results.counts.cells.iter().enumerate() {
                    for (column, cell) in cells.iter().enumerate() {
                        look(row, column, &cell.failures);
                    }
                }
            }
            Self::Untimed(results) => {
                for (row, own) in results.counts.rows.iter().enumerate() {
                    look(row, 0, &own.failures);
                }
            }
        }
        found.sort();
        let trials = found.into_iter().map(|(_, trial)| trial);
        let mut all = self.invalid_trials();
        all.extend(trials.take(most));
        all
    }

    /// Returns notes on the executions that the validator rejects: bugs of the program. Executions in worlds
    /// without time are not validated.
    pub fn invalid_notes(&self) -> Vec<String> {
        match self {
            Self::Timed(results) => results.invalid_notes(),
            Self::Untimed(_) => Vec::new(),
        }
    }

    /// Returns the first invalid trial of each cell, as an additional kind of failure.
    fn invalid_trials(&self) -> Vec<FailedTrial> {
        let Self::Timed(results) = self else {
            return Vec::new();
        };
        let mut found = Vec::new();
        for (row, cells) in results.counts.cells.iter().enumerate() {
            for (column, cell) in cells.iter().enumerate() {
                let place = (row, column, cell.failures.kinds().len());
                let first = cell.invalid.first.as_ref();
                found.extend(first.map(|(id, _)| FailedTrial {
                    position: place,
                    id: *id,
                }));
            }
        }
        found
    }

    /// Returns the results as JSON.
    pub fn json(&self) -> serde_json::Value {
        serde_json::to_value(self).unwrap_or_default()
    }

    /// Returns `true` if it was interrupted before all trials had run.
    pub fn is_interrupted(&self) -> bool {
        self.origin().is_interrupted
    }

    /// Returns the table.
    ///
    /// # Errors
    /// The results are those of another kind of experiment.
    pub fn table(&self, experiment: &AnyExperiment) -> Result<Table, ExperimentError> {
        match (self, experiment) {
            (Self::Timed(results), AnyExperiment::Timed(experiment)) => {
                Ok(results.table(experiment))
            }
            (Self::Untimed(results), AnyExperiment::Untimed(_)) => Ok(results.table()),
            _ => Err(ExperimentError::WrongExperiment),
        }
    }

    /// Returns the results for programs: a number in each cell, and unique names.
    pub fn records(&self) -> Table {
        match self {
            Self::Timed(results) => results.records(),
            Self::Untimed(results) => results.records(),
        }
    }

    /// Returns the plots, by name.
    pub fn plots(&self) -> Vec<(String, IntervalPlot)> {
        match self {
            Self::Timed(results) => results.plots(),
            Self::Untimed(results) => results.plots(),
        }
    }
}
