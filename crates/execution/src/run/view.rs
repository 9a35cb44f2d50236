//! Queries about the present state of a run: the situation, the forecast, time-outs and slack.

mod prediction;
mod slack;
mod timeouts;

use std::collections::BTreeSet;
use std::sync::Arc;

use elbowroom_model::{Situation, Step, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::action_log::ActionLog;
use super::settings::RunSettings;
use super::situation::{OverrunEstimate, StartedPlan, remaining_plan_of, situation_at};
use crate::belief_state::BeliefState;
use crate::event::ActionHandle;
use crate::executor::Executor;

pub(super) use prediction::{
    ExpectedStart, LateActionAssumption, PredictedState, PredictionHorizon, punctuality_tolerance,
};
pub(super) use slack::LateAction;
pub(super) use timeouts::ActionTimeout;

/// Read-only view of a run.
#[derive(Clone, Copy)]
pub(super) struct RunView<'r> {
    pub(super) task: &'r Arc<Task>,
    pub(super) settings: &'r RunSettings,
    pub(super) now: &'r Rational,
    pub(super) belief: &'r BeliefState,
    pub(super) log: &'r ActionLog,
    pub(super) executor: &'r dyn Executor,
    pub(super) expected_planning_time: &'r Rational,
    /// `true` if the goals are not, or no longer, those of the problem.
    pub(super) have_goals_changed: bool,
}

impl RunView<'_> {
    pub(super) fn are_all_starts_reported(&self) -> bool {
        let is_reported = |ticket| self.belief.running().contains_key(&ticket);
        self.log.open_tickets().all(is_reported)
    }

    /// Returns the actions that no plan can continue: those that have not started, and those whose
    /// over-all condition fails.
    pub(super) fn actions_that_cannot_continue(&self) -> Vec<ActionHandle> {
        let breaking = self.belief.failing_actions().into_iter();
        let breaking: BTreeSet<ActionHandle> = breaking.map(|(ticket, _)| ticket).collect();
        let is_lost = |ticket: &ActionHandle| match self.belief.running().get(ticket) {
            Some(underway) => {
                breaking.contains(ticket) || !underway.violated_conjuncts().is_empty()
            }
            None => true,
        };
        self.log.open_tickets().filter(is_lost).collect()
    }

    /// Returns the situation when the new plan can start: after the expected planning time, and ε
    /// after the last event before that.
    pub(super) fn situation(
        &self,
        allowance: &Rational,
        guess: OverrunEstimate,
    ) -> (Situation, Vec<ActionHandle>) {
        let epsilon = self.task.epsilon();
        let mut time = self.now + allowance;
        // With other goals, the problem is a different one, and is written again for planners that
        // read files.
        if self.now.is_positive() || self.log.started() > 0 || self.have_goals_changed {
            time += epsilon;
        }
        if time.is_zero() {
            return (Situation::initial(self.task), Vec::new());
        }
        self.situation_at(time, guess)
    }

    pub(super) fn situation_after_planning(
        &self,
        guess: OverrunEstimate,
    ) -> (Situation, Vec<ActionHandle>) {
        self.situation(self.expected_planning_time, guess)
    }

    /// Returns the situation at this time, or ε after the timed initials that come just before it.
    pub(super) fn situation_at(
        &self,
        time: Rational,
        guess: OverrunEstimate,
    ) -> (Situation, Vec<ActionHandle>) {
        if guess != OverrunEstimate::Cancelled {
            return situation_at(self.belief, time, guess);
        }
        let mut belief = self.belief.clone();
        for ticket in self.overdue() {
            belief.stop(ticket);
        }
        situation_at(&belief, time, guess)
    }

    /// Returns the remaining plan, started as soon as possible, if it reaches the goal. Running
    /// actions end as expected, and the remaining steps keep their planned distances.
    pub(super) fn remaining_plan(&self, plan: &TimeTriggeredPlan) -> Option<StartedPlan> {
        if !self.are_all_starts_reported() {
            return None;
        }
        let mut left: Vec<Step> = plan.steps.clone();
        for (_, started) in self.log.plan_starts() {
            let name = &started.action.name;
            let same = left
                .iter()
                .enumerate()
                .filter(|(_, it)| it.action.name == *name);
            let first = same.min_by(|(_, one), (_, other)| one.start.cmp(&other.start));
            let index = first.map(|(index, _)| index)?;
            left.remove(index);
        }
        let (situation, running) = self.situation(&Rational::ZERO, OverrunEstimate::QuarterLonger);
        let rest = remaining_plan_of(self.task, &situation, left)?;
        Some((rest, situation, running))
    }
}
