//! Distribution functions of the durations of contingent links, for the choice of a box.
//!
//! They are floating-point numbers: they choose a box and state its probability, and an exact check
//! decides that the network is controllable in it.

use elbowroom_network::{Duration, NetworkFile};
use elbowroom_stn::uncertain::LinkId;

use super::simulate::Durations;

/// Distance from the mean of a normal distribution, in deviations, beyond which it has no relevant
/// mass (less than 10^-15).
const DEVIATIONS: f64 = 8.0;

/// Multiple of the scale of an exponential tail beyond which it has no relevant mass.
const TAIL: f64 = 40.0;

/// Greatest shape of a gamma distribution for which rounding errors stay below 10^-9.
const MAX_SHAPE: f64 = 1e4;

/// Distribution of a duration, cut at 0 because no duration is negative.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Law {
    shape: Shape,
    /// Least relevant duration; not negative.
    pub(super) least: f64,
    /// Greatest relevant duration; greater than the least one.
    pub(super) most: f64,
    /// Width of the distribution: its deviation, or a similar length.
    pub(super) spread: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    Normal { mean: f64, deviation: f64 },
    Uniform { from: f64, to: f64 },
    Exponential { from: f64, mean: f64 },
    Gamma { from: f64, shape: f64, scale: f64 },
}

/// Probability of an interval, and the derivatives that Newton's method needs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mass {
    /// The probability.
    pub(super) probability: f64,
    /// Density at the lower and at the upper end.
    pub(super) density: [f64; 2],
    /// Derivative of the density at the lower and at the upper end.
    pub(super) slope: [f64; 2],
}

impl Law {
    /// Returns the distribution of the duration of a link, as in simulated runs. `None` if it has a
    /// single value or a shape above [`MAX_SHAPE`], or the file gives neither a distribution nor an
    /// upper bound.
    pub(super) fn of(file: &NetworkFile, id: LinkId, durations: Durations) -> Option<Self> {
        let link = file.network.link(id);
        let given = match durations {
            Durations::Given => file.durations[id.index()].as_ref(),
            Durations::Uniform => None,
        };
        let shape = match given {
            None => Shape::Uniform {
                from: link.lower.to_f64(),
                to: link.upper.as_ref()?.to_f64(),
            },
            Some(Duration::Normal { mean, deviation }) => Shape::Normal {
                mean: mean.to_f64(),
                deviation: deviation.to_f64(),
            },
            Some(Duration::Uniform { from, to }) => Shape::Uniform {
                from: from.to_f64(),
                to: to.to_f64(),
            },
            Some(Duration::Exponential { from, mean }) => Shape::Exponential {
                from: from.to_f64(),
                mean: mean.to_f64(),
            },
            Some(Duration::Gamma { from, shape, scale }) => Shape::Gamma {
                from: from.to_f64(),
                shape: shape.to_f64(),
                scale: scale.to_f64(),
            },
        };
        Self::new(shape)
    }

    fn new(shape: Shape) -> Option<Self> {
        let (least, most, spread) = match shape {
            Shape::Normal { mean, deviation } => (
                mean - DEVIATIONS * deviation,
                mean + DEVIATIONS * deviation,
                deviation,
            ),
            Shape::Uniform { from, to } => (from, to, (to - from) / 4.0),
            Shape::Exponential { from, mean } => (from, from + TAIL * mean, mean),
            Shape::Gamma { shape, .. } if shape > MAX_SHAPE => return None,
            Shape::Gamma { from, shape, scale } => {
                let deviation = shape.sqrt() * scale;
                let most = from + shape * scale + DEVIATIONS * deviation + TAIL * scale;
                (from, most, deviation)
            }
        };
        let least = f64::max(least, 0.0);
        (spread > 0.0 && most > least && most.is_finite()).then_some(Self {
            shape,
            least,
            most,
            spread,
        })
    }

