//! Parts of experiments, and their sum.

use std::collections::BTreeSet;

use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::error::ExperimentError;

/// Results of one or several parts of an experiment.
pub(crate) trait Partial: Clone {
    /// Returns the fingerprint of the experiment, and the number of parts.
    fn origin(&self) -> (&str, u64);
    /// Returns `true` if both have the same rows and columns.
    fn has_shape_of(&self, other: &Self) -> bool;
    /// Returns the number of parts, and the positions of those in these results.
    fn parts(&mut self) -> (&mut u64, &mut Vec<u64>);
    /// Checks results that were read.
    fn check(&self) -> Result<(), ExperimentError>;
    /// Adds the counts of another part.
    fn add(&mut self, other: &Self);
}

/// Reads results as JSON.
///
/// # Errors
/// The text does not contain results of this format.
pub(crate) fn read<P: Partial + DeserializeOwned>(text: &str) -> Result<P, ExperimentError> {
    let results: P = serde_json::from_str(text)
        .map_err(|error| ExperimentError::other(format!("no results: {error}")))?;
    results.check()?;
    Ok(results)
}

/// Checks the format of results, and that these parts exist.
pub(crate) fn check(
    (format, version): (&str, u64),
    known: &str,
    (shards, parts): (u64, &[u64]),
) -> Result<(), ExperimentError> {
    if format != known || version != 1 {
        let message = format!("this program reads {known}, version 1");
        return Err(ExperimentError::other(message));
    }
    if !are_valid_parts(shards, parts) {
        return Err(ExperimentError::other("these parts do not exist"));
    }
    Ok(())
}

/// Merges parts of one experiment.
///
/// # Errors
/// They belong to different experiments, or a part occurs twice.
pub(crate) fn merge_parts<P: Partial>(parts: &[P]) -> Result<P, ExperimentError> {
    let Some((first, rest)) = parts.split_first() else {
        return Err(ExperimentError::other("there are no results to merge"));
    };
    let mut whole = first.clone();
    for part in rest {
        if part.origin() != whole.origin() || !part.has_shape_of(&whole) {
            let message = "these are parts of different experiments";
            return Err(ExperimentError::other(message));
        }
        whole.add(part);
        let mut part = part.clone();
        let (theirs, mine) = (part.parts().1, whole.parts().1);
        if let Some(twice) = theirs.iter().find(|shard| mine.contains(shard)) {
            let message = format!("part {twice} is given twice");
            return Err(ExperimentError::other(message));
        }
        mine.append(theirs);
    }
    let (count, shards) = whole.parts();
    shards.sort_unstable();
    if (0..*count).eq(shards.iter().copied()) {
        (*count, *shards) = (1, vec![0]);
    }
    Ok(whole)
}

/// Returns `true` if these are distinct parts of an experiment with `shards` parts.
pub(crate) fn are_valid_parts(shards: u64, parts: &[u64]) -> bool {
    let mut seen = BTreeSet::new();
    !parts.is_empty() && parts.iter().all(|part| *part < shards && seen.insert(part))
}

/// Describes the number of trials of `what`. Missing parts are mentioned.
pub(crate) fn describe_trials(trials: u64, what: &str, shards: u64, parts: &[u64]) -> String {
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
pub(crate) fn is_false(value: &bool) -> bool {
    !value
}

/// Returns the fingerprint of an experiment: FNV-1a over all data on which its results depend.
/// Internal names are not part of it, so stored results stay valid.
pub(crate) fn fingerprint(identity: &Value, trials: u64) -> String {
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
    use crate::compare::Part;

    #[test]
    fn number_of_trials_equals_sum_of_parts() {
        assert_eq!(
            describe_trials(8, "each problem", 3, &[0, 1, 2]),
            "8 trials of each problem"
        );
        for (trials, shards) in [(8, 3), (2, 5), (9, 3), (1, 1)] {
            for shard in 0..shards {
                let part = Part {
                    trials,
                    shard,
                    shards,
                    jobs: 0,
                };
                let words = describe_trials(trials, "it", shards, &[shard]);
                let count = part.numbers().count();
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
