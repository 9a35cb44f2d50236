//! Goals of an executive.

use std::sync::Arc;

use elbowroom_model::ground::Condition;
use elbowroom_model::{Task, problem};

use super::Run;
use super::kept_goals::Wait;
use super::persistent::{PROBLEM_GOAL_NAME, PendingGoalChange};
use super::snapshot::{GivenGoal, Goals};
use crate::event::GoalTerms;
use crate::executor::PlanForm;
use crate::reason::{Cause, Reason, Subject};

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
fn conjunction<'g>(goals: impl IntoIterator<Item = &'g OpenGoal>) -> problem::Condition {
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

impl Run<'_> {
    /// Records a change of the goals.
    pub(super) fn record_goal_change(&mut self, what: String, may_keep: bool) {
        self.set_goal();
        let Some(lasting) = &mut self.goal_manager else {
            return;
        };
        let earlier = lasting.pending_change.take();
        let what = match earlier.as_ref().and_then(|turn| turn.reason.about.as_ref()) {
            Some(earlier) => format!("{earlier}, {what}"),
            None => what,
        };
        let may_keep = may_keep && earlier.is_none_or(|earlier| earlier.are_goals_only_added);
        lasting.pending_change = Some(PendingGoalChange::of(what, may_keep));
    }

    /// Makes the conjunction of all pursued goals the goal of the task.
    pub(super) fn set_goal(&mut self) {
        let Some(lasting) = &mut self.goal_manager else {
            return;
        };
        lasting.have_goals_changed = true;
        let goals = std::mem::take(&mut lasting.goals);
        self.anticipated_replan = None;
        self.refusal_backoff.reset();
        self.pursue(&Arc::clone(&self.task), &goals);
        if let Some(lasting) = &mut self.goal_manager {
            lasting.goals = goals;
        }
    }

    /// Makes the conjunction of these goals the goal of the task.
    fn pursue(&mut self, task: &Task, goals: &[OpenGoal]) {
        self.task = Arc::new(self.planning_task(task, goals));
        let all = task.with_goal(conjunction(goals));
        self.belief.set_goal(&Arc::new(all));
    }

    /// Returns the task for plans for these goals. A plan need not keep a goal with a deadline true
    /// until its end, because such a goal is closed as soon as it is achieved. Executors that
    /// choose the order themselves, and plans under constraints of the problem, ignore deadlines of
    /// goals.
    fn planning_task(&self, task: &Task, goals: &[OpenGoal]) -> Task {
        let pursued = goals.iter().filter(|it| it.is_pursued());
        let deadlines = pursued.filter_map(|it| Some((it.terms.deadline.clone()?, &it.condition)));
        let others = goals.iter().filter(|it| it.terms.deadline.is_none());
        let in_time = task
            .with_goal(conjunction(others))
            .with_deadlines(deadlines);
        let chooses_order = self.ports.executor.need() == PlanForm::PartialOrder;
        match in_time.filter(|_| !chooses_order) {
            Some(task) => task,
            None => task.with_goal(conjunction(goals)),
        }
    }

    /// Returns the open goals.
    pub(super) fn goals(&self) -> Goals {
        let Some(lasting) = &self.goal_manager else {
            return Goals::default();
        };
        let open = lasting.goals.iter();
        Goals {
            open: open.map(GivenGoal::of).collect(),
            are_changed: lasting.have_goals_changed,
        }
    }

    /// Returns the queued goals.
    pub(super) fn queued_goals(&self) -> Vec<GivenGoal> {
        let queued = self.goal_manager.iter().flat_map(|it| &it.queued);
        queued.map(GivenGoal::of).collect()
    }

    /// Parses given goals again.
    fn parse_again(&self, problem: &Task, goals: &[GivenGoal]) -> Vec<OpenGoal> {
        let Some(lasting) = &self.goal_manager else {
            return Vec::new();
        };
        let goals = goals.iter().filter_map(|given| {
            let goal = match &given.text {
                None => OpenGoal::problem_goal(problem),
                Some(text) => {
                    let condition = lasting.reader.read(problem, text).ok()?;
                    OpenGoal::new(problem, given.name.clone(), Some(text.clone()), condition)
                }
            };
            Some(OpenGoal {
                terms: given.terms.clone(),
                set_aside: given.set_aside.clone(),
                missed_deadline: given.missed_deadline.clone(),
                is_announced: given.set_aside.is_some() && given.wait != Wait::Conflict,
                wait: given.wait,
                ..goal
            })
        });
        goals.collect()
    }

    /// Returns the task with these goals; `problem` is the task with the goal of the problem.
    pub(super) fn task_with_goals(&self, problem: &Arc<Task>, goals: &Goals) -> Arc<Task> {
        if !goals.are_changed {
            return Arc::clone(problem);
        }
        Arc::new(self.planning_task(problem, &self.parse_again(problem, &goals.open)))
    }

    /// Restores the open and the queued goals; `problem` is the task with the goal of the problem.
    pub(super) fn restore_goals(
        &mut self,
        problem: &Arc<Task>,
        goals: &Goals,
        queued: &[GivenGoal],
        is_paused: bool,
    ) {
        let open = self.parse_again(problem, &goals.open);
        let queued = self.parse_again(problem, queued);
        if goals.are_changed {
            self.pursue(problem, &open);
        }
        if let Some(lasting) = &mut self.goal_manager {
            lasting.goals = open;
            lasting.queued = queued;
            lasting.have_goals_changed = goals.are_changed;
            lasting.is_paused = is_paused;
        }
    }

    /// Returns the change of the goals in words, and `true` if goals were only added. `None` if
    /// they have not changed.
    pub(super) fn describe_goal_change(&self) -> Option<(String, bool)> {
        let turn = self.goal_manager.as_ref()?.pending_change.as_ref()?;
        let words = turn.reason.about.as_ref().map(ToString::to_string);
        Some((words.unwrap_or_default(), turn.are_goals_only_added))
    }

    /// Restores a change of the goals.
    pub(super) fn restore_goal_change(&mut self, turn: Option<(String, bool)>) {
        if let Some(lasting) = &mut self.goal_manager {
            lasting.pending_change =
                turn.map(|(words, may_keep)| PendingGoalChange::of(words, may_keep));
        }
    }

    pub(super) fn has_no_goals(&self) -> bool {
        let lasting = self.goal_manager.as_ref();
        lasting.is_some_and(|lasting| lasting.goals.is_empty())
    }
}

impl PendingGoalChange {
    fn of(words: String, may_keep: bool) -> Self {
        Self {
            reason: Reason::new(Cause::Asked).about(Subject::ExternalMessage(words)),
            are_goals_only_added: may_keep,
        }
    }
}
