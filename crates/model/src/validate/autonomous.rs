//! Processes and events between two happening groups.
//!
//! The time between two groups is cut at each event, and at each start or stop of a process. These
//! moments are zeros of polynomials, and may be irrational. If the moment is rational, the state
//! advances to it in the same way as to a happening group. After an irrational moment, the
//! polynomials keep their time variable, with a new constant term if that is rational. It is
//! rational if the motion of the number does not change, if its value is rational, or if it reaches
//! the bound of a condition. A number whose constant is irrational has no value until it is
//! assigned a new one. The plan is undecided if a condition or an effect reads the number before
//! that.
//!
//! At each moment, conditions that are true at the moment are processed first, and then those that
//! are true right after it: an event on `(> x 1)` happens right after `x` has reached 1. The
//! conditions that are true right after a moment depend on the processes that are active then, and
//! vice versa. The validator starts with the processes whose condition is true at the moment,
//! continues with those whose condition is true under these, and repeats this until nothing
//! changes.

use std::cmp::Ordering;
use std::collections::BTreeSet;

use elbowroom_num::Rational;

use super::abort::{Abort, EvaluationContext};
use super::effects;
use super::evaluate::{Fault, evaluate};
use super::instant::Instant;
use super::interference::over;
use super::judge::Judge;
use super::polynomial::Polynomial;
use super::segment::{Segment, SegmentPart};
use super::state::{BasicState, Motion, Rate};
use super::timeline::{Group, HappeningKind};
use super::violation::{ConditionTime, Undecided, UndecidedReason, ViolationKind};
use crate::autonomous::{Autonomous, GroundEvent};
use crate::ground::{Change, Condition, Expression, FactId, FluentId};
use crate::interference::Footprint;
use crate::problem::UpdateOperator;
use crate::task::Task;

/// Largest number of changes (events, starts and stops of processes) between two happening groups.
const MAX_CHANGES: usize = 1000;

/// Conditions of events have no tolerance, because the plan does not contain the times of events.
static NO_SLACK: Rational = Rational::ZERO;

/// Record of the events that have happened, as far as it is needed.
#[derive(Debug)]
pub(super) struct EventHistory {
    /// Footprint of each event.
    footprints: Vec<Footprint>,
    /// Events that have happened at the present moment.
    fired: BTreeSet<usize>,
    /// Number of these that happened before the last ones.
    rounds: usize,
    /// Events since the last but one group: time of the preceding group, time since then, and
    /// position of the event.
    recent: Vec<(Rational, Instant, usize)>,
}

impl EventHistory {
    /// Returns `None` if the task has neither processes nor events.
    pub(super) fn of(task: &Task) -> Option<Self> {
        let autonomous = task.autonomous();
        let footprint = |event: &GroundEvent| Footprint::of_snap(task, &event.snap);
        (!autonomous.is_empty()).then(|| Self {
            footprints: autonomous.events.iter().map(footprint).collect(),
            fired: BTreeSet::new(),
            rounds: 0,
            recent: Vec::new(),
        })
    }
}

/// A moment between two groups.
struct Flow {
    /// Start of the clock.
    base: Rational,
    /// The moment, on that clock, and the motion of numbers before it.
    at: Instant,
    motion: Motion,
}

impl Flow {
    fn beginning(time: &Rational) -> Self {
        Self {
            base: time.clone(),
            at: Instant::exact(Rational::ZERO),
            motion: Motion::default(),
        }
    }

    /// Returns the time, or a number close to it.
    fn time(&self) -> Rational {
        &self.base + self.at.near()
    }
}

/// Moment at which a condition is read: at a moment, or right after it, under a motion.
enum Read<'m> {
    At,
    After(&'m BasicState, &'m Motion, &'m Rational),
}

