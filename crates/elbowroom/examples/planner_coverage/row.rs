//! A line of the results.

use std::path::Path;

use serde::{Deserialize, Serialize};

/// What became of one instance with one planner. Times in seconds; empty where there is nothing to
/// say.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Row {
    pub(crate) planner: String,
    /// `collection/domain`
    pub(crate) domain: String,
    pub(crate) instance: String,
    /// `deadlines`, `numbers`, `concurrency`, joined by spaces.
    pub(crate) kinds: String,
    /// [`Outcome::name`](elbowroom::external::Outcome::name).
    pub(crate) outcome: String,
    pub(crate) first_seconds: String,
    pub(crate) first_makespan: String,
    pub(crate) best_makespan: String,
    pub(crate) plans: String,
    /// Plans that the judge refused.
    pub(crate) refused: String,
    /// Whether the times of the last plan had to be repaired.
    pub(crate) repaired: String,
    /// Processor time of all its processes.
    pub(crate) seconds: String,
    pub(crate) megabytes: String,
    /// The value of the problem's metric in the best plan by it, where there is one that is not the makespan.
    #[serde(default)]
    pub(crate) best_metric: String,
    /// `less` or `more`: what is better of the metric.
    #[serde(default)]
    pub(crate) better: String,
    /// What VAL says of the last plan: `valid`, `failed`, `error`; empty where it was not asked.
    #[serde(default)]
    pub(crate) val: String,
    /// What else is to be said.
    pub(crate) note: String,
}

impl Row {
    pub(crate) fn is_solved(&self) -> bool {
        self.outcome == "plan"
    }

    /// What makes it the same run.
    pub(crate) fn key(&self) -> (String, String, String) {
        (
            self.planner.clone(),
            self.domain.clone(),
            self.instance.clone(),
        )
    }
}

/// The rows of a file. A last line that an interrupted run left unfinished is passed over.
pub(crate) fn read(path: &Path) -> Result<Vec<Row>, String> {
    let reader = csv::Reader::from_path(path);
    let reader = reader.map_err(|error| format!("{}: {error}", path.display()))?;
    Ok(reader.into_deserialize().filter_map(Result::ok).collect())
}
