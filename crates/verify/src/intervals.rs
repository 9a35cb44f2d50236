//! The box of a certificate: [`Intervals`].

use elbowroom_num::Rational;

use crate::certificate::{Certificate, End};
use crate::flaw::Flaw;
use crate::sound::Endless;

/// Least and greatest value of each parameter; `None` is infinite.
#[derive(Clone, Debug)]
pub(crate) struct Intervals(Vec<[Option<Rational>; 2]>);

impl Intervals {
    /// Returns the box with these slacks, with some ends infinite.
    ///
    /// # Errors
    /// When an infinite end does not exist or is listed twice, slacks are missing, or a symmetric
    /// box has an infinite end.
    pub(crate) fn new(certificate: &Certificate, endless: &[Endless]) -> Result<Self, Flaw> {
        let parameters = certificate.parameters.iter().enumerate();
        let intervals = parameters.map(|(index, own)| {
            let places = if certificate.symmetric {
                [index, index]
            } else {
                [2 * index, 2 * index + 1]
            };
            let slack = |place: usize| {
                let slack = certificate.slacks.get(place);
                slack.ok_or(Flaw::UnknownReference("variable", place))
            };
            let lower = &own.nominal - &slack(places[0])?.0;
            let upper = &own.nominal + &slack(places[1])?.0;
            Ok([Some(lower), Some(upper)])
        });
        let mut intervals = intervals.collect::<Result<Vec<_>, Flaw>>()?;
        for own in endless {
            let interval = intervals.get_mut(own.parameter);
            let interval = interval.ok_or(Flaw::UnknownReference("parameter", own.parameter))?;
            let end = &mut interval[usize::from(own.end == End::Upper)];
            let end = end.take().filter(|_| !certificate.symmetric);
            end.ok_or(Flaw::Range("the interval of parameter", own.parameter))?;
        }
        Ok(Self(intervals))
    }

    /// Returns the box that contains only these values.
    pub(crate) fn exactly(values: impl Iterator<Item = Rational>) -> Self {
        Self(values.map(|own| [Some(own.clone()), Some(own)]).collect())
    }

    /// Returns a box around the nominal values. Each parameter ranges from its nominal value
    /// upwards if `is_up` returns `Some(true)`, downwards for `Some(false)`, and is fixed
    /// otherwise. Values are not negative unless `is_signed` is true.
    pub(crate) fn around_nominal(
        certificate: &Certificate,
        is_signed: &dyn Fn(usize) -> bool,
        is_up: impl Fn(usize) -> Option<bool>,
    ) -> Self {
        let parameters = certificate.parameters.iter().enumerate();
        let intervals = parameters.map(|(index, own)| {
            let nominal = Some(own.nominal.clone());
            match is_up(index) {
                None => [nominal.clone(), nominal],
                Some(true) => [nominal, None],
                Some(false) => [(!is_signed(index)).then_some(Rational::ZERO), nominal],
            }
        });
        Self(intervals.collect())
    }

    /// Returns the box of all values; they are not negative unless `is_signed` is true.
    pub(crate) fn widest(certificate: &Certificate, is_signed: &dyn Fn(usize) -> bool) -> Self {
        let parameters = 0..certificate.parameters.len();
        let least = |own: usize| (!is_signed(own)).then_some(Rational::ZERO);
        Self(parameters.map(|own| [least(own), None]).collect())
    }

    /// Returns the ends of a parameter's interval.
    ///
    /// # Errors
    /// When there is no such parameter.
    pub(crate) fn of(&self, parameter: usize) -> Result<&[Option<Rational>; 2], Flaw> {
        self.0
            .get(parameter)
            .ok_or(Flaw::UnknownReference("parameter", parameter))
    }

    /// Returns the box with a parameter fixed at one of its ends; `None` if the end is infinite, or
    /// there is no such parameter.
    pub(crate) fn at_end(&self, parameter: usize, is_upper: bool) -> Option<Self> {
        let value = self.0.get(parameter)?[usize::from(is_upper)].clone()?;
        let mut narrowed = self.clone();
        narrowed.0[parameter] = [Some(value.clone()), Some(value)];
        Some(narrowed)
    }

    /// Returns the greatest value of `constant + Σ factor · value`; `None` if it is unbounded.
    pub(crate) fn greatest<'a>(
        &self,
        constant: Rational,
        factors: impl IntoIterator<Item = (usize, &'a Rational)>,
    ) -> Option<Rational> {
        let mut sum = constant;
        for (parameter, factor) in factors {
            if !factor.is_zero() {
                let end = &self.0.get(parameter)?[usize::from(factor.is_positive())];
                sum += end.as_ref()? * factor;
            }
        }
        Some(sum)
    }
}
