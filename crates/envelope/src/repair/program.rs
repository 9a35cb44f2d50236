//! The linear program: times and quantities, and the costs of their changes.

use std::collections::BTreeMap;

use elbowroom_num::simplex::{Optimum, Simplex, VariableId};
use elbowroom_num::{Delta, Interval, Rational};
use elbowroom_plan::{
    Bound, Node, NodeId, ParameterId, ParametrizedPlan, Schedule, Side, Valuation,
};

use super::{BindingConstraint, Changeable};
use crate::linear::Linear;
use crate::obligations::Refusal;

/// The optimum of a case.
pub(super) struct Solved {
    /// The least cost.
    pub(super) cost: Delta,
    pub(super) values: Valuation,
    pub(super) schedule: Schedule,
    pub(super) because: Vec<(BindingConstraint, Rational)>,
}

/// Parameter as `base + Σ term`.
struct Value {
    base: Rational,
    terms: Vec<(VariableId, Rational)>,
}

/// Row that holds in some cases: `sum <= bound`, or a contradiction if there is no sum.
struct CaseRow {
    sum: Option<VariableId>,
    bound: Delta,
    hindrance: BindingConstraint,
}

pub(super) struct Program<'a> {
    plan: &'a ParametrizedPlan,
    changeable: &'a [Changeable],
    simplex: Simplex,
    /// The times, by node; the first is time zero and unused.
    times: Vec<VariableId>,
    parameters: BTreeMap<ParameterId, Value>,
    /// The values of parameters that do not change.
    fixed: BTreeMap<ParameterId, Rational>,
    /// The negated cost, which is maximised. `earliness`, the negated sum of all times of actions,
    /// is maximised after that.
    negated_cost: Vec<(VariableId, Rational)>,
    /// The negated cost as a variable, to fix it at its optimum.
    negated_cost_variable: VariableId,
    earliness: Vec<(VariableId, Rational)>,
    /// By tag, the origin of a bound.
    hindrances: Vec<BindingConstraint>,
    rows: Vec<CaseRow>,
}

impl<'a> Program<'a> {
    /// Creates the program of the plan's bounds, and of these orders, each at least `epsilon`
    /// apart.
    pub(super) fn new(
        plan: &'a ParametrizedPlan,
        changeable: &'a [Changeable],
        epsilon: &Rational,
        orders: &[(NodeId, NodeId)],
    ) -> Self {
        let mut simplex = Simplex::new();
        let times: Vec<VariableId> = plan.plan.nodes().map(|_| simplex.add_variable()).collect();
        let mut program = Self {
            plan,
            changeable,
            negated_cost_variable: times[0],
            simplex,
            times,
            parameters: BTreeMap::new(),
            fixed: BTreeMap::new(),
            negated_cost: Vec::new(),
            earliness: Vec::new(),
            hindrances: Vec::new(),
            rows: Vec::new(),
        };
        for (node, what) in plan.plan.nodes().skip(1) {
            let variable = program.times[node.index()];
            let tag = program.tag(BindingConstraint::TimeZero);
            program.simplex.assert_lower(variable, Delta::ZERO, tag);
            if !matches!(what, Node::Timed(_)) {
                program.earliness.push((variable, Rational::from(-1)));
            }
        }
        for (index, parameter) in plan.parameters.iter().enumerate() {
            let id = ParameterId::from(index);
            match changeable.iter().find(|own| own.parameter == id) {
                Some(own) => program.add_changeable(own),
                None => {
                    program.fixed.insert(id, parameter.nominal.clone());
                }
            }
        }
        program.negated_cost_variable = program.simplex.define(&program.negated_cost);
        for (index, constraint) in plan.plan.constraints.iter().enumerate() {
            for side in Side::BOTH {
                let (bound, from, to, sign) = match side {
                    Side::Lower => (&constraint.lower, constraint.to, constraint.from, 1),
                    Side::Upper => (&constraint.upper, constraint.from, constraint.to, -1),
                };
                let mut expression = Linear::difference(from, to);
                let sign = Rational::from(sign);
                match bound {
                    Bound::Infinite => continue,
                    Bound::Finite(value) => {
                        expression.add_scaled(&Linear::constant(value.clone()), &sign);
                    }
                    Bound::Parameter(id) => {
                        expression.add_scaled(&Linear::parameter(*id), &sign);
                    }
                }
                program.require_always(&expression, BindingConstraint::Bound(index, side));
            }
        }
        for &(first, second) in orders {
            let mut expression = Linear::difference(second, first);
            expression.constant = epsilon.clone();
            program.require_always(&expression, BindingConstraint::Order(first, second));
        }
        program
    }

