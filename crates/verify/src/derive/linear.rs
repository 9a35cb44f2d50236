//! Linear expressions over times and parameters: [`Linear`].

use std::collections::BTreeMap;

use elbowroom_num::Rational;

/// `constant + Σ factor · time + Σ factor · parameter`, without factors of zero.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Linear {
    pub(super) constant: Rational,
    /// By point.
    pub(super) times: BTreeMap<usize, Rational>,
    /// By parameter.
    pub(super) parameters: BTreeMap<usize, Rational>,
}

impl Linear {
    pub(super) fn number(constant: Rational) -> Self {
        Self {
            constant,
            ..Self::default()
        }
    }

    pub(super) fn parameter(parameter: usize) -> Self {
        let mut value = Self::default();
        value.add_parameter(parameter, &Rational::ONE);
        value
    }

    /// Returns the time of a point; time zero is 0.
    pub(super) fn time(point: usize) -> Self {
        let mut time = Self::default();
        time.add_time(point, &Rational::ONE);
        time
    }

    pub(super) fn add_time(&mut self, point: usize, factor: &Rational) {
        if point != 0 {
            add(&mut self.times, point, factor);
        }
    }

    pub(super) fn add_parameter(&mut self, parameter: usize, factor: &Rational) {
        add(&mut self.parameters, parameter, factor);
    }

    /// Adds `factor` times another expression.
    pub(super) fn add_scaled(&mut self, other: &Self, factor: &Rational) {
        self.constant += &other.constant * factor;
        for (point, own) in &other.times {
            self.add_time(*point, &(own * factor));
        }
        for (parameter, own) in &other.parameters {
            self.add_parameter(*parameter, &(own * factor));
        }
    }

    #[must_use]
    pub(super) fn plus(&self, other: &Self) -> Self {
        let mut sum = self.clone();
        sum.add_scaled(other, &Rational::ONE);
        sum
    }

    #[must_use]
    pub(super) fn minus(&self, other: &Self) -> Self {
        let mut difference = self.clone();
        difference.add_scaled(other, &Rational::from(-1));
        difference
    }

    #[must_use]
    pub(super) fn scaled(&self, factor: &Rational) -> Self {
        let mut scaled = Self::default();
        scaled.add_scaled(self, factor);
        scaled
    }

    /// Returns the number, if the expression is one.
    pub(super) fn as_number(&self) -> Option<&Rational> {
        (self.times.is_empty() && self.parameters.is_empty()).then_some(&self.constant)
    }

    /// Returns the product, or `None` if neither factor is a number.
    pub(super) fn product(&self, other: &Self) -> Option<Self> {
        let by_other = other.as_number().map(|factor| self.scaled(factor));
        by_other.or_else(|| Some(other.scaled(self.as_number()?)))
    }

    /// Returns the factor `k` for which `self - k · other` is a number, or `None` if there is none. It is 0 for
    /// a number.
    pub(super) fn ratio(&self, other: &Self) -> Option<Rational> {
        let first = |own: &Self| {
            let time = own.times.iter().next().map(|(_, factor)| factor.clone());
            time.or_else(|| own.parameters.values().next().cloned())
        };
        let ratio = match (first(self), first(other)) {
            (None, _) => Rational::ZERO,
            (Some(_), None) => return None,
            (Some(own), Some(other)) => own.checked_div(&other)?,
        };
        let rest = self.minus(&other.scaled(&ratio));
        rest.as_number().is_some().then_some(ratio)
    }
}

fn add(factors: &mut BTreeMap<usize, Rational>, index: usize, factor: &Rational) {
    let sum = factors.entry(index).or_default();
    *sum += factor;
    if sum.is_zero() {
        factors.remove(&index);
    }
}

/// `expression <= 0`, or `< 0` when strict.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Inequality {
    pub(super) expression: Linear,
    pub(super) is_strict: bool,
}

impl Inequality {
    /// Returns `true` if the other inequality follows from this one, because it is a positive multiple of it
    /// plus a negative number or zero.
    pub(super) fn implies(&self, other: &Self) -> bool {
        let Some(factor) = other.expression.ratio(&self.expression) else {
            return false;
        };
        if factor.is_negative() {
            return false;
        }
        let slack = &self.expression.constant * &factor - &other.expression.constant;
        // `other = factor · self - slack`
        match (slack.is_negative(), slack.is_zero()) {
            (true, _) => false,
            (_, false) => true,
            _ => !other.is_strict || (self.is_strict && factor.is_positive()),
        }
    }
}
