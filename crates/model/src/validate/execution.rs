//! Validation of an execution, event by event.
//!
//! In an execution, the world determines the real starts and ends of actions, their failures, and
//! all other changes. [`Execution`] receives events in the order of their arrival at the executor,
//! and updates the state by the rules of the validator. It validates only the decisions of the
//! executor: each start, against the state at the moment of the command, and the claim that the
//! goal is reached. It does not validate conditions and durations that the world violates.
//!
//! All reports about one time form a group. A start reads the state on arrival at its group. Facts
//! and values that were *seen* at that time belong to this state, because a sensor reports a value,
//! not the moment of its change.
//!
//! ```
//! use elbowroom_model::validate::Execution;
//! use elbowroom_model::{Problem, Task};
//!
//! let task = Task::new(Problem::default());
//! let execution = Execution::new(&task);
//! assert_eq!(execution.reaches_goal(task.goal()), Some(true));
//! ```

mod present_state;
mod start;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use elbowroom_num::{Interval, Rational};

use super::interference::over;
use super::segment::Segment;
use super::violation::{ActionInstance, Occurrence, Point, Violation, ViolationKind};
use crate::derivation::{Derivation, holds};
use crate::ground::{Action, Body, Change, Condition, FactId, FluentId, SnapAction};
use crate::interference::Footprint;
use crate::situation::Situation;
use crate::task::Task;

use present_state::{Indeterminate, Moment, PresentState, RateOf};

/// A measured amount that replaces the domain's `amount` in `(increase fluent amount)`, or in another
/// update.
pub type MeasuredAmount = (FluentId, Rational);

/// An execution up to the present time. The caller identifies starts by numbers of its choice.
#[derive(Clone, Debug)]
pub struct Execution {
    task: Task,
    /// Rules of derived facts, with the number of facts in the table for which they were computed.
    derivation: (usize, Derivation),
    present: PresentState,
    /// Number of groups of timed initials that have happened.
    timed: usize,
    /// Commanded starts that were neither reported nor refused.
    commanded: BTreeMap<u64, Commanded>,
    running: BTreeMap<u64, Running>,
    /// Commanded or running actions that were cancelled.
    cancelled: BTreeSet<u64>,
    /// Happenings less than ε ago.
    recent: VecDeque<Recent>,
}

/// A start that was commanded.
#[derive(Clone, Debug)]
struct Commanded {
    action: Arc<Action>,
    planned: Option<Rational>,
}

/// A running action.
#[derive(Clone, Debug)]
struct Running {
    action: Arc<Action>,
    start: Rational,
    /// The commanded duration, the value of `?duration` until the end is known.
    planned: Rational,
    /// For each end effect, `true` as long as its guards hold, at the start and over all.
    end_guards: Vec<bool>,
    /// For each continuous effect, `true` if it is active.
    continuous: Vec<bool>,
    /// `true` if no time has passed since its start.
    is_new: bool,
}

/// A happening less than ε ago.
#[derive(Clone, Debug)]
struct Recent {
    time: Rational,
    footprint: Footprint,
    point: Point,
    action: Option<ActionInstance>,
    /// The number of a start.
    number: Option<u64>,
}

impl Execution {
    /// Creates an execution at time 0, before any event. Commands have the durations of the domain.
    pub fn new(task: &Task) -> Self {
        let task = &task.with_domain_durations();
        Self {
            derivation: (0, Derivation::default()),
            present: PresentState::of(task, task.initial(), Rational::ZERO),
            task: task.clone(),
            timed: 0,
            commanded: BTreeMap::new(),
            running: BTreeMap::new(),
            cancelled: BTreeSet::new(),
            recent: VecDeque::new(),
        }
    }

    /// Creates an execution that continues in `situation`. `numbers` identify its running actions, in the same
    /// order.
    pub fn from(task: &Task, situation: &Situation, numbers: &[u64]) -> Self {
        let mut execution = Self::new(task);
        execution.present = PresentState::of(task, &situation.state, situation.time.clone());
        let timed = task.timed().iter();
        execution.timed = timed
            .take_while(|timed| timed.time <= situation.time)
            .count();
        for (&number, running) in numbers.iter().zip(&situation.running) {
            let Some(body) = running.action.durative() else {
                continue;
            };
            let planned = nominal(&running.duration, &(&situation.time - &running.start));
            let running = Running {
                start: running.start.clone(),
                planned,
                end_guards: vec![true; body.end.effects.len()],
                continuous: vec![true; body.continuous.len()],
                action: Arc::clone(&running.action),
                is_new: false,
            };
            execution.running.insert(number, running);
        }
        execution
    }

    /// Returns the present time.
    pub fn time(&self) -> &Rational {
        self.present.time()
    }

