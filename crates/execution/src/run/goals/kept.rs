//! Goals to keep: conditions that the executive achieves again whenever they do not hold.
//!
//! Such a goal is queued while its condition holds, and while other goals are pursued. If it does
//! not hold, and no other goal is open or the executive is idle because no plan reaches these, all
//! goals to keep are pursued together. So the plan preserves the ones that hold. If no plan reaches
//! all of them, some are selected as usual, and the others are queued with the reason until
//! something is observed or the goals change. So goals to keep that exclude each other are not
//! achieved alternately.

use elbowroom_num::Rational;

use super::open_goal::{OpenGoal, Wait};
use super::{GoalContext, GoalManager};
use crate::belief_state::BeliefState;
use crate::record::{Entry, GoalChange};

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

impl GoalManager<'_> {
    /// Returns `true` if there are released goals to keep that are not pursued now.
    pub(in crate::run) fn has_watched_goals(&self, now: &Rational) -> bool {
        let mut queued = self.queued.iter();
        queued.any(|goal| goal.is_watched(now))
    }

    /// Returns `true` if a goal to keep is queued because no plan reaches it with the others.
    pub(in crate::run) fn has_conflicting_goals(&self) -> bool {
        let mut queued = self.queued.iter();
        queued.any(|goal| goal.wait == Wait::Conflict)
    }

    /// Lets the goals to keep that excluded each other be tried again, because the situation or the
    /// goals have changed.
    pub(super) fn retry_conflicting_goals(&mut self) {
        let queued = self.queued.iter_mut();
        for goal in queued.filter(|goal| goal.wait == Wait::Conflict) {
            (goal.wait, goal.set_aside) = (Wait::Release, None);
        }
    }

    /// Evaluates the queued goals to keep. Pursues them if one does not hold and no other goal is
    /// pursued.
    pub(in crate::run) fn tend_kept_goals(&mut self, ctx: &mut GoalContext<'_>) {
        // A change of the goals ends the idle state.
        let is_idle = self.idle_since().is_some() && !self.is_change_pending();
        let is_free = is_idle || self.goals.iter().all(|goal| goal.terms.keep);
        let (now, belief) = (ctx.now, &ctx.belief);
        let is_violated = |goal: &OpenGoal| {
            goal.is_watched(now) && goal.wait != Wait::Conflict && !goal.holds(belief)
        };
        if is_free && self.queued.iter().any(is_violated) {
            self.pursue_kept_goals(ctx);
            return;
        }
        for goal in self.queued.iter_mut().filter(|it| it.is_watched(now)) {
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
            ctx.recorder.record(&Entry::Goal {
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
    pub(in crate::run) fn pursue_kept_goals(&mut self, ctx: &mut GoalContext<'_>) {
        let (now, belief) = (ctx.now, &ctx.belief);
        let is_watched = |goal: &mut OpenGoal| goal.is_watched(now);
        let opened: Vec<OpenGoal> = self.queued.extract_if(.., is_watched).collect();
        let violated = opened.iter().filter(|goal| !goal.holds(belief));
        let names: Vec<String> = violated.map(|goal| format!("`{}`", goal.name)).collect();
        for goal in &opened {
            ctx.recorder.record(&Entry::Goal {
                now,
                name: &goal.name,
                change: GoalChange::Pursued,
            });
        }
        let opened = opened.into_iter().map(OpenGoal::unevaluated);
        self.goals.extend(opened);
        self.pursue_all(ctx);
        self.record_change(
            ctx,
            format!("{} does not hold and is to be kept", names.join(", ")),
            false,
        );
    }

    /// Queues the pursued goals to keep, because another goal was added. Returns `true` if there
    /// are any.
    pub(super) fn queue_kept_goals(&mut self) -> bool {
        let is_kept = |goal: &mut OpenGoal| goal.terms.keep;
        let kept = self.goals.extract_if(.., is_kept);
        let kept: Vec<OpenGoal> = kept.map(OpenGoal::unevaluated).collect();
        let is_any = !kept.is_empty();
        self.queued.extend(kept);
        is_any
    }

    /// Queues the goals to keep that are set aside, with the reasons, because the pursued goals are
    /// achieved.
    pub(super) fn queue_conflicting_goals(&mut self, ctx: &mut GoalContext<'_>) {
        let is_conflicting = |goal: &mut OpenGoal| goal.terms.keep && !goal.is_pursued();
        for goal in self.goals.extract_if(.., is_conflicting) {
            ctx.recorder.record(&Entry::Goal {
                now: ctx.now,
                name: &goal.name,
                change: GoalChange::Queued {
                    why: goal.set_aside.as_deref().unwrap_or_default(),
                },
            });
            let (wait, is_announced) = (Wait::Conflict, false);
            self.queued.push(OpenGoal {
                is_announced,
                wait,
                ..goal
            });
        }
    }

    /// Queues the goals to keep among these, which are achieved. Returns the others.
    pub(super) fn keep_achieved(&mut self, achieved: Vec<OpenGoal>) -> Vec<OpenGoal> {
        let (kept, others): (Vec<_>, Vec<_>) = achieved.into_iter().partition(|it| it.terms.keep);
        // Before those that they exclude: of goals with equal values, the first one is selected.
        let kept = kept.into_iter().map(OpenGoal::unevaluated);
        self.queued.splice(0..0, kept);
        others
    }
}
