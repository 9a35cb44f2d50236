//! Kinds of plans with frequent errors in guarantees or execution: one small plan for each, with
//! its known properties.
#![allow(dead_code, reason = "each test uses some of it")]

use std::sync::Arc;

use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_pddl::{Source, read_plan, read_problem};

mod battery;
mod cases;
mod coinciding_ends;
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

/// Plan with its known properties.
///
/// Boxes name the durations of the plan's actions in the order of their starts, by name if several
/// start together: `dur_0=[1,2],dur_1=[3,4]`; missing ones are nominal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Kind {
    pub(crate) name: &'static str,
    pub(crate) domain: &'static str,
    pub(crate) problem: &'static str,
    pub(crate) plan: &'static str,
    /// Boxes inside the robustness envelope (the weak guarantee).
    pub(crate) inside: &'static [&'static str],
    /// Boxes that are not inside.
    pub(crate) outside: &'static [&'static str],
    /// Boxes inside that are dynamically controllable (not all of them).
    pub(crate) dynamic: &'static [&'static str],
    /// Boxes inside that are not dynamically controllable.
    pub(crate) not_dynamic: &'static [&'static str],
}

impl Kind {
    /// Returns the task and the plan.
    pub(crate) fn read(&self) -> (Arc<Task>, TimeTriggeredPlan) {
        self.read_with(self.plan)
    }

    /// Returns the task, and a plan from another text.
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

/// Returns all kinds.
pub(crate) fn kinds() -> Vec<Kind> {
    vec![
        loaf::END_WHILE_ANOTHER_RUNS,
        cases::LAMP,
        cases::HATCHERY,
        cases::PAINTSHOP,
        van::END_IN_A_WINDOW,
        kiln::END_AFTER_AN_END_BEFORE_A_DEADLINE,
        handover::END_WITHIN_ANOTHER,
        coinciding_ends::ENDS_THAT_COINCIDE_WITHOUT_NEED,
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
