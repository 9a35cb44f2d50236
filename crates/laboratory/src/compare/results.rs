//! Results of an experiment, or of a part of it.

use std::collections::BTreeMap;

use elbowroom_execution::executors::ExecutorSpec;
use elbowroom_execution::run::{Report, Verdict};
use elbowroom_report::statistics::{Mean, Proportion};
use elbowroom_report::table::Table;
use serde::{Deserialize, Serialize};

use super::Experiment;
use super::clairvoyant;
use super::experiment::CLAIRVOYANT;
use super::initial_plans::{self, FirstPlanNote};
use super::optimum::{self, ColumnOptimum};
use crate::error::ExperimentError;
use crate::failures::{Failures, TrialId};
use crate::results::{Counts, Results};

/// Counts by row and column.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimedCounts {
    /// The rows: executors.
    pub rows: Vec<String>,
    /// The columns.
    pub columns: Vec<String>,
    /// By row and column.
    pub cells: Vec<Vec<Cell>>,
    /// Comparison in pairs of each row with the first one, by row and column.
    pub pairs: Vec<Vec<DiscordantTrials>>,
    /// First plans of executors that were chosen by their probability.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub beginnings: Vec<FirstPlanNote>,
    /// Bounds on the optimal policy by column, if the experiment requests them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub optimum: Vec<ColumnOptimum>,
}

/// Results of one executor in one column.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cell {
    /// Number of runs.
    pub runs: u64,
    /// Number of runs that reached the goal.
    pub successes: u64,
    /// Number of new plans in successful runs.
    pub replans: u64,
    /// Number of runs by verdict.
    pub verdicts: BTreeMap<String, u64>,
    /// Number of abandoned plans by cause.
    pub causes: BTreeMap<String, u64>,
    /// Failed runs by kind.
    #[serde(default, skip_serializing_if = "Failures::is_empty")]
    pub failures: Failures,
    /// Executions that the validator rejects: bugs of the program, whether or not they reached the goal.
    #[serde(default, skip_serializing_if = "Invalid::is_empty")]
    pub invalid: Invalid,
}

/// Executions that the validator rejects.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Invalid {
    /// Number of runs.
    pub runs: u64,
    /// The first of them, with its violation.
    pub first: Option<(TrialId, String)>,
}

impl Invalid {
    fn is_empty(&self) -> bool {
        self.runs == 0
    }

    pub(super) fn count(&mut self, found: &[String], id: TrialId) {
        if let Some(first) = found.first() {
            self.add(&Self {
                runs: 1,
                first: Some((id, first.clone())),
            });
        }
    }

    fn add(&mut self, other: &Self) {
        self.runs += other.runs;
        let both = [self.first.take(), other.first.clone()];
        self.first = both.into_iter().flatten().min();
    }
}

/// Numbers of trials in which exactly one of two executors reached the goal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DiscordantTrials {
    /// Only the first row did.
    pub only_first: u64,
    /// Only this row did.
    pub only_this: u64,
}

impl TimedCounts {
    /// Creates counts without trials.
    pub(super) fn empty(experiment: &Experiment) -> Self {
        let rows = experiment.rows();
        let columns = experiment.columns.iter().map(|it| it.name.clone());
        let columns: Vec<String> = columns.collect();
        Self {
            cells: vec![vec![Cell::default(); columns.len()]; rows.len()],
            pairs: vec![vec![DiscordantTrials::default(); columns.len()]; rows.len()],
            beginnings: Vec::new(),
            optimum: Vec::new(),
            rows,
            columns,
        }
    }
}

