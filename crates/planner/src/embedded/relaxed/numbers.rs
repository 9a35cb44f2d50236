//! Distances of numbers from passing a test. Signs are exact; magnitudes only guide the search.

use elbowroom_model::problem::{Comparison, UpdateOperator};
use elbowroom_num::Rational;

use super::super::compile::{Compiled, Update};
use super::super::formula::Numeric;
use super::super::state::State;

/// Returns the gap of a failing test: positive if the difference must grow, NaN if the test reads a
/// fluent without a value.
pub(super) fn gap(compiled: &Compiled, test: u32, state: &State) -> f64 {
    let test = &compiled.tests[test as usize];
    match test.difference.value(&state.values, None) {
        None => f64::NAN,
        Some(value) => strict_margin(test.comparison) - value.to_f64(),
    }
}

/// Returns the gap of a test that fails even if the only fluent that it reads has its highest
/// level, or `None` if it may pass.
pub(super) fn gap_of_levels(
    compiled: &Compiled,
    test: u32,
    levels: &[(u32, Rational)],
) -> Option<f64> {
    let test = &compiled.tests[test as usize];
    let Numeric::Linear(linear) = &test.difference else {
        return None;
    };
    let [(fluent, coefficient)] = &linear.terms[..] else {
        return None;
    };
    let is_lower = matches!(test.comparison, Comparison::AtLeast | Comparison::Greater);
    if is_lower != coefficient.is_positive() || !linear.duration.is_zero() {
        return None;
    }
    let (_, level) = levels.iter().find(|(own, _)| own == fluent)?;
    let difference = coefficient * level + &linear.constant;
    let fails = !test.comparison.holds(&difference, &Rational::ZERO);
    fails.then(|| strict_margin(test.comparison) - difference.to_f64())
}

/// Returns the number of repetitions of a change that close a gap, or `None` if it never closes.
fn repetitions(gap: f64, gain: f64) -> Option<u32> {
    if gap.is_nan() || (gap > 0.0) != (gain > 0.0) {
        return None;
    }
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to a small positive range"
    )]
    let times = (gap / gain).ceil().clamp(1.0, 1000.0) as u32;
    Some(times)
}

/// The effect of a happening on a numeric test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Gain {
    /// It adds a constant to the test's difference.
    Adds(f64),
    /// It sets the difference to a constant that does not pass the test. The value is the remaining
    /// gap.
    Sets(f64),
    /// It passes the test if this number of further happenings follow. With 0, it may pass the test
    /// alone.
    Reaches(u32),
}

impl Gain {
    /// Returns the number of times the happening, or one after it, must happen to close a gap, or
    /// `None` if it never closes.
    pub(super) fn repetitions(self, gap: f64) -> Option<u32> {
        match self {
            Self::Adds(gain) => repetitions(gap, gain),
            Self::Sets(_) => None,
            Self::Reaches(more) => Some(1 + more),
        }
    }
}

/// Returns the gain for a test from the updates of one happening.
pub(super) fn gain(compiled: &Compiled, test: u32, updates: &[&Update]) -> Gain {
    if let Some(gap) = gap_after(compiled, test, updates) {
        return if gap == 0.0 {
            Gain::Reaches(0)
        } else {
            Gain::Sets(gap)
        };
    }
    match added(compiled, test, updates) {
        gain if gain.is_infinite() => Gain::Reaches(0),
        gain => Gain::Adds(gain),
    }
}

/// Returns the gap after a happening that assigns a constant to the only fluent that the test
/// reads; 0 if the test passes.
fn gap_after(compiled: &Compiled, test: u32, updates: &[&Update]) -> Option<f64> {
    let test = &compiled.tests[test as usize];
    let Numeric::Linear(linear) = &test.difference else {
        return None;
    };
    let [(fluent, coefficient)] = &linear.terms[..] else {
        return None;
    };
    let mut updates = updates.iter().filter(|update| update.fluent == *fluent);
    let (update, None) = (updates.next()?, updates.next()) else {
        return None;
    };
    if update.operator != UpdateOperator::Assign || !linear.duration.is_zero() {
        return None;
    }
    let difference = coefficient * update.value.as_constant()? + &linear.constant;
    if test.comparison.holds(&difference, &Rational::ZERO) {
        return Some(0.0);
    }
    Some(strict_margin(test.comparison) - difference.to_f64())
}

/// Returns the margin by which a strict test must be passed.
fn strict_margin(comparison: Comparison) -> f64 {
    match comparison {
        Comparison::Greater => 1e-9,
        Comparison::Less => -1e-9,
        _ => 0.0,
    }
}

/// Returns the constant that the updates of one happening add to a test's difference, or infinity
/// if they may reach any value.
fn added(compiled: &Compiled, test: u32, updates: &[&Update]) -> f64 {
    let test = &compiled.tests[test as usize];
    let Numeric::Linear(linear) = &test.difference else {
        let mut touches = false;
        test.difference
            .visit_fluents(&mut |fluent| touches |= updates.iter().any(|u| u.fluent == fluent));
        return if touches { f64::INFINITY } else { 0.0 };
    };
    let mut gain = Rational::ZERO;
    for (fluent, coefficient) in &linear.terms {
        for update in updates.iter().filter(|update| update.fluent == *fluent) {
            let Some(value) = update.value.as_constant() else {
                return f64::INFINITY;
            };
            match update.operator {
                UpdateOperator::Increase => gain += coefficient * value,
                UpdateOperator::Decrease => gain -= coefficient * value,
                _ => return f64::INFINITY,
            }
        }
    }
    gain.to_f64()
}
