//! Times at which a plan reaches the parts of the goal.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_execution::{ActionHandle, BeliefState};
use elbowroom_model::ground::Condition;
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use serde::{Deserialize, Serialize};

use crate::answers::exact;

/// A part of the goal, and the time at which the plan reaches it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct GoalReached {
    /// The condition, in PDDL.
    pub goal: String,
    /// The first time at which it holds; 0 if it holds initially.
    #[serde(with = "exact")]
    pub time: Rational,
}

/// The steps that end and start at one time.
#[derive(Default)]
struct Group {
    ends: Vec<usize>,
    starts: Vec<usize>,
}

/// Returns the parts of the goal, by the time at which a valid plan reaches them. Parts that do not
/// hold right after any happening are omitted: their truth depends on time alone.
pub(super) fn goal_times(task: &Task, plan: &TimeTriggeredPlan) -> Vec<GoalReached> {
    let mut groups: BTreeMap<Rational, Group> = BTreeMap::new();
    for (index, step) in plan.steps.iter().enumerate() {
        let group = groups.entry(step.start.clone()).or_default();
        group.starts.push(index);
        if step.duration.is_some() {
            groups.entry(step.end()).or_default().ends.push(index);
        }
    }
    for timed in task.timed() {
        groups.entry(timed.time.clone()).or_default();
    }
    let mut open = task.goal().conjuncts();
    let mut reached = Vec::new();
    let mut state = BeliefState::new(Arc::new(task.clone()));
    record_goal_part(task, &state, &Rational::ZERO, &mut open, &mut reached);
    for (time, group) in &groups {
        // The validator has accepted the plan, so errors here do not matter.
        let _ = state.advance_for_happening(time);
        for index in &group.ends {
            let _ = state.end(ticket(*index), &[]);
        }
        for index in &group.starts {
            let step = &plan.steps[*index];
            let duration = step.duration.clone().unwrap_or_default();
            let _ = state.start(ticket(*index), &step.action, &duration, &[]);
        }
        record_goal_part(task, &state, time, &mut open, &mut reached);
    }
    reached
}

fn ticket(index: usize) -> ActionHandle {
    ActionHandle(index as u64)
}

fn record_goal_part(
    task: &Task,
    state: &BeliefState,
    time: &Rational,
    open: &mut Vec<&Condition>,
    reached: &mut Vec<GoalReached>,
) {
    open.retain(|goal| {
        let holds = state.holds(goal, None) == Ok(true);
        if holds {
            reached.push(GoalReached {
                goal: task.describe_condition(goal),
                time: time.clone(),
            });
        }
        !holds
    });
}
