//! What came of it, for people.

use std::fmt::Write as _;

use elbowroom::answers::plan::{PlanFinding, PlannerFailure};
use elbowroom::planner::external::Outcome;

use crate::exit::Failure;
use crate::look::{HINT, styled};
use crate::number;

/// The plan as text, with a last line, a comment, that says what it is worth where that is not
/// simply when it ends.
pub(super) fn plan(finding: &PlanFinding) -> Option<String> {
    let PlanFinding::Plan {
        plan,
        makespan,
        metric,
        ..
    } = finding
    else {
        return None;
    };
    let mut text = plan.clone();
    if let Some(metric) = metric.as_ref().filter(|metric| *metric != makespan) {
        let _ = writeln!(text, "; metric {}", number::nearest(metric));
    }
    Some(text)
}

/// The times are not the planner's own.
pub(super) fn repaired(planner: &str, objection: &str) -> String {
    format!(
        "{}: the plan of {planner} is not valid as it stands, perhaps because its times are \
         rounded\n  {objection}\n  {}: times close to these, which are valid, are taken instead",
        styled(HINT, "warning"),
        styled(HINT, "note"),
    )
}

/// What is wrong with a planner, and what to do about it.
pub(super) fn failure(failure: PlannerFailure) -> Failure {
    let in_words = failure.to_string();
    match failure.outcome {
        Outcome::Crashed { excerpt, .. } => {
            let help = "this is a fault of that planner; try another one";
            with_excerpt(in_words, "what it printed last", &excerpt, help)
        }
        Outcome::NotUnderstood { excerpt, .. } => {
            let help = "if this is a complaint about the command line or the domain, see \
                        docs/planners.md for what this planner wants";
            with_excerpt(in_words, "what it printed last", &excerpt, help)
        }
        Outcome::Refused { plan, .. } => {
            let help = "this plan is the planner's, and is not printed as an answer; \
                        `elbowroom check` says more about it";
            with_excerpt(in_words, "its plan", &plan, help)
        }
        Outcome::NotStarted { help, .. } => Failure::new(in_words, help),
        _ => Failure::new(in_words, "try another planner"),
    }
}

/// Excerpts longer than this hide what they are shown for.
const MOST_LINES: usize = 12;

fn with_excerpt(message: String, title: &str, excerpt: &str, help: &str) -> Failure {
    let lines: Vec<&str> = excerpt.lines().collect();
    let shown = &lines[lines.len().saturating_sub(MOST_LINES)..];
    let mut text = message;
    if !shown.is_empty() {
        let _ = write!(text, "\n  {title}:");
    }
    for line in shown {
        let _ = write!(text, "\n    {line}");
    }
    Failure::new(text, help)
}
