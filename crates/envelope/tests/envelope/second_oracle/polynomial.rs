//! Values as sums of products of times and parameters.

use std::collections::BTreeMap;

use elbowroom_num::Rational;

/// Variable that a value can depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Symbol {
    /// The time of a node, by position in the plan.
    Time(usize),
    /// A parameter, by position in the plan.
    Parameter(usize),
    /// A moment between two happenings.
    Moment,
}

/// A sum of products: the factors in order, and the coefficient. None is zero.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Polynomial(BTreeMap<Vec<Symbol>, Rational>);

impl Polynomial {
    pub(crate) fn constant(value: &Rational) -> Self {
        Self::default().plus_term(Vec::new(), value)
    }

    pub(crate) fn symbol(symbol: Symbol) -> Self {
        Self::default().plus_term(vec![symbol], &Rational::ONE)
    }

    /// Returns `to - from`.
    pub(crate) fn difference(from: Symbol, to: Symbol) -> Self {
        Self::symbol(to).minus(&Self::symbol(from))
    }

    fn plus_term(mut self, mut factors: Vec<Symbol>, coefficient: &Rational) -> Self {
        factors.sort_unstable();
        let sum = self.0.entry(factors.clone()).or_default();
        *sum += coefficient;
        if sum.is_zero() {
            self.0.remove(&factors);
        }
        self
    }

    pub(crate) fn plus(&self, other: &Self) -> Self {
        let terms = other.0.iter();
        terms.fold(self.clone(), |sum, (factors, coefficient)| {
            sum.plus_term(factors.clone(), coefficient)
        })
    }

    pub(crate) fn minus(&self, other: &Self) -> Self {
        self.plus(&other.times(&Self::constant(&Rational::from(-1))))
    }

    pub(crate) fn times(&self, other: &Self) -> Self {
        let mut product = Self::default();
        for (left, a) in &self.0 {
            for (right, b) in &other.0 {
                product = product.plus_term([&left[..], right].concat(), &(a * b));
            }
        }
        product
    }

    /// Returns the number, if the polynomial is constant.
    pub(crate) fn as_constant(&self) -> Option<Rational> {
        match self.0.iter().next() {
            None => Some(Rational::ZERO),
            Some((factors, value)) if factors.is_empty() && self.0.len() == 1 => {
                Some(value.clone())
            }
            Some(_) => None,
        }
    }

    /// Returns the products of two or more factors.
    pub(crate) fn products(&self) -> impl Iterator<Item = &[Symbol]> {
        let products = self.0.keys().map(Vec::as_slice);
        products.filter(|factors| factors.len() > 1)
    }

    /// Returns the constant and the coefficient of each symbol; `None` if there is a product.
    pub(crate) fn linear(&self) -> Option<(Rational, Vec<(Symbol, Rational)>)> {
        let mut constant = Rational::ZERO;
        let mut terms = Vec::new();
        for (factors, coefficient) in &self.0 {
            match factors[..] {
                [] => constant = coefficient.clone(),
                [symbol] => terms.push((symbol, coefficient.clone())),
                _ => return None,
            }
        }
        Some((constant, terms))
    }
}