    /// Returns a central duration: the mean, inside the relevant durations.
    pub(super) fn center(&self) -> f64 {
        let mean = match self.shape {
            Shape::Normal { mean, .. } => mean,
            Shape::Uniform { from, to } => f64::midpoint(from, to),
            Shape::Exponential { from, mean } => from + mean,
            Shape::Gamma { from, shape, scale } => from + shape * scale,
        };
        let width = self.most - self.least;
        mean.clamp(self.least + 0.1 * width, self.most - 0.1 * width)
    }

    /// Returns the probability of an interval of durations, with its derivatives. All mass beyond
    /// the least or the greatest relevant duration belongs to it.
    pub(super) fn mass(&self, [lower, upper]: [f64; 2]) -> Mass {
        let [below, above] = self.tails(lower);
        let [until, beyond] = self.tails(upper);
        let is_least = lower <= self.least;
        let is_most = upper >= self.most;
        let mass = match (is_least, is_most) {
            (true, true) => 1.0,
            (true, false) => until,
            (false, true) => above,
            // The difference of the lesser tails loses no digits.
            (false, false) if below > above => above - beyond,
            (false, false) => until - below,
        };
        let (at_lower, at_upper) = (self.density(lower), self.density(upper));
        Mass {
            probability: f64::max(mass, 0.0),
            density: [at_lower.0, at_upper.0],
            slope: [at_lower.1, at_upper.1],
        }
    }

    /// Returns the probabilities of a lesser and of a greater duration.
    fn tails(&self, at: f64) -> [f64; 2] {
        match self.shape {
            Shape::Normal { mean, deviation } => {
                let z = (at - mean) / deviation;
                let [_, tail] = incomplete_gamma(0.5, z * z / 2.0);
                let tail = tail / 2.0;
                if z < 0.0 {
                    [tail, 1.0 - tail]
                } else {
                    [1.0 - tail, tail]
                }
            }
            Shape::Uniform { from, to } => {
                let share = ((at - from) / (to - from)).clamp(0.0, 1.0);
                [share, 1.0 - share]
            }
            Shape::Exponential { from, mean } => {
                let times = f64::max(at - from, 0.0) / mean;
                [-(-times).exp_m1(), (-times).exp()]
            }
            Shape::Gamma { from, shape, scale } => {
                incomplete_gamma(shape, f64::max(at - from, 0.0) / scale)
            }
        }
    }

    /// Returns the density and its derivative.
    fn density(&self, at: f64) -> (f64, f64) {
        match self.shape {
            Shape::Normal { mean, deviation } => {
                let z = (at - mean) / deviation;
                let density =
                    (-z * z / 2.0).exp() / (deviation * (2.0 * std::f64::consts::PI).sqrt());
                (density, -z / deviation * density)
            }
            Shape::Uniform { from, to } => {
                let is_inside = (from..=to).contains(&at);
                (f64::from(u8::from(is_inside)) / (to - from), 0.0)
            }
            Shape::Exponential { from, mean } if at >= from => {
                let density = (-(at - from) / mean).exp() / mean;
                (density, -density / mean)
            }
            Shape::Gamma { from, shape, scale } if at > from => {
                let x = (at - from) / scale;
                let density = ((shape - 1.0) * x.ln() - x - libm::lgamma(shape)).exp() / scale;
                (density, density * ((shape - 1.0) / x - 1.0) / scale)
            }
            Shape::Exponential { .. } | Shape::Gamma { .. } => (0.0, 0.0),
        }
    }
}

/// Returns the regularized incomplete gamma functions P(shape, x) and Q(shape, x) = 1 - P(shape, x).
///
/// Series for small `x`, continued fraction by Lentz's method otherwise (DLMF 8.11.4 and 8.9.2).
fn incomplete_gamma(shape: f64, x: f64) -> [f64; 2] {
    if x <= 0.0 {
        return [0.0, 1.0];
    }
    let factor = (shape * x.ln() - x - libm::lgamma(shape)).exp();
    if x < shape + 1.0 {
        let lower = (factor * gamma_series(shape, x)).min(1.0);
        [lower, 1.0 - lower]
    } else {
        let upper = (factor * gamma_fraction(shape, x)).min(1.0);
        [1.0 - upper, upper]
    }
}

