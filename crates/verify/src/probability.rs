//! Check that no box has a greater probability that all parameters are inside, by sums of linear
//! bounds on logarithms of probabilities.
//!
//! The bounds are those of [`elbowroom_num::log_concave`]: the probability of an interval is log-concave
//! in its ends for a log-concave density (Prékopa 1973). A jump counts in full where a case does
//! not exclude it.

use elbowroom_num::log_concave::{Cell, LogConcaveDistribution, Reach, TangentPoint as Touching};
use elbowroom_num::{Rational, enclosures};

use crate::certificate::{Certificate, Exact, Total, Touch};
use crate::flaw::Flaw;

/// Replaces the logarithm of the probability if a box has probability 0.
pub(crate) const NEVER: i64 = -1_000_000;

/// Interval of a variable in a case.
#[derive(Clone, Debug)]
pub(crate) struct Span {
    /// Lower bound.
    pub(crate) least: Rational,
    /// Upper bound, if known.
    pub(crate) far: Option<Rational>,
    /// `true` if the upper bound is strict.
    pub(crate) is_open: bool,
}

/// The parameters with their distributions.
pub(crate) struct VariableDistributions {
    own: Vec<Option<(Rational, LogConcaveDistribution)>>,
    /// For each parameter the variables that move its ends.
    ends: Vec<[usize; 2]>,
}

impl VariableDistributions {
    /// Reads the distributions of a certificate.
    ///
    /// # Errors
    /// When a distribution is invalid or missing.
    pub(crate) fn new(certificate: &Certificate) -> Result<Self, Flaw> {
        let own = certificate
            .parameters
            .iter()
            .enumerate()
            .map(|(index, parameter)| {
                let Some(chance) = &parameter.chance else {
                    return Ok(None);
                };
                let reckoned = chance.to_exact();
                let reckoned =
                    reckoned.ok_or(Flaw::Range("the distribution of parameter", index))?;
                Ok(Some((parameter.nominal.clone(), reckoned)))
            });
        let ends = (0..certificate.parameters.len()).map(|index| {
            if certificate.symmetric {
                [index; 2]
            } else {
                [2 * index, 2 * index + 1]
            }
        });
        Ok(Self {
            own: own.collect::<Result<_, _>>()?,
            ends: ends.collect(),
        })
    }

    /// Restricts variables to the range where the box has a positive probability and where moving
    /// an end increases it. A box outside this range has probability 0, or no more than some box
    /// inside it.
    pub(crate) fn restrict_spans(&self, spans: &mut [Span]) {
        let mut gains: Vec<Option<Option<Rational>>> = vec![None; spans.len()];
        for (own, ends) in self.own.iter().zip(&self.ends) {
            let limits = match own {
                Some((nominal, chance)) => chance.limits(nominal),
                None => [const { (Rational::ZERO, Some(Rational::ZERO)) }; 2],
            };
            for (&variable, (least, most)) in ends.iter().zip(limits) {
                let span = &mut spans[variable];
                span.least = span.least.clone().max(least);
                gains[variable] = Some(match gains[variable].take() {
                    None => most,
                    // The range ends where no end that the variable moves increases the probability
                    // any more.
                    Some(other) => other.zip(most).map(|(one, other)| one.max(other)),
                });
            }
        }
        for (span, gains) in spans.iter_mut().zip(gains) {
            if let (Some(Some(gains)), Some(far)) = (gains, &mut span.far) {
                *far = far.clone().min(gains);
            }
        }
    }

    /// Returns `true` if a probability jumps when this variable reaches a number.
    pub(crate) fn has_jump_at(&self, variable: usize, at: &Rational) -> bool {
        let all = self.own.iter().zip(&self.ends);
        let mut own = all.filter_map(|(own, ends)| Some((own.as_ref()?, ends)));
        own.any(|((nominal, chance), ends)| {
            let jumps = chance.jumps(nominal);
            let mut sides = ends.iter().zip(&jumps);
            sides.any(|(&moved, jumps)| moved == variable && jumps.contains(at))
        })
    }

