//! Estimation of a world's rules from attempts: grouping of actions, distributions of durations,
//! and failure rates.

use std::collections::BTreeMap;

use elbowroom_report::statistics::Proportion;
use elbowroom_sim::{Distribution, FailureTime};
use rand::SeedableRng;

use crate::drift::{Drift, drift};
use crate::fit::{Fit, best};
use crate::records::{Outcome, Record};
use crate::survival::{Sample, SurvivalFunction, float};

/// Settings of the estimation.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Resolution of times in the logs, in seconds.
    pub resolution: f64,
    /// Evidence at which drift is reported: the reciprocal of the false alarm probability.
    pub drift_limit: f64,
    /// Random seed for breaking ties in the test for drift.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            resolution: 0.001,
            drift_limit: 100.0,
            seed: 0,
        }
    }
}

/// Statistics of the actions with one name.
#[derive(Clone, Debug, PartialEq)]
pub struct Learnt {
    /// The name: `drive`.
    pub name: String,
    /// Number of attempts.
    pub attempts: usize,
    /// Distribution of durations.
    pub durations: Durations,
    /// Delay between command and start; `None` if it is not logged, or always 0.
    pub delay: Option<Fit>,
    /// Proportion of failures among the attempts that ended by themselves.
    pub failures: Proportion,
    /// Time of failures.
    pub failure_time: FailureTime,
    /// Proportion of failures that undid the effects of the start, among those for which a log
    /// contains the state. Tables of attempts do not contain it.
    pub undone: Proportion,
    /// Evidence that durations change over the logs.
    pub drift: Drift,
    /// Evidence that the failure rate changes over the logs.
    pub failure_drift: Drift,
}

impl Learnt {
    /// Returns `true` if most failures undo the effects of the start.
    pub fn is_undone(&self) -> bool {
        2 * self.undone.successes > self.undone.count
    }
}

/// Distributions of the durations of the actions with one name.
#[derive(Clone, Debug, PartialEq)]
pub enum Durations {
    /// No duration was observed, or there is none.
    Unknown,
    /// One distribution for all.
    Pooled(Group),
    /// One distribution of the ratio to the planned duration.
    Relative(Group),
    /// One distribution for each ground action.
    PerAction(BTreeMap<String, Group>),
}

/// Samples with a common distribution.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// The samples, in the order of the logs.
    pub samples: Vec<Sample>,
    /// The distribution.
    pub fit: Fit,
}

impl Group {
    fn of(samples: Vec<Sample>, resolution: f64) -> Option<Self> {
        let fit = best(&samples, resolution)?;
        Some(Self { samples, fit })
    }

    /// Returns the numbers of observed and of censored samples.
    pub fn counts(&self) -> (usize, usize) {
        let censored = self.samples.iter().filter(|sample| sample.is_censored);
        let censored = censored.count();
        (self.samples.len() - censored, censored)
    }
}

/// Minimum number of observed durations of each ground action for separate distributions.
const FEWEST_PER_GROUND_ACTION: usize = 5;

/// Estimates the statistics of actions from attempts, sorted by name. `records` must be in the
/// order of execution, log by log.
pub fn learn(records: &[Record], settings: &Settings) -> Vec<Learnt> {
    let mut by_name: BTreeMap<&str, Vec<&Record>> = BTreeMap::new();
    for record in records {
        by_name.entry(record.name()).or_default().push(record);
    }
    let learnt = by_name.into_iter();
    learnt
        .map(|(name, records)| of_name(name, &records, settings))
        .collect()
}

fn of_name(name: &str, records: &[&Record], settings: &Settings) -> Learnt {
    let ended = |record: &&&Record| matches!(record.outcome, Outcome::Succeeded | Outcome::Failed);
    let mut failures = Proportion::default();
    for record in records.iter().filter(ended) {
        failures.add(record.outcome == Outcome::Failed);
    }
    let mut durations = durations(records, Outcome::is_observed_to_end, settings);
    let when = failure_time(records, &durations, settings);
    if when == FailureTime::AtEnd {
        // An attempt that fails at its end also shows the duration.
        let shows = |outcome: Outcome| outcome.is_observed_to_end() || outcome == Outcome::Failed;
        durations = self::durations(records, shows, settings);
    }
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(settings.seed);
    let observed: Vec<f64> = durations.in_order();
    let failed: Vec<f64> = records
        .iter()
        .filter(ended)
        .map(|record| f64::from(u8::from(record.outcome == Outcome::Failed)))
        .collect();
    Learnt {
        name: name.to_owned(),
        attempts: records.len(),
        delay: delay(records, settings),
        failures,
        failure_time: when,
        undone: Proportion::default(),
        drift: drift(&observed, settings.drift_limit, &mut rng),
        failure_drift: drift(&failed, settings.drift_limit, &mut rng),
        durations,
    }
}

impl Outcome {
    /// Returns `true` if the action was observed until its end.
    fn is_observed_to_end(self) -> bool {
        self == Self::Succeeded
    }
}

/// Returns the duration of an attempt, or a lower bound of it; `None` if it never started.
fn sample(record: &Record, is_whole: impl Fn(Outcome) -> bool) -> Option<Sample> {
    let duration = record.end - record.start?;
    let sample = if is_whole(record.outcome) {
        Sample::observed(duration)
    } else {
        Sample::censored(duration)
    };
    Some(sample)
}

