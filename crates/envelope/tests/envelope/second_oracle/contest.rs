//! Compares all oracles on the same boxes, and checks their claims with the validator.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use elbowroom_envelope::obligations::Requirement;
use elbowroom_envelope::soundness::Broken;
use elbowroom_envelope::{Guarantee, Objection, Oracle};
use elbowroom_model::Task;
use elbowroom_model::validate::Verdict;
use elbowroom_num::Rational;
use elbowroom_plan::{
    BoxEnd, DecoupledEnvelope, Node, NodeId, Parameter, ParameterId, ParametrizedPlan, Schedule,
    Side, Valuation,
};

use crate::second_oracle::case::{Case, show};
use crate::second_oracle::generate::sample;
use crate::second_oracle::plain::{self, Answer, GaveUp};
use crate::second_oracle::random::Random;
use crate::second_oracle::smt::{Encoding, Places, contained};
use crate::second_oracle::system::System;
use crate::second_oracle::z3::{Found, Z3};

/// Limit on groups of happenings that the plain oracle examines for one box.
const MAX_GROUPS: usize = 1500;

/// Query for a box.
#[derive(Clone, Debug)]
pub(crate) enum Step {
    /// This box, which becomes the box to widen.
    Jump(DecoupledEnvelope),
    /// This box, independently of the box to widen.
    Look(DecoupledEnvelope),
    /// The box to widen, with one end moved out by a distance, or to infinity.
    Widen { end: BoxEnd, by: Option<Rational> },
    /// The same, but the box to widen does not change.
    LookWider { end: BoxEnd, by: Option<Rational> },
}

/// Statistics of a comparison.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tally {
    /// Numbers of boxes, by the common verdict of the oracles (or by its absence).
    pub(crate) counts: BTreeMap<&'static str, usize>,
    pub(crate) refusals: BTreeMap<String, usize>,
}

impl Tally {
    fn count(&mut self, what: &'static str) {
        *self.counts.entry(what).or_default() += 1;
    }

    pub(crate) fn include(&mut self, other: Self) {
        for (what, count) in other.counts {
            *self.counts.entry(what).or_default() += count;
        }
        for (what, count) in other.refusals {
            *self.refusals.entry(what).or_default() += count;
        }
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (what, count) in &self.counts {
            writeln!(f, "{count:7} {what}")?;
        }
        for (what, count) in &self.refusals {
            writeln!(f, "{count:7} refused: {what}")?;
        }
        Ok(())
    }
}

/// Contradiction between oracles or with the validator.
#[derive(Clone, Debug)]
pub(crate) struct Mismatch {
    /// Kind of the bug: the same for similar ones.
    pub(crate) kind: &'static str,
    pub(crate) details: String,
}

/// Case with queries.
#[derive(Clone, Debug)]
pub(crate) struct Script {
    pub(crate) case: Case,
    pub(crate) steps: Vec<Step>,
}

impl Script {
    /// Runs all queries, one after the other, on the same fast oracle.
    pub(crate) fn run(&self, solver: Option<&mut Z3>) -> Result<Tally, Mismatch> {
        let (task, plan) = self.case.build();
        let (task, plan) = (Arc::new(task), Arc::new(plan));
        let mut contest = Contest {
            case: &self.case,
            task: &task,
            plan: &plan,
            solver,
            encoding: Encoding::new(&task, &plan, &self.case.epsilon, &Places::any(&plan)).ok(),
            dice: Random::new(1),
            tally: Tally::default(),
        };
        let mut oracle = match Oracle::new(&task, &plan, Guarantee::Weak) {
            Ok(oracle) => oracle,
            Err(refusal) => {
                contest.tally.count("plans refused");
                let reason = format!("{refusal:?}");
                let reason = reason.split(' ').next().unwrap_or_default().to_owned();
                *contest.tally.refusals.entry(reason).or_default() += 1;
                return Ok(contest.tally);
            }
        };
        contest.tally.count("plans");
        for step in &self.steps {
            let Some(envelope) = next_box(step, oracle.accepted(), &plan.parameters) else {
                continue;
            };
            let before = oracle.accepted().cloned();
            let Some(is_inside) = contest.ask(&mut oracle, step, &envelope)? else {
                break;
            };
            let is_kept = match step {
                Step::Jump(_) | Step::Widen { .. } => is_inside,
                Step::Look(_) | Step::LookWider { .. } => false,
            };
            let expected = if is_kept { Some(envelope) } else { before };
            assert_eq!(oracle.accepted(), expected.as_ref(), "{step:?}");
        }
        Ok(contest.tally)
    }
}

