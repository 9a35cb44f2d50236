//! Optima over the feasible set: the primal simplex with bounded variables.

use super::{Combination, Infeasible, Simplex, VariableId};
use crate::{Delta, Rational};

/// The best value of an objective.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Optimum {
    /// The objective is unbounded.
    Unbounded,
    /// No value is better. If it has an infinitesimal part, the rational part is approached
    /// arbitrarily closely, but not reached.
    Value(Delta),
}

/// The largest step of a variable before some variable meets a bound.
enum Limit {
    None,
    /// The variable meets its own other bound after this step.
    Own(Delta),
    /// The basic variable meets its bound after this step.
    Basic(VariableId, Delta),
}

impl Simplex {
    /// Returns the largest value of `Σ coefficient · variable`. The assignment is left at the
    /// optimum, or at the point where the objective was found unbounded.
    ///
    /// # Errors
    /// Bounds that contradict each other.
    pub fn maximize(&mut self, objective: &Combination) -> Result<Optimum, Infeasible> {
        Ok(self.maximize_with_proof(objective)?.0)
    }

    /// Like [`maximize`](Self::maximize), but also returns the proof that no value is larger: the
    /// bounds with these tags, written as `term <= bound`, each times its positive multiplier, add
    /// up to `objective <= value`. The proof is empty if the objective is unbounded.
    ///
    /// # Errors
    /// Bounds that contradict each other.
    pub fn maximize_with_proof(
        &mut self,
        objective: &Combination,
    ) -> Result<(Optimum, Vec<(usize, Rational)>), Infeasible> {
        self.check()?;
        // The objective is a variable without bounds, so it never leaves the basis, and its row can
        // be removed afterwards.
        let value = self.define(objective);
        let optimum = loop {
            let Some((entering, rises)) = self.improving(value) else {
                break Optimum::Value(self.variables[value.index()].value.clone());
            };
            match self.limit(entering, rises) {
                Limit::None => break Optimum::Unbounded,
                Limit::Own(target) => self.set_value(entering, target),
                Limit::Basic(basic, target) => self.pivot_and_update(basic, entering, target),
            }
        };
        let proof = match optimum {
            Optimum::Unbounded => Vec::new(),
            Optimum::Value(_) => self.proof(value),
        };
        self.tableau.remove_newest();
        self.variables.pop();
        Ok((optimum, proof))
    }

    /// Returns the bounds that limit the objective at its optimum: every variable in its row is at
    /// one.
    fn proof(&self, objective: VariableId) -> Vec<(usize, Rational)> {
        let row = self.tableau.row(objective).iter();
        let mut proof: Vec<(usize, Rational)> = row
            .map(|(other, factor)| {
                let variable = &self.variables[other.index()];
                let bound = if factor.is_positive() {
                    &variable.upper
                } else {
                    &variable.lower
                };
                let bound = bound
                    .as_ref()
                    .expect("a variable without bounds could still move");
                (bound.tag, factor.abs())
            })
            .collect();
        proof.sort_by_key(|(tag, _)| *tag);
        proof
    }

    /// Returns the least value of `Σ coefficient · variable`; like [`Simplex::maximize`].
    ///
    /// # Errors
    /// Bounds that contradict each other.
    pub fn minimize(&mut self, objective: &Combination) -> Result<Optimum, Infeasible> {
        let negated: Vec<_> = objective.iter().map(|(v, c)| (*v, -c)).collect();
        Ok(match self.maximize(&negated)? {
            Optimum::Unbounded => Optimum::Unbounded,
            Optimum::Value(value) => Optimum::Value(-&value),
        })
    }

    /// Returns the first variable whose move makes `objective` rise, and `true` if that variable
    /// has to rise itself.
    fn improving(&self, objective: VariableId) -> Option<(VariableId, bool)> {
        let row = self.tableau.row(objective).iter();
        let mut suitable = row.filter(|(other, factor)| self.can_move(**other, factor, true));
        suitable
            .next()
            .map(|(other, factor)| (*other, factor.is_positive()))
    }

    /// Performs the ratio test. If several basic variables stop the move at once, it returns the
    /// first one (Bland's rule, here and in `improving`, prevents cycling).
    fn limit(&self, entering: VariableId, rises: bool) -> Limit {
        let own = &self.variables[entering.index()];
        let other_bound = if rises { &own.upper } else { &own.lower };
        let mut nearest: Option<Delta> = None;
        let mut limit = Limit::None;
        if let Some(bound) = other_bound {
            nearest = Some(distance(&bound.value, &own.value));
            limit = Limit::Own(bound.value.clone());
        }
        for (basic, coefficient) in self.tableau.column(entering) {
            let variable = &self.variables[basic.index()];
            let follows_up = coefficient.is_positive() == rises;
            let bound = if follows_up {
                &variable.upper
            } else {
                &variable.lower
            };
            let Some(bound) = bound else { continue };
            let room = distance(&bound.value, &variable.value);
            let steps = room.scaled(&(&Rational::ONE / &coefficient.abs()));
            if nearest.as_ref().is_none_or(|nearest| steps < *nearest) {
                nearest = Some(steps);
                limit = Limit::Basic(basic, bound.value.clone());
            }
        }
        limit
    }
}

/// Returns `|a - b|`.
fn distance(a: &Delta, b: &Delta) -> Delta {
    if a > b { a - b } else { b - a }
}