fn durations(
    records: &[&Record],
    is_whole: impl Fn(Outcome) -> bool + Copy,
    settings: &Settings,
) -> Durations {
    let resolution = settings.resolution;
    let all: Vec<(&Record, Sample)> = records
        .iter()
        .filter_map(|record| Some((*record, sample(record, is_whole)?)))
        .collect();
    // Instantaneous actions have no durations to learn.
    if all
        .iter()
        .all(|(record, sample)| sample.value <= 0.0 && record.planned.is_none())
    {
        return Durations::Unknown;
    }
    let together = Group::of(all.iter().map(|(_, sample)| *sample).collect(), resolution);
    let Some(together) = together else {
        return Durations::Unknown;
    };
    let mut best = (together.fit.aicc, Durations::Pooled(together));
    let planned = |record: &Record| record.planned.filter(|planned| *planned > 0.0);
    let relative: Option<Vec<(Sample, f64)>> = all
        .iter()
        .map(|(record, sample)| planned(record).map(|planned| (sample.over(planned), planned)))
        .collect();
    if let Some(relative) = relative {
        let samples = relative.iter().map(|(sample, _)| *sample).collect();
        // The resolution, relative to the planned durations, differs between attempts; this is
        // their mean.
        let mean = relative
            .iter()
            .map(|(_, planned)| planned.ln())
            .sum::<f64>()
            / float(all.len());
        if let Some(group) = Group::of(samples, resolution / mean.exp()) {
            // At equal criteria, ratios are preferred, because they also apply to actions not
            // observed yet.
            if group.fit.aicc <= best.0 {
                best = (group.fit.aicc, Durations::Relative(group));
            }
        }
    }
    let mut by_action: BTreeMap<&str, Vec<Sample>> = BTreeMap::new();
    for (record, sample) in &all {
        by_action.entry(&record.action).or_default().push(*sample);
    }
    if by_action.len() > 1 {
        let groups: Option<BTreeMap<String, Group>> = by_action
            .into_iter()
            .map(|(action, samples)| {
                let group = Group::of(samples, resolution)?;
                let is_enough = group.counts().0 >= FEWEST_PER_GROUND_ACTION;
                is_enough.then(|| (action.to_owned(), group))
            })
            .collect();
        if let Some(groups) = groups {
            let sum: f64 = groups.values().map(|group| group.fit.aicc).sum();
            if sum < best.0 {
                best = (sum, Durations::PerAction(groups));
            }
        }
    }
    best.1
}

impl Durations {
    /// Returns the group with the duration of an action, and the unit of its samples in seconds.
    pub fn of(&self, action: &str, planned: f64) -> Option<(&Group, f64)> {
        match self {
            Self::Unknown => None,
            Self::Pooled(group) => Some((group, 1.0)),
            Self::Relative(group) => Some((group, planned)),
            Self::PerAction(groups) => groups.get(action).map(|group| (group, 1.0)),
        }
    }

    /// Returns the observed values, group by group, in the order of the logs within a group.
    fn in_order(&self) -> Vec<f64> {
        let observed = |group: &Group| {
            let observed = group.samples.iter().filter(|sample| !sample.is_censored);
            observed.map(|sample| sample.value).collect::<Vec<f64>>()
        };
        match self {
            Self::Unknown | Self::PerAction(_) => Vec::new(),
            Self::Pooled(group) | Self::Relative(group) => observed(group),
        }
    }
}

fn delay(records: &[&Record], settings: &Settings) -> Option<Fit> {
    let delays: Vec<Sample> = records
        .iter()
        .filter_map(|record| Some(Sample::observed(record.start? - record.commanded?)))
        .collect();
    let is_at_once = delays
        .iter()
        .all(|delay| delay.value <= settings.resolution / 2.0);
    if is_at_once {
        return None;
    }
    best(&delays, settings.resolution)
}

/// Returns the time of failures: the start if most attempts failed before or at their start.
/// Otherwise it is the end if attempts failed on average after more than 3/4 of the mean duration,
/// or else a uniformly distributed moment.
fn failure_time(records: &[&Record], durations: &Durations, settings: &Settings) -> FailureTime {
    let failed: Vec<(&str, f64, Option<f64>)> = records
        .iter()
        .filter(|record| record.outcome == Outcome::Failed)
        .map(|record| {
            let duration = record.start.map_or(0.0, |start| record.end - start);
            (record.action.as_str(), duration, record.planned)
        })
        .collect();
    let early = failed
        .iter()
        .filter(|(_, duration, _)| *duration <= settings.resolution);
    let early = early.count();
    if failed.is_empty() || 2 * early > failed.len() {
        return if failed.is_empty() {
            FailureTime::AtEnd
        } else {
            FailureTime::AtStart
        };
    }
    // Time of each failure as a fraction of the mean duration: about 1 at the end, and about 1/2 in
    // the middle.
    let shares: Vec<f64> = failed
        .iter()
        .filter(|(_, duration, _)| *duration > settings.resolution)
        .filter_map(|(action, duration, planned)| {
            let (group, unit) = durations.of(action, planned.unwrap_or(1.0))?;
            let survival = SurvivalFunction::of(&group.samples);
            let mean = mean(&survival)?;
            (mean > 0.0).then(|| duration / (unit * mean))
        })
        .collect();
    let middle = shares.iter().sum::<f64>() / float(shares.len().max(1));
    if shares.is_empty() || middle > 0.75 {
        FailureTime::AtEnd
    } else {
        FailureTime::Midway
    }
}

/// Returns the mean of the observed part of a distribution.
fn mean(survival: &SurvivalFunction) -> Option<f64> {
    let mut before = 1.0;
    let mut sum = 0.0;
    for (value, after) in survival.steps() {
        sum += value * (before - after);
        before = *after;
    }
    (before < 1.0).then(|| sum / (1.0 - before))
}

/// Returns the value of a distribution with only one value.
pub(crate) fn constant(distribution: &Distribution) -> Option<f64> {
    match distribution {
        Distribution::Constant(value) => Some(*value),
        _ => None,
    }
}
