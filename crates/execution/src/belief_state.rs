//! Progression: a state that follows the events of an execution.
//!
//! The same type is the *belief* of the executing side and the *true state* of a simulated world.
//! As in the validator, all happenings at one time form a group. Conditions, guards and amounts are
//! read in the state on arrival, before any change at that time. Over-all conditions must hold
//! strictly between start and end; at the time of a group in between, in the state after it.
//! Interference between happenings of a group is not checked here: it makes the executed plan
//! invalid, which the validator reports.

mod effects;
mod evaluation;
mod goal;
mod motion;
mod over_all;
mod parts;
mod polynomial;
mod start;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use elbowroom_model::ground::{
    Action, Body, Change, Condition, DurativeBody, FactId, FluentId, SnapAction,
};
use elbowroom_model::{RunningAction, State, Task};
use elbowroom_num::{Interval, Rational};

pub use evaluation::EvaluationError;
pub(crate) use goal::GoalStatus;
pub use parts::{BeliefStateParts, Guards, RunningActionParts};
pub(crate) use start::conditions_on_duration;

use crate::event::{ActionHandle, Measured};
use motion::{Motion, Rate};

/// The state at one moment, with the running actions.
#[derive(Clone, Debug)]
pub struct BeliefState {
    task: Arc<Task>,
    time: Rational,
    facts: Vec<bool>,
    values: Vec<Option<Rational>>,
    /// The time of the present group: [`Progression::time`], or earlier for late reports.
    group: Rational,
    /// Truth on arrival of the facts that have changed since the beginning of the present group.
    facts_on_arrival: BTreeMap<FactId, bool>,
    /// The same for values.
    values_on_arrival: BTreeMap<FluentId, Option<Rational>>,
    /// Facts that an action may have changed: see [`Progression::doubt`].
    doubtful_facts: BTreeMap<FactId, Vec<Doubt>>,
    /// Fluents that an action may have changed.
    doubtful_values: BTreeMap<FluentId, Vec<Doubt>>,
    /// Number of groups of timed initials that have happened.
    timed: usize,
    running: BTreeMap<ActionHandle, RunningActionState>,
}

/// A running durative action.
#[derive(Clone, Debug, PartialEq)]
pub struct RunningActionState {
    /// The action.
    pub action: Arc<Action>,
    /// The time at which it started.
    pub start: Rational,
    /// The planned duration, which is the value of `?duration` until the action has ended.
    pub planned: Rational,
    /// For each end effect, `true` if the part of its guard that concerns the start and the
    /// interval holds.
    end_guards: Vec<bool>,
    /// For each continuous effect, `true` if it is active.
    continuous: Vec<bool>,
    /// Conjuncts of the over-all condition that have failed at some moment since the start.
    broken: BTreeSet<usize>,
}

/// Reason for which facts or values are in doubt.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Doubt {
    /// Beginning of the doubt.
    pub since: Rational,
    /// The ticket of the action's start.
    pub ticket: ActionHandle,
    /// The name of the action whose end may or may not have happened.
    pub action: String,
}

impl RunningActionState {
    /// Returns the conjuncts of the over-all condition that have failed at some moment since the
    /// start.
    pub fn violated_conjuncts(&self) -> Vec<&Condition> {
        let Some(body) = self.action.durative() else {
            return Vec::new();
        };
        let parts = body.over_all.conjuncts().into_iter().enumerate();
        let broken = parts.filter(|(index, _)| self.broken.contains(index));
        broken.map(|(_, part)| part).collect()
    }
}