/// Limit on terms of a series or continued fraction; more than needed for full precision up to
/// [`MAX_SHAPE`].
const TERMS: u32 = 20_000;

/// Returns the lower incomplete gamma function divided by `x^shape * exp(-x)`.
fn gamma_series(shape: f64, x: f64) -> f64 {
    let (mut term, mut sum) = (1.0 / shape, 1.0 / shape);
    for number in 1..TERMS {
        term *= x / (shape + f64::from(number));
        sum += term;
        if term < sum * f64::EPSILON {
            break;
        }
    }
    sum
}

/// Returns the upper incomplete gamma function divided by `x^shape * exp(-x)`.
fn gamma_fraction(shape: f64, x: f64) -> f64 {
    let tiny = f64::MIN_POSITIVE / f64::EPSILON;
    let avoid_zero = |value: f64| if value.abs() < tiny { tiny } else { value };
    let mut denominator = x + 1.0 - shape;
    let (mut forward, mut backward) = (1.0 / tiny, 1.0 / denominator);
    let mut fraction = backward;
    for number in 1..TERMS {
        let number = f64::from(number);
        let numerator = -number * (number - shape);
        denominator += 2.0;
        backward = 1.0 / avoid_zero(numerator * backward + denominator);
        forward = avoid_zero(denominator + numerator / forward);
        fraction *= backward * forward;
        if (backward * forward - 1.0).abs() < f64::EPSILON {
            break;
        }
    }
    fraction
}

#[cfg(test)]
mod tests {
    use super::*;

    fn laws() -> Vec<Law> {
        let shapes = [
            Shape::Normal {
                mean: 9.0,
                deviation: 1.5,
            },
            Shape::Uniform { from: 2.0, to: 5.0 },
            Shape::Exponential {
                from: 1.0,
                mean: 2.0,
            },
            Shape::Gamma {
                from: 0.5,
                shape: 2.5,
                scale: 1.2,
            },
        ];
        shapes.into_iter().filter_map(Law::new).collect()
    }

    #[test]
    fn masses_match_known_values() {
        let [normal, _, exponential, gamma] = &laws()[..] else {
            panic!("four laws");
        };
        let close = |one: f64, other: f64| assert!((one / other - 1.0).abs() < 1e-12, "{one}");
        close(
            normal.mass([7.5, 10.5]).probability,
            0.682_689_492_137_085_9,
        );
        close(
            normal.mass([15.0, 18.0]).probability,
            3.167_025_524_547_488e-5,
        );
        close(
            exponential.mass([0.0, 3.0]).probability,
            0.632_120_558_828_557_7,
        );
        // P(2.5, 2.5) (DLMF 8.2).
        close(gamma.mass([0.5, 3.5]).probability, 0.584_119_813_004_492_3);
    }

    #[test]
    fn distribution_without_width_or_with_extreme_shape_has_no_law() {
        let point = Shape::Normal {
            mean: 3.0,
            deviation: 0.0,
        };
        let extreme = Shape::Gamma {
            from: 0.0,
            shape: 1e5,
            scale: 1.0,
        };
        assert_eq!((Law::new(point), Law::new(extreme)), (None, None));
    }

    #[test]
    fn mass_is_the_integral_of_the_density() {
        for law in laws() {
            let (from, to) = (
                law.center() - 0.4 * law.spread,
                law.center() + 1.3 * law.spread,
            );
            let steps = 20_000;
            let width = (to - from) / f64::from(steps);
            let middles = (0..steps).map(|step| from + (f64::from(step) + 0.5) * width);
            let sum: f64 = middles.map(|at| law.density(at).0 * width).sum();
            let mass = law.mass([from, to]).probability;
            assert!((sum - mass).abs() < 1e-8, "{law:?}: {sum} and {mass}");
            let step = 1e-5;
            let slope = (law.density(to + step).0 - law.density(to - step).0) / (2.0 * step);
            assert!((slope - law.density(to).1).abs() < 1e-6, "{law:?}");
        }
    }
}
