//! Addition, release and abandonment of goals. A goal is queued until its release time: it is not
//! planned for, and closed only when it is abandoned or replaced. Goals to keep are queued while
//! they are [not pursued](super::kept_goals).

use elbowroom_num::Rational;

use super::Run;
use super::goal_selection::names_of;
use super::goals::OpenGoal;
use super::observations::Remark;
use crate::record::{Entry, GoalChange};

impl Run<'_> {
    /// Adds a goal, which replaces the goal of the same name. It is queued if its release time is
    /// in the future.
    pub(super) fn add_goal(&mut self, given: OpenGoal) -> Remark {
        self.retry_conflicting_goals();
        let Some(lasting) = &mut self.goal_manager else {
            return None;
        };
        let name = given.name.clone();
        lasting.queued.retain(|known| known.name != name);
        let index = lasting.goals.iter().position(|known| known.name == name);
        let release = given.terms.release.as_ref();
        // Goals to keep are evaluated afterwards.
        let is_queued = given.terms.keep || release.is_some_and(|it| *it > self.now);
        match index {
            Some(index) if is_queued => {
                lasting.goals.remove(index);
                lasting.queued.push(given);
                self.pursue_all();
                self.record_goal_change(format!("`{name}` is queued"), false);
            }
            Some(index) => {
                lasting.goals[index] = given;
                self.pursue_all();
                self.record_goal_change(format!("`{name}` is to be reached"), false);
            }
            None if is_queued => lasting.queued.push(given),
            None => {
                lasting.goals.push(given);
                self.add_open_goals(format!("`{name}` is to be reached"));
            }
        }
        None
    }

    /// Abandons the goal of this name.
    pub(super) fn abandon_goal(&mut self, name: &str) -> Remark {
        let Some(lasting) = &mut self.goal_manager else {
            return None;
        };
        let is_it = |known: &mut OpenGoal| known.name == name;
        if lasting.queued.extract_if(.., is_it).count() > 0 {
            self.retry_conflicting_goals();
            return None;
        }
        if lasting.goals.extract_if(.., is_it).count() == 0 {
            return Some("there is no open goal with this name");
        }
        self.retry_conflicting_goals();
        self.pursue_all();
        self.record_goal_change(format!("`{name}` is abandoned"), false);
        None
    }

    /// Returns the next coming release time of a queued goal.
    pub(super) fn next_release(&self) -> Option<Rational> {
        let queued = self.goal_manager.iter().flat_map(|it| &it.queued);
        let times = queued.filter_map(|goal| goal.terms.release.as_ref());
        times.filter(|it| **it > self.now).min().cloned()
    }

    /// Pursues the queued goals whose release times have come.
    pub(super) fn release_goals(&mut self) {
        let Some(lasting) = &mut self.goal_manager else {
            return;
        };
        let now = &self.now;
        let is_due = |goal: &mut OpenGoal| {
            !goal.terms.keep && goal.terms.release.as_ref().is_none_or(|it| it <= now)
        };
        let due: Vec<OpenGoal> = lasting.queued.extract_if(.., is_due).collect();
        let Some(names) = names_of(&due) else {
            return;
        };
        for goal in &due {
            self.ports.recorder.record(&Entry::Goal {
                now,
                name: &goal.name,
                change: GoalChange::Released,
            });
        }
        lasting.goals.extend(due);
        self.add_open_goals(format!("{names} is released"));
    }

    /// Pursues the goals that were added to the open ones, and queues goals to keep.
    fn add_open_goals(&mut self, what: String) {
        let is_replacing = self.queue_kept_goals();
        if is_replacing {
            self.pursue_all();
        } else {
            self.add_goals_to_selection();
        }
        self.record_goal_change(what, !is_replacing);
    }
}
