//! Result of a run, as text and as JSON.

use std::fmt::Write as _;

use elbowroom::answers::run::RunAnswer;
use elbowroom::execution::Ending;
use elbowroom::execution::run::{Report, Verdict};

use crate::number::nearest;
use crate::terminal::{EMPHASIS, ERROR, HINT, SUCCESS, stdout_layout, styled};
use elbowroom::report::console::wrap;
use elbowroom_executive::messages::{count_with_noun, escape_control};

/// Circumstances of the end of a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct RunEnd {
    /// `true` if the run ended because its journal cannot be written.
    pub(super) has_lost_journal: bool,
    /// `true` if the run continues after its goals are reached. New plans are then counted from
    /// that time.
    pub(super) is_persistent: bool,
}

pub(super) fn render(answer: &RunAnswer, report: &Report, ends: RunEnd) -> String {
    let mut replans = count_with_noun(report.replans, "new plan");
    if ends.is_persistent {
        replans.push_str(" since it was last idle");
    }
    let time = nearest(&report.time);
    let width = stdout_layout().width;
    let mut text = match &report.verdict {
        Verdict::GoalReached => {
            format!(
                "{}: goal reached at {time}, with {replans}\n",
                styled(SUCCESS, "done")
            )
        }
        Verdict::Unsolvable => format!(
            "{}: unsolvable from here, at {time}, after {replans}\n",
            styled(ERROR, "failed")
        ),
        Verdict::NoPlan { why, missing } => {
            let why = wrap(&escape_control(why), width, 2);
            match missing.advice() {
                Some(advice) => format!(
                    "{}: no plan found from here, at {time}, after {replans}:\n{why}\n{}\n",
                    styled(HINT, "limit"),
                    wrap(advice, width, 2)
                ),
                None => format!(
                    "{}: no plan to continue with at {time}:\n{why}\n",
                    styled(ERROR, "failed")
                ),
            }
        }
        Verdict::ReplanLimit => format!(
            "{}: stopped at {time}, after {replans}; --max-replans allows no more until an action is completed\n",
            styled(HINT, "limit")
        ),
        Verdict::TimeLimit => {
            format!(
                "{}: time limit reached at {time}, after {replans}\n",
                styled(HINT, "limit")
            )
        }
        Verdict::Interrupted if ends.has_lost_journal => {
            format!(
                "{}: the journal cannot be written, so the run was ended at {time}, after {replans}\n",
                styled(ERROR, "failed")
            )
        }
        Verdict::Interrupted => {
            format!(
                "{}: stopped on request at {time}, after {replans}\n",
                styled(HINT, "interrupted")
            )
        }
        Verdict::PlannerFailed { .. } => format!(
            "{}: the planner failed at {time}, after {replans}\n",
            styled(ERROR, "failed")
        ),
        // The command's final message states the reason, so it is not repeated here.
        Verdict::WorldFailed { .. } => format!(
            "{}: the world failed at {time}, after {replans}\n",
            styled(ERROR, "failed")
        ),
    };
    if let Some(choice) = &answer.first_plan {
        let words = wrap(&escape_control(choice), width, 2);
        let _ = writeln!(text, "\n{}\n{words}", styled(EMPHASIS, "The first plan"));
    }
    if let Some(why) = &answer.no_table {
        let what = format!(
            "{}; moves are evaluated with samples of the world instead",
            escape_control(why)
        );
        let words = wrap(&what, width, 2);
        let _ = writeln!(text, "\n{}\n{words}", styled(EMPHASIS, "No table of moves"));
    }
    for (heading, reasons) in [
        ("Why no plan reaches the goal", &report.dead_end),
        ("Why the plan was abandoned", &report.reasons),
    ] {
        // Reasons may contain messages of worlds and other programs. Repetitions are omitted.
        let reasons = reasons
            .iter()
            .map(|reason| escape_control(&reason.to_string()));
        let reasons: Vec<String> = reasons
            .map(|reason| wrap(&reason, width, 2))
            .filter(|reason| !text.contains(reason))
            .collect();
        if !reasons.is_empty() {
            let heading = styled(EMPHASIS, heading);
            let _ = writeln!(text, "\n{heading}\n{}", reasons.join("\n"));
        }
    }
    push_executed(&mut text, report);
    text
}

/// Appends the executed actions.
fn push_executed(text: &mut String, report: &Report) {
    if !report.executed.is_empty() {
        let _ = writeln!(text, "\n{}", styled(EMPHASIS, "Executed actions"));
    }
    for executed in &report.executed {
        let step = &executed.step;
        let _ = write!(text, "  {:>10}: {}", nearest(&step.start), step.action.name);
        if let Some(duration) = &step.duration {
            let _ = write!(text, " [{}]", nearest(duration));
        }
        match executed.ending.as_ref().map(Ending::name) {
            Some("succeeded") => {}
            Some(other) => {
                let _ = write!(text, " {other}");
            }
            None => text.push_str(" still running"),
        }
        text.push('\n');
    }
}
