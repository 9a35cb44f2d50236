//! Fitting of a finished plan from the expected situation to the real one.

use std::collections::BTreeSet;

use elbowroom_model::{Situation, Step, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::super::Run;
use super::super::expectation::Expected;
use super::super::here::{Guess, rest_of};
use super::Search;
use crate::event::Ticket;
use crate::executor::StepId;

/// A plan, its initial situation, and the tickets of the actions that are running there.
pub(in crate::run) type Begun = (TimeTriggeredPlan, Situation, Vec<Ticket>);

impl Run<'_> {
    /// Returns the ticket of a step of the earlier plan.
    fn start_of(&self, search: &Search, step: StepId) -> Option<Ticket> {
        let left_behind = search.left_behind.get(&step).copied();
        left_behind.or_else(|| self.account.ticket(step))
    }

    /// Returns the plan from the present situation: without the executed steps, and shifted by its
    /// delay.
    pub(super) fn fitted(&self, search: &Search, plan: &TimeTriggeredPlan) -> Option<Begun> {
        let first = search.expected.first().map(|it| it.ticket);
        let mut done = BTreeSet::new();
        let mut left: Vec<Step> = Vec::new();
        // Actions that were expected to be running, and are not.
        for (ticket, step) in search.running.iter().zip(&plan.steps) {
            let is_expected = first.is_some_and(|first| *ticket >= first);
            let expected = search.expected.iter().find(|it| it.ticket == *ticket);
            match (is_expected, expected) {
                (true, Some(it)) => match self.start_of(search, it.step) {
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
        let is_over = |it: &&Expected| !search.running.contains(&it.ticket);
        for it in search.expected.iter().filter(is_over) {
            match self.start_of(search, it.step) {
                Some(real) => {
                    done.insert(real);
                }
                None => left.push(it.as_step(it.duration.clone())),
            }
        }
        // Other actions that were started may also be steps of the plan.
        let before = search.left_behind.values();
        let before = before.filter_map(|it| Some((*it, self.account.get(*it)?)));
        let besides = self.account.of_plan().chain(before);
        let mut besides: Vec<(Ticket, String)> = besides
            .filter(|(ticket, it)| it.ordered >= search.since && !done.contains(ticket))
            .map(|(ticket, it)| (ticket, it.action.name.clone()))
            .collect();
        for step in Step::by_start(plan.new_steps(&search.situation)) {
            let same = besides.iter().position(|(_, it)| *it == step.action.name);
            match same {
                Some(index) => drop(besides.remove(index)),
                None => left.push(step.clone()),
            }
        }
        let open = self.account.open_tickets();
        let is_told = |ticket: Ticket| self.belief.running().contains_key(&ticket);
        if !open.into_iter().all(is_told) {
            return None;
        }
        let (situation, running) = self.situation(&Rational::ZERO, Guess::AQuarterLonger);
        if let Some(rest) = rest_of(&search.task, &situation, left.clone()) {
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
        let rest = rest_of(&search.task, &situation, left)?;
        Some((rest, situation, running))
    }
}