fn next_box(
    step: &Step,
    accepted: Option<&DecoupledEnvelope>,
    parameters: &[Parameter],
) -> Option<DecoupledEnvelope> {
    match step {
        Step::Jump(envelope) | Step::Look(envelope) => Some(envelope.clone()),
        Step::Widen { end, by } | Step::LookWider { end, by } => {
            let accepted = accepted?;
            let reach = end.reach(accepted)?;
            let widened = end.with_reach(accepted, by.as_ref().map(|by| reach + by));
            let range = &parameters[end.parameter.index()].range;
            let interval = widened.interval(end.parameter);
            let is_in_range = range.intersection(interval) == *interval;
            is_in_range.then_some(widened)
        }
    }
}

/// Generates random queries around the nominal point: growing boxes as in a search, and some
/// others.
pub(crate) fn steps(dice: &mut Random, parameters: &[Parameter], length: usize) -> Vec<Step> {
    let nominal: Valuation = parameters.iter().map(|p| p.nominal.clone()).collect();
    let mut steps = vec![Step::Jump(DecoupledEnvelope::point(&nominal))];
    if parameters.is_empty() {
        return steps;
    }
    for _ in 0..length {
        let end = BoxEnd {
            parameter: ParameterId::from(dice.below(parameters.len())),
            side: *dice.pick(&Side::BOTH),
        };
        let by = (!dice.chance(8)).then(|| {
            dice.pick(&[
                Rational::new(1, 4),
                Rational::new(1, 2),
                Rational::ONE,
                Rational::from(2),
                Rational::from(5),
            ])
            .clone()
        });
        steps.push(match dice.below(8) {
            0 => match random_box(dice, &nominal, parameters) {
                envelope if dice.chance(50) => Step::Jump(envelope),
                envelope => Step::Look(envelope),
            },
            1 => Step::LookWider { end, by },
            _ => Step::Widen { end, by },
        });
    }
    steps
}

/// Generates a box near the nominal point, usually one that contains it.
fn random_box(
    dice: &mut Random,
    nominal: &Valuation,
    parameters: &[Parameter],
) -> DecoupledEnvelope {
    let mut envelope = DecoupledEnvelope::point(nominal);
    let is_around = dice.chance(75);
    for (index, parameter) in parameters.iter().enumerate() {
        let width = *dice.pick(&[0, 0, 1, 2, 4, 8]);
        let below = dice.between(if is_around { 0 } else { -width }, width);
        let above = dice.between(if is_around { 0 } else { -below }, width);
        let (below, above) = (Rational::new(below, 2), Rational::new(above, 2));
        let wide = elbowroom_num::Interval::closed(
            &parameter.nominal - &below,
            &parameter.nominal + &above,
        );
        let mut wide = wide.intersection(&parameter.range);
        if dice.chance(6) {
            wide.lower = parameter.range.lower.clone();
        }
        if dice.chance(6) {
            wide.upper = parameter.range.upper.clone();
        }
        if !wide.is_empty() {
            envelope = envelope.with_interval(index.into(), wide);
        }
    }
    envelope
}

struct Contest<'a> {
    case: &'a Case,
    task: &'a Task,
    plan: &'a ParametrizedPlan,
    solver: Option<&'a mut Z3>,
    encoding: Option<Encoding>,
    dice: Random,
    tally: Tally,
}

