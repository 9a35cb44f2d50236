//! Exact linear programs, solved incrementally.
//!
//! The general simplex of Dutertre & de Moura ("A fast linear-arithmetic solver for DPLL(T)", CAV
//! 2006): variables are free, some are defined as linear combinations of others, and every
//! constraint is a bound on one variable. Bounds can be added and removed while the tableau stays,
//! so a system that differs little from the last one is decided in a few pivots. Bounds are
//! [`Delta`]s, so they can be strict.
//!
//! ```
//! use elbowroom_num::simplex::{Optimum, Simplex};
//! use elbowroom_num::{Delta, Rational};
//!
//! let mut system = Simplex::new();
//! let (x, y) = (system.add_variable(), system.add_variable());
//! let sum = system.define(&[(x, Rational::ONE), (y, Rational::ONE)]);
//! system.assert_lower(x, Delta::from(Rational::from(2)), 0); //     x >= 2
//! system.assert_lower(y, Delta::just_above(Rational::ONE), 1); //   y > 1
//! system.assert_upper(sum, Delta::from(Rational::from(10)), 2); //  x + y <= 10
//! assert!(system.check().is_ok());
//! let most = system.maximize(&[(y, Rational::ONE)])?;
//! assert_eq!(most, Optimum::Value(Delta::from(Rational::from(8))));
//!
//! system.push();
//! system.assert_upper(sum, Delta::from(Rational::from(3)), 3); //   x + y <= 3
//! let clash = system.check().unwrap_err();
//! assert_eq!(clash.tags().collect::<Vec<_>>(), [0, 1, 3]);
//! system.pop();
//! assert!(system.check().is_ok());
//! # Ok::<(), elbowroom_num::simplex::Infeasible>(())
//! ```

mod check;
mod model;
mod optimum;
mod tableau;
#[cfg(test)]
mod tests;

pub use optimum::Optimum;

use crate::{Delta, Rational};
use tableau::Tableau;

/// A variable of a [`Simplex`], free or defined.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct VariableId(pub u32);

impl VariableId {
    /// Returns the variable's position in a list of all variables.
    pub fn index(self) -> usize {
        self.0 as usize
    }

    fn from_index(index: usize) -> Self {
        Self(u32::try_from(index).expect("systems have fewer than 2^32 variables"))
    }
}

/// Proof that no values satisfy all bounds, by Farkas' lemma.
///
/// With all bounds written as `term <= 0`, the bounds with these tags, each times its multiplier,
/// add up to `c <= 0` with a constant `c > 0`.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{} bounds contradict each other", .certificate.len())]
pub struct Infeasible {
    /// Tags in ascending order with their multipliers, which are positive. Without any one of them,
    /// there is no contradiction.
    pub certificate: Vec<(usize, Rational)>,
}

impl Infeasible {
    /// Returns the tags of the bounds that contradict each other.
    pub fn tags(&self) -> impl Iterator<Item = usize> {
        self.certificate.iter().map(|(tag, _)| *tag)
    }
}

/// A linear combination `Σ coefficient · variable`.
pub type Combination = [(VariableId, Rational)];

/// A system of linear inequalities, with an assignment that is kept near to a solution.
///
/// Invariants: the rows of the tableau hold in the assignment; a variable that is not basic
/// satisfies both its bounds, unless they contradict each other.
#[derive(Clone, Debug, Default)]
pub struct Simplex {
    tableau: Tableau,
    variables: Vec<Variable>,
    /// The assertions replaced since the first [`Simplex::push`], oldest first.
    replaced: Vec<Replaced>,
    /// Length of `replaced` at each push.
    levels: Vec<usize>,
}

#[derive(Clone, Debug, Default)]
struct Variable {
    lower: Option<Bound>,
    upper: Option<Bound>,
    value: Delta,
}

#[derive(Clone, Debug)]
struct Bound {
    value: Delta,
    tag: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Lower,
    Upper,
}

#[derive(Clone, Debug)]
struct Replaced {
    variable: VariableId,
    side: Side,
    bound: Option<Bound>,
}

