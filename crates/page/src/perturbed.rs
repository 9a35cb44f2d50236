//! Pages of an experiment in worlds without time, and of one of its trials.

use elbowroom::report::statistics::Proportion;
use elbowroom_laboratory::perturbed::{StoredStep, StoredTrial, UntimedCounts};
use elbowroom_laboratory::results::Results;

use crate::document::{Document, RateGroup, Rates, Section, Table, Text, Tone, Verdict};
use crate::experiment::{
    INTERVALS, Trials, column_headings, document, experiment, mean, percent, rate, with_trials,
};
use crate::plan::serialized_name;

/// The page about an experiment in worlds without time.
pub(crate) fn untimed_experiment(results: &Results<UntimedCounts>, trials: Trials) -> Document {
    let Results {
        origin,
        counts: results,
    } = results;
    let mut groups: Vec<RateGroup> = Vec::new();
    let mut rows: Vec<Vec<Text>> = Vec::new();
    for row in &results.rows {
        let name = format!("{}, {}", row.case, serialized_name(&row.world));
        let published = row.published.and_then(Proportion::share);
        let rate = rate(
            serialized_name(&row.executor),
            row.success,
            published.or(row.optimum),
        );
        rows.push(vec![
            row.case.as_str().into(),
            serialized_name(&row.world).into(),
            rate.name.as_str().into(),
            rate.words.as_str().into(),
            row.published
                .and_then(Proportion::share)
                .map(percent)
                .unwrap_or_default()
                .into(),
            row.optimum.map(percent).unwrap_or_default().into(),
            mean(row.replans).into(),
        ]);
        match groups.last_mut().filter(|group| group.name == name) {
            Some(group) => group.rates.push(rate),
            None => groups.push(RateGroup {
                name,
                rates: vec![rate],
            }),
        }
    }
    let columns = [
        ("case", false),
        ("world", false),
        ("executor", false),
        ("success", true),
        ("published", true),
        ("optimum", true),
        ("new plans", true),
    ];
    let mut sections = vec![
        Section::Rates(Rates {
            heading: "Trials that succeeded".to_owned(),
            note: format!(
                "{INTERVALS} The line marks the published share or, without one, the greatest \
                 possible share, if known."
            ),
            groups,
        }),
        Section::Table(Table {
            heading: "All rows".to_owned(),
            columns: column_headings(&columns),
            rows,
            ..Table::default()
        }),
    ];
    let (failures, more) = failures(results, trials);
    sections.extend(failures);
    let trials = results.rows.iter().map(|row| row.success.count);
    let trials = format!("{} trials", trials.sum::<u64>());
    Document {
        more,
        ..experiment(origin, &trials, sections)
    }
}

/// Returns the table of the kinds of failure, linked to example trials, and the pages of these
/// trials.
fn failures(results: &UntimedCounts, trials: Trials) -> (Option<Section>, Vec<Document>) {
    let columns = [
        ("case", false),
        ("world", false),
        ("executor", false),
        ("reason", false),
        ("last step", false),
        ("outcome", false),
        ("trials", true),
        ("first", true),
    ];
    let mut kinds = Vec::new();
    for (place, row) in results.rows.iter().enumerate() {
        for (kind, failure) in row.failures.kinds().into_iter().enumerate() {
            let last = failure.cause.as_deref().map_or("none", last_step_result);
            let cells = vec![
                row.case.as_str().into(),
                serialized_name(&row.world).into(),
                serialized_name(&row.executor).into(),
                ending(&failure.verdict).into(),
                failure.action.clone().unwrap_or_default().into(),
                last.into(),
                failure.runs.to_string().into(),
                failure.first.trial.to_string().into(),
            ];
            kinds.push(((place, 0, kind), cells));
        }
    }
    let table = Table {
        heading: "Where trials fail".to_owned(),
        note: "Failed trials, by the reason for their end and by their last step.".to_owned(),
        columns: column_headings(&columns),
        ..Table::default()
    };
    with_trials(table, kinds, trials)
}

/// The page about a trial.
pub(crate) fn trial_page(course: &StoredTrial) -> Document {
    let facts = [
        ("experiment", course.title.clone()),
        ("case", course.case.clone()),
        ("world", serialized_name(&course.world)),
        ("executor", serialized_name(&course.executor)),
        ("trial", course.trial.to_string()),
        ("seed", course.seed.to_string()),
    ];
    let is_success = course.ended == "goal-reached";
    let mut steps: Vec<Vec<Text>> = Vec::new();
    let mut plans: Vec<Vec<Text>> = Vec::new();
    for (round, plan) in (1..).zip(&course.plans) {
        plans.push(vec![
            round.to_string().into(),
            plan.actions.join(", ").into(),
        ]);
        for step in &plan.steps {
            steps.push(vec![
                (steps.len() + 1).to_string().into(),
                round.to_string().into(),
                step.action.as_str().into(),
                step_result(step).into(),
                step.became_true.join(", ").into(),
                step.became_false.join(", ").into(),
            ]);
        }
    }
    let columns = [
        ("step", true),
        ("plan", true),
        ("action", false),
        ("outcome", false),
        ("became true", false),
        ("became false", false),
    ];
    let tables = [
        Table {
            heading: "Step by step".to_owned(),
            note: "Executed actions and the facts they changed; some facts may have changed by themselves."
                .to_owned(),
            columns: column_headings(&columns),
            rows: steps,
            ..Table::default()
        },
        Table {
            heading: "Plans".to_owned(),
            note: "A new plan is made when the previous one has become infeasible.".to_owned(),
            columns: column_headings(&[("plan", true), ("actions", false)]),
            rows: plans,
            ..Table::default()
        },
    ];
    let title = format!(
        "Trial {} of {}, {}",
        course.trial,
        course.case,
        serialized_name(&course.executor)
    );
    let facts = facts.map(|(name, value)| (name.to_owned(), value));
    let sections = tables.map(Section::Table);
    let page = document(&title, String::new(), facts.to_vec(), sections.to_vec());
    let words = format!("{}.", ending(&course.ended));
    Document {
        verdict: Verdict {
            tone: if is_success { Tone::Good } else { Tone::Bad },
            words: capital(&words),
        },
        ..page
    }
}

/// Describes the end of a trial.
fn ending(name: &str) -> &str {
    match name {
        "goal-reached" => "the goal was reached",
        "no-plan" => "there was no further plan",
        "rounds-used-up" => "no plan reached the goal",
        "dead-end" => "too many steps ended in states without a plan",
        "steps-used-up" => "the trial took too many steps",
        other => other,
    }
}

/// Describes the outcome of the last step.
fn last_step_result(cause: &str) -> &str {
    match cause {
        "after-start" => "it started",
        "start-failed" => "its start failed",
        "after-end" => "it ended",
        "end-failed" => "its end failed",
        other => other,
    }
}

fn step_result(step: &StoredStep) -> String {
    let words = match step.step.as_str() {
        "started" => "it started",
        "not-started" => "its start failed",
        "ended" => "it ended",
        "failed" => "its end failed",
        other => other,
    };
    if step.is_dead_end {
        format!("{words}, and there was no further plan")
    } else {
        words.to_owned()
    }
}

fn capital(words: &str) -> String {
    let mut letters = words.chars();
    let first = letters.next().map(|first| first.to_uppercase().to_string());
    first.unwrap_or_default() + letters.as_str()
}
