//! Explanation of why a plan does not work, with example values and a schedule.

use std::fmt::Write as _;

use elbowroom::model::Task;
use elbowroom::plan::ParametrizedPlan;
use elbowroom::{Explanation, Shortfall, pddl};

use crate::number;
use crate::terminal::{EMPHASIS, TextLayout, styled};
use elbowroom::report::console::push_wrapped;

/// Describes the reason, and the amount of the violation.
pub(super) fn reason_text(explanation: &Explanation) -> String {
    let reason = &explanation.reason;
    // If a schedule is shown, the amount is stated there, for that schedule.
    let is_said = explanation.verdict.is_some();
    match &explanation.shortfall {
        Some(Shortfall::Unbounded) => {
            format!("{reason}, but nothing in the plan ensures it")
        }
        Some(Shortfall::Time(late)) if !is_said => {
            format!("{reason}: too late by {}", number::nearest(late))
        }
        Some(Shortfall::Amount(short)) if !is_said => {
            format!("{reason}: short by {}", number::nearest(short))
        }
        _ => reason.clone(),
    }
}

/// Renders values and a schedule that violate the reason.
pub(super) fn example(
    task: &Task,
    plan: &ParametrizedPlan,
    explanation: &Explanation,
    look: TextLayout,
) -> String {
    let mut text = String::new();
    let values: Vec<String> = plan
        .parameters
        .iter()
        .zip(&explanation.valuation)
        .map(|(parameter, value)| format!("{} = {}", parameter.name, number::nearest(value)))
        .collect();
    if !values.is_empty() {
        let _ = write!(text, "\n{}\n", styled(EMPHASIS, "Example values"));
        push_wrapped(&mut text, &values.join(", "), 2, look.width);
    }
    let Some(schedule) = &explanation.schedule else {
        return text;
    };
    let fixed = plan.plan.at(&explanation.valuation).scheduled(schedule);
    let _ = write!(text, "\n{}\n", styled(EMPHASIS, "Schedule"));
    for line in pddl::write_plan(task, &fixed).lines() {
        let _ = writeln!(text, "  {line}");
    }
    if let Some(verdict) = &explanation.verdict {
        let _ = write!(text, "\n{}\n", styled(EMPHASIS, "Result"));
        push_wrapped(&mut text, verdict, 2, look.width);
    }
    text
}