    /// Returns `true` if no action is running or commanded, other than those that were cancelled.
    pub fn is_idle(&self) -> bool {
        let mut open = self.commanded.keys().chain(self.running.keys());
        open.all(|number| self.cancelled.contains(number))
    }

    /// Advances to the time `to`, with continuous change and all timed initials up to and including `to`.
    pub fn advance(&mut self, to: &Rational) {
        while let Some(timed) = self
            .task
            .timed()
            .get(self.timed)
            .filter(|it| it.time <= *to)
            .cloned()
        {
            self.advance_continuous(&timed.time);
            self.present.begin_group(&timed.time);
            let footprint = Footprint::of_timed(&timed);
            let (deletes, others): (Vec<_>, Vec<_>) =
                (timed.changes.iter()).partition(|change| matches!(change, Change::Delete(_)));
            for change in deletes.into_iter().chain(others) {
                self.present.change(change, None, &[]);
            }
            self.note_recent(&timed.time, footprint, Point::Timed, None);
            self.timed += 1;
        }
        self.advance_continuous(to);
    }

    /// Begins the group of the events at `time`. A late report does not turn back time: its event changes the
    /// present state.
    fn arrive(&mut self, time: &Rational) {
        if time >= self.present.time() {
            self.advance(time);
        }
        self.present.begin_group(time);
    }

    fn advance_continuous(&mut self, to: &Rational) {
        let length = to - self.present.time();
        if !length.is_positive() {
            return;
        }
        self.refresh();
        let running = self.running.values();
        let rates: Vec<RateOf<'_>> = running.flat_map(rates_of).collect();
        let motion = self.present.motion(&rates);
        drop(rates);
        let piece = Segment {
            now: self.present.now(),
            motion: &motion,
            length: &length,
            derivation: &self.derivation.1,
            slack: &Rational::ZERO,
            part: None,
        };
        for running in self.running.values_mut() {
            running.watch(&piece);
        }
        self.present.pass(to, &motion);
    }

    /// Records a start that the executor commands at the present time.
    ///
    /// # Errors
    /// The violation, if the conditions or duration bounds of the action are not satisfied in the present state, or
    /// if the start interferes with a happening less than ε ago. A condition that reads a doubtful fact or value is
    /// not a violation.
    pub fn command(
        &mut self,
        number: u64,
        action: &Arc<Action>,
        duration: Option<&Rational>,
    ) -> Result<(), Box<Violation>> {
        // The domain's own action, because the executor may have changed it.
        let own = self.task.instantiate(action.schema, &action.arguments);
        let own = own.map_or_else(|_| Arc::clone(action), Arc::new);
        let time = self.present.time().clone();
        self.present.begin_group(&time);
        let instance = ActionInstance {
            step: usize::try_from(number).unwrap_or(usize::MAX),
            name: own.name.clone(),
            start: time.clone(),
        };
        self.refresh();
        let mistake = self
            .mistaken_duration(&own, duration)
            .or_else(|| self.mistaken_condition(&own, duration))
            .or_else(|| self.too_short_or_long(&own, duration));
        let footprint = Footprint::of_start(&self.task, &own);
        let point = match own.body {
            Body::Durative(_) => Point::Start,
            Body::Instantaneous(_) => Point::Instant,
        };
        let mistake = mistake.or_else(|| self.interference(&footprint, point, &instance));
        self.note_recent(&time, footprint, point, Some((number, instance.clone())));
        self.commanded.insert(
            number,
            Commanded {
                action: own,
                planned: duration.cloned(),
            },
        );
        match mistake {
            None => Ok(()),
            Some(mistake) => Err(Box::new(Violation {
                time,
                action: Some(instance),
                kind: mistake,
            })),
        }
    }

    /// Adds a start that was commanded before this execution began, and has not been reported yet.
    pub fn expect(&mut self, number: u64, action: &Arc<Action>, planned: Option<Rational>) {
        let action = Arc::clone(action);
        self.commanded.insert(number, Commanded { action, planned });
    }

    /// Records that a commanded action has started at `time`, or has happened if it is instantaneous.
    pub fn start(&mut self, number: u64, time: &Rational, measured: &[MeasuredAmount]) {
        let Some(commanded) = self.commanded.remove(&number) else {
            return;
        };
        self.arrive(time);
        self.refresh();
        let action = commanded.action;
        let planned = commanded.planned.unwrap_or_default();
        match &action.body {
            Body::Instantaneous(snap) => self.happen(snap, None, None, measured),
            Body::Durative(body) => {
                let guard = |condition| self.reads(condition, Some(&planned)) == Ok(true);
                let ends = body.end.effects.iter();
                let end_guards = ends.map(|effect| guard(&effect.guard.at_start)).collect();
                let rates = body.continuous.iter();
                let continuous = rates.map(|effect| guard(&effect.guard.at_start)).collect();
                self.happen(&body.start, Some(&planned), None, measured);
                let running = Running {
                    action: Arc::clone(&action),
                    start: time.clone(),
                    planned,
                    end_guards,
                    continuous,
                    is_new: true,
                };
                self.running.insert(number, running);
            }
        }
    }

