//! Changes of facts and fluents along a plan: [`Histories`].
//! [`PointState`](super::point_state::PointState) evaluates them at one moment.
//!
//! Happenings that interfere keep the order of the plan in all schedules (`valid`). Others commute. So each
//! happening reads the same facts in all schedules, and numbers that are the same expressions in times and
//! parameters. A condition of an effect that depends on times or parameters has the truth value of the plan
//! ([`Decision`]); all other schedules are shown to be impossible.

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::ground::{
    Body, Change, DurationConstraint, DurativeBody, Effect, Expression, FactId, FluentId, Guard,
};
use elbowroom_model::problem::UpdateOperator;
use elbowroom_num::Rational;

use super::NotDerived;
use super::decisions::{Decision, GuardId};
use super::distances::Distances;
use super::linear::Linear;
use super::offset_components::OffsetComponents;
use super::point_state::{PointState, combined, negated, quotient};
use super::subject::{PointKind, Subject, is_always_defined};

/// A number at one moment.
#[derive(Clone, Debug)]
pub(super) enum Value {
    Known(Linear),
    /// It has no value.
    Undefined,
    /// It is not linear in times and parameters, or the checker has no rule for it.
    Unknown,
}

/// The reason why the truth of a condition is not the same in all schedules.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Undetermined {
    /// A number has no value.
    Undefined,
    /// A number depends on times or parameters, or is unknown.
    Varying,
}

/// A change of a fluent at a point.
#[derive(Clone, Debug)]
pub(super) enum FluentChange {
    Set(Value),
    Shift(Value),
    /// A continuous change begins, with this rate.
    Starts(ContinuousId, Value),
    Ends(ContinuousId),
}

/// A continuous effect: the step, and the position in its action.
pub(super) type ContinuousId = (usize, usize);

/// The position of the first continuous effect of an action, behind all others.
const CONTINUOUS: usize = usize::MAX / 2;

/// All changes of facts and fluents.
pub(super) struct Histories<'a> {
    pub(super) subject: &'a Subject<'a>,
    pub(super) places: &'a OffsetComponents,
    /// By fact: the points that set it, in order of time, with its truth value.
    pub(super) facts: BTreeMap<FactId, Vec<(usize, bool)>>,
    /// By fluent: its changes, in order of time.
    pub(super) fluents: BTreeMap<FluentId, Vec<(usize, FluentChange)>>,
    /// Conditions of effects that vary.
    pub(super) decisions: Vec<Decision>,
    /// By parameter: its nominal value.
    pub(super) nominal: Vec<Rational>,
    /// Decisions with the opposite truth value.
    pub(super) flipped: BTreeSet<GuardId>,
}

impl<'a> Histories<'a> {
    /// Runs the plan in the order of its times.
    ///
    /// # Errors
    /// When an effect depends on numbers in a way that the checker has no rule for.
    pub(super) fn new(
        subject: &'a Subject<'a>,
        places: &'a OffsetComponents,
        widest: &mut Distances,
        nominal: Vec<Rational>,
    ) -> Result<Self, NotDerived> {
        Self::with(subject, places, widest, (nominal, BTreeSet::new()))
    }

    pub(super) fn with(
        subject: &'a Subject<'a>,
        places: &'a OffsetComponents,
        widest: &mut Distances,
        (nominal, flipped): (Vec<Rational>, BTreeSet<GuardId>),
    ) -> Result<Self, NotDerived> {
        let mut histories = Self {
            subject,
            places,
            facts: BTreeMap::new(),
            fluents: BTreeMap::new(),
            decisions: Vec::new(),
            nominal,
            flipped,
        };
        let mut order: Vec<usize> = (0..subject.points.len()).collect();
        order.sort_by_key(|&point| &subject.points[point].time);
        for point in order {
            histories.happen(point, widest)?;
        }
        Ok(histories)
    }

    fn happen(&mut self, point: usize, widest: &mut Distances) -> Result<(), NotDerived> {
        let subject = self.subject;
        match subject.points[point].kind {
            PointKind::Zero => Ok(()),
            PointKind::Timed(index) => {
                let changes = subject.task.timed()[index].changes.iter();
                self.apply(point, changes.collect())
            }
            PointKind::Instant(step) | PointKind::Start(step) => {
                match &subject.steps[step].action.body {
                    Body::Instantaneous(snap) => self.record_effects(point, step, &snap.effects),
                    Body::Durative(body) => {
                        self.record_effects(point, step, &body.start.effects)?;
                        self.start_continuous(point, step, body, widest)
                    }
                }
            }
            PointKind::End(step) => {
                let Some(body) = subject.steps[step].action.durative() else {
                    return Ok(());
                };
                let arrival = self.changes(point, step, &body.end.effects)?;
                let changes = self.fluent_changes(point, arrival)?;
                for (index, effect) in body.continuous.iter().enumerate() {
                    let change = (point, FluentChange::Ends((step, index)));
                    self.fluents.entry(effect.fluent).or_default().push(change);
                }
                self.record(point, changes);
                Ok(())
            }
        }
    }

