//! Reading of domains, problems, plans and worlds.

use std::path::Path;

use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::pddl::{self, Diagnostic, Diagnostics, Source};
use elbowroom::plan::format;
use elbowroom::sim::WorldModel;
use elbowroom::{PlanKind, RoundingRule};
use elbowroom_calendar::Calendar;

pub(crate) use crate::file::source;
pub(crate) use elbowroom::AnyPlan;

use crate::args::ProblemArgs;
use crate::calendar::timed_problem;
use crate::exit::Failure;
use crate::output::{self, Output};
use crate::terminal::{HINT, styled};
use elbowroom_executive::journal::Journal;

/// Reads domain and problem. Warnings go to standard error.
pub(crate) fn task(
    arguments: &ProblemArgs,
    epsilon: &Rational,
    output: &mut Output,
) -> Result<Task, Failure> {
    let (read, warnings) = read(arguments, epsilon)?;
    output.warn_about(&warnings);
    Ok(read.task)
}

/// A parsed domain and problem.
pub(crate) struct ReadProblem {
    pub(crate) task: Task,
    pub(crate) domain: Source,
    /// The text of the problem, with the timed initials of its calendar.
    pub(crate) problem: Source,
    pub(crate) calendar: Option<Calendar>,
}

/// Reads domain, problem and calendar file. Returns them with the warnings.
pub(crate) fn read(
    arguments: &ProblemArgs,
    epsilon: &Rational,
) -> Result<(ReadProblem, Vec<Diagnostic>), Failure> {
    let domain = source(&arguments.domain, "domain")?;
    let mut problem = source(&arguments.problem, "problem")?;
    let (mut calendar, mut warnings) = (None, Vec::new());
    if let Some(timed) = timed_problem(&arguments.calendar, &domain, &problem, false)? {
        problem = timed.problem;
        warnings = timed.warnings;
        calendar = Some(timed.calendar);
    }
    let (read, others) = pddl::read_problem(&domain, &problem)?;
    warnings.extend(others);
    let task = Task::new(read).with_epsilon(epsilon.clone());
    let read = ReadProblem {
        task,
        domain,
        problem,
        calendar,
    };
    Ok((read, warnings))
}

/// Reads a plan of either kind. The content, or the extension `.stn`, determines the kind. `rule`
/// applies to rounded numbers.
pub(crate) fn any_plan(
    task: &Task,
    path: &Path,
    rule: &RoundingRule,
    output: &mut Output,
) -> Result<AnyPlan, Failure> {
    let text = source(path, "plan")?;
    let is_stn_name = path
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("stn"));
    if is_stn_name || PlanKind::of_text(text.text()) == PlanKind::Stn {
        return Ok(AnyPlan::Stn(format::read(&text, task)?));
    }
    let plan = with_warnings(rule.read_plan(&text, task), output)?;
    Ok(AnyPlan::TimeTriggered(plan))
}

/// Advice if a plan with fixed times is needed and an STN plan is given.
pub(crate) const FIXED_TIMES_ADVICE: &str =
    "give a plan with fixed times; the network is derived from it";

/// Reads a plan with fixed times. `advice` is shown if the file is an STN plan.
pub(crate) fn time_triggered(
    task: &Task,
    path: &Path,
    rule: &RoundingRule,
    advice: &str,
    output: &mut Output,
) -> Result<TimeTriggeredPlan, Failure> {
    match any_plan(task, path, rule, output)? {
        AnyPlan::TimeTriggered(plan) => Ok(plan),
        AnyPlan::Stn(_) => Err(Failure::new(
            format!(
                "{} is an STN plan file, which describes many plans",
                path.display()
            ),
            advice,
        )),
    }
}

/// Prints advice on an invalid plan to standard error.
pub(crate) fn advise_repair() {
    note("`elbowroom envelope DOMAIN PROBLEM PLAN --repair` prints the cheapest repair");
}

/// Prints a note to standard error.
pub(crate) fn note(text: &str) {
    output::print_to_stderr(&format!("{}: {text}", styled(HINT, "note")));
}

/// Reads a trace, or another record of `what`. The checksums of a journal's lines are removed.
pub(crate) fn record(path: &Path, what: &str) -> Result<Source, Failure> {
    let text = source(path, what)?;
    if !elbowroom_executive::journal::is_journal(text.text()) {
        return Ok(text);
    }
    let journal = Journal::read(text.text()).map_err(|why| {
        let message = format!("the journal {}: {why}", path.display());
        Failure::new(message, elbowroom_executive::journal::DAMAGE_ADVICE)
    })?;
    Ok(Source::new(text.name(), journal.text))
}

/// Reads a world on a clock.
pub(crate) fn world(path: &Path, task: &Task) -> Result<WorldModel, Failure> {
    let text = source(path, "world")?;
    WorldModel::read(&text, task.problem()).map_err(|wrong| {
        Failure::from(wrong)
            .with_default_advice("docs/reference/formats/world.md describes world files")
    })
}

/// Returns the value. Warnings go to standard error; errors become a failure.
pub(crate) fn with_warnings<T>(
    outcome: Result<(T, Vec<Diagnostic>), Diagnostics>,
    output: &mut Output,
) -> Result<T, Failure> {
    let (value, warnings) = outcome?;
    output.warn_about(&warnings);
    Ok(value)
}