    /// Records that a running action has ended at `time` with its end effects.
    pub fn end(&mut self, number: u64, time: &Rational, measured: &[MeasuredAmount]) {
        self.arrive(time);
        self.refresh();
        self.cancelled.remove(&number);
        let Some(running) = self.running.remove(&number) else {
            return;
        };
        let Some(body) = running.action.durative() else {
            return;
        };
        self.mark_end_known(&running.action);
        let duration = time - &running.start;
        self.happen(
            &body.end,
            Some(&duration),
            Some(&running.end_guards),
            measured,
        );
        let footprint = Footprint::of_end(&self.task, &running.action);
        let instance = ActionInstance {
            step: usize::try_from(number).unwrap_or(usize::MAX),
            name: running.action.name.clone(),
            start: running.start,
        };
        self.note_recent(time, footprint, Point::End, Some((number, instance)));
    }

    /// Records that an action has stopped at `time` without its end effects, or that its start was refused.
    pub fn stop(&mut self, number: u64, time: &Rational) {
        self.arrive(time);
        if self.commanded.remove(&number).is_some() {
            // A refused start has not happened, so it needs no separation.
            self.recent.retain(|recent| recent.number != Some(number));
        }
        self.cancelled.remove(&number);
        if let Some(running) = self.running.remove(&number) {
            self.mark_end_known(&running.action);
        }
    }

    /// Records the cancellation of an action. Until the action ends, its end effects are in doubt.
    pub fn cancel(&mut self, number: u64) {
        self.cancelled.insert(number);
        if let Some(running) = self.running.get(&number) {
            let action = Arc::clone(&running.action);
            self.mark_contradicted(&action);
        }
    }

    /// Marks the last effects of an action as doubtful, because the reports about it contradict each other or are
    /// missing.
    pub fn mark_contradicted(&mut self, action: &Action) {
        let snap = last_snap(action);
        for effect in &snap.effects {
            self.present.mark_doubtful(&effect.change);
        }
        for effect in action.durative().map_or(&[][..], |body| &body.continuous) {
            self.present.mark_value_doubtful(effect.fluent);
        }
    }

    /// Ends the doubt about the effects of an action, because its end is known.
    fn mark_end_known(&mut self, action: &Action) {
        for effect in &last_snap(action).effects {
            self.present.mark_known(&effect.change);
        }
        for effect in action.durative().map_or(&[][..], |body| &body.continuous) {
            self.present.mark_value_known(effect.fluent);
        }
    }

    /// Records the truth value of a fact that is seen at `time`.
    pub fn observe_fact(&mut self, time: &Rational, fact: FactId, truth: bool) {
        self.arrive(time);
        if !self.task.is_derived(fact) {
            self.present.observe_fact(fact, truth);
        }
    }

    /// Records the value of a fluent that is seen at `time`.
    pub fn observe_value(&mut self, time: &Rational, fluent: FluentId, value: &Rational) {
        self.arrive(time);
        self.present.observe_value(fluent, value);
        // A cancelled action may already have stopped, so it no longer changes the seen value.
        let running = self.running.iter_mut();
        for (_, running) in running.filter(|(number, _)| self.cancelled.contains(number)) {
            let effects = running
                .action
                .durative()
                .map_or(&[][..], |it| &it.continuous);
            for (effect, is_at_work) in effects.iter().zip(&mut running.continuous) {
                *is_at_work &= effect.fluent != fluent;
            }
        }
    }

    /// Returns whether `goal` holds after all timed initials if no further action starts or ends. Returns `None`
    /// if it reads a doubtful fact or value, or a fluent without a value.
    pub fn reaches_goal(&self, goal: &Condition) -> Option<bool> {
        let mut end = self.clone();
        end.running.clear();
        if let Some(last) = end.task.timed().last().map(|timed| timed.time.clone())
            && last > *end.time()
        {
            end.advance(&last);
        }
        end.holds(goal)
    }

    /// Returns whether `condition` holds now, after all that has happened by this time. Returns `None` if it reads a
    /// doubtful fact or value, or a fluent without a value.
    pub fn holds(&self, condition: &Condition) -> Option<bool> {
        let mut now = self.clone();
        let time = now.time().clone();
        now.present.end_group(&time);
        now.refresh();
        now.reads(condition, None).ok()
    }