    /// Adds a parameter: a base value within its free values, and variables for deviations from it.
    /// Those outside the free values have a cost.
    fn add_changeable(&mut self, own: &Changeable) {
        let range = &self.plan.parameter(own.parameter).range;
        let tag = self.tag(BindingConstraint::Range(own.parameter));
        let ends = |interval: &Interval| Side::BOTH.map(|side| side.of(interval).value().cloned());
        let [least, most] = ends(range);
        let [from, to] = ends(&own.free_range);
        let base = from.clone().or_else(|| to.clone()).unwrap_or_default();
        let mut value = Value {
            base,
            terms: Vec::new(),
        };
        let mut add =
            |program: &mut Self, sign: i64, room: Option<Rational>, cost: Option<&Rational>| {
                if room.as_ref().is_some_and(|room| !room.is_positive()) {
                    return;
                }
                let variable = program.simplex.add_variable();
                program.simplex.assert_lower(variable, Delta::ZERO, tag);
                if let Some(room) = room {
                    program
                        .simplex
                        .assert_upper(variable, Delta::from(room), tag);
                }
                value.terms.push((variable, Rational::from(sign)));
                program
                    .negated_cost
                    .extend(cost.map(|cost| (variable, -cost)));
            };
        let between = |low: Option<&Rational>, high: Option<&Rational>| Some(high? - low?);
        let weight = Some(&own.weight);
        if from.is_none() && to.is_none() {
            add(self, 1, most, None);
            add(self, -1, least.map(|least| -least), None);
        } else {
            if from.is_some() {
                add(self, -1, between(least.as_ref(), from.as_ref()), weight);
                let end = match (&to, &most) {
                    (Some(to), Some(most)) => Some(to.min(most)),
                    (to, most) => to.as_ref().or(most.as_ref()),
                };
                add(self, 1, between(from.as_ref(), end), None);
            } else {
                add(self, -1, between(least.as_ref(), to.as_ref()), None);
            }
            if to.is_some() {
                add(self, 1, between(to.as_ref(), most.as_ref()), weight);
            }
        }
        self.parameters.insert(own.parameter, value);
    }

    fn tag(&mut self, hindrance: BindingConstraint) -> usize {
        self.hindrances.push(hindrance);
        self.hindrances.len() - 1
    }

    /// Returns the expression over the variables, and its constant; `None` if it contains a
    /// product.
    fn combination(&self, expression: &Linear) -> Option<(Vec<(VariableId, Rational)>, Rational)> {
        let expression = expression.with_values(&self.fixed);
        if !expression.products.is_empty() {
            return None;
        }
        let times = expression.times.iter();
        let times = times.map(|(node, factor)| (self.times[node.index()], factor.clone()));
        let mut row: Vec<(VariableId, Rational)> = times.collect();
        let mut constant = expression.constant;
        for (id, factor) in &expression.parameters {
            let Value { base, terms } = &self.parameters[id];
            constant += base * factor;
            row.extend(terms.iter().map(|(term, sign)| (*term, sign * factor)));
        }
        Some((row, constant))
    }

    /// Adds `expression <= 0`, in all cases.
    fn require_always(&mut self, expression: &Linear, hindrance: BindingConstraint) {
        let (row, constant) = self
            .combination(expression)
            .expect("bounds and orders have no products");
        let tag = self.tag(hindrance);
        let bound = Delta::from(-constant);
        let sum = self.simplex.define(&row);
        self.simplex.assert_upper(sum, bound, tag);
    }

