//! What trials in perturbed worlds came to.

use std::collections::BTreeMap;

use crate::untimed::Trial;
use elbowroom_report::statistics::{Mean, Proportion};
use serde::{Deserialize, Serialize};

use super::{Case, OptimumRules, PerturbedError, PerturbedExperiment, WorldKind};
use crate::compare::parts::{self, Partial, fingerprint};
use crate::compare::{Failure, Failures, Part, TrialId};
use crate::untimed::{ActionName, ExecutorName, StepKind};

/// Counts by case, world and executor. Everything is a sum, so parts add up exactly, in any order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PerturbedResults {
    format: String,
    version: u64,
    /// The title of the experiment.
    pub title: String,
    /// Distinguishes experiments, so that no apples are added to pears.
    pub fingerprint: String,
    /// How many trials of each row the whole has.
    pub trials: u64,
    /// Into how many parts it was split.
    pub shards: u64,
    /// Which parts are in here.
    pub parts: Vec<u64>,
    /// Whether it was interrupted before all trials of these parts were made.
    #[serde(default, skip_serializing_if = "parts::is_false")]
    pub is_interrupted: bool,
    /// The rows: case by case, world by world.
    pub rows: Vec<Row>,
}

const FORMAT: &str = "elbowroom-perturbed-results";

impl PerturbedResults {
    pub(super) fn new(experiment: &PerturbedExperiment, part: Part, rows: Vec<Row>) -> Self {
        Self {
            format: FORMAT.to_owned(),
            version: 1,
            title: experiment.title.clone(),
            fingerprint: fingerprint(&experiment.identity(), part.trials),
            trials: part.trials,
            shards: part.shards,
            parts: vec![part.shard],
            is_interrupted: false,
            rows,
        }
    }

    /// Reads results as JSON.
    ///
    /// # Errors
    /// When they are none.
    pub fn read(text: &str) -> Result<Self, PerturbedError> {
        let results: Self = serde_json::from_str(text)
            .map_err(|error| PerturbedError::other(format!("no results: {error}")))?;
        if results.format != FORMAT || results.version != 1 {
            return Err(PerturbedError::other(format!(
                "this program reads {FORMAT}, version 1"
            )));
        }
        if !parts::are_possible(results.shards, &results.parts) {
            return Err(PerturbedError::other("there are no such parts"));
        }
        Ok(results)
    }

    /// As JSON.
    pub fn json(&self) -> serde_json::Value {
        serde_json::to_value(self).unwrap_or_default()
    }

    /// Whether these are results of that experiment, with any number of trials.
    pub fn are_of(&self, experiment: &PerturbedExperiment) -> bool {
        self.fingerprint == fingerprint(&experiment.identity(), self.trials)
    }

    /// Puts parts of one experiment together.
    ///
    /// # Errors
    /// When they are parts of different ones, or the same part comes twice.
    pub fn merged(parts: &[Self]) -> Result<Self, PerturbedError> {
        parts::merged(parts).map_err(PerturbedError::other)
    }
}

impl Partial for PerturbedResults {
    fn origin(&self) -> (&str, u64) {
        (&self.fingerprint, self.shards)
    }

    fn has_shape_of(&self, other: &Self) -> bool {
        self.rows
            .iter()
            .map(Row::name)
            .eq(other.rows.iter().map(Row::name))
    }

    fn parts(&mut self) -> (&mut u64, &mut Vec<u64>) {
        (&mut self.shards, &mut self.parts)
    }

    fn add(&mut self, other: &Self) {
        self.is_interrupted |= other.is_interrupted;
        for (mine, theirs) in self.rows.iter_mut().zip(&other.rows) {
            mine.merge(theirs);
        }
    }
}

/// The trials of one case in one world with one executor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// The case.
    pub case: String,
    /// The world.
    pub world: WorldKind,
    /// The executor.
    pub executor: ExecutorName,
    /// How many succeeded.
    pub success: Proportion,
    /// Replans in trials that succeeded.
    pub replans: Mean,
    /// The work in trials that succeeded.
    pub succeeded: Work,
    /// The work in trials that failed.
    pub failed: Work,
    /// The published rate in that world.
    pub published: Option<Proportion>,
    /// The best success probability there can be, where it is known.
    pub optimum: Option<f64>,
    /// The same by other rules, if the experiment asks for it.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub other_optima: BTreeMap<OptimumRules, f64>,
    /// The trials that failed: how they ended, and their last step.
    #[serde(default, skip_serializing_if = "Failures::is_empty")]
    pub failures: Failures,
}

