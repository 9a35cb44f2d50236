//! Closing of goals that are achieved, or whose deadlines have passed.

use std::collections::BTreeSet;

use elbowroom_num::Rational;

use super::Run;
use super::goal_selection::names_of;
use super::goals::OpenGoal;
use crate::record::{Entry, GoalChange};

impl Run<'_> {
    /// Closes the goals that are achieved while others are still pursued.
    pub(super) fn close_achieved_goals(&mut self) {
        let Some(lasting) = self.goal_manager.as_mut().filter(|it| it.goals.len() > 1) else {
            return;
        };
        let belief = &self.belief;
        // Goals to keep have to hold together in the end.
        let is_achieved =
            |goal: &OpenGoal| !goal.terms.keep && belief.is_certain(&goal.ground) == Ok(true);
        let is_left = |goal: &OpenGoal| goal.is_pursued() && !is_achieved(goal);
        if !lasting.goals.iter().any(is_left) || !lasting.goals.iter().any(is_achieved) {
            return;
        }
        let (achieved, left): (Vec<_>, Vec<_>) = lasting.goals.drain(..).partition(is_achieved);
        lasting.goals = left;
        self.continue_without(&achieved);
    }

    /// Continues with the other goals after these were achieved.
    fn continue_without(&mut self, achieved: &[OpenGoal]) {
        self.search_results.has_closed_goals = self.search.is_some();
        self.record_achieved(achieved);
        self.set_goal();
        if self.search.is_none() && self.is_selecting_goals() {
            // Without the closed goals, more sets may have a plan.
            self.restart_selection(false);
        }
    }

    /// Returns the next coming deadline of an open goal.
    pub(super) fn next_deadline_of_a_goal(&self) -> Option<Rational> {
        let goals = self.goal_manager.iter().flat_map(|it| &it.goals);
        let deadlines = goals.filter_map(|goal| goal.terms.deadline.as_ref());
        deadlines.filter(|it| **it > self.now).min().cloned()
    }

    /// Closes the goals whose deadlines are before this time, in their order. All events up to the
    /// deadlines must be known.
    pub(super) fn close_goals_due_before(&mut self, time: &Rational) {
        let goals = self.goal_manager.iter().flat_map(|it| &it.goals);
        let deadlines = goals.filter_map(|goal| goal.terms.deadline.clone());
        let due: BTreeSet<Rational> = deadlines.filter(|it| it < time).collect();
        for deadline in due {
            let _ = self.belief.advance(&deadline);
            self.close_goals_due(&deadline);
        }
    }

    /// Closes achieved goals with deadlines, because they need not stay true, and goals whose
    /// deadlines are now.
    pub(super) fn close_momentary_goals(&mut self) {
        let Some(lasting) = &mut self.goal_manager else {
            return;
        };
        let belief = &self.belief;
        let is_achieved = |goal: &mut OpenGoal| {
            goal.terms.deadline.is_some() && belief.is_certain(&goal.ground) == Ok(true)
        };
        let achieved: Vec<OpenGoal> = lasting.goals.extract_if(.., is_achieved).collect();
        let is_any_left = lasting.goals.iter().any(OpenGoal::is_pursued);
        match names_of(&achieved) {
            Some(_) if is_any_left => self.continue_without(&achieved),
            Some(names) => {
                self.record_achieved(&achieved);
                self.pursue_all();
                self.record_goal_change(format!("{names} is reached"), false);
            }
            None => {}
        }
        self.close_goals_due(&self.now.clone());
    }

    /// Closes the goals with deadlines up to this time. The others are pursued without them.
    fn close_goals_due(&mut self, time: &Rational) {
        let Some(lasting) = &mut self.goal_manager else {
            return;
        };
        let is_due =
            |goal: &mut OpenGoal| goal.terms.deadline.as_ref().is_some_and(|it| it <= time);
        let due: Vec<OpenGoal> = lasting.goals.extract_if(.., is_due).collect();
        // A goal may have been achieved exactly at its deadline.
        let is_achieved = |goal: &OpenGoal| self.belief.is_certain(&goal.ground) == Ok(true);
        let (achieved, late): (Vec<_>, Vec<_>) = due.into_iter().partition(is_achieved);
        self.record_achieved(&achieved);
        for goal in &late {
            let why = match &goal.set_aside {
                Some(aside) => format!("its deadline has passed; it was set aside: {aside}"),
                None => match &goal.missed_deadline {
                    Some(late) => {
                        format!("its deadline has passed; it would have been reached {late}")
                    }
                    None => "its deadline has passed".to_owned(),
                },
            };
            self.ports.recorder.record(&Entry::Goal {
                now: &self.now,
                name: &goal.name,
                change: GoalChange::Failed { why: &why },
            });
        }
        if achieved.is_empty() && self.are_set_aside_while_others_are_pursued(&late) {
            return;
        }
        let words = match (names_of(&late), names_of(&achieved)) {
            (Some(late), _) => format!("too late for {late}"),
            (None, Some(achieved)) => format!("{achieved} is reached"),
            (None, None) => return,
        };
        self.pursue_all();
        self.record_goal_change(words, false);
    }

    /// Returns `true` if these closed goals were set aside, and others are pursued: their plan, or the search for it,
    /// continues. The closed goals are not tried any more.
    fn are_set_aside_while_others_are_pursued(&mut self, closed: &[OpenGoal]) -> bool {
        let Some(lasting) = &mut self.goal_manager else {
            return false;
        };
        let is_unchanged = !closed.iter().any(OpenGoal::is_pursued)
            && lasting.goals.iter().any(OpenGoal::is_pursued)
            && lasting.idle_since.is_none();
        if is_unchanged && let Some(choosing) = &mut lasting.selection {
            for goal in closed {
                choosing.exclude(&goal.name);
            }
        }
        is_unchanged
    }

    pub(super) fn record_achieved(&mut self, goals: &[OpenGoal]) {
        for goal in goals {
            self.ports.recorder.record(&Entry::Goal {
                now: &self.now,
                name: &goal.name,
                change: GoalChange::Achieved,
            });
        }
    }
}
