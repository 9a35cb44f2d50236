//! An experiment on a clock: rates with intervals, paired comparisons, and how trials fail.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom::report::statistics::{Mean, Proportion, mcnemar};
use elbowroom_laboratory::answer::FailurePosition;
use elbowroom_laboratory::compare::{Cell, TimedCounts};
use elbowroom_laboratory::results::{Origin, Results};

use crate::document::{Document, Rate, RateGroup, Rates, Section, Table, Text, Tone, Verdict};

/// The meaning of the intervals.
pub(crate) const INTERVALS: &str =
    "Share of runs that reached the goal, with Wilson's 95 % interval.";

/// The pages of some failed trials, by row, column and kind of failure.
pub(crate) type Trials = BTreeMap<FailurePosition, Document>;

/// The page about an experiment on a clock.
pub(crate) fn timed(results: &Results<TimedCounts>, trials: Trials) -> Document {
    let Results {
        origin,
        counts: results,
    } = results;
    let mut sections = vec![Section::Rates(Rates {
        heading: "Runs that reached the goal".to_owned(),
        note: if results.optimum.is_empty() {
            INTERVALS.to_owned()
        } else {
            format!("{INTERVALS} The line marks an upper bound for all executors.")
        },
        groups: (0..results.columns.len())
            .map(|column| group(results, column))
            .collect(),
    })];
    if results.rows.len() > 1 {
        sections.push(Section::Table(pairs(results)));
    }
    let verdicts = |cell: &Cell| cell.verdicts.clone();
    sections.push(Section::Table(counts(results, "How runs ended", &verdicts)));
    let causes = |cell: &Cell| cell.causes.clone();
    let mut causes = counts(results, "Why plans were abandoned", &causes);
    "The number of plans, by cause. One run may abandon several.".clone_into(&mut causes.note);
    sections.push(Section::Table(causes));
    let (failures, more) = failures(results, trials);
    sections.extend(failures);
    let cells = results.cells.iter().flatten();
    let runs = cells.map(|cell| cell.runs).sum::<u64>();
    Document {
        more,
        ..experiment(origin, &format!("{runs} runs"), sections)
    }
}

/// Returns the table of the kinds of failure, linked to example trials, and the pages of these
/// trials.
fn failures(results: &TimedCounts, trials: Trials) -> (Option<Section>, Vec<Document>) {
    let columns = [
        ("world", false),
        ("executor", false),
        ("ended with", false),
        ("because", false),
        ("action", false),
        ("runs", true),
        ("first trial", false),
    ];
    let mut kinds = Vec::new();
    for (column, world) in results.columns.iter().enumerate() {
        for (row, (name, cells)) in results.rows.iter().zip(&results.cells).enumerate() {
            for (kind, failure) in cells[column].failures.kinds().into_iter().enumerate() {
                let words = |text: &Option<String>| text.clone().unwrap_or_default();
                let first = failure.first;
                let trial = match first.problem {
                    0 => first.trial.to_string(),
                    problem => format!("{} of problem {problem}", first.trial),
                };
                let cells = vec![
                    world.as_str().into(),
                    name.as_str().into(),
                    failure.verdict.replace('-', " ").into(),
                    words(&failure.cause).replace('-', " ").into(),
                    words(&failure.action).into(),
                    failure.runs.to_string().into(),
                    trial.into(),
                ];
                kinds.push(((row, column, kind), cells));
            }
        }
    }
    let table = Table {
        heading: "Where runs fail".to_owned(),
        note: "Failed runs, by the reason for which the last plan was abandoned and the action \
               concerned."
            .to_owned(),
        columns: column_headings(&columns),
        ..Table::default()
    };
    with_trials(table, kinds, trials)
}

/// Adds the kinds of failure to `table` and links each row to its example trial, if there is one.
/// Returns the section, or `None` without failures, and the linked pages.
pub(crate) fn with_trials(
    mut table: Table,
    kinds: Vec<(FailurePosition, Vec<Text>)>,
    mut trials: Trials,
) -> (Option<Section>, Vec<Document>) {
    let mut more = Vec::new();
    let mut opens = Vec::with_capacity(kinds.len());
    for (place, cells) in kinds {
        table.rows.push(cells);
        opens.push(trials.remove(&place).map(|page| {
            more.push(page);
            more.len() - 1
        }));
    }
    if !more.is_empty() {
        table.opens = opens;
        table
            .note
            .push_str(" The button of a row shows the first such trial.");
    }
    let section = (!table.rows.is_empty()).then_some(Section::Table(table));
    (section, more)
}

/// Converts columns: heading, and `true` if the column holds numbers.
pub(crate) fn column_headings(columns: &[(&str, bool)]) -> Vec<(String, bool)> {
    let named = columns.iter();
    named
        .map(|(name, is_number)| ((*name).to_owned(), *is_number))
        .collect()
}

pub(crate) fn document(
    title: &str,
    made: String,
    facts: Vec<(String, String)>,
    sections: Vec<Section>,
) -> Document {
    Document {
        title: title.to_owned(),
        verdict: Verdict {
            tone: Tone::Plain,
            words: made,
        },
        facts,
        sections,
        texts: Vec::new(),
        is_paused: false,
        more: Vec::new(),
    }
}

