//! Cumulative probabilities of the values that a world draws, with the same rules as for drawing.
//!
//! Results are floating-point numbers, accurate to about 1e-15. Values are rounded to the world's
//! resolution, as in draws.

use elbowroom_num::Rational;

use crate::draw::Distribution;
use crate::model::{Rule, WorldModel};

/// Interval of values: less than a value, or up to and including it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Less than the value.
    Below,
    /// Less than the value, or the value itself.
    AtMost,
}

impl Distribution {
    /// Returns P(a drawn number < `value`), before it is clamped, scaled and rounded; `None` for a
    /// gamma distribution, which has no closed form.
    pub fn probability_below(&self, value: f64) -> Option<f64> {
        let step = |at: f64| f64::from(u8::from(at < value));
        Some(match self {
            Self::Constant(at) => step(*at),
            Self::Normal { mean, deviation } if *deviation > 0.0 => {
                standard_normal_cdf((value - mean) / deviation)
            }
            Self::LogNormal { mean, deviation } if *deviation > 0.0 => {
                if value <= 0.0 {
                    return Some(0.0);
                }
                let variance = (deviation / mean).powi(2).ln_1p();
                let location = mean.ln() - variance / 2.0;
                standard_normal_cdf((value.ln() - location) / variance.sqrt())
            }
            Self::Normal { mean, .. } | Self::LogNormal { mean, .. } => step(*mean),
            Self::Uniform { from, to } if from < to => {
                ((value - from) / (to - from)).clamp(0.0, 1.0)
            }
            Self::Triangular { from, mode, to } if from < to => {
                let value = value.clamp(*from, *to);
                if value <= *mode && from < mode {
                    (value - from).powi(2) / ((to - from) * (mode - from))
                } else if mode < to {
                    1.0 - (to - value).powi(2) / ((to - from) * (to - mode))
                } else {
                    1.0
                }
            }
            Self::Exponential { from, mean } if *mean > 0.0 => {
                -(-(value - from).max(0.0) / mean).exp_m1()
            }
            Self::Uniform { from, .. }
            | Self::Triangular { from, .. }
            | Self::Exponential { from, .. } => step(*from),
            Self::Gamma { .. } => return None,
            Self::Empirical(values) => {
                #[allow(
                    clippy::cast_precision_loss,
                    reason = "lists of measured values are far shorter than 2^52"
                )]
                let count = |number: usize| number as f64;
                let below = values.iter().filter(|at| **at < value).count();
                count(below) / count(values.len())
            }
        })
    }
}

/// Returns Φ(`value`).
fn standard_normal_cdf(value: f64) -> f64 {
    0.5 * libm::erfc(-value / std::f64::consts::SQRT_2)
}

/// Returns the number below which a drawn number is rounded to that side of `value`. Drawn numbers
/// are rounded to the nearest multiple of the resolution.
pub fn rounding_edge(value: f64, side: Side, resolution: f64) -> f64 {
    let steps = value / resolution;
    let whole = steps.round();
    let steps = if (steps - whole).abs() < 1e-6 {
        whole
    } else {
        steps
    };
    let edge = match side {
        Side::Below => steps.ceil() - 0.5,
        Side::AtMost => steps.floor() + 0.5,
    };
    edge * resolution
}

impl Rule {
    /// Returns the probability that a value drawn for the planned value `planned` is on that side
    /// of `value`.
    pub fn probability_of_side(
        &self,
        value: f64,
        side: Side,
        planned: f64,
        resolution: f64,
    ) -> Option<f64> {
        let edge = rounding_edge(value, side, resolution);
        let scale = if self.is_relative { planned } else { 1.0 };
        if scale <= 0.0 {
            return Some(f64::from(u8::from(edge > 0.0)));
        }
        let edge = edge / scale;
        if self.minimum.is_some_and(|minimum| edge <= minimum) {
            return Some(0.0);
        }
        if self.maximum.is_some_and(|maximum| maximum < edge) {
            return Some(1.0);
        }
        self.distribution.probability_below(edge)
    }
}

impl WorldModel {
    /// Returns the probability that [`duration`](Self::duration) is on that side of `value`, in
    /// seconds; `None` if it cannot be computed.
    pub fn duration_probability(
        &self,
        action: &str,
        planned: &Rational,
        value: f64,
        side: Side,
    ) -> Option<f64> {
        let least = planned.min(&self.resolution).to_f64();
        let is_beyond = |at: f64| match side {
            Side::Below => at < value,
            Side::AtMost => at <= value,
        };
        if !is_beyond(least) {
            return Some(0.0);
        }
        let planned = planned.to_f64();
        match self.duration_rule(action) {
            Some(rule) => rule.probability_of_side(value, side, planned, self.resolution.to_f64()),
            None => Some(f64::from(u8::from(is_beyond(planned)))),
        }
    }
}

#[cfg(test)]
mod tests {
    use elbowroom_num::Rational;

    use super::Side;
    use crate::draw::{Distribution, Purpose, keyed};
    use crate::model::Rule;

    /// For each distribution, the frequencies of draws match the probabilities.
    #[test]
    fn probabilities_match_draw_frequencies() {
        let distributions = [
            Distribution::Constant(4.0),
            Distribution::Normal {
                mean: 3.0,
                deviation: 2.0,
            },
            Distribution::LogNormal {
                mean: 3.0,
                deviation: 2.0,
            },
            Distribution::Uniform { from: 1.0, to: 5.0 },
            Distribution::Triangular {
                from: 1.0,
                mode: 2.0,
                to: 6.0,
            },
            Distribution::Triangular {
                from: 1.0,
                mode: 1.0,
                to: 6.0,
            },
            Distribution::Triangular {
                from: 1.0,
                mode: 6.0,
                to: 6.0,
            },
            Distribution::Exponential {
                from: 1.0,
                mean: 2.0,
            },
            Distribution::Empirical(vec![1.0, 2.5, 2.5, 4.0]),
        ];
        let resolution = Rational::new(1, 2);
        let planned = Rational::from(2);
        for distribution in distributions {
            for (is_relative, maximum) in [(false, None), (true, Some(4.0))] {
                let rule = Rule {
                    distribution: distribution.clone(),
                    minimum: Some(1.25),
                    maximum,
                    is_relative,
                };
                let mut rng = keyed(5, "test", 0, Purpose::Duration);
                let draws: Vec<f64> = (0..20_000)
                    .map(|_| rule.draw(&planned, &resolution, &mut rng).to_f64())
                    .collect();
                for value in [1.0, 1.3, 2.5, 4.0, 4.2, 8.0] {
                    for side in [Side::Below, Side::AtMost] {
                        let is_there = |draw: &&f64| match side {
                            Side::Below => **draw < value,
                            Side::AtMost => **draw <= value,
                        };
                        #[allow(clippy::cast_precision_loss, reason = "20,000 at most")]
                        let found = draws.iter().filter(is_there).count() as f64 / 20_000.0;
                        let said = rule.probability_of_side(value, side, 2.0, 0.5).unwrap();
                        assert!(
                            (found - said).abs() < 0.015,
                            "{rule:?} {side:?} {value}: {found}, not {said}"
                        );
                    }
                }
            }
        }
    }
}