impl Simplex {
    /// Creates a system without variables and bounds.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a variable that may take any value.
    pub fn add_variable(&mut self) -> VariableId {
        let variable = VariableId::from_index(self.variables.len());
        self.variables.push(Variable::default());
        self.tableau.add_column();
        variable
    }

    /// Adds a variable that equals `Σ coefficient · variable`. It stays when levels are popped.
    pub fn define(&mut self, row: &Combination) -> VariableId {
        let variable = self.add_variable();
        self.tableau.define(variable, row);
        self.variables[variable.index()].value = self.evaluate(row);
        variable
    }

    /// Returns the number of variables.
    pub fn variable_count(&self) -> usize {
        self.variables.len()
    }

    /// Asserts `variable >= bound`. A bound that is not tighter than the present one has no
    /// effect.
    pub fn assert_lower(&mut self, variable: VariableId, bound: Delta, tag: usize) {
        let present = &self.variables[variable.index()];
        if present.lower.as_ref().is_some_and(|old| old.value >= bound) {
            return;
        }
        let moves = !self.tableau.is_basic(variable)
            && present.value < bound
            && present.upper.as_ref().is_none_or(|up| bound <= up.value);
        if moves {
            self.set_value(variable, bound.clone());
        }
        self.replace(variable, Side::Lower, Some(Bound { value: bound, tag }));
    }

    /// Asserts `variable <= bound`. A bound that is not tighter than the present one has no
    /// effect.
    pub fn assert_upper(&mut self, variable: VariableId, bound: Delta, tag: usize) {
        let present = &self.variables[variable.index()];
        if present.upper.as_ref().is_some_and(|old| old.value <= bound) {
            return;
        }
        let moves = !self.tableau.is_basic(variable)
            && present.value > bound
            && present.lower.as_ref().is_none_or(|low| bound >= low.value);
        if moves {
            self.set_value(variable, bound.clone());
        }
        self.replace(variable, Side::Upper, Some(Bound { value: bound, tag }));
    }

    /// Begins a level: [`Simplex::pop`] undoes all assertions made after this call.
    pub fn push(&mut self) {
        self.levels.push(self.replaced.len());
    }

    /// Undoes all bounds asserted since the last open push; without an open push, all bounds.
    ///
    /// The assignment stays: looser bounds do not break its invariant.
    pub fn pop(&mut self) {
        let length = self.levels.pop().unwrap_or(0);
        for old in self.replaced.drain(length..).rev() {
            let variable = &mut self.variables[old.variable.index()];
            match old.side {
                Side::Lower => variable.lower = old.bound,
                Side::Upper => variable.upper = old.bound,
            }
        }
    }

    fn replace(&mut self, variable: VariableId, side: Side, bound: Option<Bound>) {
        let present = &mut self.variables[variable.index()];
        let place = match side {
            Side::Lower => &mut present.lower,
            Side::Upper => &mut present.upper,
        };
        let bound = std::mem::replace(place, bound);
        self.replaced.push(Replaced {
            variable,
            side,
            bound,
        });
    }

    /// Moves a variable that is not basic, and updates the basic ones.
    fn set_value(&mut self, variable: VariableId, value: Delta) {
        let step = &value - &self.variables[variable.index()].value;
        for (basic, coefficient) in self.tableau.column(variable) {
            let follower = &mut self.variables[basic.index()].value;
            *follower = &*follower + &step.scaled(coefficient);
        }
        self.variables[variable.index()].value = value;
    }

    fn evaluate(&self, row: &Combination) -> Delta {
        row.iter().fold(Delta::ZERO, |sum, (variable, factor)| {
            &sum + &self.variables[variable.index()].value.scaled(factor)
        })
    }
}

impl Variable {
    fn is_below_lower(&self) -> bool {
        matches!(&self.lower, Some(bound) if self.value < bound.value)
    }

    fn is_above_upper(&self) -> bool {
        matches!(&self.upper, Some(bound) if self.value > bound.value)
    }

    fn can_rise(&self) -> bool {
        self.upper
            .as_ref()
            .is_none_or(|bound| self.value < bound.value)
    }

    fn can_fall(&self) -> bool {
        self.lower
            .as_ref()
            .is_none_or(|bound| self.value > bound.value)
    }
}