/// Rounded to as many digits as are read back as they were written.
pub(super) fn rounded(probability: f64) -> f64 {
    (probability * 1e12).round() / 1e12
}

/// What the last step was, as the cause of a failure.
fn after(step: StepKind) -> &'static str {
    match step {
        StepKind::Started => "after-start",
        StepKind::NotStarted => "start-failed",
        StepKind::Ended => "after-end",
        StepKind::Failed => "end-failed",
    }
}

/// Means of what was done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Work {
    /// Starts and ends.
    pub messages: Mean,
    /// Starts that failed.
    pub failed_starts: Mean,
    /// Actions that were started.
    pub actions: Mean,
}

impl Row {
    pub(super) fn new(
        case: &Case,
        world: WorldKind,
        executor: ExecutorName,
        optimum: Option<f64>,
    ) -> Self {
        let published = case.published.as_ref();
        let published = published.filter(|_| world == WorldKind::AsPublished);
        let published = published.and_then(|published| {
            Some(Proportion {
                successes: *published.successes.get(&executor)?,
                count: published.trials,
            })
        });
        Self {
            case: case.name.clone(),
            world,
            executor,
            success: Proportion::default(),
            replans: Mean::default(),
            succeeded: Work::default(),
            failed: Work::default(),
            published,
            optimum: optimum.map(rounded),
            other_optima: BTreeMap::new(),
            failures: Failures::default(),
        }
    }

    /// The trial of that number; `name` gives the name of an action.
    pub(super) fn add(&mut self, number: u64, trial: &Trial, name: &dyn Fn(&ActionName) -> String) {
        if let Some(lost) = &trial.lost {
            let last = lost.last.as_ref();
            self.failures.add(&Failure {
                verdict: lost.ending.name().to_owned(),
                cause: last.map(|(kind, _)| after(*kind).to_owned()),
                action: last.map(|(_, action)| name(action)),
                runs: 1,
                first: TrialId {
                    problem: 0,
                    trial: number,
                },
            });
        }
        self.success.add(trial.is_success());
        let work = if trial.is_success() {
            self.replans.add(trial.replans as u64);
            &mut self.succeeded
        } else {
            &mut self.failed
        };
        work.messages.add(trial.tally.messages());
        work.failed_starts.add(trial.tally.failed_starts);
        work.actions.add(trial.tally.starts);
    }

    fn name(&self) -> (&str, WorldKind, ExecutorName) {
        (&self.case, self.world, self.executor)
    }

    fn merge(&mut self, other: &Self) {
        self.success.merge(other.success);
        self.replans.merge(other.replans);
        self.failures.merge(&other.failures);
        for (mine, theirs) in [
            (&mut self.succeeded, &other.succeeded),
            (&mut self.failed, &other.failed),
        ] {
            mine.messages.merge(theirs.messages);
            mine.failed_starts.merge(theirs.failed_starts);
            mine.actions.merge(theirs.actions);
        }
    }

    /// How far the published share is from ours, in standard deviations of the difference: both
    /// are samples, and if they are of the same probability, all trials together say which.
    pub fn distance(&self) -> Option<f64> {
        let published = self.published?;
        let mut both = self.success;
        both.merge(published);
        let (ours, theirs, share) = (self.success.share()?, published.share()?, both.share()?);
        let parts = 1.0 / float(self.success.count) + 1.0 / float(published.count);
        let deviation = (share * (1.0 - share) * parts).sqrt();
        Some((ours - theirs) / deviation.max(f64::MIN_POSITIVE))
    }

    /// Whether the published share could, at the 5 % level, be of the same probability as ours.
    pub fn agrees(&self) -> Option<bool> {
        Some(self.distance()?.abs() <= 1.96)
    }

    /// Whether our share lies in the 95 % interval (Wilson) of what was published.
    pub fn is_inside(&self) -> Option<bool> {
        let (lower, upper) = self.published?.wilson()?;
        let share = self.success.share()?;
        Some(lower <= share && share <= upper)
    }
}

#[allow(
    clippy::cast_precision_loss,
    reason = "counts of trials are far below 2^52"
)]
fn float(count: u64) -> f64 {
    count as f64
}