    /// Adds the row `expression <= 0`, or `< 0`, which holds in some cases only, and returns its
    /// number.
    ///
    /// # Errors
    /// If it is not linear in the times and the changeable parameters.
    pub(super) fn row(
        &mut self,
        expression: &Linear,
        is_strict: bool,
        hindrance: BindingConstraint,
    ) -> Result<usize, Refusal> {
        let Some((row, constant)) = self.combination(expression) else {
            let mut multiplied = expression.with_values(&self.fixed);
            multiplied.times.clear();
            let id = multiplied.multiplied_parameters().next();
            let name = id.map(|id| self.plan.parameter(id).name.clone());
            return Err(Refusal::Coupled {
                name: name.unwrap_or_default(),
            });
        };
        let bound = if is_strict {
            Delta::just_below(-constant)
        } else {
            Delta::from(-constant)
        };
        let sum = (!row.is_empty()).then(|| self.simplex.define(&row));
        self.rows.push(CaseRow {
            sum,
            bound,
            hindrance,
        });
        Ok(self.rows.len() - 1)
    }

    /// Computes the least cost in the case of these rows, and the earliest schedule at that cost.
    ///
    /// # Errors
    /// The constraints that contradict each other.
    pub(super) fn solve(&mut self, rows: &[usize]) -> Result<Solved, Vec<BindingConstraint>> {
        self.simplex.push();
        let tags = self.hindrances.len();
        let solved = self.solve_with(rows);
        self.simplex.pop();
        self.hindrances.truncate(tags);
        solved
    }

    fn solve_with(&mut self, rows: &[usize]) -> Result<Solved, Vec<BindingConstraint>> {
        for &row in rows {
            let CaseRow {
                sum,
                bound,
                hindrance,
            } = &self.rows[row];
            let Some(sum) = *sum else {
                if *bound < Delta::ZERO {
                    return Err(vec![hindrance.clone()]);
                }
                continue;
            };
            let (bound, hindrance) = (bound.clone(), hindrance.clone());
            let tag = self.tag(hindrance);
            self.simplex.assert_upper(sum, bound, tag);
        }
        let named = |hindrances: &[BindingConstraint], proof: Vec<(usize, Rational)>| {
            let named = proof.into_iter();
            named
                .map(|(tag, factor)| (hindrances[tag].clone(), factor))
                .collect()
        };
        let (gain, proof) = match self.simplex.maximize_with_proof(&self.negated_cost) {
            Ok((Optimum::Value(gain), proof)) => (gain, proof),
            Ok((Optimum::Unbounded, _)) => unreachable!("no cost is negative"),
            Err(impossible) => {
                let named: Vec<(BindingConstraint, Rational)> =
                    named(&self.hindrances, impossible.certificate);
                return Err(named.into_iter().map(|(hindrance, _)| hindrance).collect());
            }
        };
        let because = named(&self.hindrances, proof);
        // At that cost, everything as early as possible.
        let tag = self.tag(BindingConstraint::TimeZero);
        self.simplex
            .assert_lower(self.negated_cost_variable, gain.clone(), tag);
        self.simplex
            .maximize(&self.earliness)
            .expect("the optimum just found is feasible");
        let model = self.simplex.model();
        let times = self.times.iter().enumerate().map(|(index, variable)| {
            if index == 0 {
                Rational::ZERO
            } else {
                model[variable.index()].clone()
            }
        });
        let parameters = (0..self.plan.parameters.len()).map(ParameterId::from);
        let values = parameters.map(|id| match self.parameters.get(&id) {
            Some(Value { base, terms }) => {
                let terms = terms.iter().map(|(term, sign)| sign * &model[term.index()]);
                base + &terms.sum::<Rational>()
            }
            None => self.fixed[&id].clone(),
        });
        Ok(Solved {
            cost: -&gain,
            values: values.collect(),
            schedule: times.collect(),
            because,
        })
    }

    /// Returns the cost of these values.
    pub(super) fn cost_of(&self, values: &Valuation) -> Rational {
        let costs = self.changeable.iter().map(|own| {
            let value = &values[own.parameter];
            let below = own.free_range.lower.value().map(|least| least - value);
            let above = own.free_range.upper.value().map(|most| value - most);
            let outside = below.into_iter().chain(above).max().unwrap_or_default();
            &own.weight * &outside.max(Rational::ZERO)
        });
        costs.sum()
    }
}
