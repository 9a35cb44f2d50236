//! Rational values from values with infinitesimals.

use super::{Simplex, VariableId};
use crate::{Delta, Rational};

impl Simplex {
    /// Returns the variable's value in the assignment. After a successful [`Simplex::check`] all
    /// bounds hold in the assignment.
    pub fn value(&self, variable: VariableId) -> &Delta {
        &self.variables[variable.index()].value
    }

    /// Returns rational values of all variables that satisfy all bounds, strict ones strictly.
    /// Valid after a successful [`Simplex::check`].
    pub fn model(&self) -> Vec<Rational> {
        let delta = self.small_enough_delta();
        let variables = self.variables.iter();
        variables
            .map(|variable| at(&variable.value, &delta))
            .collect()
    }

    /// Returns a positive rational that can replace δ: every bound that holds for the infinitesimal
    /// also holds for this number (Dutertre & de Moura, section 5).
    fn small_enough_delta(&self) -> Rational {
        let mut delta = Rational::ONE;
        for variable in &self.variables {
            if let Some(lower) = &variable.lower {
                narrow(&mut delta, &lower.value, &variable.value);
            }
            if let Some(upper) = &variable.upper {
                narrow(&mut delta, &variable.value, &upper.value);
            }
        }
        delta
    }
}

/// Reduces `delta` until `less <= more` stays true when δ is replaced by it.
fn narrow(delta: &mut Rational, less: &Delta, more: &Delta) {
    if less.real < more.real && less.infinitesimal > more.infinitesimal {
        let room = &more.real - &less.real;
        let rate = &less.infinitesimal - &more.infinitesimal;
        *delta = std::mem::take(delta).min(room / rate);
    }
}

/// Returns `value` with δ replaced by `delta`.
fn at(value: &Delta, delta: &Rational) -> Rational {
    &value.real + &value.infinitesimal * delta
}
