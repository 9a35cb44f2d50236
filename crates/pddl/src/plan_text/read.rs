//! Reader of plans in a planner's output.

use std::collections::BTreeSet;

use elbowroom_model::validate::{Settings, Verdict, validate};
use elbowroom_model::{Step, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use crate::plan_text::form::Form;
use crate::plan_text::line::RawStep;
use crate::plan_text::lines::{LastPlan, MisreadKind, last_plan};
use crate::plan_text::printed::{PrintedPlan, PrintedStep};
use crate::plan_text::step::{StepReader, span};
use crate::plan_text::timing::{Start, timed};
use crate::report::Report;
use elbowroom_text::Source;
use elbowroom_text::{Diagnostic, Diagnostics};

/// The form of a line, for advice.
const EXPECTED: &str = "expected `time: (action argument …) [duration]`";

/// Reads a plan: `0.000: (action argument …) [10.000]` on each line.
///
/// The plan contains all actions of the text. Log text is skipped before the first and after the
/// last action, unless it may contain an action; any other text that is not read is an error. If a
/// log contains several plans, separated by a planner's headings, the last one is read.
///
/// Other notations are read with a warning that names them: `PlanSys2`'s terminal, FF,
/// Contingent-FF, Fast Downward, unified-planning, Aries, and the happenings of vscode-pddl.
/// Actions without times happen one after the other. A missing duration is taken from the domain if
/// it is one fixed number there. The steps are [in order](TimeTriggeredPlan::in_order), regardless
/// of the order of the lines.
///
/// # Errors
/// If actions, objects, types or numbers do not fit the task, if a line cannot be read, or if there
/// is not an action although the goal does not hold yet.
pub fn read_plan(
    source: &Source,
    task: &Task,
) -> Result<(TimeTriggeredPlan, Vec<Diagnostic>), Diagnostics> {
    let (printed, warnings) = read_printed_plan(source, task)?;
    Ok((printed.plan, warnings))
}

/// Reads a plan as [`read_plan`] does, and keeps the precision of each printed number.
///
/// # Errors
/// As for [`read_plan`].
pub fn read_printed_plan(
    source: &Source,
    task: &Task,
) -> Result<(PrintedPlan, Vec<Diagnostic>), Diagnostics> {
    let mut reader = StepReader::new(source, task);
    let lines = last_plan(source, &reader.vocabulary);
    report_lines(&mut reader.report, &lines);
    if lines.steps.is_empty() && lines.mistakes.is_empty() {
        report_no_action(&mut reader.report, task, lines.has_text);
    }
    let steps = steps(&mut reader, task, lines);
    let plan = (!reader.report.is_failed()).then(|| PrintedPlan::new(steps));
    Diagnostics::outcome(plan, reader.report.into_diagnostics())
}

/// Returns the actions with their times. An action without a time starts ε after the end of the previous
/// action, or 1 after an instantaneous one.
fn steps(
    reader: &mut StepReader<'_>,
    task: &Task,
    lines: LastPlan<'_>,
) -> Vec<(Step, PrintedStep)> {
    let mut next = Rational::ZERO;
    let mut steps = Vec::with_capacity(lines.steps.len());
    for step in timed(&mut reader.report, lines.steps) {
        let start = match &step.start {
            Start::At(time) => time.clone(),
            Start::Next => next.clone(),
        };
        let Some(read) = reader.step(&step, start) else {
            continue;
        };
        if matches!(step.start, Start::Next) {
            let pause = match &read.duration {
                Some(_) => task.epsilon().clone(),
                None => Rational::ONE,
            };
            next = read.end() + pause;
        }
        steps.push((read, PrintedStep::of(&step)));
    }
    steps
}

/// Reports the lines that cannot be read, several plans in one text, and other notations.
fn report_lines(report: &mut Report, lines: &LastPlan<'_>) {
    for misread in &lines.mistakes {
        let place = span(&misread.range);
        match misread.kind {
            MisreadKind::Broken(expected) => report
                .error(place, "this is not an action of a plan")
                .label(expected)
                .advise(EXPECTED),
            MisreadKind::Possible => report
                .error(place, "this line may contain an action, but cannot be read")
                .advise(format!(
                    "{EXPECTED}; `;` before the line makes it a comment"
                )),
            MisreadKind::Between => report
                .error(
                    place,
                    "this line between actions is not an action of a plan",
                )
                .advise(format!(
                    "{EXPECTED}; `;` before the line makes it a comment"
                )),
        };
    }
    let first = |is_it: &dyn Fn(&RawStep<'_>) -> bool| {
        let step = lines.steps.iter().find(|step| is_it(step));
        step.map(|step| span(&step.range()))
    };
    if lines.plans > 1 {
        let place = first(&|_| true).unwrap_or_else(|| span(&(0..0)));
        report
            .warning(place, format!("the file has {} plans", lines.plans))
            .label("the last one is used, from here");
    }
    // After `step 0: A`, FF prints `1: B`, which looks like a time.
    let is_ff = lines.steps.iter().any(|step| step.form == Form::Ff);
    let steps = lines.steps.iter();
    let steps = steps.filter(|step| !is_ff || step.form != Form::Words);
    let notes: BTreeSet<_> = steps.filter_map(|step| step.form.note()).collect();
    for note in notes {
        if let Some(place) = first(&|step| step.form.note() == Some(note)) {
            report
                .warning(place, note)
                .advise(format!("the usual format is `{USUAL}`"));
        }
    }
    let is_untimed = lines.steps.iter().all(|step| step.time.is_none());
    if let Some(place) = first(&|_| true).filter(|_| is_untimed) {
        report
            .warning(
                place,
                "no action has a time: each starts when the one before it has ended, and 1 later \
                 if that takes no time",
            )
            .advise(format!("write the time before the action: `{USUAL}`"));
    }
}

/// A line, for advice.
const USUAL: &str = "0.000: (action argument …) [10.000]";

/// Reports a text without actions. It is an empty plan if the goal already holds.
fn report_no_action(report: &mut Report, task: &Task, has_text: bool) {
    let nothing = TimeTriggeredPlan::default();
    let is_refuted = || {
        let verdict = validate(task, &nothing, &Settings::default());
        matches!(verdict, Verdict::Invalid(_))
    };
    let advice = format!("expected lines such as `{USUAL}`");
    if has_text || is_refuted() {
        report
            .error(span(&(0..0)), "this is not a plan: it has no action")
            .advise(advice);
    } else {
        report
            .warning(span(&(0..0)), "no actions in this plan")
            .advise(advice);
    }
}
