//! Brute-force oracle: every order of the time points, ties included.
//!
//! It enumerates all orders of the happenings, group by group, and applies the validator's rules,
//! with values that are expressions in times and parameters. Each question ("can this condition be
//! false here?") is one linear program over all schedules with that order.
//!
//! Parameters that multiply something are not left open; a few values of each are tried. So
//! "inside" is certain only without such products. "Broken" always comes with a schedule.

mod effects;
mod group;
mod search;
mod truth;

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::Task;
use elbowroom_num::{Interval, Rational};
use elbowroom_plan::{DecoupledEnvelope, ParametrizedPlan, Schedule, Valuation};

use crate::second_oracle::polynomial::{Polynomial, Symbol};
use crate::second_oracle::system::System;
use search::{Search, Trouble};

/// Verdict on a box.
#[derive(Clone, Debug)]
pub(crate) enum Answer {
    Inside,
    /// For these values the plan has no schedule.
    NoSchedule(Valuation),
    /// This schedule for these values violates something.
    Broken(Break),
}

/// Violation, with values and a schedule that show it.
#[derive(Clone, Debug)]
pub(crate) struct Break {
    pub(crate) what: String,
    pub(crate) valuation: Valuation,
    pub(crate) schedule: Schedule,
    /// `true` if the violation is only a timed initial too close to another one, which the
    /// validator accepts.
    pub(crate) is_only_timed: bool,
}

/// Reason for having no answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum GaveUp {
    TooManyOrders,
    NotLinear,
    NotCovered,
}

/// Checks that all values in the box have a schedule, and that all schedules for them are valid.
pub(crate) fn check(
    task: &Task,
    plan: &ParametrizedPlan,
    epsilon: &Rational,
    envelope: &DecoupledEnvelope,
    most_groups: usize,
) -> Result<Answer, GaveUp> {
    if let Some(valuation) = without_schedule(plan, envelope) {
        return Ok(Answer::NoSchedule(valuation));
    }
    let mut multiplied = BTreeSet::new();
    let found = loop {
        match all_combinations(task, plan, epsilon, envelope, &multiplied, most_groups) {
            Ok(found) => break found,
            Err(Trouble::GaveUp(reason)) => return Err(reason),
            Err(Trouble::Product(polynomial)) => {
                let more = factors(&polynomial);
                if more.is_empty() || more.is_subset(&multiplied) {
                    return Err(GaveUp::NotLinear);
                }
                multiplied.extend(more);
            }
        }
    };
    Ok(match found {
        Some(found) => Answer::Broken(found),
        None => Answer::Inside,
    })
}

/// Returns values in the box for which the plan's network has no schedule.
///
/// The values that have one are a projection of the polyhedron of values and schedules, so they
/// form a convex set, and a box lies in it exactly if all its corners do. An infinite end is
/// replaced by a number that is larger than any sum in a small case.
pub(crate) fn without_schedule(
    plan: &ParametrizedPlan,
    envelope: &DecoupledEnvelope,
) -> Option<Valuation> {
    corners(envelope).into_iter().find(|corner| {
        let point = DecoupledEnvelope::point(corner);
        !System::new(plan, &point).is_feasible()
    })
}

/// Returns all combinations of ends.
pub(crate) fn corners(envelope: &DecoupledEnvelope) -> Vec<Valuation> {
    combinations(envelope.intervals(), &|interval| {
        let mut ends = vec![lower(interval), upper(interval)];
        ends.dedup();
        ends
    })
}

fn combinations(
    intervals: &[Interval],
    values: &dyn Fn(&Interval) -> Vec<Rational>,
) -> Vec<Valuation> {
    let mut combinations: Vec<Vec<Rational>> = vec![Vec::new()];
    for interval in intervals {
        let values = values(interval);
        combinations = combinations
            .iter()
            .flat_map(|so_far| {
                values.iter().map(move |value| {
                    let mut longer = so_far.clone();
                    longer.push(value.clone());
                    longer
                })
            })
            .collect();
    }
    combinations.into_iter().map(Valuation::new).collect()
}

/// Returns a number that is larger than any sum of the numbers in a case.
fn far() -> Rational {
    Rational::from(i64::MAX) * Rational::from(1_000_000)
}

fn lower(interval: &Interval) -> Rational {
    match (interval.lower.value(), interval.upper.value()) {
        (Some(lower), _) => lower.clone(),
        (None, Some(upper)) => upper - far(),
        (None, None) => -far(),
    }
}

fn upper(interval: &Interval) -> Rational {
    match (interval.lower.value(), interval.upper.value()) {
        (_, Some(upper)) => upper.clone(),
        (Some(lower), None) => lower + far(),
        (None, None) => far(),
    }
}

/// Returns both ends and some values in between.
fn samples(interval: &Interval) -> Vec<Rational> {
    let (lower, upper) = (lower(interval), upper(interval));
    let at = |part: Rational| &lower + (&upper - &lower) * part;
    let mut samples: Vec<_> = [(0, 1), (1, 4), (1, 2), (3, 4), (1, 1)]
        .map(|(numerator, denominator)| at(Rational::new(numerator, denominator)))
        .into();
    if interval.lower.is_infinite() || interval.upper.is_infinite() {
        let near = (-3..=3).map(|step| Rational::from(step * 4));
        samples.extend(near.filter(|value| interval.contains(value)));
    }
    samples.sort();
    samples.dedup();
    samples
}

/// Returns the parameters in products.
fn factors(polynomial: &Polynomial) -> BTreeSet<usize> {
    let products = polynomial.products();
    let symbols = products.flat_map(|factors| factors.iter());
    symbols
        .filter_map(|symbol| match symbol {
            Symbol::Parameter(index) => Some(*index),
            Symbol::Time(_) | Symbol::Moment => None,
        })
        .collect()
}

fn all_combinations(
    task: &Task,
    plan: &ParametrizedPlan,
    epsilon: &Rational,
    envelope: &DecoupledEnvelope,
    multiplied: &BTreeSet<usize>,
    most_groups: usize,
) -> Result<Option<Break>, Trouble> {
    let intervals: Vec<_> = multiplied
        .iter()
        .map(|&index| envelope.intervals()[index].clone())
        .collect();
    for values in combinations(&intervals, &samples) {
        let fixed: BTreeMap<_, _> = multiplied.iter().copied().zip(values).collect();
        let mut part = envelope.clone();
        for (&index, value) in &fixed {
            part = part.with_interval(index.into(), Interval::point(value.clone()));
        }
        let mut search = Search {
            task,
            plan,
            epsilon,
            system: System::new(plan, &part),
            fixed,
            left: most_groups,
            found: None,
        };
        if search.system.is_feasible() {
            let world = search.initial();
            search.next_groups(&world, &mut Vec::new(), 0)?;
        }
        if search.found.is_some() {
            return Ok(search.found);
        }
    }
    Ok(None)
}
