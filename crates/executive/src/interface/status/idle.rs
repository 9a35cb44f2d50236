//! The reason for which an executive is idle, in words.

use elbowroom::execution::run::Verdict;
use elbowroom::execution::{Cause, Reason, UnreachedGoal};

use super::goals::joined;

/// Returns the reason for which an executive has stopped without reaching these goals.
pub(super) fn unreached(
    verdict: &Verdict,
    goals: &str,
    dead_end: &[Reason],
    unreached: &[UnreachedGoal],
) -> String {
    let words = verdict_text(verdict);
    match details(verdict, dead_end, unreached) {
        Some(why) => format!("{words}: {goals}: {why}"),
        None => format!("{words}: {goals}"),
    }
}

/// Returns the reasons as far as they are known. Of several goals, each is named with its own ones.
fn details(verdict: &Verdict, dead_end: &[Reason], unreached: &[UnreachedGoal]) -> Option<String> {
    if unreached.len() < 2 {
        let why = verdict.why().map(str::to_owned).into_iter();
        let all: Vec<String> = why.chain(joined(dead_end)).collect();
        return (!all.is_empty()).then(|| all.join("; "));
    }
    let words = unreached.iter().filter_map(|goal| {
        let why = joined(&goal.reasons)?;
        let is_named = goal.reasons.iter().all(|it| it.cause == Cause::TooLate);
        Some(if is_named {
            why
        } else {
            format!("`{}`: {why}", goal.name)
        })
    });
    Some(words.collect::<Vec<_>>().join("; "))
}

fn verdict_text(verdict: &Verdict) -> &'static str {
    match verdict {
        Verdict::Unsolvable => "no plan reaches the goals from here",
        Verdict::NoPlan { .. } => "no plan was found",
        Verdict::PlannerFailed { .. } => "the planner failed",
        Verdict::ReplanLimit => "too many plans were abandoned",
        other => other.name(),
    }
}
