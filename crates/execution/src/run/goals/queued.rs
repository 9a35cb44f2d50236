//! Addition, release and abandonment of goals. A goal is queued until its release time: it is not
//! planned for, and closed only when it is abandoned or replaced. Goals to keep are queued while
//! they are [not pursued](super::kept_goals).

use elbowroom_num::Rational;

use super::goal_selection::names_of;
use super::open_goal::OpenGoal;
use super::{GoalContext, GoalManager, Objection};
use crate::record::{Entry, GoalChange};

impl GoalManager<'_> {
    /// Adds a goal, which replaces the goal of the same name. It is queued if its release time is
    /// in the future.
    pub(super) fn add_goal(&mut self, ctx: &mut GoalContext<'_>, given: OpenGoal) -> Objection {
        self.retry_conflicting_goals();
        let name = given.name.clone();
        self.queued.retain(|known| known.name != name);
        let index = self.goals.iter().position(|known| known.name == name);
        let release = given.terms.release.as_ref();
        // Goals to keep are evaluated afterwards.
        let is_queued = given.terms.keep || release.is_some_and(|it| it > ctx.now);
        match index {
            Some(index) if is_queued => {
                self.goals.remove(index);
                self.queued.push(given);
                self.pursue_all(ctx);
                self.record_change(ctx, format!("`{name}` is queued"), false);
            }
            Some(index) => {
                self.goals[index] = given;
                self.pursue_all(ctx);
                self.record_change(ctx, format!("`{name}` is to be reached"), false);
            }
            None if is_queued => self.queued.push(given),
            None => {
                self.goals.push(given);
                self.add_open_goals(ctx, format!("`{name}` is to be reached"));
            }
        }
        None
    }

    /// Abandons the goal of this name.
    pub(super) fn abandon_goal(&mut self, ctx: &mut GoalContext<'_>, name: &str) -> Objection {
        let is_it = |known: &mut OpenGoal| known.name == name;
        if self.queued.extract_if(.., is_it).count() > 0 {
            self.retry_conflicting_goals();
            return None;
        }
        if self.goals.extract_if(.., is_it).count() == 0 {
            return Some("there is no open goal with this name");
        }
        self.retry_conflicting_goals();
        self.pursue_all(ctx);
        self.record_change(ctx, format!("`{name}` is abandoned"), false);
        None
    }

    /// Returns the next coming release time of a queued goal.
    pub(in crate::run) fn next_release(&self, now: &Rational) -> Option<Rational> {
        let queued = self.queued.iter();
        let times = queued.filter_map(|goal| goal.terms.release.as_ref());
        times.filter(|it| *it > now).min().cloned()
    }

    /// Pursues the queued goals whose release times have come.
    pub(in crate::run) fn release_goals(&mut self, ctx: &mut GoalContext<'_>) {
        let now = ctx.now;
        let is_due = |goal: &mut OpenGoal| {
            !goal.terms.keep && goal.terms.release.as_ref().is_none_or(|it| it <= now)
        };
        let due: Vec<OpenGoal> = self.queued.extract_if(.., is_due).collect();
        let Some(names) = names_of(&due) else {
            return;
        };
        for goal in &due {
            ctx.recorder.record(&Entry::Goal {
                now,
                name: &goal.name,
                change: GoalChange::Released,
            });
        }
        self.goals.extend(due);
        self.add_open_goals(ctx, format!("{names} is released"));
    }

    /// Pursues the goals that were added to the open ones, and queues goals to keep.
    fn add_open_goals(&mut self, ctx: &mut GoalContext<'_>, what: String) {
        let is_replacing = self.queue_kept_goals();
        if is_replacing {
            self.pursue_all(ctx);
        } else {
            self.add_goals_to_selection(ctx);
        }
        self.record_change(ctx, what, !is_replacing);
    }
}