impl Results<TimedCounts> {
    /// Returns the table: coverage with its 95 % interval, and the mean number of new plans of
    /// successful runs, next to the published figures.
    pub fn table(&self, experiment: &Experiment) -> Table {
        let mut headings = vec!["executor".to_owned()];
        for column in &self.counts.columns {
            headings.push(format!("{column}: coverage [95 %]"));
            headings.push("replans".to_owned());
            if !experiment.published.is_empty() {
                headings.push("published".to_owned());
            }
        }
        let has_published = !experiment.published.is_empty();
        let best = (!self.counts.optimum.is_empty()).then(|| {
            let mut cells = vec![optimum::ROW.to_owned()];
            for column in &self.counts.optimum {
                cells.extend([column.describe(), "-".to_owned()]);
                cells.extend(has_published.then(|| "-".to_owned()));
            }
            cells
        });
        let rows = self.counts.rows.iter().enumerate().map(|(index, row)| {
            let mut cells = vec![row.clone()];
            for (column, cell) in self.counts.cells[index].iter().enumerate() {
                cells.extend(cell.describe());
                if !experiment.published.is_empty() {
                    cells.push(experiment.published_text(row, column));
                }
            }
            cells
        });
        let mut made = self.origin.describe_trials("each problem");
        if self.origin.is_interrupted {
            // All rows have the same trials.
            let made_here = self.counts.cells.first().map_or(0, |row| {
                let runs = row.iter().map(|cell| cell.runs);
                runs.sum::<u64>()
            });
            made = format!(
                "interrupted after {made_here} trials of {made}; the problems are processed in \
                 order, and the missing ones may be harder or easier"
            );
        }
        Table {
            caption: format!("{} ({made})", self.origin.title),
            rows: rows.chain(best).collect(),
            headings,
            keys: 1,
            notes: self.notes(),
        }
    }

    /// Returns the table for programs: a row for each column and executor, a number in each cell,
    /// and unique names.
    pub fn records(&self) -> Table {
        let headings = [
            "column",
            "executor",
            "runs",
            "successes",
            "coverage",
            "coverage_lower_95",
            "coverage_upper_95",
            "mean_replans",
        ];
        let mut rows = Vec::new();
        for (index, column) in self.counts.columns.iter().enumerate() {
            for (executor, cells) in self.counts.rows.iter().zip(&self.counts.cells) {
                let cell = &cells[index];
                let number = |value: Option<f64>| {
                    value.map_or_else(String::new, |value| format!("{value:.4}"))
                };
                let interval = cell.coverage().wilson();
                rows.push(vec![
                    column.clone(),
                    executor.clone(),
                    cell.runs.to_string(),
                    cell.successes.to_string(),
                    number(cell.coverage().share()),
                    number(interval.map(|(lower, _)| lower)),
                    number(interval.map(|(_, upper)| upper)),
                    number(cell.mean_replans().value()),
                ]);
            }
        }
        Table {
            caption: self.origin.title.clone(),
            headings: headings.map(str::to_owned).to_vec(),
            keys: 2,
            rows,
            notes: Vec::new(),
        }
    }

    /// Returns notes on the executions that the validator rejects, by row and column.
    pub fn invalid_notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        for (row, cells) in self.counts.rows.iter().zip(&self.counts.cells) {
            for (column, cell) in self.counts.columns.iter().zip(cells) {
                let Invalid { runs, first } = &cell.invalid;
                notes.extend(first.as_ref().map(|(id, what)| {
                    format!(
                        "bug: {runs} executions of `{row}` in {column} are not valid; the first is trial {} of \
                         problem {}: {what}",
                        id.trial, id.problem
                    )
                }));
            }
        }
        notes
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = notes(&self.counts.rows);
        notes.extend(self.invalid_notes());
        if !self.counts.optimum.is_empty() {
            notes.push(format!("`{}`: {}", optimum::ROW, optimum::SUMMARY));
        }
        notes.extend(initial_plans::notes(
            &self.counts.beginnings,
            &self.counts.rows,
            &self.counts.columns,
        ));
        for (name, column) in self.counts.columns.iter().zip(&self.counts.optimum) {
            let reason = column.unknown.as_ref();
            notes.extend(reason.map(|why| format!("unknown `{}` in {name}: {why}", optimum::ROW)));
        }
        notes
    }
}

/// Returns the registered summary of each row's executor, without duplicates.
fn notes(rows: &[String]) -> Vec<String> {
    let mut notes: Vec<String> = Vec::new();
    for row in rows {
        let note = match row.parse::<ExecutorSpec>() {
            Ok(spec) => format!("`{}`: {}", spec.registered.name, spec.registered.summary),
            Err(_) if row == CLAIRVOYANT => format!("`{row}`: {}", clairvoyant::SUMMARY),
            Err(_) => continue,
        };
        if !notes.contains(&note) {
            notes.push(note);
        }
    }
    notes
}

impl Counts for TimedCounts {
    const FORMAT: &'static str = "elbowroom-results";