/// Builds the page of an experiment; `count` states its number of trials.
pub(crate) fn experiment(origin: &Origin, count: &str, sections: Vec<Section>) -> Document {
    let end = if origin.is_interrupted {
        "; the experiment was interrupted before it was complete"
    } else {
        ""
    };
    let mut facts = vec![
        ("trials of each".to_owned(), origin.trials.to_string()),
        ("fingerprint".to_owned(), origin.fingerprint.clone()),
    ];
    if origin.shards > 1 {
        let parts: Vec<String> = origin.parts.iter().map(u64::to_string).collect();
        let parts = format!("{} of {}", parts.join(", "), origin.shards);
        facts.push(("parts".to_owned(), parts));
    }
    document(&origin.title, format!("{count}{end}."), facts, sections)
}

/// The executors in one column.
fn group(results: &TimedCounts, column: usize) -> RateGroup {
    let best = results.optimum.get(column).filter(|best| best.is_known());
    let best = best.map(|best| best.upper);
    let rows = results.rows.iter().zip(&results.cells);
    RateGroup {
        name: results.columns[column].clone(),
        rates: rows
            .map(|(row, cells)| {
                let cell = &cells[column];
                let success = Proportion {
                    successes: cell.successes,
                    count: cell.runs,
                };
                let replans = Mean {
                    sum: cell.replans,
                    count: cell.successes,
                };
                let mut rate = rate(row.clone(), success, best);
                rate.words = format!("{}; new plans in these: {}", rate.words, mean(replans));
                rate
            })
            .collect(),
    }
}

pub(crate) fn rate(name: String, success: Proportion, mark: Option<f64>) -> Rate {
    let share = success.share().zip(success.wilson());
    Rate {
        name,
        share: share.map(|(share, (lower, upper))| (share, lower, upper)),
        mark,
        words: match share {
            Some((share, (lower, upper))) => format!(
                "{} [{}, {}], {} of {}",
                percent(share),
                percent(lower),
                percent(upper),
                success.successes,
                success.count
            ),
            None => "no runs".to_owned(),
        },
    }
}

pub(crate) fn percent(share: f64) -> String {
    format!("{:.1} %", share * 100.0)
}

pub(crate) fn mean(mean: Mean) -> String {
    mean.value()
        .map_or_else(|| "-".to_owned(), |mean| format!("{mean:.2}"))
}

/// Compares each executor with the first one, in the same worlds.
fn pairs(results: &TimedCounts) -> Table {
    let first = results.rows.first().cloned().unwrap_or_default();
    let columns = [
        ("world".to_owned(), false),
        ("executor".to_owned(), false),
        (format!("only {first} reached the goal"), true),
        ("only this one reached it".to_owned(), true),
        ("p".to_owned(), true),
    ];
    let mut rows: Vec<Vec<Text>> = Vec::new();
    for (column, world) in results.columns.iter().enumerate() {
        for (row, pairs) in results.rows.iter().zip(&results.pairs).skip(1) {
            let pair = pairs[column];
            let p = mcnemar(pair.only_first, pair.only_this);
            rows.push(vec![
                world.as_str().into(),
                row.as_str().into(),
                pair.only_first.to_string().into(),
                pair.only_this.to_string().into(),
                if p < 0.0001 {
                    "< 0.0001".into()
                } else {
                    format!("{p:.4}").into()
                },
            ]);
        }
    }
    Table {
        heading: format!("Compared with {first}, trial by trial"),
        note:
            "All executors run in the same worlds. p is the p-value of McNemar's exact test: the \
               probability of a difference at least this large if both executors were equally \
               good. It is not corrected for multiple comparisons."
                .to_owned(),
        columns: columns.to_vec(),
        rows,
        ..Table::default()
    }
}

/// Builds a table of counts with a column for each name.
fn counts(
    results: &TimedCounts,
    heading: &str,
    counts: &dyn Fn(&Cell) -> BTreeMap<String, u64>,
) -> Table {
    let names: BTreeSet<String> = results
        .cells
        .iter()
        .flatten()
        .flat_map(|cell| counts(cell).into_keys())
        .collect();
    let mut columns = vec![("world".to_owned(), false), ("executor".to_owned(), false)];
    columns.extend(names.iter().map(|name| (name.replace('-', " "), true)));
    let mut rows: Vec<Vec<Text>> = Vec::new();
    for (column, world) in results.columns.iter().enumerate() {
        for (row, cells) in results.rows.iter().zip(&results.cells) {
            let counted = counts(&cells[column]);
            let mut cells: Vec<Text> = vec![world.as_str().into(), row.as_str().into()];
            for name in &names {
                let count = counted.get(name).copied().unwrap_or_default();
                cells.push(count.to_string().into());
            }
            rows.push(cells);
        }
    }
    Table {
        heading: heading.to_owned(),
        columns,
        rows,
        ..Table::default()
    }
}
