//! Text output of planning.

use std::fmt::Write as _;

use elbowroom::answers::plan::{PlanAnswer, PlanFinding, PlanStop, PlannerFailure};
use elbowroom::answers::plan::{PlanChoice, PlanObjective, PlanValue};
use elbowroom::external::Outcome;
use elbowroom::verify::no_plan::Kind;

use crate::args::EMBEDDED;
use crate::exit::Failure;
use crate::number;
use crate::terminal::{HINT, SECONDARY, TextLayout, styled};
use elbowroom::report::console::wrap;
use elbowroom_executive::messages::count_with_noun;

/// Renders the plan as text. If its metric differs from its makespan, a comment at the end states
/// the metric.
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

/// Describes the plan: makespan, metric, and whether better plans may exist.
pub(super) fn summary(answer: &PlanAnswer) -> Option<String> {
    let PlanFinding::Plan {
        makespan, metric, ..
    } = &answer.finding
    else {
        return None;
    };
    let mut text = format!("makespan {}", number::nearest(makespan));
    if let Some(metric) = metric.as_ref().filter(|metric| *metric != makespan) {
        let _ = write!(text, ", metric {}", number::nearest(metric));
    }
    if let Some(choice) = &answer.choice {
        let _ = write!(text, "; {}", choice_text(choice));
        return Some(styled(SECONDARY, &text));
    }
    let plans = count_with_noun(answer.plans, "plan");
    let better = match answer.stop {
        PlanStop::Exhausted => "the search found no better one",
        // Another planner may have been about to prove optimality when it was ended.
        PlanStop::FirstPlan if answer.planner != EMBEDDED => "not proved optimal",
        PlanStop::FirstPlan => "not proved optimal; --time-limit searches for better ones",
        _ => "not proved optimal",
    };
    let _ = write!(text, "; {plans} found, {better}");
    Some(styled(SECONDARY, &text))
}

/// Describes the certificate that no plan exists, or advises what to try if there is none.
pub(super) fn certificate_text(answer: &PlanAnswer, look: TextLayout) -> Option<String> {
    let line = match &answer.finding {
        PlanFinding::Plan { .. } => return None,
        PlanFinding::NoPlan { certificate, .. } => {
            let by = match certificate.kind() {
                Kind::Apart => "pairs of facts that are never true together",
                Kind::Closed => "a closed set of states",
                Kind::Reached => "the earliest times of all reachable facts",
            };
            format!("certified by {by}; --json prints the certificate")
        }
        PlanFinding::None { uncertified, .. } => {
            uncertified.as_ref()?;
            let other = if answer.planner == EMBEDDED {
                "another planner may find one: --planner, docs/reference/planners.md"
            } else {
                "another planner may find one: --planner embedded, docs/reference/planners.md"
            };
            other.to_owned()
        }
    };
    Some(styled(SECONDARY, &wrap(&line, look.width, 0)))
}

/// Describes the plan's objective value, compared with that of the shortest plan.
fn choice_text(choice: &PlanChoice) -> String {
    let PlanChoice {
        objective,
        value,
        shortest,
        shortest_makespan,
        made_for,
        compared,
    } = choice;
    let name = match objective {
        PlanObjective::Slack => "slack",
        PlanObjective::Probability => "works in",
    };
    let plans = count_with_noun(*compared, "plan");
    let mut text = format!("{name} {value}");
    if let PlanValue::Sampled { .. } = value {
        text.push_str(" samples of the world");
    }
    if let PlanValue::Unknown { why } = value {
        let _ = write!(text, " ({why})");
    }
    if made_for.is_empty() {
        let _ = write!(text, ", the shortest of {plans} compared");
    } else {
        let _ = write!(
            text,
            ", compared with {shortest} for the shortest plan (makespan {}); best of {plans} \
             compared, made {made_for}",
            number::nearest(&shortest_makespan.0)
        );
    }
    text
}

/// Reports that the times are not the planner's own.
pub(super) fn repair_text(planner: &str, objection: &str) -> String {
    format!(
        "{}: the plan of {planner} is not valid as it stands, perhaps because its times are \
         rounded\n  {objection}\n  {}: valid times close to these are used instead",
        styled(HINT, "warning"),
        styled(HINT, "note"),
    )
}

/// Converts the failure of a planner to one with advice.
pub(super) fn failure(failure: PlannerFailure) -> Failure {
    let in_words = failure.to_string();
    match failure.outcome {
        Outcome::Crashed { excerpt, .. } => {
            let help = "this is an error in that planner; try another one";
            with_excerpt(in_words, "its last output", &excerpt, help)
        }
        Outcome::NotUnderstood { excerpt, .. } => {
            let help = "if the output complains about the command line or the domain, see \
                        docs/reference/planners.md for the requirements of this planner";
            with_excerpt(in_words, "its last output", &excerpt, help)
        }
        Outcome::Refused { plan, .. } => {
            let help = "the planner's plan is invalid, so it is not printed as an answer; \
                        `elbowroom check` explains why";
            with_excerpt(in_words, "its plan", &plan, help)
        }
        Outcome::NotStarted { help, .. } => Failure::new(in_words, help),
        _ => Failure::new(in_words, "try another planner"),
    }
}

/// Maximum number of lines of an excerpt.
const MAX_LINES: usize = 12;

fn with_excerpt(message: String, title: &str, excerpt: &str, help: &str) -> Failure {
    let lines: Vec<&str> = excerpt.lines().collect();
    let shown = &lines[lines.len().saturating_sub(MAX_LINES)..];
    let mut text = message;
    if !shown.is_empty() {
        let _ = write!(text, "\n  {title}:");
    }
    for line in shown {
        let _ = write!(text, "\n    {line}");
    }
    Failure::new(text, help)
}
