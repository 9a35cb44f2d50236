//! Where a proof begins: a task's own beginning, or a situation in the middle of its execution.

use elbowroom_model::{RunningAction, Situation, Task, TimedHappening};
use elbowroom_num::Rational;

/// See the module.
#[derive(Clone, Debug)]
pub(super) struct Beginning {
    /// Nothing happens earlier.
    pub(super) now: Rational,
    /// The timed initials that are to come.
    pub(super) timed: Vec<TimedHappening>,
    /// The actions under way.
    pub(super) running: Vec<RunningAction>,
}

impl Beginning {
    /// The beginning, and the task with what is true there as its initial state.
    pub(super) fn of(task: &Task, situation: &Situation) -> (Self, Task) {
        // Timed initials of time 0 are to come in the beginning.
        let is_own = *situation == Situation::initial(task);
        let timed = task.timed().iter();
        let to_come = timed.filter(|timed| is_own || timed.time > situation.time);
        let beginning = Self {
            now: situation.time.clone(),
            timed: to_come.cloned().collect(),
            running: situation.running.clone(),
        };
        let begun = if is_own {
            task.with_own_table()
        } else {
            task.beginning_at(situation).with_own_table()
        };
        (beginning, begun)
    }
}

/// The durations that a running action may still turn out to have.
pub(super) fn lasting(running: &RunningAction, now: &Rational) -> (Rational, Option<Rational>) {
    let passed = now - &running.start;
    let least = running.duration.lower.value().cloned();
    let least = Rational::max(least.unwrap_or_default(), passed);
    (least, running.duration.upper.value().cloned())
}
