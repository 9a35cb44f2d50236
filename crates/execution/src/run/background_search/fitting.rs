//! Fitting of a finished plan from the expected situation to the real one.

use std::collections::BTreeSet;

use elbowroom_model::{Situation, Step, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::super::Run;
use super::super::prediction::ExpectedStart;
use super::super::situation::{OverrunEstimate, remaining_plan_of};
use super::BackgroundSearch;
use crate::event::ActionHandle;
use crate::executor::StepId;

/// A plan, its initial situation, and the tickets of the actions that are running there.
pub(in crate::run) type StartedPlan = (TimeTriggeredPlan, Situation, Vec<ActionHandle>);

impl Run<'_> {
    /// Returns the ticket of a step of the earlier plan.
    fn ticket_in_earlier_plan(
        &self,
        search: &BackgroundSearch,
        step: StepId,
    ) -> Option<ActionHandle> {
        let left_behind = search.abandoned_steps.get(&step).copied();
        left_behind.or_else(|| self.action_log.ticket(step))
    }

    /// Returns the plan from the present situation: without the executed steps, and shifted by its
    /// delay.
    pub(super) fn fit_to_present(
        &self,
        search: &BackgroundSearch,
        plan: &TimeTriggeredPlan,
    ) -> Option<StartedPlan> {
        let first = search.expected.first().map(|it| it.ticket);
        let mut done = BTreeSet::new();
        let mut left: Vec<Step> = Vec::new();
        // Actions that were expected to be running, and are not.
        for (ticket, step) in search.running.iter().zip(&plan.steps) {
            let is_expected = first.is_some_and(|first| *ticket >= first);
            let expected = search.expected.iter().find(|it| it.ticket == *ticket);
            match (is_expected, expected) {
                (true, Some(it)) => match self.ticket_in_earlier_plan(search, it.step) {
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
        let is_over = |it: &&ExpectedStart| !search.running.contains(&it.ticket);
        for it in search.expected.iter().filter(is_over) {
            match self.ticket_in_earlier_plan(search, it.step) {
                Some(real) => {
                    done.insert(real);
                }
                None => left.push(it.as_step(it.duration.clone())),
            }
        }
        // Other actions that were started may also be steps of the plan.
        let before = search.abandoned_steps.values();
        let before = before.filter_map(|it| Some((*it, self.action_log.get(*it)?)));
        let besides = self.action_log.plan_starts().chain(before);
        let mut besides: Vec<(ActionHandle, String)> = besides
            .filter(|(ticket, it)| it.commanded >= search.since && !done.contains(ticket))
            .map(|(ticket, it)| (ticket, it.action.name.clone()))
            .collect();
        for step in Step::by_start(plan.new_steps(&search.situation)) {
            let same = besides.iter().position(|(_, it)| *it == step.action.name);
            match same {
                Some(index) => drop(besides.remove(index)),
                None => left.push(step.clone()),
            }
        }
        let open = self.action_log.open_tickets();
        let is_told = |ticket: ActionHandle| self.belief.running().contains_key(&ticket);
        if !open.into_iter().all(is_told) {
            return None;
        }
        let (situation, running) = self.situation(&Rational::ZERO, OverrunEstimate::QuarterLonger);
        if let Some(rest) = remaining_plan_of(&search.task, &situation, left.clone()) {
            return Some((rest, situation, running));
        }
        // The plan may wait for actions that take longer than expected.
        let ends = situation.running.iter();
        let ends = ends.filter_map(|it| Some(&it.start + it.duration.lower.value()?));
        let late = ends.max()? - &search.situation.time + self.task.epsilon();
        if !late.is_positive() {
            return None;
        }
        for step in &mut left {
            step.start = &step.start + &late;
        }
        let rest = remaining_plan_of(&search.task, &situation, left)?;
        Some((rest, situation, running))
    }
}
