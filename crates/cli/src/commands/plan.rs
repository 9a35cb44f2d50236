//! `elbowroom plan`: find a plan, or have another planner find one.

mod conclusion;
mod embedded;
mod external;
mod watch;

use elbowroom::model::Task;
use elbowroom::pddl::Source;

use crate::args::{EMBEDDED, PlanArgs};
use crate::exit::Answer;
use crate::input;

/// Plans.
pub(crate) fn run(arguments: &PlanArgs) -> Answer {
    // A misspelt planner is told before files are read.
    let planner = if arguments.planner.eq_ignore_ascii_case(EMBEDDED) {
        None
    } else {
        Some(external::planner(arguments)?)
    };
    let (task, domain, problem) = input::task_with_sources(&arguments.problem)?;
    let subject = Subject {
        arguments,
        task,
        domain,
        problem,
    };
    match planner {
        None => embedded::run(subject),
        Some(planner) => external::run(&planner, subject),
    }
}

/// What to plan.
struct Subject<'a> {
    arguments: &'a PlanArgs,
    task: Task,
    domain: Source,
    problem: Source,
}
