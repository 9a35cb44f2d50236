//! A state that follows what happens: progression, as planners call it.
//!
//! The same type is what an executor's side *believes* and what a simulated world *is*. It applies
//! the effects of happenings one by one; two happenings at one time do not interfere, or else the
//! executed plan is not valid, which the judge says.

mod effects;
mod motion;
mod reading;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use elbowroom_model::ground::{
    Action, Body, Change, Condition, DurativeBody, FactId, FluentId, SnapAction,
};
use elbowroom_model::{RunningAction, State, Task};
use elbowroom_num::{Interval, Rational};

pub use reading::Unreadable;

use crate::event::{Measured, Ticket};
use motion::Rate;

/// The state at one moment, with what is under way.
#[derive(Clone, Debug)]
pub struct Progression {
    task: Arc<Task>,
    time: Rational,
    facts: Vec<bool>,
    values: Vec<Option<Rational>>,
    /// Facts about which reports contradict each other.
    doubtful_facts: BTreeSet<FactId>,
    /// Fluents about which reports contradict each other.
    doubtful_values: BTreeSet<FluentId>,
    /// How many groups of timed initials have happened.
    timed: usize,
    running: BTreeMap<Ticket, Underway>,
}

/// A durative action under way.
#[derive(Clone, Debug, PartialEq)]
pub struct Underway {
    /// What is being done.
    pub action: Arc<Action>,
    /// When it started.
    pub start: Rational,
    /// How long it is planned to take: what `?duration` means until it has ended.
    pub planned: Rational,
    /// For each end effect, whether the part of its guard that concerns start and interval holds.
    end_guards: Vec<bool>,
    /// For each continuous effect, whether it is at work.
    continuous: Vec<bool>,
}

impl Progression {
    /// The beginning of a task.
    pub fn new(task: Arc<Task>) -> Self {
        let mut facts = vec![false; task.fact_count()];
        let mut values = vec![None; task.fluent_count()];
        for fact in &task.initial().facts {
            facts[fact.index()] = true;
        }
        for (fluent, value) in &task.initial().values {
            values[fluent.index()] = Some(value.clone());
        }
        Self {
            task,
            time: Rational::ZERO,
            facts,
            values,
            doubtful_facts: BTreeSet::new(),
            doubtful_values: BTreeSet::new(),
            timed: 0,
            running: BTreeMap::new(),
        }
    }

    /// The task whose facts these are.
    pub fn task(&self) -> &Arc<Task> {
        &self.task
    }

    /// The table of facts and fluents has grown; those known keep their numbers.
    pub fn know(&mut self, task: Arc<Task>) {
        self.task = task;
    }

    /// The moment.
    pub fn time(&self) -> &Rational {
        &self.time
    }

    /// What is under way.
    pub fn running(&self) -> &BTreeMap<Ticket, Underway> {
        &self.running
    }

    /// The groups of timed initials that have happened: the first so many of [`Task::timed`].
    pub fn timed_past(&self) -> usize {
        self.timed
    }

    /// Whether a basic fact is true.
    pub fn fact(&self, fact: FactId) -> bool {
        self.facts.get(fact.index()).copied().unwrap_or(false)
    }

    /// A fluent's value.
    pub fn value(&self, fluent: FluentId) -> Option<&Rational> {
        self.values.get(fluent.index()).and_then(Option::as_ref)
    }

    /// Facts and values as the model knows them.
    pub fn state(&self) -> State {
        let facts = self.facts.iter().enumerate().filter(|(_, truth)| **truth);
        let values = self.values.iter().enumerate();
        State {
            facts: facts.map(|(index, _)| FactId(narrow(index))).collect(),
            values: values
                .filter_map(|(index, value)| Some((FluentId(narrow(index)), value.clone()?)))
                .collect(),
        }
    }

    /// When the next timed initials happen.
    pub fn next_timed(&self) -> Option<&Rational> {
        self.task.timed().get(self.timed).map(|timed| &timed.time)
    }

    /// Lets time pass: continuous change, and the timed initials up to and including `to`.
    ///
    /// # Errors
    /// When a fluent that moves has no value. Time passes all the same.
    pub fn advance(&mut self, to: &Rational) -> Result<(), Unreadable> {
        let mut outcome = Ok(());
        while let Some(timed) = self.task.timed().get(self.timed).filter(|t| t.time <= *to) {
            let (time, changes) = (timed.time.clone(), timed.changes.clone());
            outcome = outcome.and(self.drift(&time));
            for change in &changes {
                let (change, amount) = self.amount(change, None, &[]);
                outcome = outcome.and(amount.and_then(|amount| self.apply(change, &amount)));
            }
            self.timed += 1;
            self.check_guards();
        }
        outcome.and(self.drift(to))
    }

    /// An action starts now, or happens, if it is instantaneous. `measured` overrides the amounts
    /// that the domain has.
    ///
    /// # Errors
    /// When an effect reads a fluent without a value; the other effects take place.
    pub fn start(
        &mut self,
        ticket: Ticket,
        action: &Arc<Action>,
        planned: &Rational,
        measured: &[Measured],
    ) -> Result<(), Unreadable> {
        let action = Arc::clone(action);
        match &action.body {
            Body::Instantaneous(snap) => self.happen(snap, None, None, measured),
            Body::Durative(body) => {
                let guards = |condition: &Condition| self.holds(condition, Some(planned));
                let end_guards = body.end.effects.iter();
                let continuous = body.continuous.iter();
                let underway = Underway {
                    end_guards: end_guards
                        .map(|effect| guards(&effect.guard.at_start).unwrap_or(false))
                        .collect(),
                    continuous: continuous
                        .map(|effect| guards(&effect.guard.at_start).unwrap_or(false))
                        .collect(),
                    action: Arc::clone(&action),
                    start: self.time.clone(),
                    planned: planned.clone(),
                };
                let outcome = self.happen(&body.start, Some(planned), None, measured);
                self.running.insert(ticket, underway);
                self.check_guards();
                outcome
            }
        }
    }

