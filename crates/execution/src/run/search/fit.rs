//! Where the present plan leads, and whether a plan that was made for that works from where it did.

use std::collections::BTreeSet;
use std::sync::Arc;

use elbowroom_model::ground::Action;
use elbowroom_model::{Situation, Step, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::super::Run;
use super::super::here::{Guess, rest_of, situation_at};
use super::Search;
use crate::event::Ticket;
use crate::executor::StepId;
use crate::progression::Progression;

/// A start that the present plan is expected to make.
#[derive(Clone, Debug)]
pub(super) struct Expected {
    /// By which it is known in the situation that is expected.
    ticket: Ticket,
    pub(super) step: StepId,
    action: Arc<Action>,
    start: Rational,
    duration: Option<Rational>,
}

/// Where a plan is to begin.
pub(super) struct Fit {
    pub(super) situation: Situation,
    pub(super) running: Vec<Ticket>,
    pub(super) expected: Vec<Expected>,
}

/// A plan, from where it begins, with the tickets of what is running there.
pub(in crate::run) type Begun = (TimeTriggeredPlan, Situation, Vec<Ticket>);

/// What is expected to happen.
enum Happening {
    Start(usize),
    End(Ticket),
}

impl Run<'_> {
    /// Where the present plan will have led when planning is expected to be over, or at `until`:
    /// each step starts as planned, or as soon as the executor can, and what is under way and not late
    /// ends as planned.
    pub(super) fn where_the_plan_leads(&self, until: Option<&Rational>) -> Fit {
        let epsilon = self.task.epsilon();
        let expected_to_be_over = &self.now + &self.allowance + epsilon;
        let time = until.cloned().unwrap_or(expected_to_be_over);
        let mut expected: Vec<Expected> = self.to_come();
        expected.retain(|it| &it.start + epsilon < time);
        expected.sort_by(|one, other| one.start.cmp(&other.start));
        for (ticket, it) in (self.account.started() as u64..).zip(&mut expected) {
            it.ticket = Ticket(ticket);
        }
        let mut belief = self.belief.clone();
        let mut coming: Vec<(Rational, Happening)> = Vec::new();
        for (ticket, underway) in belief.running() {
            let end = &underway.start + &underway.planned;
            if end > self.now {
                coming.push((end, Happening::End(*ticket)));
            }
        }
        for (index, it) in expected.iter().enumerate() {
            coming.push((it.start.clone(), Happening::Start(index)));
            if let Some(duration) = &it.duration {
                coming.push((&it.start + duration, Happening::End(it.ticket)));
            }
        }
        coming.retain(|(when, _)| when + epsilon <= time);
        // Ends before starts: what starts may need what has ended.
        let is_start = |it: &Happening| matches!(it, Happening::Start(_));
        coming.sort_by(|(one, what), (other, that)| {
            one.cmp(other).then(is_start(what).cmp(&is_start(that)))
        });
        for (when, happening) in &coming {
            happen(&mut belief, when, happening, &expected);
        }
        let (situation, running) = situation_at(&belief, time, Guess::AQuarterLonger);
        Fit {
            situation,
            running,
            expected,
        }
    }

    /// The steps of the present plan that have not been started, with the times at which they are
    /// expected to start. Their tickets are not chosen yet.
    fn to_come(&self) -> Vec<Expected> {
        let steps = self.account.plan_steps().iter();
        let left = steps.filter(|(id, _)| self.account.ticket(*id).is_none());
        let soonest = &self.now + self.task.epsilon();
        left.map(|(id, step)| {
            let window = self.ports.executor.window(*id, false);
            let earliest = window.and_then(|window| window.earliest);
            let start = step.start.clone().max(soonest.clone());
            Expected {
                ticket: Ticket(0),
                step: *id,
                action: Arc::clone(&step.action),
                start: earliest.map_or(start.clone(), |earliest| earliest.max(start)),
                duration: step.duration.clone(),
            }
        })
        .collect()
    }

    /// Which start the step of the plan before was.
    fn start_of(&self, search: &Search, step: StepId) -> Option<Ticket> {
        let left_behind = search.left_behind.get(&step).copied();
        left_behind.or_else(|| self.account.ticket(step))
    }

    /// The plan from here: without what has been done of it, and as much later as it is late.
    pub(super) fn fitted(&self, search: &Search, plan: &TimeTriggeredPlan) -> Option<Begun> {
        let first = search.expected.first().map(|it| it.ticket);
        let mut done = BTreeSet::new();
        let mut left: Vec<Step> = Vec::new();
        // What was expected to be under way, and is not.
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
        // What was expected to be over.
        let is_over = |it: &&Expected| !search.running.contains(&it.ticket);
        for it in search.expected.iter().filter(is_over) {
            match self.start_of(search, it.step) {
                Some(real) => {
                    done.insert(real);
                }
                None => left.push(it.as_step(it.duration.clone())),
            }
        }
        // What was begun besides may be what the plan has, too.
        let before = search.left_behind.values();
        let before = before.filter_map(|it| Some((*it, self.account.get(*it)?)));
        let besides = self.account.of_plan().chain(before);
        let mut besides: Vec<(Ticket, String)> = besides
            .filter(|(ticket, it)| it.ordered >= search.begun && !done.contains(ticket))
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
        // What takes longer than was expected may be waited for.
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

impl Expected {
    fn as_step(&self, duration: Option<Rational>) -> Step {
        Step {
            action: Arc::clone(&self.action),
            start: self.start.clone(),
            duration,
        }
    }
}

/// Lets something happen in a belief. What cannot be computed is left as it was: what is expected is
/// no promise.
fn happen(belief: &mut Progression, when: &Rational, what: &Happening, expected: &[Expected]) {
    let _ = belief.arrive(when);
    match what {
        Happening::End(ticket) => drop(belief.end(*ticket, &[])),
        Happening::Start(index) => {
            let it = &expected[*index];
            let duration = it.duration.clone().unwrap_or_default();
            let _ = belief.start(it.ticket, &it.action, &duration, &[]);
        }
    }
}