impl BeliefState {
    /// Creates the initial state of a task.
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
            group: Rational::ZERO,
            facts_on_arrival: BTreeMap::new(),
            values_on_arrival: BTreeMap::new(),
            doubtful_facts: BTreeMap::new(),
            doubtful_values: BTreeMap::new(),
            timed: 0,
            running: BTreeMap::new(),
        }
    }

    /// Returns the task, which defines the facts.
    pub fn task(&self) -> &Arc<Task> {
        &self.task
    }

    /// Returns the same state with a task whose table of facts grows independently, for
    /// hypothetical states.
    #[must_use]
    pub fn with_separate_fact_table(&self) -> Self {
        let task = Arc::new(self.task.with_own_table());
        Self {
            task,
            ..self.clone()
        }
    }

    /// Replaces the task by one that differs only in its goal.
    pub(crate) fn set_goal(&mut self, task: &Arc<Task>) {
        self.task = Arc::clone(task);
    }

    /// Returns the present time.
    pub fn time(&self) -> &Rational {
        &self.time
    }

    /// Returns the running actions.
    pub fn running(&self) -> &BTreeMap<ActionHandle, RunningActionState> {
        &self.running
    }

    /// Returns the number of groups of timed initials that have happened; they are the first ones
    /// of [`Task::timed`].
    pub fn past_timed_initials(&self) -> usize {
        self.timed
    }

    /// Returns `true` if a basic fact is true.
    pub fn fact(&self, fact: FactId) -> bool {
        let truth = self.facts.get(fact.index()).copied().unwrap_or(false);
        truth && !self.doubtful_facts.contains_key(&fact)
    }

    /// Returns the facts that are in doubt.
    pub fn doubtful_facts(&self) -> &BTreeMap<FactId, Vec<Doubt>> {
        &self.doubtful_facts
    }

    /// Returns the fluents whose values are in doubt.
    pub fn doubtful_values(&self) -> &BTreeMap<FluentId, Vec<Doubt>> {
        &self.doubtful_values
    }

    /// Returns a fluent's value.
    pub fn value(&self, fluent: FluentId) -> Option<&Rational> {
        self.values.get(fluent.index()).and_then(Option::as_ref)
    }

    /// Returns a fluent's value on arrival at the present moment, before any happening of it.
    pub fn value_on_arrival(&self, fluent: FluentId) -> Option<&Rational> {
        match self.values_on_arrival.get(&fluent) {
            Some(value) => value.as_ref(),
            None => self.value(fluent),
        }
    }

    /// Returns facts and values as a state of the model.
    pub fn state(&self) -> State {
        let facts = (0..self.facts.len()).map(|index| FactId(to_u32(index)));
        let values = self.values.iter().enumerate();
        State {
            facts: facts.filter(|fact| self.fact(*fact)).collect(),
            values: values
                .filter_map(|(index, value)| Some((FluentId(to_u32(index)), value.clone()?)))
                .collect(),
        }
    }

    /// Returns the time of the next timed initials.
    pub fn next_timed(&self) -> Option<&Rational> {
        self.task.timed().get(self.timed).map(|timed| &timed.time)
    }

    /// Advances the time: applies continuous change, and the timed initials up to and including
    /// `to`.
    ///
    /// # Errors
    /// If a fluent that changes continuously has no value. The time is advanced in any case.
    pub fn advance(&mut self, to: &Rational) -> Result<(), EvaluationError> {
        let mut outcome = Ok(());
        while let Some(timed) = self.task.timed().get(self.timed).filter(|t| t.time <= *to) {
            let (time, mut changes) = (timed.time.clone(), timed.changes.clone());
            outcome = outcome.and(self.advance_continuous(&time));
            changes.sort_by_key(|change| matches!(change, Change::Add(_)));
            for change in &changes {
                let (change, amount) = self.amount(change, None, &[]);
                outcome = outcome.and(amount.and_then(|amount| self.apply(change, &amount)));
            }
            self.timed += 1;
        }
        outcome.and(self.advance_continuous(to))
    }

    /// Prepares for happenings at `time`: advances the time to it, or begins a separate group for
    /// it if it is past. Time never goes back.
    ///
    /// # Errors
    /// As [`Progression::advance`].
    pub fn advance_for_happening(&mut self, time: &Rational) -> Result<(), EvaluationError> {
        if *time >= self.time {
            let outcome = self.advance(time);
            self.begin_group(time);
            return outcome;
        }
        self.begin_group(time);
        Ok(())
    }

    fn begin_group(&mut self, time: &Rational) {
        if self.group != *time {
            self.group.clone_from(time);
            self.facts_on_arrival.clear();
            self.values_on_arrival.clear();
        }
    }

    /// Starts an action now, or executes it if it is instantaneous. Amounts in `measured` replace
    /// those of the domain.
    ///
    /// # Errors
    /// If an effect reads a fluent without a value. The other effects take place.
    pub fn start(
        &mut self,
        ticket: ActionHandle,
        action: &Arc<Action>,
        planned: &Rational,
        measured: &[Measured],
    ) -> Result<(), EvaluationError> {
        let action = Arc::clone(action);
        match &action.body {
            Body::Instantaneous(snap) => self.apply_effects(snap, None, None, measured),
            Body::Durative(body) => {
                let guards =
                    |condition: &Condition| self.holds_on_arrival(condition, Some(planned));
                let end_guards = body.end.effects.iter();
                let continuous = body.continuous.iter();
                let underway = RunningActionState {
                    end_guards: end_guards
                        .map(|effect| guards(&effect.guard.at_start).unwrap_or(false))
                        .collect(),
                    continuous: continuous
                        .map(|effect| guards(&effect.guard.at_start).unwrap_or(false))
                        .collect(),
                    action: Arc::clone(&action),
                    start: self.group.clone(),
                    planned: planned.clone(),
                    broken: BTreeSet::new(),
                };
                let outcome = self.apply_effects(&body.start, Some(planned), None, measured);
                self.running.insert(ticket, underway);
                outcome
            }
        }
    }

    /// Ends a running action successfully. Has no effect if it is not running.
    ///
    /// # Errors
    /// As [`Progression::start`].
    pub fn end(
        &mut self,
        ticket: ActionHandle,
        measured: &[Measured],
    ) -> Result<(), EvaluationError> {
        let Some(underway) = self.running.remove(&ticket) else {
            return Ok(());
        };
        let Some(body) = underway.action.durative() else {
            return Ok(());
        };
        let duration = &self.group - &underway.start;
        self.apply_effects(
            &body.end,
            Some(&duration),
            Some(&underway.end_guards),
            measured,
        )
    }

    /// Stops a running action without its end effects.
    pub fn stop(&mut self, ticket: ActionHandle) {
        self.running.remove(&ticket);
    }

    /// Records an observed fact, also for the state on arrival. Returns `true` if it differs from
    /// the belief, or was in doubt.
    pub fn observe_fact(&mut self, fact: FactId, truth: bool) -> bool {
        let was_doubtful = self.doubtful_facts.remove(&fact).is_some();
        let is_news = self.fact(fact) != truth;
        self.set_fact(fact, truth);
        self.facts_on_arrival.remove(&fact);
        is_news || was_doubtful
    }

    /// Records an observed value, also for the state on arrival. Returns `true` if it differs from
    /// the belief, or was in doubt.
    pub fn observe_value(&mut self, fluent: FluentId, value: &Rational) -> bool {
        let was_doubtful = self.doubtful_values.remove(&fluent).is_some();
        let is_news = self.value(fluent) != Some(value);
        self.set_value(fluent, Some(value.clone()));
        self.values_on_arrival.remove(&fluent);
        is_news || was_doubtful
    }

    /// Changes a fact spontaneously.
    pub fn change_fact(&mut self, fact: FactId, truth: bool) {
        self.set_fact(fact, truth);
    }

    /// Changes a value spontaneously.
    pub fn change_value(&mut self, fluent: FluentId, value: &Rational) {
        self.doubtful_values.remove(&fluent);
        self.set_value(fluent, Some(value.clone()));
    }

    /// Marks the effects as doubtful: it is unknown whether they have taken place. Until that is
    /// known, the facts that they write count as false, for planners and for executors, and the
    /// fluents keep their values. A goal that reads them is not reached.
    pub fn doubt(&mut self, snap: &SnapAction, doubt: &Doubt) {
        for effect in &snap.effects {
            match effect.change {
                Change::Add(fact) | Change::Delete(fact) => {
                    let doubts = self.doubtful_facts.entry(fact).or_default();
                    doubts.push(doubt.clone());
                }
                Change::Update { fluent, .. } => {
                    let doubts = self.doubtful_values.entry(fluent).or_default();
                    doubts.push(doubt.clone());
                }
            }
        }
    }

    /// Returns the number of doubts about facts and fluents.
    pub fn doubt_count(&self) -> usize {
        let facts = self.doubtful_facts.values().map(Vec::len);
        let values = self.doubtful_values.values().map(Vec::len);
        facts.chain(values).sum()
    }

    /// Ends the doubts about an action's end, which has not happened. Returns the facts and fluents
    /// that were in doubt because of it.
    pub fn resolve_doubts(&mut self, ticket: ActionHandle) -> (Vec<FactId>, Vec<FluentId>) {
        let facts = without_doubts(&mut self.doubtful_facts, ticket);
        let fluents = without_doubts(&mut self.doubtful_values, ticket);
        (facts, fluents)
    }

    /// Ends the doubts about an action, and applies these effects, which have happened. Facts and
    /// values that were observed since are not changed, and other doubts remain. Returns the facts
    /// and fluents that were in doubt.
    pub fn resolve_doubts_as_happened(
        &mut self,
        ticket: ActionHandle,
        effects: &[&SnapAction],
        duration: &Rational,
        measured: &[Measured],
    ) -> (Vec<FactId>, Vec<FluentId>) {
        let (facts, fluents) = self.resolve_doubts(ticket);
        let others = (self.doubtful_facts.clone(), self.doubtful_values.clone());
        for &snap in effects {
            let mut snap = snap.clone();
            snap.effects.retain(|effect| match &effect.change {
                Change::Add(fact) | Change::Delete(fact) => facts.contains(fact),
                Change::Update { fluent, .. } => fluents.contains(fluent),
            });
            // An effect that cannot be computed does not change its fluent.
            let _ = self.apply_effects(&snap, Some(duration), None, measured);
        }
        (self.doubtful_facts, self.doubtful_values) = others;
        (facts, fluents)
    }

    /// Returns the first running action whose over-all condition has failed at some past moment
    /// since its start; [`Underway::broken_parts`] has the conjuncts. A condition that fails at the
    /// present moment does not count yet, as long as more can happen at this moment: see
    /// [`Progression::breaking`].
    pub fn violated_action(&self) -> Option<(ActionHandle, &RunningActionState)> {
        let mut running = self.running.iter();
        running
            .find(|(_, underway)| !underway.broken.is_empty())
            .map(|(ticket, underway)| (*ticket, underway))
    }

    /// Returns a running action in the form of the model, with its guards decided. Before its end,
    /// it reads the planned duration.
    pub fn running_action(
        &self,
        underway: &RunningActionState,
        duration: Interval,
    ) -> RunningAction {
        let planned = underway.action.with_planned_duration(&underway.planned);
        let mut action = planned.unwrap_or_else(|| Action::clone(&underway.action));
        if let Body::Durative(body) = &mut action.body {
            decide_guards(body, &underway.end_guards, &underway.continuous);
        }
        RunningAction {
            action: Arc::new(action),
            start: underway.start.clone(),
            duration,
        }
    }

    /// Advances the time from the present group to `to`, where the next one may begin.
    fn advance_continuous(&mut self, to: &Rational) -> Result<(), EvaluationError> {
        if *to <= self.time {
            return Ok(());
        }
        let elapsed = to - &self.time;
        let motion = self.motion();
        let (motion, outcome) = match motion {
            Ok(motion) => (motion, Ok(())),
            Err(why) => (Motion::default(), Err(why)),
        };
        self.record_failures(&motion, &elapsed);
        for (fluent, value) in motion.after(&elapsed) {
            self.set_value(fluent, Some(value));
        }
        self.time.clone_from(to);
        self.begin_group(to);
        outcome
    }

    /// Returns the changes by the active continuous effects.
    fn motion(&self) -> Result<Motion, EvaluationError> {
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
        let now = |fluent| {
            let value = self.value(fluent).cloned();
            value.ok_or(EvaluationError::Undefined(fluent))
        };
        Motion::of(&rates, &now)
    }

    fn set_fact(&mut self, fact: FactId, truth: bool) {
        if self.facts.len() <= fact.index() {
            self.facts.resize(fact.index() + 1, false);
        }
        let old = std::mem::replace(&mut self.facts[fact.index()], truth);
        self.facts_on_arrival.entry(fact).or_insert(old);
        self.doubtful_facts.remove(&fact);
    }

    fn set_value(&mut self, fluent: FluentId, value: Option<Rational>) {
        if self.values.len() <= fluent.index() {
            self.values.resize(fluent.index() + 1, None);
        }
        let old = std::mem::replace(&mut self.values[fluent.index()], value);
        self.values_on_arrival.entry(fluent).or_insert(old);
    }
}

