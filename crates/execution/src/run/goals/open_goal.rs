//! Goals, as they were given and as they are pursued.

use elbowroom_model::ground::Condition;
use elbowroom_model::{Task, problem};

use super::PROBLEM_GOAL_NAME;
use crate::event::GoalTerms;
use crate::run::settings::Verdict;

/// Reason for which a goal is queued.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wait {
    /// Its release time has not come, or it was not evaluated since.
    #[default]
    Release,
    /// It is a goal to keep, and holds.
    Holds,
    /// It is a goal to keep, and does not hold, but other goals are pursued.
    Others,
    /// It is a goal to keep, and no plan reaches it together with the other ones.
    Conflict,
}

/// Open goals, as they were given.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Goals {
    /// The goals in the order of their requests.
    pub open: Vec<GivenGoal>,
    /// `true` if they are not, or no longer, those of the problem.
    pub are_changed: bool,
}

/// A goal as it was given.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GivenGoal {
    /// Its name.
    pub name: String,
    /// Its text in PDDL; `None` for the goal of the problem.
    pub text: Option<String>,
    /// Its value, its times and its author.
    pub terms: GoalTerms,
    /// The reason for which it is set aside while others are pursued; `None` if it is pursued.
    pub set_aside: Option<String>,
    /// Lateness in words, if its deadline is known to be missed.
    pub missed_deadline: Option<String>,
    /// The reason for which it is queued, if it is.
    pub wait: Wait,
}

/// An open goal.
pub(super) struct OpenGoal {
    pub(super) name: String,
    /// Its text in PDDL; `None` for the goal of the problem.
    pub(super) text: Option<String>,
    pub(super) condition: problem::Condition,
    pub(super) terms: GoalTerms,
    /// Its condition, grounded.
    pub(super) ground: Condition,
    /// The reason for which it can never become true, if that is known.
    pub(super) unreachable: Option<String>,
    /// The reason for which it is set aside while other goals are pursued.
    pub(super) set_aside: Option<String>,
    /// Lateness in words, if its deadline is known to be missed.
    pub(super) missed_deadline: Option<String>,
    /// `true` if a certificate proves that it misses its deadline, whichever other goals are pursued.
    pub(super) is_proven_late: bool,
    /// The result of the last search for a plan for this goal alone, if it has failed.
    pub(super) failed_search: Option<Verdict>,
    /// `true` if the record contains that it is set aside.
    pub(super) is_announced: bool,
    /// The reason for which it is queued, if it is.
    pub(super) wait: Wait,
}

impl OpenGoal {
    /// Creates a goal of a task from its text and its condition.
    pub(super) fn new(
        task: &Task,
        name: String,
        text: Option<String>,
        condition: problem::Condition,
    ) -> Self {
        Self {
            name,
            text,
            ground: task.with_goal(condition.clone()).goal().clone(),
            condition,
            terms: GoalTerms::default(),
            unreachable: None,
            set_aside: None,
            missed_deadline: None,
            is_proven_late: false,
            failed_search: None,
            is_announced: false,
            wait: Wait::default(),
        }
    }

    /// Returns the problem's own goal.
    pub(super) fn problem_goal(task: &Task) -> Self {
        let condition = task.problem().goal.clone();
        Self::new(task, PROBLEM_GOAL_NAME.to_owned(), None, condition)
    }

    /// Returns `true` unless it is set aside.
    pub(super) fn is_pursued(&self) -> bool {
        self.set_aside.is_none()
    }
}

/// Returns the conjunction of all pursued goals.
pub(super) fn conjunction<'g>(goals: impl IntoIterator<Item = &'g OpenGoal>) -> problem::Condition {
    let goals = goals.into_iter().filter(|it| it.is_pursued());
    let mut goals: Vec<_> = goals.map(|it| it.condition.clone()).collect();
    match (goals.pop(), goals.is_empty()) {
        (None, _) => problem::Condition::TRUE,
        (Some(only), true) => only,
        (Some(last), false) => {
            goals.push(last);
            problem::Condition::And(goals)
        }
    }
}

impl GivenGoal {
    pub(super) fn of(goal: &OpenGoal) -> Self {
        Self {
            name: goal.name.clone(),
            text: goal.text.clone(),
            terms: goal.terms.clone(),
            set_aside: goal.set_aside.clone(),
            missed_deadline: goal.missed_deadline.clone(),
            wait: goal.wait,
        }
    }
}

/// Returns the task for plans for these goals. A plan need not keep a goal with a deadline true
/// until its end, because such a goal is closed as soon as it is achieved. Executors that choose the
/// order themselves, and plans under constraints of the problem, ignore deadlines of goals.
pub(super) fn planning_task(task: &Task, goals: &[OpenGoal], chooses_order: bool) -> Task {
    let pursued = goals.iter().filter(|it| it.is_pursued());
    let deadlines = pursued.filter_map(|it| Some((it.terms.deadline.clone()?, &it.condition)));
    let others = goals.iter().filter(|it| it.terms.deadline.is_none());
    let in_time = task
        .with_goal(conjunction(others))
        .with_deadlines(deadlines);
    match in_time.filter(|_| !chooses_order) {
        Some(task) => task,
        None => task.with_goal(conjunction(goals)),
    }
}
