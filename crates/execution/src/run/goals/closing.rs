//! Closing of goals that are achieved, or whose deadlines have passed.

use std::collections::BTreeSet;

use elbowroom_num::Rational;

use super::goal_selection::names_of;
use super::open_goal::OpenGoal;
use super::{GoalContext, GoalManager};
use crate::record::{Entry, GoalChange};

impl GoalManager<'_> {
    /// Closes the goals that are achieved while others are still pursued.
    pub(in crate::run) fn close_achieved_goals(&mut self, ctx: &mut GoalContext<'_>) {
        if self.goals.len() < 2 {
            return;
        }
        let belief = &ctx.belief;
        // Goals to keep have to hold together in the end.
        let is_achieved =
            |goal: &OpenGoal| !goal.terms.keep && belief.is_certain(&goal.ground) == Ok(true);
        let is_left = |goal: &OpenGoal| goal.is_pursued() && !is_achieved(goal);
        if !self.goals.iter().any(is_left) || !self.goals.iter().any(is_achieved) {
            return;
        }
        let (achieved, left): (Vec<_>, Vec<_>) = self.goals.drain(..).partition(is_achieved);
        self.goals = left;
        self.continue_without(ctx, &achieved);
    }

    /// Continues with the other goals after these were achieved.
    fn continue_without(&mut self, ctx: &mut GoalContext<'_>, achieved: &[OpenGoal]) {
        self.has_closed_goals = ctx.is_searching;
        Self::record_achieved(ctx, achieved);
        self.set_goal(ctx);
        if !ctx.is_searching && self.is_selecting_goals() {
            // Without the closed goals, more sets may have a plan.
            self.restart_selection(ctx, false);
        }
    }

    /// Returns the next coming deadline of an open goal.
    pub(in crate::run) fn next_deadline(&self, now: &Rational) -> Option<Rational> {
        let goals = self.goals.iter();
        let deadlines = goals.filter_map(|goal| goal.terms.deadline.as_ref());
        deadlines.filter(|it| *it > now).min().cloned()
    }

    /// Closes the goals whose deadlines are before this time, in their order. All events up to the
    /// deadlines must be known.
    pub(in crate::run) fn close_goals_due_before(
        &mut self,
        ctx: &mut GoalContext<'_>,
        time: &Rational,
    ) {
        let goals = self.goals.iter();
        let deadlines = goals.filter_map(|goal| goal.terms.deadline.clone());
        let due: BTreeSet<Rational> = deadlines.filter(|it| it < time).collect();
        for deadline in due {
            let _ = ctx.belief.advance(&deadline);
            self.close_goals_due(ctx, &deadline);
        }
    }

    /// Closes achieved goals with deadlines, because they need not stay true, and goals whose
    /// deadlines are now.
    pub(in crate::run) fn close_momentary_goals(&mut self, ctx: &mut GoalContext<'_>) {
        let belief = &ctx.belief;
        let is_achieved = |goal: &mut OpenGoal| {
            goal.terms.deadline.is_some() && belief.is_certain(&goal.ground) == Ok(true)
        };
        let achieved: Vec<OpenGoal> = self.goals.extract_if(.., is_achieved).collect();
        let is_any_left = self.goals.iter().any(OpenGoal::is_pursued);
        match names_of(&achieved) {
            Some(_) if is_any_left => self.continue_without(ctx, &achieved),
            Some(names) => {
                Self::record_achieved(ctx, &achieved);
                self.pursue_all(ctx);
                self.record_change(ctx, format!("{names} is reached"), false);
            }
            None => {}
        }
        self.close_goals_due(ctx, ctx.now);
    }

    /// Closes the goals with deadlines up to this time. The others are pursued without them.
    fn close_goals_due(&mut self, ctx: &mut GoalContext<'_>, time: &Rational) {
        let is_due =
            |goal: &mut OpenGoal| goal.terms.deadline.as_ref().is_some_and(|it| it <= time);
        let due: Vec<OpenGoal> = self.goals.extract_if(.., is_due).collect();
        // A goal may have been achieved exactly at its deadline.
        let is_achieved = |goal: &OpenGoal| ctx.belief.is_certain(&goal.ground) == Ok(true);
        let (achieved, late): (Vec<_>, Vec<_>) = due.into_iter().partition(is_achieved);
        Self::record_achieved(ctx, &achieved);
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
            ctx.recorder.record(&Entry::Goal {
                now: ctx.now,
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
        self.pursue_all(ctx);
        self.record_change(ctx, words, false);
    }

    /// Returns `true` if these closed goals were set aside, and others are pursued: their plan, or the search for it,
    /// continues. The closed goals are not tried any more.
    fn are_set_aside_while_others_are_pursued(&mut self, closed: &[OpenGoal]) -> bool {
        let is_unchanged = !closed.iter().any(OpenGoal::is_pursued)
            && self.goals.iter().any(OpenGoal::is_pursued)
            && self.idle_since.is_none();
        if is_unchanged && let Some(choosing) = &mut self.selection {
            for goal in closed {
                choosing.exclude(&goal.name);
            }
        }
        is_unchanged
    }

    pub(super) fn record_achieved(ctx: &mut GoalContext<'_>, goals: &[OpenGoal]) {
        for goal in goals {
            ctx.recorder.record(&Entry::Goal {
                now: ctx.now,
                name: &goal.name,
                change: GoalChange::Achieved,
            });
        }
    }
}