impl<'a> Judge<'a> {
    fn autonomous(&self) -> &'a Autonomous {
        self.task.autonomous()
    }

    /// Fires the events whose conditions hold now, and those whose conditions become true as a
    /// result.
    pub(super) fn fire_now(&mut self, time: &Rational) -> Result<(), Abort> {
        if self.event_history.is_none() {
            return Ok(());
        }
        self.fire_at(&mut Flow::beginning(time))
    }

    /// Applies processes and events from just after the group at `from` to the arrival at the next
    /// one.
    pub(super) fn advance_with_autonomous(
        &mut self,
        from: &Rational,
        to: &Rational,
    ) -> Result<(), Abort> {
        let mut flow = Flow::beginning(from);
        self.forget_events_before(from);
        for _ in 0..MAX_CHANGES {
            let length = to - &flow.base;
            let is_after = self.settle_after(&mut flow, &length)?;
            let next = self.next_switch_time(&flow, &length)?;
            let end = next.clone();
            let part = SegmentPart {
                from: flow.at.clone(),
                to: Some(end.unwrap_or_else(|| Instant::exact(length.clone()))),
                is_after,
            };
            self.check_throughout(&flow, &length, &part)?;
            for running in self.running.values_mut() {
                running.is_new = false;
            }
            let is_over = next.is_none();
            self.advance(&mut flow, next.unwrap_or_else(|| Instant::exact(length)));
            self.fire_at(&mut flow)?;
            if is_over {
                return Ok(());
            }
        }
        let most = MAX_CHANGES;
        Err(undecided(
            &flow.time(),
            UndecidedReason::ManyChanges { most },
        ))
    }

    /// Checks over-all conditions and constraints throughout a part.
    fn check_throughout(
        &mut self,
        flow: &Flow,
        length: &Rational,
        part: &SegmentPart,
    ) -> Result<(), Abort> {
        self.watch_over_all(&flow.base, &flow.motion, length, Some(part))?;
        self.record_phases(&flow.base, &flow.motion, length, Some(part))
    }

    /// Advances to a later moment.
    fn advance(&mut self, flow: &mut Flow, at: Instant) {
        if let Some(elapsed) = at.as_exact() {
            flow.motion.advance_state(&mut self.now, elapsed);
            *flow = Flow::beginning(&(&flow.base + elapsed));
        } else {
            flow.at = at;
        }
        self.derived.take();
        if let Some(history) = &mut self.event_history {
            history.fired.clear();
            history.rounds = 0;
        }
    }

    /// Fires the events whose conditions hold at the moment.
    fn fire_at(&mut self, flow: &mut Flow) -> Result<(), Abort> {
        loop {
            let ready = self.ready(flow, &Read::At)?;
            if ready.is_empty() {
                return Ok(());
            }
            self.fire(flow, &ready, &Read::At)?;
        }
    }

    /// Determines the processes that are active right after the moment, and fires the events whose
    /// conditions hold right after it. Returns `true` if there were any.
    fn settle_after(&mut self, flow: &mut Flow, length: &Rational) -> Result<bool, Abort> {
        let mut is_after = false;
        loop {
            let (now, motion) = self.active_motion(flow, length)?;
            let read = Read::After(&now, &motion, length);
            let ready = self.ready(flow, &read)?;
            if ready.is_empty() {
                (self.now, flow.motion) = (now, motion);
                return Ok(is_after);
            }
            if !is_after {
                let part = SegmentPart {
                    from: flow.at.clone(),
                    to: None,
                    is_after: false,
                };
                self.check_throughout(flow, length, &part)?;
                is_after = true;
            }
            self.fire(flow, &ready, &read)?;
        }
    }

    /// Returns the motion of numbers right after the moment, and the state with the values of those
    /// that do not change.
    fn active_motion(&self, flow: &Flow, length: &Rational) -> Result<(BasicState, Motion), Abort> {
        let processes = &self.autonomous().processes;
        let time = flow.time();
        let mut on = Vec::with_capacity(processes.len());
        for process in processes {
            on.push(self.holds(flow, &process.condition, &Read::At)?);
        }
        let mut tried = BTreeSet::new();
        loop {
            let mut rates = effects::rates(self);
            for (process, _) in processes.iter().zip(&on).filter(|(_, on)| **on) {
                rates.extend(process.effects.iter().map(|effect| Rate {
                    step: None,
                    fluent: effect.fluent,
                    per_time: &effect.rate,
                    duration: None,
                }));
            }
            let mut now = self.now.clone();
            let motion = Motion::continued_from(&mut now, &flow.motion, &rates, &flow.at).map_err(
                |(step, fault)| self.to_abort(fault, &EvaluationContext::rate(&time, step)),
            )?;
            let mut then = Vec::with_capacity(processes.len());
            let read = Read::After(&now, &motion, length);
            for process in processes {
                then.push(self.holds(flow, &process.condition, &read)?);
            }
            if then == on {
                return Ok((now, motion));
            }
            let turned = on.iter().zip(&then).position(|(on, then)| on != then);
            if !tried.insert(std::mem::replace(&mut on, then)) {
                let process = turned.map(|index| processes[index].name.clone());
                let process = process.unwrap_or_default();
                return Err(undecided(&time, UndecidedReason::Chattering { process }));
            }
        }
    }

    /// Returns the next moment at which, or right after which, an event's condition becomes true or
    /// a process starts or stops.
    fn next_switch_time(&self, flow: &Flow, length: &Rational) -> Result<Option<Instant>, Abort> {
        if flow.motion.is_constant() {
            return Ok(None);
        }
        let part = SegmentPart {
            from: flow.at.clone(),
            to: Some(Instant::exact(length.clone())),
            is_after: true,
        };
        let piece = self.piece(&self.now, &flow.motion, length, Some(&part));
        let mut next: Option<Instant> = None;
        for condition in self.conditions() {
            let place = EvaluationContext::condition(
                &flow.base,
                None,
                ConditionTime::Trajectory,
                condition,
            );
            let (_, turn) = piece
                .next_change(condition)
                .map_err(|fault| self.to_abort(fault, &place))?;
            if let Some(turn) = turn
                && next
                    .as_ref()
                    .is_none_or(|next| turn.order(next) == Ordering::Less)
            {
                next = Some(turn);
            }
        }
        Ok(next)
    }

    /// Returns the conditions of all events and processes.
    fn conditions(&self) -> impl Iterator<Item = &'a Condition> {
        let autonomous = self.autonomous();
        let events = autonomous.events.iter().map(|event| &event.snap.condition);
        let processes = autonomous.processes.iter();
        events.chain(processes.map(|process| &process.condition))
    }

    /// Returns the events whose conditions hold.
    fn ready(&self, flow: &Flow, read: &Read<'_>) -> Result<Vec<usize>, Abort> {
        let mut ready = Vec::new();
        for (index, event) in self.autonomous().events.iter().enumerate() {
            if self.holds(flow, &event.snap.condition, read)? {
                ready.push(index);
            }
        }
        Ok(ready)
    }

    fn holds(&self, flow: &Flow, condition: &Condition, read: &Read<'_>) -> Result<bool, Abort> {
        let holds = match read {
            Read::At => {
                let length = Rational::ZERO;
                let piece = self.piece(&self.now, &flow.motion, &length, None);
                piece.holds_at(condition, &flow.at)
            }
            Read::After(now, motion, length) => {
                let part = SegmentPart {
                    from: flow.at.clone(),
                    to: Some(Instant::exact((*length).clone())),
                    is_after: true,
                };
                let piece = self.piece(now, motion, length, Some(&part));
                piece.next_change(condition).map(|(holds, _)| holds)
            }
        };
        holds.map_err(|fault| {
            let time = flow.time();
            self.to_abort(
                fault,
                &EvaluationContext::condition(&time, None, ConditionTime::Trajectory, condition),
            )
        })
    }

    fn piece<'p>(
        &'p self,
        now: &'p BasicState,
        motion: &'p Motion,
        length: &'p Rational,
        part: Option<&'p SegmentPart>,
    ) -> Segment<'p> {
        Segment {
            now,
            motion,
            length,
            derivation: &self.derivation,
            slack: &NO_SLACK,
            part,
        }
    }

    /// Applies simultaneous events.
    fn fire(&mut self, flow: &mut Flow, ready: &[usize], read: &Read<'_>) -> Result<(), Abort> {
        self.reject_repeated_event(flow, ready)?;
        self.refuse_interference(flow, ready)?;
        let changes = self.changes(flow, ready, read)?;
        let time = flow.time();
        for (fluent, value) in changes.values {
            flow.motion.set_value(&mut self.now, fluent, value);
        }
        for (truth, facts) in [(false, changes.deletes), (true, changes.adds)] {
            for (fact, event) in facts {
                let old = std::mem::replace(&mut self.now.facts[fact.index()], truth);
                if old != truth {
                    self.last_changes
                        .insert(fact, (time.clone(), HappeningKind::Event(event)));
                }
            }
        }
        self.derived.take();
        if let Some(history) = &mut self.event_history {
            history.rounds += 1;
            for &event in ready {
                history.fired.insert(event);
                let moment = (flow.base.clone(), flow.at.clone(), event);
                history.recent.push(moment);
            }
        }
        Ok(())
    }

    /// Rejects an event that happens twice at a moment.
    fn reject_repeated_event(&self, flow: &Flow, ready: &[usize]) -> Result<(), Abort> {
        let Some(history) = &self.event_history else {
            return Ok(());
        };
        let Some(&again) = ready.iter().find(|event| history.fired.contains(event)) else {
            return Ok(());
        };
        let mistake = ViolationKind::EndlessEvent {
            event: self.autonomous().events[again].name.clone(),
            is_alone: history.rounds == 1 && history.fired.len() == 1,
        };
        Err(self.violation(&flow.time(), None, mistake))
    }

    /// Rejects simultaneous events that interfere.
    fn refuse_interference(&self, flow: &Flow, ready: &[usize]) -> Result<(), Abort> {
        let Some(history) = &self.event_history else {
            return Ok(());
        };
        for (position, &second) in ready.iter().enumerate() {
            for &first in &ready[..position] {
                let footprints = [first, second].map(|event| &history.footprints[event]);
                if !footprints[0].interferes_with(footprints[1]) {
                    continue;
                }
                let time = flow.time();
                let mistake = ViolationKind::Interference {
                    first: self.occurrence(HappeningKind::Event(first), &time),
                    second: self.occurrence(HappeningKind::Event(second), &time),
                    over: over(self.task, footprints[0], footprints[1]),
                    separation: None,
                };
                return Err(self.violation(&time, None, mistake));
            }
        }
        Ok(())
    }

    /// Returns the changes of some events, all read in the same state.
    fn changes(&self, flow: &Flow, ready: &[usize], read: &Read<'_>) -> Result<Changes, Abort> {
        let mut changes = Changes::default();
        let time = flow.time();
        for &event in ready {
            for effect in &self.autonomous().events[event].snap.effects {
                let guard = &effect.guard.now;
                if !guard.is_trivial() && !self.holds(flow, guard, read)? {
                    continue;
                }
                match &effect.change {
                    Change::Add(fact) => changes.adds.push((*fact, event)),
                    Change::Delete(fact) => changes.deletes.push((*fact, event)),
                    Change::Update {
                        operator,
                        fluent,
                        value,
                    } => {
                        let place = EvaluationContext::effect(&time, None, value);
                        let value_of = |fluent| flow.motion.value(&self.now, fluent);
                        let old = changes.values.iter().find(|(known, _)| known == fluent);
                        if old.is_some() && !operator.is_additive() {
                            let mistake = ViolationKind::Conflict {
                                fluent: self.task.fluent_name(*fluent),
                            };
                            return Err(self.violation(&time, None, mistake));
                        }
                        let old = match old {
                            Some((_, value)) => Ok(value.clone()),
                            None => value_of(*fluent),
                        };
                        let new = evaluate(value, None, &value_of)
                            .and_then(|value| updated(*operator, old, value, &flow.at, *fluent))
                            .map_err(|fault| self.to_abort(fault, &place))?;
                        changes.values.retain(|(known, _)| known != fluent);
                        changes.values.push((*fluent, new));
                    }
                }
            }
        }
        Ok(changes)
    }

    /// Checks that happenings of the plan are at least ε after events before them. If no separation
    /// is needed, it is sufficient that the event comes first.
    pub(super) fn check_separation_from_events(&self, group: &Group<'a>) -> Result<(), Abort> {
        let Some(history) = self
            .event_history
            .as_ref()
            .filter(|_| self.settings.needs_separation)
        else {
            return Ok(());
        };
        let separation = self.task.epsilon();
        for (base, at, event) in &history.recent {
            for happening in &group.happenings {
                let Some(step) = happening.kind.step() else {
                    continue;
                };
                let since = &happening.time - base;
                let is_close = at.order(&Instant::exact(since - separation)) == Ordering::Greater;
                let footprint = &history.footprints[*event];
                if !is_close || !footprint.interferes_with(&happening.footprint) {
                    continue;
                }
                let time = base + at.near();
                let mistake = ViolationKind::Interference {
                    first: self.occurrence(HappeningKind::Event(*event), &time),
                    second: self.occurrence(happening.kind, &happening.time),
                    over: over(self.task, footprint, &happening.footprint),
                    separation: Some(separation.clone()),
                };
                return Err(self.violation(&happening.time, Some(step), mistake));
            }
        }
        Ok(())
    }

    /// Removes the events that are too far in the past for later happenings.
    fn forget_events_before(&mut self, time: &Rational) {
        let separation = self.task.epsilon();
        if let Some(history) = &mut self.event_history {
            let is_close = |(base, at, _): &(Rational, Instant, usize)| {
                at.order(&Instant::exact(time - base - separation)) == Ordering::Greater
            };
            history.recent.retain(is_close);
        }
    }
}

