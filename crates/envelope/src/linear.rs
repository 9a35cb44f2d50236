//! Linear expressions over time points and parameters.

use std::collections::BTreeMap;

use elbowroom_num::Rational;

use elbowroom_plan::{NodeId, ParameterId, Schedule, Valuation};

pub use terms::Terms;

mod terms;

/// Factor that multiplies a parameter in a [`Linear`] expression.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Factor {
    /// The time of a node.
    Time(NodeId),
    /// The value of a parameter.
    Parameter(ParameterId),
}

/// `constant + Σ c·t_i + Σ d·γ_j + Σ e·γ_j·x`, where `x` is a time or another parameter.
///
/// Linear in the times for fixed parameters and in each parameter for fixed times; the products
/// come from parametrized rates. [`NodeId::ZERO`] is at time 0 and never occurs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Linear {
    /// The constant part.
    pub constant: Rational,
    /// Coefficients of times, none zero.
    pub times: Terms<NodeId>,
    /// Coefficients of parameters, none zero.
    pub parameters: Terms<ParameterId>,
    /// Coefficients of products, none zero. In a product of two parameters the first is the
    /// smaller id.
    pub products: Terms<(ParameterId, Factor)>,
}

impl Linear {
    /// Creates a constant expression.
    pub fn constant(constant: Rational) -> Self {
        Self {
            constant,
            ..Self::default()
        }
    }

    /// Creates an expression of one parameter.
    pub fn parameter(id: ParameterId) -> Self {
        Self {
            parameters: Terms::one(id, Rational::ONE),
            ..Self::default()
        }
    }

    /// Creates the time of `to` minus the time of `from`.
    pub fn difference(from: NodeId, to: NodeId) -> Self {
        let mut difference = Self::default();
        difference.add_time(to, &Rational::ONE);
        difference.add_time(from, &Rational::from(-1));
        difference
    }

    /// Returns the number, if the expression is constant.
    pub fn as_constant(&self) -> Option<&Rational> {
        let is_constant =
            self.times.is_empty() && self.parameters.is_empty() && self.products.is_empty();
        is_constant.then_some(&self.constant)
    }

    /// Adds `coefficient` times the time of `node`.
    pub fn add_time(&mut self, node: NodeId, coefficient: &Rational) {
        if node != NodeId::ZERO {
            self.times.add(node, coefficient);
        }
    }

    /// Adds `factor` times `other`.
    pub fn add_scaled(&mut self, other: &Self, factor: &Rational) {
        self.constant += &other.constant * factor;
        for (node, coefficient) in &other.times {
            self.times.add(*node, &(coefficient * factor));
        }
        for (id, coefficient) in &other.parameters {
            self.parameters.add(*id, &(coefficient * factor));
        }
        for (product, coefficient) in &other.products {
            self.products.add(*product, &(coefficient * factor));
        }
    }

