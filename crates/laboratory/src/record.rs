//! What came of each trial: tidy rows, one for each trial and executor.

use std::sync::{Mutex, PoisonError};

use elbowroom_report::table::Table;

/// The result of one trial with one executor.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct TrialRecord {
    /// The position of the case and of the column in the experiment, for the order of the rows.
    pub(crate) place: (usize, usize),
    /// The number of the trial.
    pub trial: u64,
    /// The position of the executor.
    pub(crate) row: usize,
    /// The seed of its world: the same for all executors, so that they can be compared in pairs.
    pub seed: u64,
    /// The case, or what was filled in: `early = 420, late = 800`.
    pub case: String,
    /// The column; the world, where there is no time.
    pub column: String,
    /// The executor.
    pub executor: String,
    /// How it ended: `goal-reached`, or another word of `docs/formats/run-json.md`; where there is
    /// no time, `goal-reached` or `failed`.
    pub verdict: String,
    /// The world's time at the end, in seconds; `None` where there is no time.
    pub time: Option<String>,
    /// How many new plans were made.
    pub replans: usize,
}

/// Gathers the records of trials that are made in any order.
#[derive(Debug, Default)]
pub struct TrialRecords(Mutex<Vec<TrialRecord>>);

impl TrialRecords {
    pub(crate) fn add(&self, record: TrialRecord) {
        let mut records = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        records.push(record);
    }

    /// The records in the order of the experiment, whoever was ready first.
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
