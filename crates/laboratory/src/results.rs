//! Results of experiments: the counts of their trials, and the sum of parts.

use std::collections::BTreeSet;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::error::ExperimentError;

/// Results of an experiment, or of parts of it: `docs/reference/formats/results-json.md`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Results<C> {
    /// The experiment and its parts.
    #[serde(flatten)]
    pub origin: Origin,
    /// The counts.
    #[serde(flatten)]
    pub counts: C,
}

/// Experiment of some results, and its parts in them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Origin {
    format: String,
    version: u64,
    /// Title of the experiment.
    pub title: String,
    /// Fingerprint of the experiment. Only parts with the same fingerprint are merged.
    pub fingerprint: String,
    /// Number of trials of each setting in the whole experiment.
    pub trials: u64,
    /// Number of parts of the experiment.
    pub shards: u64,
    /// Parts in these results.
    pub parts: Vec<u64>,
    /// `true` if it was interrupted before all trials of these parts had run.
    #[serde(default, skip_serializing_if = "is_false")]
    pub is_interrupted: bool,
}

/// Results with counts that are not yet read.
#[derive(Deserialize)]
struct Stored {
    #[serde(flatten)]
    origin: Origin,
    #[serde(flatten)]
    counts: Map<String, Value>,
}

/// Counts of trials. All counts are sums, so parts add up exactly, in any order.
pub trait Counts: Clone + Serialize + DeserializeOwned {
    /// `format` of the results.
    const FORMAT: &'static str;

    /// Returns `true` if both have the same rows and columns.
    fn has_shape_of(&self, other: &Self) -> bool;

    /// Checks counts that were read.
    ///
    /// # Errors
    /// Rows and columns do not fit.
    fn check(&self) -> Result<(), ExperimentError> {
        Ok(())
    }

    /// Adds the counts of another part.
    fn add(&mut self, other: &Self);
}

impl<C: Counts> Results<C> {
    /// Reads results as JSON.
    ///
    /// # Errors
    /// The text does not contain results of this kind.
    pub fn read(text: &str) -> Result<Self, ExperimentError> {
        let wrong =
            |error: serde_json::Error| ExperimentError::other(format!("no results: {error}"));
        let stored: Stored = serde_json::from_str(text).map_err(wrong)?;
        stored.origin.check(C::FORMAT)?;
        let counts: C = serde_json::from_value(Value::Object(stored.counts)).map_err(wrong)?;
        counts.check()?;
        Ok(Self {
            origin: stored.origin,
            counts,
        })
    }

    /// Returns the results as JSON.
    pub fn json(&self) -> Value {
        serde_json::to_value(self).unwrap_or_default()
    }

    /// Merges parts of one experiment.
    ///
    /// # Errors
    /// There are no parts, they belong to different experiments, or a part occurs twice.
    pub fn merge_results(parts: &[Self]) -> Result<Self, ExperimentError> {
        let Some((first, rest)) = parts.split_first() else {
            return Err(ExperimentError::other("there are no results to merge"));
        };
        let mut whole = first.clone();
        for part in rest {
            whole.origin.add(&part.origin)?;
            if !part.counts.has_shape_of(&whole.counts) {
                return Err(ExperimentError::other(OTHER_EXPERIMENT));
            }
            whole.counts.add(&part.counts);
        }
        whole.origin.join_parts();
        Ok(whole)
    }
}

const OTHER_EXPERIMENT: &str = "these are parts of different experiments";

impl Origin {
    /// Creates the origin of the part `shard` of `shards` parts.
    pub(crate) fn new(
        format: &str,
        (title, identity): (&str, &Value),
        (trials, shard, shards): (u64, u64, u64),
        is_interrupted: bool,
    ) -> Self {
        Self {
            format: format.to_owned(),
            version: 1,
            title: title.to_owned(),
            fingerprint: fingerprint(identity, trials),
            trials,
            shards,
            parts: vec![shard],
            is_interrupted,
        }
    }

    /// Returns `true` if the experiment has this identity.
    pub(crate) fn is_of(&self, identity: &Value) -> bool {
        self.fingerprint == fingerprint(identity, self.trials)
    }

