//! Kinds of plans in which it is easy to promise, or to do, something wrong: one small plan for
//! each, with what is true of it.
#![allow(dead_code, reason = "each test uses some of it")]

use std::sync::Arc;

use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_pddl::{Source, read_plan, read_problem};

mod battery;
mod calm;
mod cases;
mod deadline;
mod handover;
mod instant;
mod kiln;
mod lamps;
mod level;
mod light;
mod loaf;
mod power;
mod tide;
mod van;

/// A plan, and what is true of it.
///
/// Boxes name the durations of the plan's actions in order of their start, by name where several
/// start together: `dur_0=[1,2],dur_1=[3,4]`; what is left out is nominal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Kind {
    pub(crate) name: &'static str,
    pub(crate) domain: &'static str,
    pub(crate) problem: &'static str,
    pub(crate) plan: &'static str,
    /// Boxes inside the robustness envelope (the weak guarantee).
    pub(crate) inside: &'static [&'static str],
    /// Boxes that are not.
    pub(crate) outside: &'static [&'static str],
    /// Of the boxes inside, some whose promise can be kept by deciding from what has been seen.
    pub(crate) dynamic: &'static [&'static str],
    /// Boxes inside whose promise cannot be kept so.
    pub(crate) not_dynamic: &'static [&'static str],
}

impl Kind {
    /// The task and the plan.
    pub(crate) fn read(&self) -> (Arc<Task>, TimeTriggeredPlan) {
        self.read_with(self.plan)
    }

    /// The task, and another text of the plan.
    pub(crate) fn read_with(&self, plan: &str) -> (Arc<Task>, TimeTriggeredPlan) {
        let source = |part: &str, text: &str| Source::new(format!("{} {part}", self.name), text);
        let problem = read_problem(
            &source("domain", self.domain),
            &source("problem", self.problem),
        );
        let (problem, _) = problem.unwrap_or_else(|error| panic!("{}", error.render(false)));
        let task = Task::new(problem);
        let plan = read_plan(&source("plan", plan), &task);
        let (plan, _) = plan.unwrap_or_else(|error| panic!("{}", error.render(false)));
        (Arc::new(task), plan)
    }
}

/// All kinds.
pub(crate) fn kinds() -> Vec<Kind> {
    vec![
        loaf::END_WHILE_ANOTHER_RUNS,
        cases::LAMP,
        cases::HATCHERY,
        cases::PAINTSHOP,
        van::END_IN_A_WINDOW,
        kiln::END_AFTER_AN_END_BEFORE_A_DEADLINE,
        handover::END_WITHIN_ANOTHER,
        calm::ENDS_THAT_COINCIDE_WITHOUT_NEED,
        lamps::ONE_FACT_TAKES_OVER,
        light::ENDS_AT_THE_SAME_INSTANT,
        power::CONDITION_FROM_AN_ACTION_THAT_STARTS_TOGETHER,
        level::COMPARISON_THAT_ENDS_IN_AN_EQUALITY,
        instant::NO_TIME_AT_ALL,
        battery::THREE_JOBS_AT_ONCE,
        battery::THREE_JOBS_IN_TURN,
        tide::CHANGES_THAT_NOTHING_READS,
        tide::GOAL_THAT_COMES_BY_ITSELF,
        tide::GOAL_THAT_IS_TAKEN_AWAY,
        deadline::TWO_DEADLINES,
    ]
}
