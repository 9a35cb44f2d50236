//! What came of it, for people and for programs.

use std::fmt::Write as _;
use std::time::Duration;

use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::pddl::write_plan;
use serde_json::{Value, json};

use crate::args::PlanArgs;
use crate::exit::{Answer, Exit};
use crate::look::{HINT, styled};
use crate::{json, number, output};

/// An answer, and how it was found.
pub(super) struct Conclusion {
    /// Who planned.
    pub(super) planner: String,
    pub(super) answer: Found,
    /// From the start of the search.
    pub(super) elapsed: Duration,
    /// When the first plan was there.
    pub(super) first_plan: Option<Duration>,
    /// How many plans were found, each better than the one before as far as the planner knows.
    pub(super) plans: usize,
    /// Why it ended: `"time limit"`, `"cancelled"`, ….
    pub(super) stop: &'static str,
    /// What else this planner counts.
    pub(super) statistics: Value,
}

/// What was found. Failures of planners are [`Failure`](crate::exit::Failure)s.
pub(super) enum Found {
    Plan {
        plan: TimeTriggeredPlan,
        makespan: Rational,
        /// The value of the problem's metric, if it has one.
        metric: Option<Rational>,
        /// What the judge had to object to in the planner's own times, if they were repaired.
        repaired: Option<String>,
    },
    /// There is no plan, and why; or who says so.
    NoPlan { reason: String },
    /// Nothing is known, and why.
    Nothing { reason: String },
}

/// Prints an answer.
pub(super) fn print(task: &Task, arguments: &PlanArgs, conclusion: &Conclusion) -> Answer {
    let exit = match &conclusion.answer {
        Found::Plan { .. } => Exit::Yes,
        Found::NoPlan { .. } => Exit::No,
        Found::Nothing { .. } => Exit::Limit,
    };
    if let Found::Plan { repaired, .. } = &conclusion.answer
        && let Some(objection) = repaired
    {
        output::tell(&format!(
            "{}: the plan of {} is not valid as it stands, perhaps because its times are \
             rounded\n  {objection}\n  {}: times close to these, which are valid, are taken \
             instead",
            styled(HINT, "warning"),
            conclusion.planner,
            styled(HINT, "note"),
        ));
    }
    if let (Some(text), Some(path)) = (text(task, &conclusion.answer), &arguments.output) {
        output::write_file(path, &text)?;
    }
    if arguments.json {
        output::print_json(&document(task, conclusion))?;
        return Ok(exit);
    }
    match &conclusion.answer {
        Found::Plan { .. } => {
            if let (Some(text), None) = (text(task, &conclusion.answer), &arguments.output) {
                output::print(&text)?;
            }
        }
        Found::NoPlan { reason } | Found::Nothing { reason } => {
            output::print(&format!("{reason}\n"))?;
        }
    }
    Ok(exit)
}

/// The plan as text, with a last line, a comment, that says what it is worth where that is not
/// simply when it ends.
fn text(task: &Task, answer: &Found) -> Option<String> {
    let Found::Plan {
        plan,
        makespan,
        metric,
        ..
    } = answer
    else {
        return None;
    };
    let mut text = write_plan(task, plan);
    if let Some(metric) = metric.as_ref().filter(|metric| *metric != makespan) {
        let _ = writeln!(text, "; metric {}", number::nearest(metric));
    }
    Some(text)
}

/// See `docs/formats/plan-json.md`.
fn document(task: &Task, conclusion: &Conclusion) -> Value {
    let mut document = json!({
        "format": "elbowroom-plan",
        "version": 1,
        "domain": task.problem().domain,
        "problem": task.problem().name,
        "planner": conclusion.planner,
    });
    match &conclusion.answer {
        Found::Plan {
            plan,
            makespan,
            metric,
            repaired,
        } => {
            document["answer"] = json!("plan");
            document["makespan"] = json::number(makespan);
            document["metric"] = json!(metric.as_ref().map(json::number));
            document["repaired"] = json!(repaired);
            document["steps"] = steps(plan);
            document["plan"] = json!(write_plan(task, plan));
        }
        Found::NoPlan { reason } => {
            document["answer"] = json!("no plan");
            document["reason"] = json!(reason);
        }
        Found::Nothing { reason } => {
            document["answer"] = json!("none");
            document["reason"] = json!(reason);
        }
    }
    document["stop"] = json!(conclusion.stop);
    document["plans"] = json!(conclusion.plans);
    document["seconds"] = json!(conclusion.elapsed.as_secs_f64());
    document["first_plan_seconds"] = json!(conclusion.first_plan.map(|d| d.as_secs_f64()));
    document["statistics"] = conclusion.statistics.clone();
    document
}

fn steps(plan: &TimeTriggeredPlan) -> Value {
    let mut steps: Vec<_> = plan.steps.iter().collect();
    steps.sort_by(|a, b| a.start.cmp(&b.start));
    let steps = steps.into_iter().map(|step| {
        json!({
            "start": json::number(&step.start),
            "action": step.action.name,
            "duration": step.duration.as_ref().map(json::number),
        })
    });
    steps.collect()
}
