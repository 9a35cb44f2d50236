//! Upper bounds on numbers that depend on times, without a linear program.
//!
//! The level of a battery that was charged for an open time is a linear expression over the start
//! and the end of that action. Two kinds of constraints bound it: the demand that the level stays
//! within the capacity, which is the same expression up to a constant, and the duration bounds.

use elbowroom_model::problem::Comparison;
use elbowroom_num::Rational;

use super::super::compile::Compiled;
use super::super::expressions::{Form, Symbolic};
use super::super::network::Network;
use super::super::state::State;
use super::super::time::Scale;
use super::{is_assigned_later, settled_function};

/// Returns an upper bound on the value of a fluent after the ends of all running actions, without
/// its jumps at these ends, or `None` if it has no bound.
pub(crate) fn highest_level(compiled: &Compiled, state: &State, fluent: u32) -> Option<Rational> {
    if let Some(value) = &state.values[fluent as usize] {
        return Some(value.clone());
    }
    let symbolic = state.symbolic.as_ref()?;
    if is_assigned_later(compiled, state, fluent) {
        return None;
    }
    let course = settled_function(compiled, symbolic, state, fluent)?;
    if !course.rate.is_zero() {
        return None;
    }
    highest_value(course.base, symbolic, &state.network, compiled.scale)
}

/// Returns an upper bound on the value of an expression over times. The latest happenings are
/// bounded by durations, and the rest by a demand, or all of them by either; the least of these
/// bounds counts.
fn highest_value(
    mut form: Form,
    symbolic: &Symbolic,
    network: &Network,
    scale: Scale,
) -> Option<Rational> {
    let mut highest: Option<Rational> = None;
    let mut of_durations = Rational::ZERO;
    loop {
        let demands = symbolic.demands.iter();
        let bounds =
            demands.filter_map(|(demanded, comparison)| by_demand(&form, demanded, *comparison));
        let bounds = bounds.chain(form.as_constant().cloned());
        let bounds = bounds.map(|rest| rest + &of_durations);
        highest = bounds.chain(highest).min();
        match take_duration(&mut form, network, scale) {
            Some(bound) => of_durations += bound,
            None => return highest,
        }
    }
}

/// Returns the bound on an expression by the demand `demanded comparison 0`, if that concerns a
/// multiple of it and a constant.
fn by_demand(form: &Form, demanded: &Form, comparison: Comparison) -> Option<Rational> {
    let (first, known) = (form.terms.first()?, demanded.terms.first()?);
    let factor = &first.1 / &known.1;
    let bounds_above = match comparison {
        Comparison::Less | Comparison::AtMost => !factor.is_negative(),
        Comparison::Equal => true,
        Comparison::AtLeast | Comparison::Greater => factor.is_negative(),
    };
    let mut pairs = form.terms.iter().zip(&demanded.terms);
    let is_multiple = form.terms.len() == demanded.terms.len()
        && pairs.all(|(own, other)| own.0 == other.0 && own.1 == &factor * &other.1);
    (bounds_above && is_multiple).then(|| &form.constant - &(&factor * &demanded.constant))
}

/// Removes a multiple of a duration from an expression: the latest happening, and an earlier one
/// with the opposite coefficient. Returns an upper bound on it by the constraints between the two.
fn take_duration(form: &mut Form, network: &Network, scale: Scale) -> Option<Rational> {
    let (end, coefficient) = form.terms.last()?.clone();
    let opposite = -&coefficient;
    let place = form
        .terms
        .iter()
        .rposition(|(_, other)| *other == opposite)?;
    let start = form.terms[place].0;
    // `to >= from + distance`: a lower bound on the duration, or the negative of an upper bound.
    let (from, to) = if coefficient.is_negative() {
        (start, end)
    } else {
        (end, start)
    };
    let distance = network
        .edges()
        .filter(|edge| (edge.0, edge.1) == (from, to))
        .map(|edge| edge.2)
        .max()?;
    form.terms.pop();
    form.terms.remove(place);
    Some(-(coefficient.abs() * scale.units(distance)))
}

#[cfg(test)]
mod tests;
