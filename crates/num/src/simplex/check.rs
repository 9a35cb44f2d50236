//! Feasibility: the procedure `Check` of Dutertre & de Moura, Figure 2.

use super::{Bound, Infeasible, Simplex, VariableId};
use crate::{Delta, Rational};

/// The number of pivots per row after which Bland's rule takes over, which cannot cycle.
const GREEDY_PIVOTS_PER_ROW: usize = 2;

impl Simplex {
    /// Moves the assignment until it satisfies all bounds, or proves that none does.
    ///
    /// # Errors
    /// Bounds that contradict each other.
    pub fn check(&mut self) -> Result<(), Infeasible> {
        self.refute_by_one_variable()?;
        let mut greedy_pivots = GREEDY_PIVOTS_PER_ROW * self.tableau.basic().count();
        while let Some((basic, violated)) = self.violated_basic() {
            let rises = violated == Violated::Lower;
            let Some(entering) = self.entering(basic, rises, greedy_pivots > 0) else {
                return Err(self.refutation_by_row(basic, rises));
            };
            greedy_pivots = greedy_pivots.saturating_sub(1);
            let target = match violated {
                Violated::Lower => &self.variables[basic.index()].lower,
                Violated::Upper => &self.variables[basic.index()].upper,
            };
            let target = value_of(target.as_ref());
            self.pivot_and_update(basic, entering, target);
        }
        Ok(())
    }

    /// Fails if a variable's lower bound lies above its upper one.
    fn refute_by_one_variable(&self) -> Result<(), Infeasible> {
        for variable in &self.variables {
            if let (Some(lower), Some(upper)) = (&variable.lower, &variable.upper)
                && lower.value > upper.value
            {
                let mut certificate = vec![(lower.tag, Rational::ONE), (upper.tag, Rational::ONE)];
                certificate.sort_by_key(|(tag, _)| *tag);
                return Err(Infeasible { certificate });
            }
        }
        Ok(())
    }

    /// Returns the first basic variable outside its bounds (Bland's rule requires the first).
    fn violated_basic(&self) -> Option<(VariableId, Violated)> {
        self.tableau.basic().find_map(|basic| {
            let variable = &self.variables[basic.index()];
            if variable.is_below_lower() {
                Some((basic, Violated::Lower))
            } else if variable.is_above_upper() {
                Some((basic, Violated::Upper))
            } else {
                None
            }
        })
    }

    /// Returns a variable that can make the basic variable rise (or fall): the one with the fewest
    /// rows if `is_greedy`, to keep rows short, otherwise the first one.
    fn entering(&self, basic: VariableId, rises: bool, is_greedy: bool) -> Option<VariableId> {
        let row = self.tableau.row(basic).iter();
        let mut suitable = row
            .filter(|(other, coefficient)| self.can_move(**other, coefficient, rises))
            .map(|(other, _)| *other);
        if is_greedy {
            suitable.min_by_key(|&other| self.tableau.column_length(other))
        } else {
            suitable.next()
        }
    }

    /// Returns `true` if `other` can move so that `coefficient · other` rises (or falls).
    pub(super) fn can_move(&self, other: VariableId, coefficient: &Rational, rises: bool) -> bool {
        let variable = &self.variables[other.index()];
        if coefficient.is_positive() == rises {
            variable.can_rise()
        } else {
            variable.can_fall()
        }
    }

    /// Returns the proof by a row: every variable in it is at the bound that blocks the basic one.
    fn refutation_by_row(&self, basic: VariableId, rises: bool) -> Infeasible {
        let variable = &self.variables[basic.index()];
        let violated = if rises {
            &variable.lower
        } else {
            &variable.upper
        };
        let mut certificate = vec![(tag_of(violated.as_ref()), Rational::ONE)];
        for (other, coefficient) in self.tableau.row(basic) {
            let variable = &self.variables[other.index()];
            let limiting = if coefficient.is_positive() == rises {
                &variable.upper
            } else {
                &variable.lower
            };
            certificate.push((tag_of(limiting.as_ref()), coefficient.abs()));
        }
        certificate.sort_by_key(|(tag, _)| *tag);
        Infeasible { certificate }
    }

    /// Gives `basic` the value `target` by moving `entering`, which takes its place in the basis.
    pub(super) fn pivot_and_update(
        &mut self,
        basic: VariableId,
        entering: VariableId,
        target: Delta,
    ) {
        let coefficient = &self.tableau.row(basic)[&entering];
        let needed = &target - &self.variables[basic.index()].value;
        let step = needed.scaled(&(&Rational::ONE / coefficient));
        let moved = &self.variables[entering.index()].value + &step;
        self.set_value(entering, moved);
        self.variables[basic.index()].value = target;
        self.tableau.pivot(basic, entering);
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Violated {
    Lower,
    Upper,
}

fn value_of(bound: Option<&Bound>) -> Delta {
    let bound = bound.expect("a violated bound exists");
    bound.value.clone()
}

fn tag_of(bound: Option<&Bound>) -> usize {
    bound.expect("a limiting bound exists").tag
}
