//! The goals of a lasting run.

use std::sync::Arc;

use elbowroom_model::{Task, problem};

use super::Run;
use super::lasting::{FIRST_GOAL, Turn};
use super::stand::Goals;
use crate::reason::{About, Cause, Reason};

/// A goal that is open.
pub(super) struct OpenGoal {
    pub(super) name: String,
    /// As it was given; `None` for that of the problem.
    pub(super) text: Option<String>,
    pub(super) condition: problem::Condition,
}

impl OpenGoal {
    /// The goal that the problem itself has.
    pub(super) fn of_the_problem(condition: problem::Condition) -> Self {
        Self {
            name: FIRST_GOAL.to_owned(),
            text: None,
            condition,
        }
    }
}

/// All of them together.
fn together(goals: &[OpenGoal]) -> problem::Condition {
    let mut goals: Vec<_> = goals.iter().map(|it| it.condition.clone()).collect();
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
    /// The goals have changed.
    pub(super) fn turn(&mut self, what: String, may_keep: bool) {
        self.set_goal();
        let Some(lasting) = &mut self.lasting else {
            return;
        };
        let earlier = lasting.change.take();
        let what = match earlier.as_ref().and_then(|turn| turn.reason.about.as_ref()) {
            Some(earlier) => format!("{earlier}, {what}"),
            None => what,
        };
        let may_keep = may_keep && earlier.is_none_or(|earlier| earlier.may_keep);
        lasting.change = Some(Turn::of(what, may_keep));
    }

    /// All open goals together are the goal.
    pub(super) fn set_goal(&mut self) {
        let Some(lasting) = &mut self.lasting else {
            return;
        };
        lasting.has_other_goals = true;
        let goal = together(&lasting.goals);
        self.foreseen = None;
        self.refusals.forget();
        self.task = Arc::new(self.task.with_goal(goal));
        self.belief.pursue(&self.task);
    }

    /// The open goals.
    pub(super) fn goals(&self) -> Goals {
        let Some(lasting) = &self.lasting else {
            return Goals::default();
        };
        let open = lasting.goals.iter();
        Goals {
            open: open.map(|it| (it.name.clone(), it.text.clone())).collect(),
            are_others: lasting.has_other_goals,
        }
    }

    /// Reads goals again that were read before.
    fn read_again(&self, problem: &Task, goals: &Goals) -> Vec<OpenGoal> {
        let Some(lasting) = &self.lasting else {
            return Vec::new();
        };
        let goals = goals.open.iter().filter_map(|(name, text)| {
            let Some(text) = text else {
                return Some(OpenGoal::of_the_problem(problem.problem().goal.clone()));
            };
            Some(OpenGoal {
                name: name.clone(),
                text: Some(text.clone()),
                condition: lasting.reader.read(problem, text).ok()?,
            })
        });
        goals.collect()
    }

    /// The task with these goals, where `problem` has its own.
    pub(super) fn task_of(&self, problem: &Arc<Task>, goals: &Goals) -> Arc<Task> {
        if !goals.are_others {
            return Arc::clone(problem);
        }
        Arc::new(problem.with_goal(together(&self.read_again(problem, goals))))
    }

    /// These are the open goals, where `problem` has its own.
    pub(super) fn pursue_again(&mut self, problem: &Arc<Task>, goals: &Goals, is_paused: bool) {
        let open = self.read_again(problem, goals);
        self.task = self.task_of(problem, goals);
        if let Some(lasting) = &mut self.lasting {
            lasting.goals = open;
            lasting.has_other_goals = goals.are_others;
            lasting.is_paused = is_paused;
        }
    }

    /// How the goals have changed, if they have: in words, and whether they have only become more.
    pub(super) fn turn_in_words(&self) -> Option<(String, bool)> {
        let turn = self.lasting.as_ref()?.change.as_ref()?;
        let words = turn.reason.about.as_ref().map(ToString::to_string);
        Some((words.unwrap_or_default(), turn.may_keep))
    }

    /// The goals have changed like that.
    pub(super) fn turn_again(&mut self, turn: Option<(String, bool)>) {
        if let Some(lasting) = &mut self.lasting {
            lasting.change = turn.map(|(words, may_keep)| Turn::of(words, may_keep));
        }
    }

    pub(super) fn has_no_goals(&self) -> bool {
        let lasting = self.lasting.as_ref();
        lasting.is_some_and(|lasting| lasting.goals.is_empty())
    }
}

impl Turn {
    fn of(words: String, may_keep: bool) -> Self {
        Self {
            reason: Reason::new(Cause::Asked).about(About::Said(words)),
            may_keep,
        }
    }
}