    fn has_shape_of(&self, other: &Self) -> bool {
        (&self.rows, &self.columns) == (&other.rows, &other.columns)
    }

    fn check(&self) -> Result<(), ExperimentError> {
        let (height, width) = (self.rows.len(), self.columns.len());
        let cells: Vec<usize> = self.cells.iter().map(Vec::len).collect();
        let pairs: Vec<usize> = self.pairs.iter().map(Vec::len).collect();
        let is_for_all = self.optimum.is_empty() || self.optimum.len() == width;
        if cells != vec![width; height] || pairs != cells || !is_for_all {
            return Err(ExperimentError::other("rows and columns do not fit"));
        }
        Ok(())
    }

    fn add(&mut self, other: &Self) {
        initial_plans::merge(&mut self.beginnings, &other.beginnings);
        // Interrupted results may have no optimum.
        if self.optimum.is_empty() {
            self.optimum.clone_from(&other.optimum);
        } else {
            for (mine, theirs) in self.optimum.iter_mut().zip(&other.optimum) {
                mine.add(theirs);
            }
        }
        for (mine, theirs) in self
            .cells
            .iter_mut()
            .flatten()
            .zip(other.cells.iter().flatten())
        {
            mine.runs += theirs.runs;
            mine.successes += theirs.successes;
            mine.replans += theirs.replans;
            merge(&mut mine.verdicts, &theirs.verdicts);
            merge(&mut mine.causes, &theirs.causes);
            mine.failures.merge(&theirs.failures);
            mine.invalid.add(&theirs.invalid);
        }
        for (mine, theirs) in self
            .pairs
            .iter_mut()
            .flatten()
            .zip(other.pairs.iter().flatten())
        {
            mine.only_first += theirs.only_first;
            mine.only_this += theirs.only_this;
        }
    }
}

impl Cell {
    /// Counts a run.
    pub(super) fn count(&mut self, report: &Report, id: TrialId) {
        self.runs += 1;
        self.failures.count(report, id);
        *self
            .verdicts
            .entry(report.verdict.name().to_owned())
            .or_default() += 1;
        for reason in &report.reasons {
            let cause = reason.cause.name().to_owned();
            *self.causes.entry(cause).or_default() += 1;
        }
        if report.verdict == Verdict::GoalReached {
            self.successes += 1;
            self.replans += report.replans as u64;
        }
    }

    /// Returns the share of runs that reached the goal.
    pub(super) fn coverage(&self) -> Proportion {
        Proportion {
            successes: self.successes,
            count: self.runs,
        }
    }

    /// Returns the mean number of new plans of successful runs.
    pub(super) fn mean_replans(&self) -> Mean {
        Mean {
            sum: self.replans,
            count: self.successes,
        }
    }

    /// Returns [`Self::coverage`] and [`Self::mean_replans`] for the table.
    fn describe(&self) -> [String; 2] {
        let (coverage, replans) = (self.coverage(), self.mean_replans());
        let percent = |share: f64| format!("{:.1}", share * 100.0);
        let coverage = match (coverage.share(), coverage.wilson()) {
            (Some(share), Some((lower, upper))) => {
                format!(
                    "{} [{}, {}]",
                    percent(share),
                    percent(lower),
                    percent(upper)
                )
            }
            _ => "-".to_owned(),
        };
        let replans = replans
            .value()
            .map_or("-".to_owned(), |mean| format!("{mean:.2}"));
        [coverage, replans]
    }
}

impl Experiment {
    fn published_text(&self, row: &str, column: usize) -> String {
        let Some(published) = self.published.iter().find(|it| it.executor == row) else {
            return "-".to_owned();
        };
        let replans = published
            .replans
            .get(column)
            .filter(|mean| mean.is_finite());
        match (published.coverage.get(column), replans) {
            (Some(coverage), Some(replans)) => format!("{coverage:.1} ({replans:.1})"),
            (Some(coverage), None) => format!("{coverage:.1}"),
            (None, _) => "-".to_owned(),
        }
    }
}

fn merge(mine: &mut BTreeMap<String, u64>, theirs: &BTreeMap<String, u64>) {
    for (name, count) in theirs {
        *mine.entry(name.clone()).or_default() += count;
    }
}
