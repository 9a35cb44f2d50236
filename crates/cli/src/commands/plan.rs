//! `elbowroom plan`: find a plan, or have another planner find one.

mod conclusion;
mod external;

use elbowroom::model::Task;
use elbowroom::pddl::Source;

use crate::args::{EMBEDDED, PlanArgs};
use crate::exit::{Answer, Failure};
use crate::input;

/// Plans.
pub(crate) fn run(arguments: &PlanArgs) -> Answer {
    if arguments.planner.eq_ignore_ascii_case(EMBEDDED) {
        return Err(Failure::new(
            "--planner embedded is not available in this version",
            "name another planner; `elbowroom plan --help` lists them",
        ));
    }
    let planner = external::planner(arguments)?;
    let (task, domain, problem) = input::task_with_sources(&arguments.problem)?;
    external::run(
        &planner,
        Subject {
            arguments,
            task,
            domain,
            problem,
        },
    )
}

/// What to plan.
struct Subject<'a> {
    arguments: &'a PlanArgs,
    task: Task,
    domain: Source,
    problem: Source,
}
