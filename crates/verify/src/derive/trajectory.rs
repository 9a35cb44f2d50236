//! Trajectory constraints, as orders and bounds on differences of times:
//! [`TrajectoryDerivation`].
//!
//! The facts that a constraint reads change at some points. These changes keep their order in all
//! schedules, and simultaneous ones stay simultaneous. So the constraint's conditions are true and
//! false in the same phases in each schedule. `always`, `sometime`, `at-most-once`,
//! `sometime-after`, `sometime-before` and `at end` depend on nothing else. The others need bounds
//! on the times at which phases begin: the state of a phase counts from the time of its change
//! until just before the next change (`elbowroom_model::Modal`). The validator has checked the
//! constraints in the plan itself.

use std::collections::BTreeSet;

use elbowroom_model::ground::{Condition, FactId};
use elbowroom_model::{Footprint, Modal};
use elbowroom_num::Rational;

use super::NotDerived;
use super::distances::Distances;
use super::subject::{PointKind, Subject};
use crate::certificate::{Constraint, Limit};

/// `least <= time of to - time of from <= most`, which the plan needs because of a trajectory
/// constraint..
struct Bound {
    from: usize,
    to: usize,
    least: Option<Rational>,
    most: Option<Rational>,
}

/// The bounds that keep the trajectory constraints.
pub(super) struct TrajectoryDerivation(Vec<Bound>);

/// Part of the plan during which the conditions of a constraint keep their truth values.
struct Phase {
    /// The points of the change that begins the phase; time zero for the initial state.
    change: Vec<usize>,
    /// The truth of the conditions; of the second, false if there is only one.
    holds: [bool; 2],
}

impl TrajectoryDerivation {
    /// Computes the bounds.
    ///
    /// # Errors
    /// When a constraint reads numbers, derived facts, or facts that conditional effects change.
    pub(super) fn new(subject: &Subject<'_>) -> Result<Self, NotDerived> {
        let constraints = subject.task.constraints();
        if !constraints.hard.is_empty() && constraints.depends_on_unknown_past() {
            let what = "trajectory constraints during execution";
            return Err(NotDerived::unknown(what));
        }
        let mut course = Self(Vec::new());
        for modal in &constraints.hard {
            let phases = phases(subject, modal)?;
            course.check_order(subject, &phases);
            course.check_times(subject, modal, &phases);
        }
        Ok(course)
    }

    /// Checks that all bounds hold in all schedules.
    ///
    /// # Errors
    /// The first bound that some schedule breaks.
    pub(super) fn check(
        &self,
        subject: &Subject<'_>,
        distances: &mut Distances,
    ) -> Result<(), NotDerived> {
        for bound in &self.0 {
            let Bound { from, to, .. } = *bound;
            let mut holds = true;
            if let Some(least) = &bound.least {
                holds = distances.is_before(from, to, least)?;
            }
            if let Some(most) = &bound.most {
                holds = holds && distances.is_before(to, from, &-most)?;
            }
            if !holds {
                let what = format!(
                    "in some schedules of the network, the times of `{}` and `{}` violate a \
                     trajectory constraint",
                    subject.label(from),
                    subject.label(to)
                );
                return Err(NotDerived::differs(what));
            }
        }
        Ok(())
    }

    /// Returns `true` if the bounds imply a constraint of the network.
    pub(super) fn implies(&self, constraint: &Constraint) -> bool {
        let keeps = |own: &Bound| {
            let is_least = match &constraint.lower {
                Limit::None => true,
                Limit::Number(least) => own.least.as_ref().is_some_and(|own| least.0 <= *own),
                Limit::Parameter(_) => false,
            };
            let is_most = match &constraint.upper {
                Limit::None => true,
                Limit::Number(most) => own.most.as_ref().is_some_and(|own| most.0 >= *own),
                Limit::Parameter(_) => false,
            };
            own.from == constraint.from && own.to == constraint.to && is_least && is_most
        };
        !constraint.observed && self.0.iter().any(keeps)
    }

    /// Keeps the changes in their order, and the points of each change together.
    fn check_order(&mut self, subject: &Subject<'_>, phases: &[Phase]) {
        let zero = || Some(Rational::ZERO);
        for (index, phase) in phases.iter().enumerate().skip(1) {
            for (place, &from) in phase.change.iter().enumerate() {
                for &to in &phase.change[place + 1..] {
                    self.add((from, to), zero(), zero());
                }
                for later in phases.iter().skip(index + 1) {
                    for &to in &later.change {
                        let gap = &subject.points[to].time - &subject.points[from].time;
                        let least = gap.min(subject.task.epsilon().clone());
                        self.add((from, to), Some(least), None);
                    }
                }
            }
        }
    }

