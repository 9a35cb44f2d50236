//! Combinations of ends of the intervals of parameters that multiply something.

use std::collections::BTreeMap;

use elbowroom_num::Rational;

use crate::linear::{Factor, Linear};
use crate::obligations::Inequality;
use elbowroom_plan::{DecoupledEnvelope, ParameterId, Valuation};

/// Returns the combinations of ends of the parameters' intervals. For an infinite end, the
/// combination describes the limit of an expression as the parameter grows without bound.
pub(crate) fn corners(envelope: &DecoupledEnvelope, parameters: &[ParameterId]) -> Vec<Corner> {
    let mut corners = vec![Corner::default()];
    for &parameter in parameters {
        let interval = envelope.interval(parameter);
        let zero = Rational::ZERO;
        let (lower, upper) = (interval.lower.value(), interval.upper.value());
        let mut ends = vec![lower.ok_or(false), upper.ok_or(true)];
        if lower.is_none() && upper.is_none() {
            // If the factor vanishes, the remainder does not depend on the value.
            ends.push(Ok(&zero));
        }
        ends.dedup();
        corners = corners
            .iter()
            .flat_map(|corner| {
                ends.iter().map(move |end| {
                    let mut corner = corner.clone();
                    match *end {
                        Ok(value) => {
                            corner.values.insert(parameter, value.clone());
                        }
                        Err(is_upper) => corner.infinite.push((parameter, is_upper)),
                    }
                    corner
                })
            })
            .collect();
    }
    corners
}

/// Values for multiplied parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Corner {
    pub(crate) values: BTreeMap<ParameterId, Rational>,
    /// Parameters at an infinite end, with `true` if it is the upper one.
    infinite: Vec<(ParameterId, bool)>,
}

impl Corner {
    /// Substitutes these values in an inequality.
    pub(crate) fn apply(&self, inequality: &Inequality) -> Inequality {
        let mut expression = inequality.expression.with_values(&self.values);
        let mut is_strict = inequality.is_strict;
        for &(parameter, is_upper) in &self.infinite {
            // As the parameter grows without limit, only its coefficient determines the sign of the
            // expression: it becomes negative if the coefficient can be negative (if the parameter
            // decreases without limit: if it can be positive).
            let coefficient = coefficient_of(&expression, parameter);
            if coefficient == Linear::default() {
                continue;
            }
            let sign = Rational::from(if is_upper { 1 } else { -1 });
            expression = coefficient.scaled(&sign);
            is_strict = true;
        }
        Inequality {
            expression,
            is_strict,
        }
    }
}

impl Corner {
    /// Replaces the parameters at infinite ends by finite values that satisfy `will_do`.
    ///
    /// As in [`apply`](Self::apply), the first of them outgrows the second, and so on.
    pub(crate) fn far_out(
        &self,
        mut valuation: Valuation,
        will_do: &dyn Fn(&Valuation) -> bool,
    ) -> Option<Valuation> {
        let mut step = Rational::ONE;
        for _ in 0..MAX_DOUBLINGS {
            let mut reach = step.clone();
            for &(parameter, is_upper) in self.infinite.iter().rev() {
                valuation[parameter] = if is_upper { reach.clone() } else { -&reach };
                reach *= &step;
            }
            if will_do(&valuation) {
                return Some(valuation);
            }
            step = &step + &step;
        }
        None
    }
}

/// Limit on doublings of values in the search for values that are large enough.
const MAX_DOUBLINGS: usize = 256;

/// Returns the factor of a parameter in an expression.
fn coefficient_of(expression: &Linear, parameter: ParameterId) -> Linear {
    let mut coefficient = Linear::default();
    if let Some(constant) = expression.parameters.get(parameter) {
        coefficient.constant = constant.clone();
    }
    for &((first, factor), ref amount) in &expression.products {
        match factor {
            Factor::Time(node) if first == parameter => coefficient.add_time(node, amount),
            Factor::Parameter(second) if first == parameter => {
                coefficient.add_scaled(&Linear::parameter(second), amount);
            }
            Factor::Parameter(second) if second == parameter => {
                coefficient.add_scaled(&Linear::parameter(first), amount);
            }
            Factor::Time(_) | Factor::Parameter(_) => {}
        }
    }
    coefficient
}
