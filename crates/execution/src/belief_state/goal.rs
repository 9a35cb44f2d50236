//! Forecast for the goal if no more actions are executed: [`GoalStatus`].

use elbowroom_model::Footprint;
use elbowroom_model::ground::Condition;
use elbowroom_num::Rational;

use super::BeliefState;

/// Forecast for the goal if no more actions are executed. The goal counts after all timed initials,
/// so it is not decided before the last one that changes a fact or fluent it reads.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum GoalStatus {
    /// The goal holds, and no coming timed initial affects it.
    Reached,
    /// The goal will hold at this time, after the last timed initial that affects it.
    Awaited(Rational),
    /// The goal will not hold, or cannot be evaluated.
    Unmet,
}

impl BeliefState {
    /// Returns the forecast for the goal if no more actions are executed and the running ones have
    /// no effect.
    pub(crate) fn goal_status(&self) -> GoalStatus {
        let (last, state) = self.final_state();
        if state.is_goal() != Ok(true) {
            return GoalStatus::Unmet;
        }
        last.map_or(GoalStatus::Reached, GoalStatus::Awaited)
    }

    /// Returns `true` if the goal holds at the end, but only by the assumptions about doubtful
    /// facts and values.
    pub(crate) fn is_goal_in_doubt(&self) -> bool {
        let is_in_doubt = !self.doubtful_facts().is_empty() || !self.doubtful_values().is_empty();
        if !is_in_doubt {
            return false;
        }
        let (_, state) = self.final_state();
        state.is_goal() != Ok(true) && state.holds(self.task.goal(), None) == Ok(true)
    }

    /// Returns the conjuncts of the goal that will not hold at the end, or cannot be evaluated.
    pub(crate) fn unmet_finally(&self) -> Vec<&Condition> {
        let goal = self.task.goal();
        let (_, state) = self.final_state();
        let mut parts = goal.conjuncts();
        parts.retain(|part| state.is_certain(part) != Ok(true));
        parts
    }

    /// Returns the state after the last coming timed initial that affects the goal, and its time.
    fn final_state(&self) -> (Option<Rational>, Self) {
        let goal = Footprint::of_condition(&self.task, self.task.goal());
        let to_come = self.task.timed().get(self.timed..).unwrap_or(&[]);
        let is_read = |changes: &Footprint| changes.writes_reads_of(&goal);
        let mut to_come = to_come.iter().rev();
        let last = to_come.find(|timed| is_read(&Footprint::of_timed(timed)));
        let last = last.map(|timed| timed.time.clone());
        let mut state = self.clone();
        if let Some(last) = &last {
            // A value that cannot be computed shows up as a goal that cannot be evaluated.
            let _ = state.advance(last);
        }
        (last, state)
    }
}
