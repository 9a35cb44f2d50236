//! Linear constraints on the times and parameters of a plan, for the simplex.

use std::collections::BTreeMap;

use elbowroom_num::simplex::{Optimum, Simplex, VariableId};
use elbowroom_num::{Delta, Rational};
use elbowroom_plan::{Bound, DecoupledEnvelope, ParametrizedPlan, Schedule, Valuation};

use crate::second_oracle::polynomial::{Polynomial, Symbol};

/// Comparison of a polynomial with zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Relation {
    Below,
    NotAbove,
    Zero,
}

/// Error for a product of two unknowns, which the simplex cannot handle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NotLinear;

/// All schedules of a plan for all values in a box, with temporary assumptions.
pub(crate) struct System {
    simplex: Simplex,
    variables: BTreeMap<Symbol, VariableId>,
    rows: BTreeMap<Vec<(VariableId, Rational)>, VariableId>,
    /// One level for each push: `true` if a constraint without unknowns has failed.
    absurd: Vec<bool>,
    nodes: usize,
    parameters: usize,
}

impl System {
    pub(crate) fn new(plan: &ParametrizedPlan, envelope: &DecoupledEnvelope) -> Self {
        let mut system = Self {
            simplex: Simplex::new(),
            variables: BTreeMap::new(),
            rows: BTreeMap::new(),
            absurd: vec![false],
            nodes: plan.plan.nodes.len(),
            parameters: plan.parameters.len(),
        };
        let times = (0..system.nodes).map(Symbol::Time);
        let parameters = (0..system.parameters).map(Symbol::Parameter);
        for symbol in times.chain(parameters).chain([Symbol::Moment]) {
            let variable = system.simplex.add_variable();
            system.variables.insert(symbol, variable);
        }
        system.network(plan);
        for (index, interval) in envelope.intervals().iter().enumerate() {
            let value = Polynomial::symbol(Symbol::Parameter(index));
            if let Some(lower) = interval.lower.value() {
                system.at_most(&Polynomial::constant(lower), &value);
            }
            if let Some(upper) = interval.upper.value() {
                system.at_most(&value, &Polynomial::constant(upper));
            }
        }
        system
    }

    fn network(&mut self, plan: &ParametrizedPlan) {
        let zero = Polynomial::symbol(Symbol::Time(0));
        self.assert_linear(&zero, Relation::Zero);
        for node in 1..self.nodes {
            self.at_most(&zero, &Polynomial::symbol(Symbol::Time(node)));
        }
        for constraint in &plan.plan.constraints {
            let difference = Polynomial::difference(
                Symbol::Time(constraint.from.index()),
                Symbol::Time(constraint.to.index()),
            );
            if let Some(lower) = bound(&constraint.lower) {
                self.at_most(&lower, &difference);
            }
            if let Some(upper) = bound(&constraint.upper) {
                self.at_most(&difference, &upper);
            }
        }
    }

    fn at_most(&mut self, left: &Polynomial, right: &Polynomial) {
        self.assert_linear(&left.minus(right), Relation::NotAbove);
    }

    fn assert_linear(&mut self, polynomial: &Polynomial, relation: Relation) {
        self.assert(polynomial, relation)
            .expect("networks are linear");
    }

    /// Asserts `polynomial relation 0`.
    pub(crate) fn assert(
        &mut self,
        polynomial: &Polynomial,
        relation: Relation,
    ) -> Result<(), NotLinear> {
        let (constant, terms) = polynomial.linear().ok_or(NotLinear)?;
        let Some((_, leading)) = terms.first().cloned() else {
            let holds = match relation {
                Relation::Below => constant.is_negative(),
                Relation::NotAbove => !constant.is_positive(),
                Relation::Zero => constant.is_zero(),
            };
            *self.absurd.last_mut().expect("a level") |= !holds;
            return Ok(());
        };
        // Rows that differ only by a factor share a variable.
        let row: Vec<_> = terms
            .iter()
            .map(|(symbol, factor)| (self.variables[symbol], factor / &leading))
            .collect();
        let known = self.rows.get(&row).copied();
        let variable = known.unwrap_or_else(|| self.simplex.define(&row));
        self.rows.insert(row, variable);
        let limit = -constant / &leading;
        let (is_upper, is_lower) = match relation {
            Relation::Zero => (true, true),
            _ => (leading.is_positive(), leading.is_negative()),
        };
        let is_strict = relation == Relation::Below;
        if is_upper {
            let bound = if is_strict {
                Delta::just_below(limit.clone())
            } else {
                Delta::from(limit.clone())
            };
            self.simplex.assert_upper(variable, bound, 0);
        }
        if is_lower {
            let bound = if is_strict {
                Delta::just_above(limit)
            } else {
                Delta::from(limit)
            };
            self.simplex.assert_lower(variable, bound, 0);
        }
        Ok(())
    }

    pub(crate) fn push(&mut self) {
        self.simplex.push();
        self.absurd.push(*self.absurd.last().expect("a level"));
    }

    pub(crate) fn pop(&mut self) {
        self.simplex.pop();
        self.absurd.pop();
    }

    pub(crate) fn is_feasible(&mut self) -> bool {
        !self.absurd.last().expect("a level") && self.simplex.check().is_ok()
    }

    /// Returns values and a schedule that satisfy everything, after a successful check.
    pub(crate) fn model(&self) -> (Valuation, Schedule) {
        let model = self.simplex.model();
        let value = |symbol: Symbol| model[self.variables[&symbol].index()].clone();
        (
            (0..self.parameters)
                .map(|index| value(Symbol::Parameter(index)))
                .collect(),
            (0..self.nodes)
                .map(|node| value(Symbol::Time(node)))
                .collect(),
        )
    }

    /// Returns an extreme schedule in some direction: `weights` by node. Times are at most
    /// `horizon`.
    pub(crate) fn extreme(
        &mut self,
        weights: &[i64],
        horizon: i64,
    ) -> Option<(Valuation, Schedule)> {
        self.push();
        for node in 0..self.nodes {
            let latest = Polynomial::constant(&Rational::from(horizon));
            self.at_most(&Polynomial::symbol(Symbol::Time(node)), &latest);
        }
        let objective: Vec<_> = weights
            .iter()
            .take(self.nodes)
            .enumerate()
            .filter(|(_, weight)| **weight != 0)
            .map(|(node, weight)| (self.variables[&Symbol::Time(node)], Rational::from(*weight)))
            .collect();
        let optimum = self.simplex.maximize(&objective);
        let model = matches!(optimum, Ok(Optimum::Value(_))).then(|| self.model());
        self.pop();
        model
    }
}

/// Returns the bound as a polynomial, if there is one.
fn bound(bound: &Bound) -> Option<Polynomial> {
    match bound {
        Bound::Infinite => None,
        Bound::Finite(value) => Some(Polynomial::constant(value)),
        Bound::Parameter(id) => Some(Polynomial::symbol(Symbol::Parameter(id.index()))),
    }
}