    fn interference(
        &self,
        footprint: &Footprint,
        point: Point,
        instance: &ActionInstance,
    ) -> Option<ViolationKind> {
        let time = self.present.time();
        let epsilon = self.task.epsilon();
        let near = |recent: &&Recent| {
            time - &recent.time < *epsilon && recent.footprint.interferes_with(footprint)
        };
        let first = self.recent.iter().find(near)?;
        let occurrence = |time: &Rational, point, action: Option<&ActionInstance>| Occurrence {
            time: time.clone(),
            point,
            action: action.cloned(),
            event: None,
        };
        Some(ViolationKind::Interference {
            over: over(&self.task, &first.footprint, footprint),
            first: occurrence(&first.time, first.point, first.action.as_ref()),
            second: occurrence(time, point, Some(instance)),
            separation: Some(epsilon.clone()),
        })
    }

    fn note_recent(
        &mut self,
        time: &Rational,
        footprint: Footprint,
        point: Point,
        action: Option<(u64, ActionInstance)>,
    ) {
        let (number, action) = action.unzip();
        let (now, epsilon) = (self.present.time(), self.task.epsilon());
        self.recent.retain(|recent| &recent.time + epsilon > *now);
        self.recent.push_back(Recent {
            time: time.clone(),
            footprint,
            point,
            action,
            number,
        });
    }

    /// Applies the effects of a happening. All read the state on arrival, and deletions come before additions.
    fn happen(
        &mut self,
        snap: &SnapAction,
        duration: Option<&Rational>,
        guards: Option<&[bool]>,
        measured: &[MeasuredAmount],
    ) {
        let effects = snap.effects.iter().enumerate();
        let due = effects.filter(|(index, effect)| {
            guards.is_none_or(|guards| guards[*index])
                && self.reads(&effect.guard.now, duration) == Ok(true)
        });
        let due: Vec<&Change> = due.map(|(_, effect)| &effect.change).collect();
        let (deletes, others): (Vec<_>, Vec<_>) = due
            .into_iter()
            .partition(|change| matches!(change, Change::Delete(_)));
        for change in deletes.into_iter().chain(others) {
            self.present.change(change, duration, measured);
        }
    }

    /// Extends the state to the facts and fluents of the table, and recomputes the rules of derived facts if the
    /// table has grown.
    fn refresh(&mut self) {
        self.present.extend_to_table(&self.task);
        let count = self.task.fact_count();
        if self.derivation.0 != count {
            let derivation = self.task.derivation().unwrap_or_default();
            self.derivation = (count, derivation);
        }
    }

    fn moment<'a>(&'a self, duration: Option<&'a Rational>) -> Moment<'a> {
        self.present.on_arrival(duration)
    }

    fn reads(
        &self,
        condition: &Condition,
        duration: Option<&Rational>,
    ) -> Result<bool, Indeterminate> {
        let basic = self.moment(duration);
        let (_, derivation) = &self.derivation;
        if derivation.is_read_by(condition) {
            let derived = derivation.derive(&basic);
            holds(condition, &derivation.with_derived_facts(&basic, &derived))
        } else {
            holds(condition, &basic)
        }
    }
}

impl Running {
    /// Drops the end effects whose over-all guard fails in a piece of the execution.
    fn watch(&mut self, piece: &Segment<'_>) {
        let includes_start = !std::mem::take(&mut self.is_new);
        let ends = self.action.durative().map_or(&[][..], |it| &it.end.effects);
        for (effect, takes_place) in ends.iter().zip(&mut self.end_guards) {
            let guard = &effect.guard.over_all;
            *takes_place &= guard.is_trivial()
                || piece.first_falsification(guard, Some(&self.planned), includes_start)
                    == Ok(None);
        }
    }
}

fn rates_of(running: &Running) -> impl Iterator<Item = RateOf<'_>> {
    let effects = running
        .action
        .durative()
        .map_or(&[][..], |it| &it.continuous);
    let at_work = effects.iter().zip(&running.continuous);
    at_work
        .filter(|(_, on)| **on)
        .map(|(effect, _)| (effect.fluent, &effect.rate, &running.planned))
}

/// Returns the value of `?duration` for a running action with an interval of possible durations: the upper end,
/// else the lower end, else the elapsed time.
fn nominal(possible: &Interval, elapsed: &Rational) -> Rational {
    let bound = possible.upper.value().or_else(|| possible.lower.value());
    bound.cloned().unwrap_or_else(|| elapsed.clone())
}

/// Returns the snap action that completes an action.
fn last_snap(action: &Action) -> &SnapAction {
    match &action.body {
        Body::Instantaneous(snap) => snap,
        Body::Durative(body) => &body.end,
    }
}
