//! How far numbers are from passing a test. Signs are exact, magnitudes only guide the search.

use elbowroom_model::problem::{Comparison, UpdateOperator};
use elbowroom_num::Rational;

use super::super::compile::{Compiled, Update};
use super::super::formula::Numeric;
use super::super::state::State;

/// What is missing for a test that fails: positive if the difference must grow. Not a number if
/// something it reads has no value.
pub(super) fn gap(compiled: &Compiled, test: u32, state: &State) -> f64 {
    let test = &compiled.tests[test as usize];
    match test.difference.value(&state.values, None) {
        None => f64::NAN,
        // A strict test asks for a little more than the gap.
        Some(value) => {
            let strict = match test.comparison {
                Comparison::Greater => 1e-9,
                Comparison::Less => -1e-9,
                _ => 0.0,
            };
            strict - value.to_f64()
        }
    }
}

/// How often a change must happen to close a gap; `None` if it never will.
pub(super) fn repetitions(gap: f64, gain: f64) -> Option<u32> {
    if gain.is_infinite() {
        return Some(1);
    }
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

/// What the updates of one happening do to a test: the constant that they add to its difference,
/// or infinity if they may do anything.
pub(super) fn gain(compiled: &Compiled, test: u32, updates: &[&Update]) -> f64 {
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