/// Changes of some events.
#[derive(Default)]
struct Changes {
    deletes: Vec<(FactId, usize)>,
    adds: Vec<(FactId, usize)>,
    /// New values, as polynomials on the clock of the motion. They are valid only at the moment
    /// itself.
    values: Vec<(FluentId, Polynomial)>,
}

/// Returns the value of a fluent after an update.
fn updated(
    operator: UpdateOperator,
    old: Result<Polynomial, Fault>,
    value: Polynomial,
    at: &Instant,
    fluent: FluentId,
) -> Result<Polynomial, Fault> {
    Ok(match operator {
        UpdateOperator::Assign => value,
        UpdateOperator::Increase => old?.plus(&value),
        UpdateOperator::Decrease => old?.minus(&value),
        UpdateOperator::ScaleUp => old?.times(&value),
        UpdateOperator::ScaleDown => {
            let divisor = at.value(&value).ok_or(Fault::Irrational(fluent))?;
            let zero = Expression::Constant(Rational::ZERO);
            let factor = divisor.reciprocal().ok_or(Fault::DivisionByZero(zero))?;
            old?.scaled(&factor)
        }
    })
}

fn undecided(time: &Rational, difficulty: UndecidedReason) -> Abort {
    Abort::Undecided(Box::new(Undecided {
        time: Some(time.clone()),
        reason: difficulty,
    }))
}