/// Removes the effects that will not take place, and the decided parts of the guards of the others.
fn decide_guards(body: &mut DurativeBody, at_end: &[bool], continuous: &[bool]) {
    let mut on = at_end.iter();
    let end = Arc::make_mut(&mut body.end);
    end.effects.retain(|_| on.next().copied().unwrap_or(true));
    for effect in &mut end.effects {
        effect.guard.at_start = Condition::TRUE;
    }
    let mut on = continuous.iter();
    body.continuous
        .retain(|_| on.next().copied().unwrap_or(true));
    for effect in &mut body.continuous {
        effect.guard.at_start = Condition::TRUE;
    }
}

fn to_u32(index: usize) -> u32 {
    u32::try_from(index).expect("fewer than 2^32 facts and fluents")
}

/// Removes the doubts about an action, and returns the facts and fluents.
fn without_doubts<T: Copy + Ord>(
    doubts: &mut BTreeMap<T, Vec<Doubt>>,
    ticket: ActionHandle,
) -> Vec<T> {
    let mut found = Vec::new();
    doubts.retain(|&about, doubts| {
        let before = doubts.len();
        doubts.retain(|doubt| doubt.ticket != ticket);
        if doubts.len() < before {
            found.push(about);
        }
        !doubts.is_empty()
    });
    found
}
