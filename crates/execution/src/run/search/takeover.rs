//! Switch to a finished plan.

use std::sync::Arc;

use elbowroom_model::TimeTriggeredPlan;
use elbowroom_num::Rational;

use super::super::beginning::Course;
use super::super::expectation::Expected;
use super::super::pending::Otherwise;
use super::super::{Run, Stop};
use super::fit::Begun;
use super::{Goes, Search, WORD};
use crate::executor::News;

impl Run<'_> {
    /// Switches to a plan if nothing was started since the plan was requested. If the situation is
    /// not as expected, the plan is fitted to the real one, if possible. Otherwise the events are
    /// reported to the executor, which decides whether the plan is still feasible.
    pub(super) fn take_over_from_nothing(
        &mut self,
        search: Search,
        plan: &TimeTriggeredPlan,
        may_fit: bool,
    ) -> Result<(), Stop> {
        let time = search.situation.time.clone();
        let (situation, running) = self.situation_at(time, search.guess);
        let is_as_expected = situation == search.situation && running == search.running;
        if !is_as_expected
            && may_fit
            && let Some(fit) = self.fitted(&search, plan)
        {
            if self.settings.readies_aside {
                // The fitted plan includes all events so far.
                self.news.clear();
                self.make_ready(search, fit, true);
                return Ok(());
            }
            let (fitted, situation, running) = fit;
            let course = Course::of(&fitted, &situation, &running);
            let (task, goals) = (Arc::clone(&search.task), search.goals.clone());
            let otherwise = Otherwise::AsMade(Box::new(search), plan.clone());
            self.await_preparation(&task, &goals, course, otherwise);
            return Ok(());
        }
        self.take_over_as_made(search, plan)
    }

    /// Switches to the plan as it was made.
    pub(in crate::run) fn take_over_as_made(
        &mut self,
        search: Search,
        plan: &TimeTriggeredPlan,
    ) -> Result<(), Stop> {
        let time = search.situation.time.clone();
        let (situation, running) = self.situation_at(time, search.guess);
        let is_as_expected = situation == search.situation && running == search.running;
        let is_known = |ticket| search.running.contains(&ticket);
        let knows_all = self.account.open_tickets().all(is_known);
        if !is_as_expected && (!knows_all || !search.expected.is_empty()) {
            // The plan continues actions that were never started, or does not contain all running
            // actions.
            return self.search_again(&search.reason);
        }
        if self.settings.readies_aside {
            let as_made = (
                plan.clone(),
                search.situation.clone(),
                search.running.clone(),
            );
            self.make_ready(search, as_made, false);
            return Ok(());
        }
        self.tell_what_happened();
        let course = Course::of(plan, &search.situation, &search.running);
        self.take_up_for(&search.task, &search.goals, course);
        Ok(())
    }

    /// Reports the events until now to the executor of the next plan, without the starts and ends
    /// of steps of other plans.
    pub(super) fn tell_what_happened(&mut self) {
        let mut surprises = std::mem::take(&mut self.news);
        surprises.retain(|it| !matches!(it, News::Started { .. } | News::Ended { .. }));
        self.agenda.push(super::Todo::Tell(surprises));
    }

    /// Switches to a finished plan when it is due, or prepares it. Returns `true` if the executor
    /// is not to be asked.
    pub(super) fn take_over_if_due(&mut self) -> Result<bool, Stop> {
        let Some(search) = &self.search else {
            return Ok(false);
        };
        let Some((plan, since)) = &search.plan else {
            return Ok(false);
        };
        let is_begun = |it: &Expected| self.account.ticket(it.step).is_some();
        // With background preparation, steps that have not begun are part of the prepared plan.
        let is_due = self.settings.readies_aside
            || self.now >= search.situation.time
            || search.expected.iter().all(is_begun);
        // A plan cannot include commanded actions whose start has not been reported.
        let is_told = |ticket| self.belief.running().contains_key(&ticket);
        let waits_for_word =
            !self.account.open_tickets().all(is_told) && self.now < since + Rational::from(WORD);
        if search.course != Goes::UnderWay && (!is_due || waits_for_word) {
            return Ok(false);
        }
        let fit = self.fitted(search, plan);
        let Some(search) = self.search.take() else {
            return Ok(false);
        };
        self.take_over_as(search, fit)?;
        Ok(true)
    }

    /// Switches to the fitted plan, or prepares it. Without a fit, the plan is outdated.
    fn take_over_as(&mut self, search: Search, fit: Option<Begun>) -> Result<(), Stop> {
        if let Some(fit) = fit {
            if self.settings.readies_aside {
                self.make_ready(search, fit, true);
                return Ok(());
            }
            let (plan, situation, running) = fit;
            let course = Course::of(&plan, &situation, &running);
            let (task, goals) = (Arc::clone(&search.task), search.goals.clone());
            let otherwise = if search.is_optional() {
                Otherwise::Continue(search.reason)
            } else {
                Otherwise::SearchAgain(Box::new(search))
            };
            self.await_preparation(&task, &goals, course, otherwise);
            return Ok(());
        }
        self.search_again(&search.reason)
    }
}
