//! `elbowroom plan`: planning with the embedded planner or another one.

mod monitor;
mod problem_input;
mod text;

use std::sync::Arc;

use elbowroom::answers::plan::{
    BestPlanRequest, PlanAim, PlanFinding, PlanObjective, PlanOutcome, PlanRequest, best_plan,
    plan, plan_with, stopped_before_reading,
};
use elbowroom::answers::{Observer, RequestError};
use elbowroom::execute::SpecError;
use elbowroom::external::Planner;
use elbowroom::model::Task;
use elbowroom::pddl::write_plan;
use elbowroom::sim::WorldModel;
use elbowroom_calendar::Calendar;

use super::run::spec::contradiction_failure;
use super::threads::{self, ALL_PROCESSORS};
use crate::args::{EMBEDDED, PlanArgs};
use crate::exit::{Answer, Exit, Failure};
use crate::input::ReadProblem;
use crate::output::Output;
use crate::terminal::stdout_layout;
use crate::{input, output};
use monitor::PlanMonitor;

/// Number of variants of the problem for which plans are compared without a time limit.
const SEARCHES: usize = 40;

/// Searches for a plan and prints it.
pub(crate) fn run(arguments: &PlanArgs, output: &mut Output) -> Answer {
    // Reports a misspelt planner before any file is read.
    let planner = if arguments.planner.eq_ignore_ascii_case(EMBEDDED) {
        None
    } else {
        Some(planner_of(arguments)?)
    };
    let threads = threads::thread_count(arguments.jobs, ALL_PROCESSORS, planner.is_none())?;
    if let (true, Some(planner)) = (arguments.self_overlap, &planner) {
        let error = SpecError::SelfOverlap(planner.name.clone());
        return Err(contradiction_failure(error));
    }
    let mut watch = PlanMonitor::start(arguments);
    let read = match problem_input::read(arguments, &mut watch, output)? {
        Ok(read) => read,
        Err(halt) => {
            let name = planner.as_ref().map_or(EMBEDDED, |planner| &planner.name);
            let outcome = stopped_before_reading(name, halt, watch.elapsed());
            drop(watch);
            return print(arguments, &outcome, None, output);
        }
    };
    if let Some(objective) = arguments.objective {
        return run_with_objective(arguments, objective, planner.as_ref(), read, watch, output);
    }
    let ReadProblem {
        task,
        domain,
        problem,
        calendar,
    } = read;
    let mut request = PlanRequest {
        task: &task,
        first_plan_only: arguments.first || watch.limit().is_none(),
        most_memory: arguments.memory.map(|megabytes| megabytes << 20),
        self_overlap: arguments.self_overlap,
        threads,
    };
    let mut outcome = match &planner {
        None => plan(&mut request, &mut watch).map_err(unsupported)?,
        Some(planner) => {
            // This planner enforces the limits itself.
            let limit = watch.take_limits();
            let sources = [&domain, &problem];
            plan_with(planner, &mut request, sources, limit, &mut watch).map_err(text::failure)?
        }
    };
    outcome.answer.name_files([domain.name(), problem.name()]);
    write_exactly(arguments, &task, &mut outcome);
    // The progress line is removed before the answer is printed.
    drop(watch);
    print(arguments, &outcome, calendar.as_ref(), output)
}

/// Writes the plan with exact numbers, if that was requested.
fn write_exactly(arguments: &PlanArgs, task: &Task, outcome: &mut PlanOutcome) {
    let finding = &mut outcome.answer.finding;
    if let (true, PlanFinding::Plan { plan: text, .. }, Some(plan)) =
        (arguments.exact, finding, &outcome.plan)
    {
        *text = write_plan(task, plan);
    }
}

/// Searches for the best plan by an objective and prints it.
fn run_with_objective(
    arguments: &PlanArgs,
    objective: PlanObjective,
    planner: Option<&Planner>,
    read: ReadProblem,
    mut watch: PlanMonitor,
    output: &mut Output,
) -> Answer {
    if planner.is_some() {
        return Err(Failure::new(
            "--objective works only with the embedded planner",
            "leave out --planner, or --objective",
        ));
    }
    let task = &Arc::new(read.task);
    let world;
    let aim = match (objective, &arguments.world) {
        (PlanObjective::Slack, None) => PlanAim::Slack,
        (PlanObjective::Slack, Some(_)) => {
            return Err(Failure::new(
                "--world has no effect with `--objective slack`",
                "leave it out, or use --objective probability",
            ));
        }
        (PlanObjective::Probability, None) => {
            return Err(Failure::new(
                "`--objective probability` needs a world file",
                "give one with --world (docs/reference/formats/world.md)",
            ));
        }
        (PlanObjective::Probability, Some(path)) => {
            let source = input::source(path, "world")?;
            world = WorldModel::read(source, task.problem())
                .map_err(|wrong| contradiction_failure(SpecError::World(wrong)))?;
            PlanAim::Probability(&world)
        }
    };
    let request = BestPlanRequest {
        task,
        aim,
        most_searches: watch.limit().is_none().then_some(SEARCHES),
        self_overlap: arguments.self_overlap,
        most_memory: arguments.memory.map(|megabytes| megabytes << 20),
    };
    let mut outcome = best_plan(&request, &mut watch).map_err(unsupported)?;
    outcome
        .answer
        .name_files([read.domain.name(), read.problem.name()]);
    write_exactly(arguments, task, &mut outcome);
    drop(watch);
    print(arguments, &outcome, read.calendar.as_ref(), output)
}

/// Returns the planner of the arguments.
fn planner_of(arguments: &PlanArgs) -> Result<Planner, Failure> {
    Planner::named(&arguments.planner).map_err(|error| {
        Failure::new(
            error,
            "`elbowroom plan --help` lists the planners; --planner embedded is always available",
        )
    })
}

fn unsupported(error: RequestError) -> Failure {
    Failure::new(
        error,
        "docs/reference/planners.md lists what the embedded planner supports; --planner selects another one",
    )
}

fn print(
    arguments: &PlanArgs,
    outcome: &PlanOutcome,
    calendar: Option<&Calendar>,
    output: &mut Output,
) -> Answer {
    let answer = &outcome.answer;
    if let PlanFinding::Plan {
        repaired: Some(objection),
        ..
    } = &answer.finding
    {
        output::print_to_stderr(&text::repair_text(&answer.planner, objection));
    }
    let plan = text::plan(&answer.finding);
    let plan = match calendar {
        Some(calendar) => plan.map(|plan| calendar.dated_plan(&plan)),
        None => plan,
    };
    if let (Some(plan), Some(path)) = (&plan, &arguments.output) {
        output::write_file(path, plan)?;
    }
    if arguments.json {
        output.document(answer)?;
    } else if let PlanFinding::NoPlan { reason, .. } | PlanFinding::None { reason, .. } =
        &answer.finding
    {
        output::print(&format!("{reason}\n"))?;
    } else if let (Some(plan), None) = (&plan, &arguments.output) {
        output::print(plan)?;
    }
    let certified = text::certificate_text(answer, stdout_layout());
    if let Some(line) = certified.filter(|_| !arguments.json) {
        output::print_to_stderr(&line);
    }
    if let Some(summary) = text::summary(answer).filter(|_| !arguments.json) {
        output::print_to_stderr(&summary);
    }
    Ok(match &answer.finding {
        PlanFinding::Plan { .. } => Exit::Yes,
        PlanFinding::NoPlan { .. } => Exit::No,
        PlanFinding::None { .. } => Exit::Limit,
    })
}
