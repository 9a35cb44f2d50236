//! Results of trials: tidy rows, one for each trial and executor.

use std::sync::{Mutex, PoisonError};

use elbowroom_report::table::Table;

/// Result of one trial with one executor.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct TrialRecord {
    /// Positions of the case and the column in the experiment, which determine the order of the
    /// rows.
    pub(crate) place: (usize, usize),
    /// Number of the trial.
    pub trial: u64,
    /// Position of the executor.
    pub(crate) row: usize,
    /// Seed of its world. It is the same for all executors, for comparisons in pairs.
    pub seed: u64,
    /// The case, or the values of the blanks: `early = 420, late = 800`.
    pub case: String,
    /// The column, or the world in experiments without time.
    pub column: String,
    /// The executor.
    pub executor: String,
    /// Verdict: `goal-reached`, or another word of `docs/reference/formats/run-json.md`; in experiments
    /// without time, `goal-reached` or `failed`.
    pub verdict: String,
    /// Time of the world at the end, in seconds; `None` in experiments without time.
    pub time: Option<String>,
    /// Number of new plans.
    pub replans: usize,
}

/// Collector of trial records, which may arrive in any order.
#[derive(Debug, Default)]
pub struct TrialRecords(Mutex<Vec<TrialRecord>>);

impl TrialRecords {
    pub(crate) fn add(&self, record: TrialRecord) {
        let mut records = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        records.push(record);
    }

    /// Returns the records in the order of the experiment.
    pub fn table(self) -> Table {
        let mut records = self.0.into_inner().unwrap_or_else(PoisonError::into_inner);
        records.sort();
        let headings = [
            "seed", "case", "column", "trial", "executor", "verdict", "time", "replans",
        ];
        Table {
            caption: String::new(),
            headings: headings.map(str::to_owned).to_vec(),
            keys: 5,
            rows: records
                .into_iter()
                .map(|record| {
                    vec![
                        record.seed.to_string(),
                        record.case,
                        record.column,
                        record.trial.to_string(),
                        record.executor,
                        record.verdict,
                        record.time.unwrap_or_default(),
                        record.replans.to_string(),
                    ]
                })
                .collect(),
            notes: Vec::new(),
        }
    }
}
