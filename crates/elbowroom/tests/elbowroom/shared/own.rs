//! The cases of this repository.

use std::path::Path;
use std::sync::Arc;

use elbowroom::AnyPlan;
use elbowroom_model::Task;
use elbowroom_pddl::{read_plan, read_problem};

use super::source;

/// Reads a case with its plan.
pub(crate) fn case(name: &str) -> (Arc<Task>, AnyPlan) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../cases")
        .join(name);
    let file = |file: &str| source(&folder.join(file));
    let read = read_problem(&file("domain.pddl"), &file("problem.pddl"));
    let task = Arc::new(Task::new(read.expect("a case without mistakes").0));
    let plan = read_plan(&file("plan.plan"), &task);
    (task, plan.expect("a plan without mistakes").0.into())
}