    /// Bounds the times at which phases begin.
    fn check_times(&mut self, subject: &Subject<'_>, modal: &Modal<Condition>, phases: &[Phase]) {
        match modal {
            Modal::Within(time, _) => {
                if let Some(first) = phases.iter().find(|phase| phase.holds[0]) {
                    self.begins(first, None, Some(time));
                }
            }
            Modal::AlwaysWithin(time, ..) => {
                for (index, phase) in phases.iter().enumerate() {
                    let is_open = phase.holds[0] && !phase.holds[1];
                    let answer = phases[index..].iter().find(|phase| phase.holds[1]);
                    if let Some(answer) = answer.filter(|_| is_open) {
                        let pair = (phase.change[0], answer.change[0]);
                        self.add(pair, None, Some(time.clone()));
                    }
                }
            }
            Modal::HoldDuring(from, _, _) | Modal::HoldAfter(from, _) => {
                for (index, phase) in phases.iter().enumerate() {
                    if phase.holds[0] {
                        continue;
                    }
                    let next = phases.get(index + 1);
                    let begins = |phase: &Phase| &subject.points[phase.change[0]].time;
                    match (next.filter(|next| begins(next) <= from), modal) {
                        (Some(next), _) => self.begins(next, None, Some(from)),
                        (None, Modal::HoldDuring(_, until, _)) => {
                            self.begins(phase, Some(until), None);
                        }
                        (None, _) => {}
                    }
                }
            }
            Modal::AtEnd(_)
            | Modal::Always(_)
            | Modal::Sometime(_)
            | Modal::AtMostOnce(_)
            | Modal::SometimeAfter(..)
            | Modal::SometimeBefore(..) => {}
        }
    }

    fn begins(&mut self, phase: &Phase, least: Option<&Rational>, most: Option<&Rational>) {
        self.add((0, phase.change[0]), least.cloned(), most.cloned());
    }

    fn add(&mut self, (from, to): (usize, usize), least: Option<Rational>, most: Option<Rational>) {
        if from != to {
            self.0.push(Bound {
                from,
                to,
                least,
                most,
            });
        }
    }
}

/// Returns the phases of a constraint in the plan: that of the initial state, then one for each
/// change.
fn phases(subject: &Subject<'_>, modal: &Modal<Condition>) -> Result<Vec<Phase>, NotDerived> {
    let task = subject.task;
    let unknown = |what: &str| {
        let modal = task.describe_modal(modal);
        NotDerived::Unknown(format!("the constraint {modal}, which reads {what}"))
    };
    let conditions = modal.conditions();
    let mut read: BTreeSet<FactId> = BTreeSet::new();
    for condition in &conditions {
        let footprint = Footprint::of_condition(task, condition);
        if !footprint.reads_fluents.is_empty() {
            return Err(unknown("numbers"));
        }
        let mut is_derived = false;
        condition.visit_facts(&mut |fact| is_derived |= task.is_derived(fact));
        if is_derived {
            return Err(unknown("derived facts"));
        }
        read.extend(footprint.reads);
    }
    let mut changes: Vec<usize> = Vec::new();
    for (index, point) in subject.points.iter().enumerate().skip(1) {
        let footprint = &point.footprint;
        let mut written = footprint.adds.iter().chain(&footprint.deletes);
        if written.any(|fact| read.contains(fact)) {
            if !matches!(point.kind, PointKind::Timed(_)) && subject.has_guards(index) {
                return Err(unknown("facts that conditional effects change"));
            }
            changes.push(index);
        }
    }
    let time = |point: usize| &subject.points[point].time;
    changes.sort_by_key(|&point| time(point));
    let mut facts: BTreeSet<FactId> = task.initial().facts.iter().copied().collect();
    let truth = |facts: &BTreeSet<FactId>| {
        let mut holds = [false; 2];
        for (condition, holds) in conditions.iter().zip(&mut holds) {
            *holds = is_true(condition, facts);
        }
        holds
    };
    let mut phases = vec![Phase {
        change: vec![0],
        holds: truth(&facts),
    }];
    for change in changes.chunk_by(|one, other| time(*one) == time(*other)) {
        for &point in change {
            for fact in &subject.points[point].footprint.deletes {
                facts.remove(fact);
            }
        }
        for &point in change {
            facts.extend(&subject.points[point].footprint.adds);
        }
        phases.push(Phase {
            change: change.to_vec(),
            holds: truth(&facts),
        });
    }
    Ok(phases)
}

/// Returns the truth of a condition that reads no numbers and no derived facts.
fn is_true(condition: &Condition, facts: &BTreeSet<FactId>) -> bool {
    match condition {
        Condition::Fact(fact) => facts.contains(fact),
        Condition::Compare(..) => false,
        Condition::Not(part) => !is_true(part, facts),
        Condition::And(parts) => parts.iter().all(|part| is_true(part, facts)),
        Condition::Or(parts) => parts.iter().any(|part| is_true(part, facts)),
    }
}