impl Contest<'_> {
    /// Returns `true` if the box is inside; `None` if the fast oracle has no answer.
    fn ask(
        &mut self,
        oracle: &mut Oracle,
        step: &Step,
        envelope: &DecoupledEnvelope,
    ) -> Result<Option<bool>, Mismatch> {
        self.tally.count("boxes");
        let fast = match step {
            Step::Jump(_) => oracle.start(envelope),
            Step::Look(_) | Step::LookWider { .. } => oracle.objection(envelope),
            Step::Widen { end, .. } => oracle.objection_to_reach(*end, end.reach(envelope)),
        };
        let fast = match fast {
            Ok(fast) => fast,
            Err(refusal) => {
                let reason = format!("{refusal:?}");
                let reason = reason.split(' ').next().unwrap_or_default().to_owned();
                *self.tally.refusals.entry(reason).or_default() += 1;
                return Ok(None);
            }
        };
        let is_inside = fast.is_none();
        self.compare_with_plain(envelope, is_inside)?;
        match &fast {
            None => self.sample(envelope)?,
            Some(Objection::NoSchedule(valuation)) => {
                self.confirm_no_schedule(envelope, valuation)?;
            }
            Some(Objection::Broken(broken)) => self.confirm(oracle, envelope, broken)?,
            Some(other) => panic!("{other:?}"),
        }
        self.compare_with_solver(envelope, is_inside)?;
        Ok(Some(is_inside))
    }

    fn mismatch<T>(
        &self,
        kind: &'static str,
        envelope: &DecoupledEnvelope,
        details: &str,
    ) -> Result<T, Mismatch> {
        Err(Mismatch {
            kind,
            details: format!("box {}: {details}\n{}", show(envelope), self.case),
        })
    }

    /// Checks that all sampled schedules are valid.
    fn sample(&mut self, envelope: &DecoupledEnvelope) -> Result<(), Mismatch> {
        let mut system = System::new(self.plan, envelope);
        for _ in 0..3 {
            let Some((valuation, schedule)) = sample(&mut system, &mut self.dice) else {
                return Ok(());
            };
            if let Verdict::Invalid(violation) = self.case.validate(&valuation, &schedule) {
                if self.timed_change_places(&schedule) {
                    continue;
                }
                let details = format!("{violation} at {valuation:?}, {schedule:?}");
                return self.mismatch("inside, but the judge objects", envelope, &details);
            }
        }
        Ok(())
    }

    fn timed_change_places(&self, schedule: &Schedule) -> bool {
        let nodes = self.plan.plan.nodes();
        let times: Vec<_> = nodes
            .filter(|(_, node)| matches!(node, Node::Timed(_)))
            .map(|(id, _)| &schedule[id])
            .collect();
        times.windows(2).any(|pair| pair[0] >= pair[1])
    }

    fn confirm_no_schedule(
        &self,
        envelope: &DecoupledEnvelope,
        valuation: &Valuation,
    ) -> Result<(), Mismatch> {
        let details = format!("{valuation:?}");
        if !envelope.contains(valuation) {
            return self.mismatch("no schedule, outside the box", envelope, &details);
        }
        if System::new(self.plan, &DecoupledEnvelope::point(valuation)).is_feasible() {
            return self.mismatch("no schedule, but there is one", envelope, &details);
        }
        Ok(())
    }

    /// Checks that the counterexample is a schedule in the box, and that the validator rejects it.
    fn confirm(
        &mut self,
        oracle: &Oracle,
        envelope: &DecoupledEnvelope,
        broken: &Broken,
    ) -> Result<(), Mismatch> {
        let Some(counterexample) = oracle.counterexample(envelope, broken) else {
            let details = format!("{broken:?}");
            return self.mismatch("no counterexample", envelope, &details);
        };
        let (valuation, schedule) = (&counterexample.valuation, &counterexample.schedule);
        let details = format!("{broken:?}\nat {valuation:?}, {schedule:?}");
        if !envelope.contains(valuation) {
            return self.mismatch("counterexample outside the box", envelope, &details);
        }
        if !self.is_schedule(valuation, schedule) {
            return self.mismatch("counterexample is no schedule", envelope, &details);
        }
        if let Requirement::Separation { first, second } = broken.requirement
            && self.are_timed(first, second)
        {
            self.tally.count("timed initials too near");
            return Ok(());
        }
        match self.case.validate(valuation, schedule) {
            Verdict::Valid(_) => self.mismatch("counterexample is valid", envelope, &details),
            Verdict::Invalid(_) => {
                self.tally.count("counterexamples confirmed");
                Ok(())
            }
            Verdict::Undecided(_) => {
                self.tally.count("counterexamples the judge cannot tell");
                Ok(())
            }
        }
    }

    /// Returns `true` if both are timed initials; the validator does not require a distance between
    /// them.
    fn are_timed(&self, first: NodeId, second: NodeId) -> bool {
        let is_timed = |id: NodeId| matches!(self.plan.plan.nodes[id.index()], Node::Timed(_));
        is_timed(first) && is_timed(second)
    }

    fn is_schedule(&self, valuation: &Valuation, schedule: &Schedule) -> bool {
        let plan = self.plan.plan.at(valuation);
        let gaps = plan.constraints.iter().all(|constraint| {
            let gap = &schedule[constraint.to] - &schedule[constraint.from];
            let lower = match &constraint.lower {
                elbowroom_plan::Bound::Finite(lower) => gap >= *lower,
                _ => true,
            };
            let upper = match &constraint.upper {
                elbowroom_plan::Bound::Finite(upper) => gap <= *upper,
                _ => true,
            };
            lower && upper
        });
        gaps && schedule.iter().all(|time| !time.is_negative()) && schedule[NodeId::ZERO].is_zero()
    }

    fn compare_with_plain(
        &mut self,
        envelope: &DecoupledEnvelope,
        is_inside: bool,
    ) -> Result<(), Mismatch> {
        let plain = plain::check(
            self.task,
            self.plan,
            &self.case.epsilon,
            envelope,
            MAX_GROUPS,
        );
        match plain {
            Err(GaveUp::TooManyOrders) => self.tally.count("plain: too many orders"),
            Err(GaveUp::NotLinear) => self.tally.count("plain: not linear"),
            Err(GaveUp::NotCovered) => self.tally.count("plain: not covered"),
            Ok(Answer::Inside) if is_inside => self.tally.count("plain: agreed inside"),
            Ok(Answer::Inside) => {
                return self.mismatch("outside, but plain says inside", envelope, "");
            }
            Ok(Answer::NoSchedule(valuation)) => {
                if is_inside {
                    let details = format!("{valuation:?}");
                    return self.mismatch("inside, but without schedule", envelope, &details);
                }
                self.tally.count("plain: agreed outside, no schedule");
            }
            Ok(Answer::Broken(found)) => {
                let details = format!(
                    "{} at {:?}, {:?}",
                    found.what, found.valuation, found.schedule
                );
                if !self.is_schedule(&found.valuation, &found.schedule)
                    || !envelope.contains(&found.valuation)
                    || (!found.is_only_timed
                        && self
                            .case
                            .validate(&found.valuation, &found.schedule)
                            .is_valid())
                {
                    return self.mismatch("plain is wrong", envelope, &details);
                }
                if is_inside {
                    return self.mismatch("inside, but broken", envelope, &details);
                }
                self.tally.count("plain: agreed outside, broken");
            }
        }
        Ok(())
    }

    fn compare_with_solver(
        &mut self,
        envelope: &DecoupledEnvelope,
        is_inside: bool,
    ) -> Result<(), Mismatch> {
        let Some(solver) = self.solver.as_deref_mut() else {
            return Ok(());
        };
        let Some(encoding) = &self.encoding else {
            self.tally.count("z3: not encoded");
            return Ok(());
        };
        let mut found = Found::NoModel;
        for corner in plain::corners(envelope) {
            let point = DecoupledEnvelope::point(&corner);
            if solver.ask(&encoding.scheduled(&point)) == Found::NoModel {
                found = Found::Model;
                break;
            }
        }
        if found == Found::NoModel {
            found = solver.ask(&encoding.broken(envelope));
        }
        self.compare_with_shortcuts(envelope, found)?;
        match (found, is_inside) {
            (Found::Unknown, _) => self.tally.count("z3: unknown"),
            (Found::Model, false) => self.tally.count("z3: agreed outside"),
            (Found::NoModel, true) => self.tally.count("z3: agreed inside"),
            (Found::Model, true) => return self.mismatch("inside, z3 objects", envelope, ""),
            (Found::NoModel, false) => {
                return self.mismatch("outside, z3 says inside", envelope, "");
            }
        }
        Ok(())
    }

    /// Compares the verdicts without enumerating corners and impossible orders, as for large plans.
    fn compare_with_shortcuts(
        &mut self,
        envelope: &DecoupledEnvelope,
        found: Found,
    ) -> Result<(), Mismatch> {
        let Some(solver) = self.solver.as_deref_mut() else {
            return Ok(());
        };
        let shortcut = match contained(self.task, self.plan, &self.case.epsilon, envelope, solver) {
            Some(true) => Found::NoModel,
            Some(false) => Found::Model,
            None => Found::Unknown,
        };
        if shortcut != found && shortcut != Found::Unknown && found != Found::Unknown {
            let details = format!("{found:?} {shortcut:?}");
            return self.mismatch("z3 disagrees with its own shortcuts", envelope, &details);
        }
        Ok(())
    }
}
