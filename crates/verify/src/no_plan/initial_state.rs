//! Initial state of a proof: the task's own, or a situation during its execution.

use elbowroom_model::{RunningAction, Situation, Task, TimedHappening};
use elbowroom_num::Rational;

/// Initial time, pending timed initials and running actions.
#[derive(Clone, Debug)]
pub(super) struct InitialState {
    /// Initial time.
    pub(super) now: Rational,
    /// Pending timed initials.
    pub(super) timed: Vec<TimedHappening>,
    /// Running actions.
    pub(super) running: Vec<RunningAction>,
}

impl InitialState {
    /// Returns the beginning, and the task with the facts that are true there as its initial state.
    pub(super) fn of(task: &Task, situation: &Situation) -> (Self, Task) {
        // Timed initials at time 0 are still pending in the task's own initial situation.
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
            task.starting_from(situation).with_own_table()
        };
        (beginning, begun)
    }
}

/// Returns the least and the greatest duration that are still possible for a running action.
pub(super) fn lasting(running: &RunningAction, now: &Rational) -> (Rational, Option<Rational>) {
    let passed = now - &running.start;
    let least = running.duration.lower.value().cloned();
    let least = Rational::max(least.unwrap_or_default(), passed);
    (least, running.duration.upper.value().cloned())
}
