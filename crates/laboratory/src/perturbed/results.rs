//! Results of trials in perturbed worlds.

use std::collections::BTreeMap;

use crate::untimed::Trial;
use elbowroom_report::statistics::{Mean, Proportion};
use serde::{Deserialize, Serialize};

use super::{Case, OptimumRules, WorldKind};
use crate::failures::{Failure, Failures, TrialId};
use crate::results::Counts;
use crate::untimed::{ActionName, ExecutorName, StepKind};

/// Counts by case, world and executor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UntimedCounts {
    /// The rows, by case and world.
    pub rows: Vec<Row>,
}

impl Counts for UntimedCounts {
    const FORMAT: &'static str = "elbowroom-perturbed-results";

    fn has_shape_of(&self, other: &Self) -> bool {
        self.rows
            .iter()
            .map(Row::name)
            .eq(other.rows.iter().map(Row::name))
    }

    fn add(&mut self, other: &Self) {
        for (mine, theirs) in self.rows.iter_mut().zip(&other.rows) {
            mine.merge(theirs);
        }
    }
}

/// Trials of one case in one world with one executor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// The case.
    pub case: String,
    /// The world.
    pub world: WorldKind,
    /// The executor.
    pub executor: ExecutorName,
    /// Share of trials that succeeded.
    pub success: Proportion,
    /// Number of replans in trials that succeeded.
    pub replans: Mean,
    /// Steps in trials that succeeded.
    pub succeeded: Work,
    /// Steps in trials that failed.
    pub failed: Work,
    /// Published success rate in that world.
    pub published: Option<Proportion>,
    /// Maximum success probability of all executors, where it is known.
    pub optimum: Option<f64>,
    /// Maximum success probabilities by other rules, if the experiment requests them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub other_optima: BTreeMap<OptimumRules, f64>,
    /// Failed trials by their ending and their last step.
    #[serde(default, skip_serializing_if = "Failures::is_empty")]
    pub failures: Failures,
}

/// Rounds to the number of digits that survives writing and reading.
pub(super) fn rounded(probability: f64) -> f64 {
    (probability * 1e12).round() / 1e12
}

/// Names the last step, as the cause of a failure.
fn step_name(step: StepKind) -> &'static str {
    match step {
        StepKind::Started => "after-start",
        StepKind::NotStarted => "start-failed",
        StepKind::Ended => "after-end",
        StepKind::Failed => "end-failed",
    }
}

/// Means of the numbers of steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Work {
    /// Starts and ends.
    pub messages: Mean,
    /// Failed starts.
    pub failed_starts: Mean,
    /// Started actions.
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

    /// Adds the trial of that number; `name` returns the name of an action.
    pub(super) fn add(&mut self, number: u64, trial: &Trial, name: &dyn Fn(&ActionName) -> String) {
        if let Some(lost) = &trial.failure {
            let last = lost.last.as_ref();
            self.failures.add(&Failure {
                verdict: lost.ending.name().to_owned(),
                cause: last.map(|(kind, _)| step_name(*kind).to_owned()),
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

    /// Returns the difference between the published share and ours, in standard deviations of the
    /// difference. Both are samples, and their common probability is estimated from all trials
    /// together.
    pub fn distance(&self) -> Option<f64> {
        let published = self.published?;
        let mut both = self.success;
        both.merge(published);
        let (ours, theirs, share) = (self.success.share()?, published.share()?, both.share()?);
        let parts = 1.0 / float(self.success.count) + 1.0 / float(published.count);
        let deviation = (share * (1.0 - share) * parts).sqrt();
        Some((ours - theirs) / deviation.max(f64::MIN_POSITIVE))
    }

    /// Returns `true` if the published share is consistent with ours at the 5 % level.
    pub fn agrees(&self) -> Option<bool> {
        Some(self.distance()?.abs() <= 1.96)
    }

    /// Returns `true` if our share lies in the 95 % interval (Wilson) of the published one.
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