    /// Returns `self + other`.
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        let mut sum = self.clone();
        sum.add_scaled(other, &Rational::ONE);
        sum
    }

    /// Returns `self - other`.
    #[must_use]
    pub fn minus(&self, other: &Self) -> Self {
        let mut difference = self.clone();
        difference.add_scaled(other, &Rational::from(-1));
        difference
    }

    /// Returns `factor * self`.
    #[must_use]
    pub fn scaled(&self, factor: &Rational) -> Self {
        let mut scaled = Self::default();
        scaled.add_scaled(self, factor);
        scaled
    }

    /// Returns the product; `None` if it cannot be represented: two times, or three factors.
    pub fn times(&self, other: &Self) -> Option<Self> {
        if let Some(factor) = other.as_constant() {
            return Some(self.scaled(factor));
        }
        if let Some(factor) = self.as_constant() {
            return Some(other.scaled(factor));
        }
        // One side may hold times; the other only parameters; neither holds products.
        let (parametric, other) = if self.times.is_empty() {
            (self, other)
        } else {
            (other, self)
        };
        if !parametric.times.is_empty()
            || !parametric.products.is_empty()
            || !other.products.is_empty()
        {
            return None;
        }
        let mut product = other.scaled(&parametric.constant);
        for &(id, ref coefficient) in &parametric.parameters {
            product.parameters.add(id, &(coefficient * &other.constant));
            for &(node, ref time) in &other.times {
                let key = (id, Factor::Time(node));
                product.products.add(key, &(coefficient * time));
            }
            for &(second, ref factor) in &other.parameters {
                let key = (id.min(second), Factor::Parameter(id.max(second)));
                product.products.add(key, &(coefficient * factor));
            }
        }
        Some(product)
    }

    /// Returns the same expression with some parameters replaced by numbers.
    #[must_use]
    pub fn with_values(&self, values: &BTreeMap<ParameterId, Rational>) -> Self {
        let mut fixed = Self {
            constant: self.constant.clone(),
            times: self.times.clone(),
            ..Self::default()
        };
        for &(id, ref coefficient) in &self.parameters {
            match values.get(&id) {
                Some(value) => fixed.constant += coefficient * value,
                None => fixed.parameters.add(id, coefficient),
            }
        }
        for &((id, factor), ref coefficient) in &self.products {
            let first = values.get(&id);
            match (first, factor) {
                (Some(value), Factor::Time(node)) => fixed.add_time(node, &(coefficient * value)),
                (first, Factor::Parameter(second)) => match (first, values.get(&second)) {
                    (Some(a), Some(b)) => fixed.constant += &(coefficient * a) * b,
                    (Some(a), None) => fixed.parameters.add(second, &(coefficient * a)),
                    (None, Some(b)) => fixed.parameters.add(id, &(coefficient * b)),
                    (None, None) => fixed.products.add((id, factor), coefficient),
                },
                (None, Factor::Time(_)) => fixed.products.add((id, factor), coefficient),
            }
        }
        fixed
    }

    /// Returns the value for these times (by node) and parameters.
    pub fn value(&self, times: &Schedule, parameters: &Valuation) -> Rational {
        let mut value = self.constant.clone();
        for (node, coefficient) in &self.times {
            value += coefficient * &times[*node];
        }
        for (id, coefficient) in &self.parameters {
            value += coefficient * &parameters[*id];
        }
        for ((id, factor), coefficient) in &self.products {
            let factor = match factor {
                Factor::Time(node) => &times[*node],
                Factor::Parameter(second) => &parameters[*second],
            };
            value += &(coefficient * &parameters[*id]) * factor;
        }
        value
    }

    /// Returns a parameter whose square has a positive coefficient.
    pub fn squared_parameter(&self) -> Option<ParameterId> {
        let square = self.products.iter().find(|((first, factor), amount)| {
            *factor == Factor::Parameter(*first) && amount.is_positive()
        });
        square.map(|((id, _), _)| *id)
    }

    /// Returns the parameters that occur in products.
    pub fn multiplied_parameters(&self) -> impl Iterator<Item = ParameterId> + '_ {
        self.products.keys().flat_map(|(first, factor)| {
            let second = match factor {
                Factor::Parameter(second) => Some(second),
                Factor::Time(_) => None,
            };
            std::iter::once(first).chain(second)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{Linear, NodeId, ParameterId, Rational, Valuation};

    #[test]
    fn a_rate_times_a_duration_is_bilinear_and_a_duration_squared_is_refused() {
        let rate = Linear::parameter(ParameterId(0)).plus(&Linear::constant(Rational::from(2)));
        let duration = Linear::difference(NodeId(1), NodeId(2));
        let product = rate.times(&duration).expect("bilinear");
        // (3 + 2) * (10 - 4)
        let times = [0, 4, 10].map(Rational::from).into_iter().collect();
        assert_eq!(
            product.value(&times, &Valuation::new(vec![Rational::from(3)])),
            Rational::from(30)
        );
        assert!(duration.times(&duration).is_none());
        assert!(product.times(&duration).is_none());
    }

    #[test]
    fn cancelled_terms_are_removed() {
        let difference = Linear::difference(NodeId(1), NodeId(2));
        assert_eq!(difference.minus(&difference), Linear::default());
        assert_eq!(
            Linear::difference(NodeId::ZERO, NodeId::ZERO),
            Linear::default()
        );
    }
}