    /// Checks the format of results, and that these parts exist.
    fn check(&self, format: &str) -> Result<(), ExperimentError> {
        if self.format != format || self.version != 1 {
            let message = format!("this program reads {format}, version 1");
            return Err(ExperimentError::other(message));
        }
        if !are_valid_parts(self.shards, &self.parts) {
            return Err(ExperimentError::other("these parts do not exist"));
        }
        Ok(())
    }

    /// Adds other parts.
    fn add(&mut self, other: &Self) -> Result<(), ExperimentError> {
        if (&self.fingerprint, self.shards) != (&other.fingerprint, other.shards) {
            return Err(ExperimentError::other(OTHER_EXPERIMENT));
        }
        if let Some(twice) = other.parts.iter().find(|it| self.parts.contains(it)) {
            let message = format!("part {twice} is given twice");
            return Err(ExperimentError::other(message));
        }
        self.parts.extend(&other.parts);
        self.is_interrupted |= other.is_interrupted;
        Ok(())
    }

    /// Replaces all parts of an experiment by the whole.
    fn join_parts(&mut self) {
        self.parts.sort_unstable();
        if (0..self.shards).eq(self.parts.iter().copied()) {
            (self.shards, self.parts) = (1, vec![0]);
        }
    }

    /// Describes the number of trials of `what`. Missing parts are mentioned.
    pub(crate) fn describe_trials(&self, what: &str) -> String {
        describe_trials(self.trials, what, self.shards, &self.parts)
    }
}

/// Returns `true` if these are distinct parts of an experiment with `shards` parts.
fn are_valid_parts(shards: u64, parts: &[u64]) -> bool {
    let mut seen = BTreeSet::new();
    !parts.is_empty() && parts.iter().all(|part| *part < shards && seen.insert(part))
}

/// Describes the number of trials of `what`. Missing parts are mentioned.
fn describe_trials(trials: u64, what: &str, shards: u64, parts: &[u64]) -> String {
    let shards = shards.max(1);
    if (0..shards).all(|part| parts.contains(&part)) {
        return format!("{trials} trials of {what}");
    }
    // Part p has the trials p, p + shards, … below `trials`.
    let of_part = |part: &u64| trials.saturating_sub(*part).div_ceil(shards);
    let count: u64 = parts.iter().map(of_part).sum();
    let names: Vec<String> = parts
        .iter()
        .map(|part| format!("{part}/{shards}"))
        .collect();
    format!(
        "incomplete: {count} of {trials} trials of {what}; parts made: {}",
        names.join(", ")
    )
}

/// Skips a member in the output if it is `false`.
#[allow(clippy::trivially_copy_pass_by_ref, reason = "what serde asks for")]
fn is_false(value: &bool) -> bool {
    !value
}

/// Returns the fingerprint of an experiment: FNV-1a over all data on which its results depend.
/// Internal names are not part of it, so stored results stay valid.
fn fingerprint(identity: &Value, trials: u64) -> String {
    let everything = format!("{trials} {identity}");
    let hash = everything
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        });
    format!("{hash:016x}")
}

#[cfg(test)]
mod tests {
    use super::{are_valid_parts, describe_trials};

    #[test]
    fn number_of_trials_equals_sum_of_parts() {
        assert_eq!(
            describe_trials(8, "each problem", 3, &[0, 1, 2]),
            "8 trials of each problem"
        );
        for (trials, shards) in [(8, 3), (2, 5), (9, 3), (1, 1)] {
            for shard in 0..shards {
                let words = describe_trials(trials, "it", shards, &[shard]);
                let count = (0..trials).filter(|trial| trial % shards == shard).count();
                let expected =
                    format!("{count} of {trials} trials of it; parts made: {shard}/{shards}");
                assert!(shards == 1 || words.ends_with(&expected), "{words}");
            }
        }
    }

    #[test]
    fn part_numbers_are_unique_and_in_range() {
        assert!(are_valid_parts(3, &[2, 0]));
        for (shards, parts) in [(3, vec![3]), (3, vec![1, 1]), (1, vec![]), (0, vec![0])] {
            assert!(!are_valid_parts(shards, &parts), "{shards}: {parts:?}");
        }
    }
}