    /// Returns the logarithm of the probability of a box, rounded down; [`NEVER`] if it is 0 or
    /// below that.
    pub(crate) fn log_probability(&self, slacks: &[Rational]) -> Rational {
        let mut sum = Rational::ZERO;
        for (own, ends) in self.own.iter().zip(&self.ends) {
            let Some((nominal, chance)) = own else {
                continue;
            };
            let reach: Reach = ends.map(|variable| slacks[variable].clone());
            let [mass, _] = chance.probability_bounds(nominal, &reach);
            match enclosures::ln(&mass) {
                Some([below, _]) => sum += below,
                None => return Rational::from(NEVER),
            }
        }
        enclosures::floor_to_billionth(&sum).max(Rational::from(NEVER))
    }

    /// Returns an upper bound of the logarithm of the probability, rounded up to 10^-18, in a case
    /// where the sum of the ends, each times its slope, is limited by the total. Returns `None` if
    /// nothing follows. `factors` are the factors of the variables in the sum.
    pub(crate) fn bound(
        &self,
        total: &Total,
        factors: &[Rational],
        spans: &[Span],
    ) -> Option<Rational> {
        let count = self.own.len();
        if total.slopes.len() != 2 * count || total.touches.len() != count {
            return None;
        }
        let mut wanted = vec![Rational::ZERO; factors.len()];
        let mut bound = total.bound.clone();
        for (index, (own, ends)) in self.own.iter().zip(&self.ends).enumerate() {
            let slopes = [2 * index, 2 * index + 1].map(|place| total.slopes[place].0.clone());
            for (variable, slope) in ends.iter().zip(&slopes) {
                wanted[*variable] += slope;
            }
            let touch = &total.touches[index];
            let Some((nominal, chance)) = own else {
                let is_nothing = slopes.iter().all(Rational::is_zero) && *touch == Touch::Nowhere;
                if !is_nothing {
                    return None;
                }
                continue;
            };
            let [below, above] = ends.map(|variable| &spans[variable]);
            let cell = Cell {
                below: [below.least.clone(), below.far.clone()?],
                above: [above.least.clone(), above.far.clone()?],
                is_open: [below.is_open, above.is_open],
            };
            let touching = contact_point(touch, &cell)?;
            bound += chance.gap(nominal, &cell, &touching, &slopes)?;
        }
        let fine = Rational::from(1_000_000_000_000_000_000_i64);
        (wanted == factors).then(|| (bound * &fine).ceil() / fine)
    }
}

/// Returns an enclosure of the probability that all parameters are inside their intervals: at least this in the box,
/// rounded down to a billionth, and at most this in any box, rounded up. An end that is `None` is infinite; `bound` is
/// the greatest logarithm of the probability of a box. Returns `None` if a distribution makes no sense.
pub(crate) fn enclosure(
    certificate: &Certificate,
    ends: impl Iterator<Item = [Option<Rational>; 2]>,
    bound: &Rational,
) -> Option<[Rational; 2]> {
    /// Longer than any duration; replaces infinite ends.
    const EVER: i64 = 1_000_000_000_000;
    let mut least = Rational::ONE;
    for (parameter, [lower, upper]) in certificate.parameters.iter().zip(ends) {
        let Some(own) = &parameter.chance else {
            continue;
        };
        let resolution = own.resolution.as_ref();
        let resolution = resolution.map_or(Rational::ONE, |own| own.0.clone());
        let ever = Rational::from(EVER);
        let lower = lower.unwrap_or_else(|| -&ever);
        let inside = own
            .to_exact()?
            .probability_inside([&lower, &upper.unwrap_or(ever)], &resolution);
        least = enclosures::floor_to_billionth(&(least * inside));
    }
    let [_, most] = enclosures::exp_of_minus(&(-bound).max(Rational::ZERO));
    Some([
        least,
        enclosures::ceil_to_billionth(&most).min(Rational::ONE),
    ])
}

/// Returns the point of contact with its numbers; `None` if it is not in the cell.
fn contact_point(touch: &Touch, cell: &Cell) -> Option<Touching> {
    Some(match touch {
        Touch::At([Exact(below), Exact(above)]) => {
            let is_in = |at: &Rational, [near, far]: &[Rational; 2]| near <= at && at <= far;
            if !is_in(below, &cell.below) || !is_in(above, &cell.above) {
                return None;
            }
            Touching::At([below.clone(), above.clone()])
        }
        Touch::Mass(Exact(mass)) => Touching::Mass(mass.clone()),
        Touch::Nowhere => Touching::NoContact,
    })
}
