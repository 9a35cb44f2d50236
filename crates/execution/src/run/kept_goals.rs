//! Goals to keep: conditions that the executive achieves again whenever they do not hold.
//!
//! Such a goal is queued while its condition holds, and while other goals are pursued. If it does
//! not hold, and no other goal is open or the executive is idle because no plan reaches these, all
//! goals to keep are pursued together. So the plan preserves the ones that hold. If no plan reaches
//! all of them, some are selected as usual, and the others are queued with the reason until
//! something is observed or the goals change. So goals to keep that exclude each other are not
//! achieved alternately.

use elbowroom_num::Rational;

use super::goals::OpenGoal;
use super::{BeliefState, Run};
use crate::record::{Entry, GoalChange};

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

/// Reason for which a goal to keep is queued although it does not hold.
const OTHERS: &str = "it does not hold, but other goals are pursued first";

impl OpenGoal {
    /// Returns `true` if it is to be kept, and is released.
    fn is_watched(&self, now: &Rational) -> bool {
        self.terms.keep && self.terms.release.as_ref().is_none_or(|it| it <= now)
    }

    fn holds(&self, belief: &BeliefState) -> bool {
        belief.is_certain(&self.ground) == Ok(true)
    }

    /// Returns the goal without the results of its last evaluation and selection.
    fn unevaluated(self) -> Self {
        Self {
            wait: Wait::Release,
            set_aside: None,
            is_announced: false,
            ..self
        }
    }
}

impl Run<'_> {
    /// Returns `true` if there are released goals to keep that are not pursued now.
    pub(super) fn has_watched_goals(&self) -> bool {
        let mut queued = self.goal_manager.iter().flat_map(|it| &it.queued);
        queued.any(|goal| goal.is_watched(&self.now))
    }

    /// Returns `true` if a goal to keep is queued because no plan reaches it with the others.
    pub(super) fn has_conflicting_goals(&self) -> bool {
        let mut queued = self.goal_manager.iter().flat_map(|it| &it.queued);
        queued.any(|goal| goal.wait == Wait::Conflict)
    }

    /// Lets the goals to keep that excluded each other be tried again, because the situation or the
    /// goals have changed.
    pub(super) fn retry_conflicting_goals(&mut self) {
        let queued = self.goal_manager.iter_mut().flat_map(|it| &mut it.queued);
        for goal in queued.filter(|goal| goal.wait == Wait::Conflict) {
            (goal.wait, goal.set_aside) = (Wait::Release, None);
        }
    }

    /// Evaluates the queued goals to keep. Pursues them if one does not hold and no other goal is
    /// pursued.
    pub(super) fn tend_kept_goals(&mut self) {
        // A change of the goals ends the idle state.
        let is_idle = self.idle_since_and_proof().is_some() && !self.is_goal_change_pending();
        let Some(lasting) = &mut self.goal_manager else {
            return;
        };
        let is_free = is_idle || lasting.goals.iter().all(|goal| goal.terms.keep);
        let (now, belief) = (&self.now, &self.belief);
        let is_violated = |goal: &OpenGoal| {
            goal.is_watched(now) && goal.wait != Wait::Conflict && !goal.holds(belief)
        };
        if is_free && lasting.queued.iter().any(is_violated) {
            self.pursue_kept_goals();
            return;
        }
        for goal in lasting.queued.iter_mut().filter(|it| it.is_watched(now)) {
            let wait = if goal.holds(belief) {
                Wait::Holds
            } else if goal.wait == Wait::Conflict {
                Wait::Conflict
            } else {
                Wait::Others
            };
            if std::mem::replace(&mut goal.wait, wait) == wait {
                continue;
            }
            goal.set_aside = None;
            self.ports.recorder.record(&Entry::Goal {
                now,
                name: &goal.name,
                change: match wait {
                    Wait::Holds => GoalChange::Kept,
                    _ => GoalChange::Queued { why: OTHERS },
                },
            });
        }
    }

    /// Pursues all goals to keep, including those that hold.
    pub(super) fn pursue_kept_goals(&mut self) {
        let Some(lasting) = &mut self.goal_manager else {
            return;
        };
        let (now, belief) = (&self.now, &self.belief);
        let is_watched = |goal: &mut OpenGoal| goal.is_watched(now);
        let opened: Vec<OpenGoal> = lasting.queued.extract_if(.., is_watched).collect();
        let violated = opened.iter().filter(|goal| !goal.holds(belief));
        let names: Vec<String> = violated.map(|goal| format!("`{}`", goal.name)).collect();
        for goal in &opened {
            self.ports.recorder.record(&Entry::Goal {
                now,
                name: &goal.name,
                change: GoalChange::Pursued,
            });
        }
        let opened = opened.into_iter().map(OpenGoal::unevaluated);
        lasting.goals.extend(opened);
        self.pursue_all();
        self.record_goal_change(
            format!("{} does not hold and is to be kept", names.join(", ")),
            false,
        );
    }

    /// Queues the pursued goals to keep, because another goal was added. Returns `true` if there
    /// are any.
    pub(super) fn queue_kept_goals(&mut self) -> bool {
        let Some(lasting) = &mut self.goal_manager else {
            return false;
        };
        let is_kept = |goal: &mut OpenGoal| goal.terms.keep;
        let kept = lasting.goals.extract_if(.., is_kept);
        let kept: Vec<OpenGoal> = kept.map(OpenGoal::unevaluated).collect();
        let is_any = !kept.is_empty();
        lasting.queued.extend(kept);
        is_any
    }

    /// Queues the goals to keep that are set aside, with the reasons, because the pursued goals are
    /// achieved.
    pub(super) fn queue_conflicting_goals(&mut self) {
        let Some(lasting) = &mut self.goal_manager else {
            return;
        };
        let is_conflicting = |goal: &mut OpenGoal| goal.terms.keep && !goal.is_pursued();
        for goal in lasting.goals.extract_if(.., is_conflicting) {
            self.ports.recorder.record(&Entry::Goal {
                now: &self.now,
                name: &goal.name,
                change: GoalChange::Queued {
                    why: goal.set_aside.as_deref().unwrap_or_default(),
                },
            });
            let (wait, is_announced) = (Wait::Conflict, false);
            lasting.queued.push(OpenGoal {
                is_announced,
                wait,
                ..goal
            });
        }
    }

    /// Queues the goals to keep among these, which are achieved. Returns the others.
    pub(super) fn keep_achieved(&mut self, achieved: Vec<OpenGoal>) -> Vec<OpenGoal> {
        let (kept, others): (Vec<_>, Vec<_>) = achieved.into_iter().partition(|it| it.terms.keep);
        if let Some(lasting) = &mut self.goal_manager {
            // Before those that they exclude: of goals with equal values, the first one is selected.
            let kept = kept.into_iter().map(OpenGoal::unevaluated);
            lasting.queued.splice(0..0, kept);
        }
        others
    }
}