    /// Records the effects of a snap action.
    fn record_effects(
        &mut self,
        point: usize,
        step: usize,
        effects: &'a [Effect],
    ) -> Result<(), NotDerived> {
        let changes = self.changes(point, step, effects)?;
        self.apply(point, changes)
    }

    fn apply(&mut self, point: usize, changes: Vec<&Change>) -> Result<(), NotDerived> {
        let changes = self.fluent_changes(point, changes)?;
        self.record(point, changes);
        Ok(())
    }

    fn record(&mut self, point: usize, changes: Vec<(FluentId, FluentChange)>) {
        for (fluent, change) in changes {
            self.fluents
                .entry(fluent)
                .or_default()
                .push((point, change));
        }
    }

    /// Returns the changes of those effects whose conditions hold.
    fn changes(
        &mut self,
        point: usize,
        step: usize,
        effects: &'a [Effect],
    ) -> Result<Vec<&'a Change>, NotDerived> {
        let mut changes = Vec::new();
        for (index, effect) in effects.iter().enumerate() {
            if self.is_effective(point, step, (index, &effect.guard))? {
                changes.push(&effect.change);
            }
        }
        Ok(changes)
    }

    /// Returns `true` if an effect with this guard takes place. Where that depends on times or parameters, it is a
    /// decision.
    fn is_effective(
        &mut self,
        point: usize,
        step: usize,
        (index, guard): (usize, &Guard),
    ) -> Result<bool, NotDerived> {
        let name = &self.subject.steps[step].action.name;
        if !guard.over_all.is_trivial() {
            let what = format!("a conditional effect over all of {name}");
            return Err(NotDerived::Unknown(what));
        }
        let start = self.subject.ends[step][0];
        for (part, (condition, at)) in [(&guard.at_start, start), (&guard.now, point)]
            .into_iter()
            .enumerate()
        {
            if !condition.is_trivial()
                && !self.decide((point, index, part), (condition, at), name)?
            {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Records the facts of changes, and returns those of fluents.
    fn fluent_changes(
        &mut self,
        point: usize,
        changes: Vec<&Change>,
    ) -> Result<Vec<(FluentId, FluentChange)>, NotDerived> {
        let mut facts: BTreeMap<FactId, bool> = BTreeMap::new();
        let mut updates = Vec::new();
        let mut operators: BTreeMap<FluentId, bool> = BTreeMap::new();
        for change in changes {
            match change {
                Change::Add(fact) => {
                    facts.insert(*fact, true);
                }
                Change::Delete(fact) => {
                    facts.entry(*fact).or_insert(false);
                }
                Change::Update {
                    operator,
                    fluent,
                    value,
                } => {
                    let is_additive = operator.is_additive();
                    let known = operators.insert(*fluent, is_additive);
                    if known.is_some_and(|other| !other || !is_additive) {
                        let what = format!(
                            "several changes of {} at `{}`",
                            self.subject.task.fluent_name(*fluent),
                            self.subject.label(point)
                        );
                        return Err(NotDerived::Unknown(what));
                    }
                    updates.push((
                        *fluent,
                        self.fluent_change(point, *operator, *fluent, value)?,
                    ));
                }
            }
        }
        for (fact, truth) in facts {
            self.facts.entry(fact).or_default().push((point, truth));
        }
        Ok(updates)
    }

    fn fluent_change(
        &self,
        point: usize,
        operator: UpdateOperator,
        fluent: FluentId,
        expression: &Expression,
    ) -> Result<FluentChange, NotDerived> {
        let (amount, before) = self.arrival(point, &mut |reading| {
            (reading.expression(expression), reading.fluent(fluent))
        });
        let is_divisor = operator == UpdateOperator::ScaleDown;
        let is_safe = match &amount {
            Value::Known(amount) => {
                !is_divisor || amount.as_number().is_some_and(|number| !number.is_zero())
            }
            Value::Undefined => false,
            Value::Unknown => !is_divisor && is_always_defined(expression),
        };
        if !is_safe {
            let what = format!(
                "an effect at `{}` on {}",
                self.subject.label(point),
                self.subject.task.fluent_name(fluent)
            );
            return Err(NotDerived::Unknown(what));
        }
        Ok(match operator {
            UpdateOperator::Assign => FluentChange::Set(amount),
            UpdateOperator::Increase => FluentChange::Shift(amount),
            UpdateOperator::Decrease => FluentChange::Shift(negated(amount)),
            UpdateOperator::ScaleUp => {
                FluentChange::Set(combined(&before, &amount, Linear::product))
            }
            UpdateOperator::ScaleDown => FluentChange::Set(combined(&before, &amount, quotient)),
        })
    }

    /// Records the starts of continuous changes. A rate has to stay as it is while the action runs.
    fn start_continuous(
        &mut self,
        point: usize,
        step: usize,
        body: &'a DurativeBody,
        widest: &mut Distances,
    ) -> Result<(), NotDerived> {
        let subject = self.subject;
        let end = subject.ends[step][1];
        for (index, effect) in body.continuous.iter().enumerate() {
            if !effect.guard.now.is_trivial() {
                let what = format!("a condition of {}", subject.steps[step].action.name);
                return Err(NotDerived::Unknown(what));
            }
            if !self.is_effective(point, step, (CONTINUOUS + index, &effect.guard))? {
                continue;
            }
            let mut rate = self.arrival(point, &mut |reading| reading.expression(&effect.rate));
            let mut is_steady = matches!(&rate, Value::Known(rate) if rate.times.is_empty());
            let mut read = elbowroom_model::Footprint::default();
            effect.rate.visit_fluents(&mut |fluent| {
                read.reads_fluents.insert(fluent);
            });
            for (other, own) in subject.points.iter().enumerate() {
                if own.time >= subject.points[point].time && own.writes(&read) {
                    is_steady &= widest.is_before(end, other, &Rational::ZERO)?;
                }
            }
            if !is_steady {
                if !is_always_defined(&effect.rate) {
                    let what = format!("a rate of {}", subject.steps[step].action.name);
                    return Err(NotDerived::Unknown(what));
                }
                rate = Value::Unknown;
            }
            let change = (point, FluentChange::Starts((step, index), rate));
            self.fluents.entry(effect.fluent).or_default().push(change);
        }
        Ok(())
    }

    /// Calls `read` with the state on arrival at a point.
    pub(super) fn arrival<T>(&self, point: usize, read: &mut dyn FnMut(&PointState<'_>) -> T) -> T {
        let subject = self.subject;
        let time = &subject.points[point].time;
        let planned = |step: usize| subject.steps[step].duration.clone();
        let duration = match subject.points[point].kind {
            PointKind::Start(step) => planned(step).map(Linear::number),
            PointKind::End(step) => {
                let start = self.places.time(subject.ends[step][0]);
                Some(self.places.time(point).minus(&start))
            }
            _ => None,
        };
        self.at(
            &|other| subject.points[other].time < *time,
            self.places.time(point),
            duration,
            read,
        )
    }

    /// Calls `read` with the state at the end of the plan.
    pub(super) fn finally<T>(&self, read: &mut dyn FnMut(&PointState<'_>) -> T) -> T {
        // Nothing changes any more, so the time does not count.
        self.at(&|_| true, Linear::default(), None, read)
    }

    /// Calls `read` with the state after the points for which `has_happened` is true.
    pub(super) fn at<T>(
        &self,
        has_happened: &dyn Fn(usize) -> bool,
        time: Linear,
        duration: Option<Linear>,
        read: &mut dyn FnMut(&PointState<'_>) -> T,
    ) -> T {
        read(&PointState {
            histories: self,
            has_happened,
            time,
            duration,
            derived: OnceCell::new(),
        })
    }

    /// Returns the number of a bound on the duration of a step, or `None` if it is not the same in all schedules.
    pub(super) fn duration_bound(
        &self,
        step: usize,
        bound: &DurationConstraint,
    ) -> Option<Rational> {
        let point = self.subject.ends[step][usize::from(bound.at_end)];
        let value = self.arrival(point, &mut |reading| reading.expression(&bound.bound));
        match value {
            Value::Known(value) => value.as_number().cloned(),
            Value::Undefined | Value::Unknown => None,
        }
    }

    /// Returns `true` if the fluent's initial value is a number or missing, and all its changes are
    /// assignments of numbers.
    pub(super) fn has_steps_alone(&self, fluent: FluentId) -> bool {
        let changes = self.fluents.get(&fluent);
        let is_initially_open = self.subject.initials.contains_key(&fluent);
        !is_initially_open
            && changes.is_none_or(|changes| {
                changes.iter().all(|(_, change)| {
                matches!(change, FluentChange::Set(Value::Known(value)) if value.as_number().is_some())
            })
            })
    }
}