    /// A running action ends now, as the domain says. Nothing if it is not running.
    ///
    /// # Errors
    /// As [`Progression::start`].
    pub fn end(&mut self, ticket: Ticket, measured: &[Measured]) -> Result<(), Unreadable> {
        let Some(underway) = self.running.remove(&ticket) else {
            return Ok(());
        };
        let Some(body) = underway.action.durative() else {
            return Ok(());
        };
        let duration = &self.time - &underway.start;
        self.happen(
            &body.end,
            Some(&duration),
            Some(&underway.end_guards),
            measured,
        )
    }

    /// A running action stops without its end taking place.
    pub fn stop(&mut self, ticket: Ticket) {
        self.running.remove(&ticket);
    }

    /// A fact is seen; whether that is news.
    pub fn see_fact(&mut self, fact: FactId, truth: bool) -> bool {
        let was_doubtful = self.doubtful_facts.remove(&fact);
        let is_news = self.fact(fact) != truth;
        self.set_fact(fact, truth);
        self.check_guards();
        is_news || was_doubtful
    }

    /// A value is seen; whether that is news.
    pub fn see_value(&mut self, fluent: FluentId, value: &Rational) -> bool {
        let was_doubtful = self.doubtful_values.remove(&fluent);
        let is_news = self.value(fluent) != Some(value);
        self.set_value(fluent, Some(value.clone()));
        self.check_guards();
        is_news || was_doubtful
    }

    /// Nobody knows any more what these effects have done: what they write says nothing until it
    /// is seen.
    pub fn doubt(&mut self, snap: &SnapAction) {
        for effect in &snap.effects {
            match effect.change {
                Change::Add(fact) | Change::Delete(fact) => {
                    self.doubtful_facts.insert(fact);
                }
                Change::Update { fluent, .. } => {
                    self.doubtful_values.insert(fluent);
                }
            }
        }
    }

    /// Whether reports contradict each other about anything.
    pub fn is_doubtful(&self) -> bool {
        !self.doubtful_facts.is_empty() || !self.doubtful_values.is_empty()
    }

    /// The first running action whose over-all condition is not fulfilled.
    pub fn broken(&self) -> Option<(Ticket, &Underway)> {
        let is_broken = |(_, underway): &(&Ticket, &Underway)| {
            let body = underway.action.durative();
            body.is_some_and(|body| {
                !body.over_all.is_trivial()
                    && self.holds(&body.over_all, Some(&underway.planned)) != Ok(true)
            })
        };
        let mut running = self.running.iter();
        running
            .find(is_broken)
            .map(|(ticket, underway)| (*ticket, underway))
    }

    /// A running action as the model knows it, with its guards decided.
    pub fn running_action(&self, underway: &Underway, duration: Interval) -> RunningAction {
        let mut action = Action::clone(&underway.action);
        if let Body::Durative(body) = &mut action.body {
            decide_guards(body, underway);
        }
        RunningAction {
            action,
            start: underway.start.clone(),
            duration,
        }
    }

    fn drift(&mut self, to: &Rational) -> Result<(), Unreadable> {
        if *to <= self.time {
            return Ok(());
        }
        let elapsed = to - &self.time;
        self.time = to.clone();
        let mut rates = Vec::new();
        for underway in self.running.values() {
            let Some(body) = underway.action.durative() else {
                continue;
            };
            let at_work = body.continuous.iter().zip(&underway.continuous);
            rates.extend(at_work.filter(|(_, on)| **on).map(|(effect, _)| Rate {
                fluent: effect.fluent,
                per_time: &effect.rate,
                duration: Some(&underway.planned),
            }));
        }
        if rates.is_empty() {
            return Ok(());
        }
        let now = |fluent| {
            let value = self.value(fluent).cloned();
            value.ok_or(Unreadable::Undefined(fluent))
        };
        for (fluent, value) in motion::moved(&rates, &elapsed, &now)? {
            self.set_value(fluent, Some(value));
        }
        self.check_guards();
        Ok(())
    }

    fn set_fact(&mut self, fact: FactId, truth: bool) {
        if self.facts.len() <= fact.index() {
            self.facts.resize(fact.index() + 1, false);
        }
        self.facts[fact.index()] = truth;
        self.doubtful_facts.remove(&fact);
    }

    fn set_value(&mut self, fluent: FluentId, value: Option<Rational>) {
        if self.values.len() <= fluent.index() {
            self.values.resize(fluent.index() + 1, None);
        }
        self.values[fluent.index()] = value;
    }
}

/// Leaves out the effects that will not take place, and what is decided of the others' guards.
fn decide_guards(body: &mut DurativeBody, underway: &Underway) {
    let mut on = underway.end_guards.iter();
    body.end
        .effects
        .retain(|_| on.next().copied().unwrap_or(true));
    for effect in &mut body.end.effects {
        effect.guard.at_start = Condition::TRUE;
    }
    let mut on = underway.continuous.iter();
    body.continuous
        .retain(|_| on.next().copied().unwrap_or(true));
    for effect in &mut body.continuous {
        effect.guard.at_start = Condition::TRUE;
    }
}

fn narrow(index: usize) -> u32 {
    u32::try_from(index).expect("fewer than 2^32 facts and fluents")
}
