//! Line of the results.

use std::path::Path;

use serde::{Deserialize, Serialize};

/// Result of one planner on one instance. Times are in seconds; missing values are empty.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Row {
    pub(crate) planner: String,
    /// `collection/domain`
    pub(crate) domain: String,
    pub(crate) instance: String,
    /// `deadlines`, `numbers`, `concurrency`, separated by spaces.
    pub(crate) kinds: String,
    /// Outcome, as [`Outcome::name`](elbowroom::external::Outcome::name).
    pub(crate) outcome: String,
    pub(crate) first_seconds: String,
    pub(crate) first_makespan: String,
    pub(crate) best_makespan: String,
    pub(crate) plans: String,
    /// Number of plans that the validator rejected.
    pub(crate) refused: String,
    /// `true` if the times of the last plan had to be repaired.
    pub(crate) repaired: String,
    /// Processor time of all its processes.
    pub(crate) seconds: String,
    pub(crate) megabytes: String,
    /// Best value of the problem's metric over its plans, if there is a metric other than the
    /// makespan.
    #[serde(default)]
    pub(crate) best_metric: String,
    /// Better direction of the metric: `less` or `more`.
    #[serde(default)]
    pub(crate) better: String,
    /// VAL's verdict on the last plan: `valid`, `failed`, `error`; empty if VAL was not used.
    #[serde(default)]
    pub(crate) val: String,
    /// Message.
    pub(crate) note: String,
}

impl Row {
    pub(crate) fn is_solved(&self) -> bool {
        self.outcome == "plan"
    }

    /// Returns the identity of the run.
    pub(crate) fn key(&self) -> (String, String, String) {
        (
            self.planner.clone(),
            self.domain.clone(),
            self.instance.clone(),
        )
    }
}

/// Returns the rows of a file. An incomplete last line of an interrupted run is ignored.
pub(crate) fn read(path: &Path) -> Result<Vec<Row>, String> {
    let reader = csv::Reader::from_path(path);
    let reader = reader.map_err(|error| format!("{}: {error}", path.display()))?;
    Ok(reader.into_deserialize().filter_map(Result::ok).collect())
}
