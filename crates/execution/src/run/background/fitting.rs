//! Fitting of a finished plan from the expected situation to the real one.

use std::collections::BTreeSet;

use elbowroom_model::{Step, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::BackgroundSearch;
use crate::event::ActionHandle;
use crate::executor::StepId;
use crate::run::action_log::ActionLog;
use crate::run::situation::{OverrunEstimate, StartedPlan, remaining_plan_of};
use crate::run::view::{ExpectedStart, RunView};

impl BackgroundSearch {
    /// Returns the ticket of a step of the earlier plan.
    fn ticket_in_earlier_plan(&self, log: &ActionLog, step: StepId) -> Option<ActionHandle> {
        let left_behind = self.abandoned_steps().get(&step).copied();
        left_behind.or_else(|| log.ticket(step))
    }

    /// Returns the plan from the present situation: without the executed steps, and shifted by its
    /// delay.
    pub(in crate::run) fn fit_to_present(
        &self,
        plan: &TimeTriggeredPlan,
        view: &RunView<'_>,
    ) -> Option<StartedPlan> {
        let query = self.query();
        let start = &query.start;
        let first = start.expected.first().map(|it| it.ticket);
        let mut done = BTreeSet::new();
        let mut left: Vec<Step> = Vec::new();
        // Actions that were expected to be running, and are not.
        for (ticket, step) in start.running.iter().zip(&plan.steps) {
            let is_expected = first.is_some_and(|first| *ticket >= first);
            let expected = start.expected.iter().find(|it| it.ticket == *ticket);
            match (is_expected, expected) {
                (true, Some(it)) => match self.ticket_in_earlier_plan(view.log, it.step) {
                    Some(real) => {
                        done.insert(real);
                    }
                    None => left.push(it.as_step(step.duration.clone())),
                },
                _ => {
                    done.insert(*ticket);
                }
            }
        }
        // Actions that were expected to have ended.
        let is_over = |it: &&ExpectedStart| !start.running.contains(&it.ticket);
        for it in start.expected.iter().filter(is_over) {
            match self.ticket_in_earlier_plan(view.log, it.step) {
                Some(real) => {
                    done.insert(real);
                }
                None => left.push(it.as_step(it.duration.clone())),
            }
        }
        // Other actions that were started may also be steps of the plan.
        let before = self.abandoned_steps().values();
        let before = before.filter_map(|it| Some((*it, view.log.get(*it)?)));
        let besides = view.log.plan_starts().chain(before);
        let mut besides: Vec<(ActionHandle, String)> = besides
            .filter(|(ticket, it)| it.commanded >= query.since && !done.contains(ticket))
            .map(|(ticket, it)| (ticket, it.action.name.clone()))
            .collect();
        for step in Step::by_start(plan.new_steps(&start.situation)) {
            let same = besides.iter().position(|(_, it)| *it == step.action.name);
            match same {
                Some(index) => drop(besides.remove(index)),
                None => left.push(step.clone()),
            }
        }
        if !view.are_all_starts_reported() {
            return None;
        }
        let (situation, running) = view.situation(&Rational::ZERO, OverrunEstimate::QuarterLonger);
        if let Some(rest) = remaining_plan_of(&query.task, &situation, left.clone()) {
            return Some((rest, situation, running));
        }
        // The plan may wait for actions that take longer than expected.
        let ends = situation.running.iter();
        let ends = ends.filter_map(|it| Some(&it.start + it.duration.lower.value()?));
        let late = ends.max()? - &start.situation.time + view.task.epsilon();
        if !late.is_positive() {
            return None;
        }
        for step in &mut left {
            step.start = &step.start + &late;
        }
        let rest = remaining_plan_of(&query.task, &situation, left)?;
        Some((rest, situation, running))
    }
}
