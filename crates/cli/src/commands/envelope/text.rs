//! An envelope as people read it.

use std::fmt::Write as _;

use elbowroom::plan::{ParameterId, ParameterKind, Valuation};

use super::Subject;
use super::search::Outcome;
use super::watch::Stop;
use crate::limits::{self, Limit, push_paragraph};
use crate::look::{FAINT, Look, STRONG, styled};
use crate::table::{self, Row};
use crate::{number, output};

/// The table, what it means, what limits it, and how it was found.
pub(super) fn envelope(subject: &Subject<'_>, outcome: &Outcome, look: Look) -> String {
    let rows: Vec<Row> = subject
        .plan
        .parameters
        .iter()
        .enumerate()
        .map(|(index, parameter)| Row {
            name: parameter.name.clone(),
            quantity: quantity(subject, ParameterId::from(index)),
            nominal: parameter.nominal.clone(),
            interval: outcome.envelope.intervals[index].clone(),
        })
        .collect();
    let mut text = title(subject);
    text.push('\n');
    if rows.is_empty() {
        text.push_str(" Nothing in this plan is left open. It works as it is.\n");
        return text;
    }
    text.push_str(&table::render(&rows, look));
    text.push('\n');
    push_paragraph(&mut text, meaning(&rows), look.width);
    text.push('\n');
    let limits = limits::render(&limits_of(subject, outcome), look);
    if !limits.is_empty() {
        text.push_str(&limits);
        text.push('\n');
    }
    if let Some(makespan) = makespan(subject, outcome) {
        push_paragraph(&mut text, &makespan, look.width);
    }
    let mut how = String::new();
    push_paragraph(&mut how, &course(subject, outcome), look.width);
    text.push_str(&styled(FAINT, how.trim_end()));
    text.push('\n');
    text
}

fn title(subject: &Subject<'_>) -> String {
    let title = format!("Elbow room of {}", subject.file());
    format!("{}\n", styled(STRONG, &title))
}

/// A parameter in plain words; the duration of an action goes without saying.
fn quantity(subject: &Subject<'_>, id: ParameterId) -> String {
    match subject.plan.parameter(id).kind {
        ParameterKind::Duration(instance) => {
            subject.plan.plan.instance(instance).action.name.clone()
        }
        _ => subject.explainer.quantity(id),
    }
}

fn meaning(rows: &[Row]) -> &'static str {
    if rows.len() == 1 {
        "The plan works for any value in the interval."
    } else {
        "The plan works as long as each of these stays inside its interval, whatever the others do \
         in theirs."
    }
}

fn limits_of(subject: &Subject<'_>, outcome: &Outcome) -> Vec<Limit> {
    let parameters = subject.plan.parameters.iter().zip(&outcome.limits);
    parameters
        .flat_map(|(parameter, [lower, upper])| {
            [(false, lower), (true, upper)].map(|(is_upper, reason)| {
                reason.as_ref().map(|reason| Limit {
                    parameter: parameter.name.clone(),
                    is_upper,
                    reason: reason.clone(),
                })
            })
        })
        .flatten()
        .collect()
}

/// When the plan is done, with everything started as early as possible.
fn makespan(subject: &Subject<'_>, outcome: &Outcome) -> Option<String> {
    let end = |values: Option<Valuation>| {
        values.and_then(|values| elbowroom::earliest_end(subject.plan, &values))
    };
    let intervals = &outcome.envelope.intervals;
    let at_least: Option<Valuation> = intervals.iter().map(|i| i.lower.value().cloned()).collect();
    let at_most: Option<Valuation> = intervals.iter().map(|i| i.upper.value().cloned()).collect();
    let nominal = end(Some(subject.plan.nominal()))?;
    let mut line = format!("Done at {} as planned", number::nearest(&nominal));
    if let Some(shortest) = end(at_least) {
        let _ = write!(
            line,
            ", at {} with all at their lower ends",
            number::nearest(&shortest)
        );
    }
    if let Some(longest) = end(at_most) {
        let _ = write!(
            line,
            ", at {} with all at their upper ends",
            number::nearest(&longest)
        );
    }
    line.push_str(", if started as early as possible.");
    Some(line)
}

/// How the search went, in one line.
fn course(subject: &Subject<'_>, outcome: &Outcome) -> String {
    let ended = match outcome.stop {
        Stop::Converged if subject.arguments.sharpen => "Each end touches its limit".to_owned(),
        Stop::Converged => format!(
            "Steps below {} were not tried (--sharpen moves each end onto its limit)",
            number::nearest(&subject.arguments.precision)
        ),
        Stop::CheckLimit | Stop::TimeLimit => {
            "The time limit came before the search was done; the intervals could be wider"
                .to_owned()
        }
        Stop::Undecided => {
            "Some wider boxes have too many cases to tell apart; the intervals could be wider"
                .to_owned()
        }
        Stop::Cancelled => {
            "Interrupted before the search was done; the intervals could be wider".to_owned()
        }
    };
    format!(
        "{ended}. {}, {}, {}.",
        output::counted(outcome.checks, "check"),
        output::counted(outcome.widenings.len(), "widening"),
        duration(outcome.seconds)
    )
}

fn duration(seconds: f64) -> String {
    if seconds < 1.0 {
        format!("{:.1} ms", seconds * 1000.0)
    } else {
        format!("{seconds:.1} s")
    }
}
