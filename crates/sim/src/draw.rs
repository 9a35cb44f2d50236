//! Keyed random numbers, and distributions.

use elbowroom_num::Rational;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, Exp1, Gamma, LogNormal, Normal, Triangular};

/// The purpose of a random number.
///
/// It is part of the key. The numbers must never change, because old seeds would then yield other
/// worlds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub enum Purpose {
    /// The duration of an action.
    Duration = 1,
    /// The delay between the command and the start of an action.
    Delay = 2,
    /// The failure of an action.
    Failure = 3,
    /// The time of an exogenous event.
    Exogenous = 4,
    /// The reliability of a report.
    Report = 5,
    /// The amount by which an action changes a fluent; the fluent is part of the instance.
    Amount = 6,
    /// The effects of an action.
    Effect = 7,
    /// A spontaneous change from one step to the next.
    Change = 8,
    /// The time of a spontaneous change at a rate.
    Hazard = 9,
    /// The outcome of a failure.
    Outcome = 10,
}

/// Returns a random number generator that is determined by these four values.
///
/// `instance` is the name of an action, fact or fluent, and `occurrence` counts from 0.
pub fn keyed(seed: u64, instance: &str, occurrence: u64, purpose: Purpose) -> ChaCha8Rng {
    let mut key = [0; 32];
    let parts = [seed, stable_hash(instance), occurrence, purpose as u64];
    for (bytes, part) in key.chunks_exact_mut(8).zip(parts) {
        bytes.copy_from_slice(&part.to_le_bytes());
    }
    ChaCha8Rng::from_seed(key)
}

/// Returns the 64-bit FNV-1a hash. It is the same on every machine and in every version, unlike the
/// hashers of the standard library.
fn stable_hash(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte.to_ascii_lowercase())).wrapping_mul(0x0100_0000_01b3)
    })
}

/// The distribution of a quantity.
#[derive(Clone, Debug, PartialEq)]
pub enum Distribution {
    /// A single value.
    Constant(f64),
    /// Normal distribution.
    Normal {
        /// The mean, before values are clamped.
        mean: f64,
        /// The standard deviation, before values are clamped.
        deviation: f64,
    },
    /// Log-normal distribution. Mean and deviation are those of the quantity itself.
    LogNormal {
        /// The mean.
        mean: f64,
        /// The standard deviation.
        deviation: f64,
    },
    /// Uniform distribution.
    Uniform {
        /// The least value.
        from: f64,
        /// The greatest value.
        to: f64,
    },
    /// Triangular distribution.
    Triangular {
        /// The least value.
        from: f64,
        /// The likeliest value.
        mode: f64,
        /// The greatest value.
        to: f64,
    },
    /// `from`, plus an exponentially distributed value.
    Exponential {
        /// The least value.
        from: f64,
        /// The mean of the part above `from`.
        mean: f64,
    },
    /// `from`, plus a gamma-distributed value.
    Gamma {
        /// The least value.
        from: f64,
        /// The shape.
        shape: f64,
        /// The scale.
        scale: f64,
    },
    /// Measured values, all with the same probability.
    Empirical(Vec<f64>),
}

impl Distribution {
    /// Returns the error in the parameters, if there is one.
    pub fn problem(&self) -> Option<String> {
        let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
        let problem = match self {
            Self::Constant(value) if !finite(&[*value]) => "the value must be finite",
            Self::Normal { mean, deviation } if !finite(&[*mean, *deviation]) => {
                "mean and deviation must be finite"
            }
            Self::Normal { deviation, .. } if *deviation < 0.0 => {
                "the deviation must not be negative"
            }
            Self::LogNormal { mean, deviation }
                if !finite(&[*mean, *deviation]) || *mean <= 0.0 || *deviation < 0.0 =>
            {
                "the mean must be greater than 0 and the deviation not negative"
            }
            Self::Uniform { from, to } if !finite(&[*from, *to]) || from > to => {
                "`from` must not be greater than `to`"
            }
            Self::Triangular { from, mode, to }
                if !finite(&[*from, *mode, *to]) || from > mode || mode > to =>
            {
                "expected from <= mode <= to"
            }
            Self::Exponential { from, mean } if !finite(&[*from, *mean]) || *mean < 0.0 => {
                "the mean of the added delay must not be negative"
            }
            Self::Gamma { from, shape, scale }
                if !finite(&[*from, *shape, *scale]) || *shape <= 0.0 || *scale <= 0.0 =>
            {
                "shape and scale must be greater than 0"
            }
            Self::Empirical(values) if values.is_empty() || !finite(values) => {
                "the list must have at least one value, and only finite values"
            }
            _ => return None,
        };
        Some(problem.to_owned())
    }

    /// Draws a value. The parameters must be valid ([`Distribution::problem`]).
    pub fn draw(&self, rng: &mut impl Rng) -> f64 {
        match self {
            Self::Constant(value) => *value,
            Self::Normal { mean, deviation } => {
                Normal::new(*mean, *deviation).map_or(*mean, |normal| normal.sample(rng))
            }
            Self::LogNormal { mean, deviation } => {
                let variance = (deviation / mean).powi(2).ln_1p();
                let location = mean.ln() - variance / 2.0;
                LogNormal::new(location, variance.sqrt()).map_or(*mean, |it| it.sample(rng))
            }
            Self::Uniform { from, to } => from + (to - from) * rng.random::<f64>(),
            Self::Triangular { from, mode, to } => {
                Triangular::new(*from, *to, *mode).map_or(*mode, |it| it.sample(rng))
            }
            Self::Exponential { from, mean } => {
                let added: f64 = Exp1.sample(rng);
                from + mean * added
            }
            Self::Gamma { from, shape, scale } => {
                Gamma::new(*shape, *scale).map_or(*from, |gamma| from + gamma.sample(rng))
            }
            Self::Empirical(values) => values[rng.random_range(0..values.len())],
        }
    }
}

/// Returns the nearest multiple of `resolution`, or the value itself if it has too many steps for a
/// float to represent each of them.
pub fn rounded(value: f64, resolution: &Rational) -> Rational {
    let steps = (value / resolution.to_f64()).round();
    if steps.abs() > MAX_STEPS
        && let Some(exact) = Rational::from_f64_as_written(value)
    {
        return exact;
    }
    // After this, only NaN is not bounded.
    let bounded = steps.clamp(-MAX_STEPS, MAX_STEPS);
    #[allow(clippy::cast_possible_truncation, reason = "just bounded, and whole")]
    let steps = bounded as i64;
    Rational::from(steps) * resolution
}

/// Beyond this number, floats do not represent all integers (the exact limit is 2⁵³).
const MAX_STEPS: f64 = 9e15;

#[cfg(test)]
mod tests {
    use super::{Distribution, Purpose, keyed, rounded};
    use elbowroom_num::Rational;
    use rand::Rng;

    #[test]
    fn draw_depends_on_each_part_of_its_key() {
        let number = |seed, name: &str, occurrence, purpose| {
            keyed(seed, name, occurrence, purpose).random::<u64>()
        };
        let first = number(1, "(pick a)", 0, Purpose::Duration);
        assert_eq!(first, number(1, "(PICK A)", 0, Purpose::Duration));
        assert_ne!(first, number(2, "(pick a)", 0, Purpose::Duration));
        assert_ne!(first, number(1, "(pick b)", 0, Purpose::Duration));
        assert_ne!(first, number(1, "(pick a)", 1, Purpose::Duration));
        assert_ne!(first, number(1, "(pick a)", 0, Purpose::Delay));
    }

    #[test]
    fn recorded_seeds_give_unchanged_draws() {
        let number = keyed(7, "(drive rover depot shelf)", 0, Purpose::Duration).random::<u32>();
        insta::assert_snapshot!(number);
    }

    #[test]
    fn means_and_spreads_are_as_stated() {
        let cases = [
            (
                Distribution::Normal {
                    mean: 170.0,
                    deviation: 70.0,
                },
                170.0,
                70.0,
            ),
            (
                Distribution::LogNormal {
                    mean: 20.0,
                    deviation: 5.0,
                },
                20.0,
                5.0,
            ),
            (
                Distribution::Uniform { from: 2.0, to: 8.0 },
                5.0,
                3.0_f64.sqrt(),
            ),
            (
                Distribution::Triangular {
                    from: 0.0,
                    mode: 3.0,
                    to: 6.0,
                },
                3.0,
                1.5_f64.sqrt(),
            ),
            (
                Distribution::Exponential {
                    from: 2.0,
                    mean: 3.0,
                },
                5.0,
                3.0,
            ),
            (
                Distribution::Gamma {
                    from: 1.0,
                    shape: 4.0,
                    scale: 0.5,
                },
                3.0,
                1.0,
            ),
            (Distribution::Empirical(vec![1.0, 3.0]), 2.0, 1.0),
            (Distribution::Constant(4.0), 4.0, 0.0),
        ];
        for (distribution, mean, deviation) in cases {
            assert_eq!(distribution.problem(), None);
            let mut rng = keyed(3, "test", 0, Purpose::Duration);
            let values: Vec<f64> = (0..40_000).map(|_| distribution.draw(&mut rng)).collect();
            let count = 40_000.0;
            let found = values.iter().sum::<f64>() / count;
            let spread = values.iter().map(|v| (v - found).powi(2)).sum::<f64>() / count;
            assert!(
                (found - mean).abs() < 0.03 * mean.max(1.0),
                "{distribution:?}: {found}"
            );
            let difference = (spread.sqrt() - deviation).abs();
            assert!(
                difference < 0.03 * deviation.max(1.0),
                "{distribution:?}: {spread}"
            );
        }
    }

    #[test]
    fn values_are_multiples_of_the_resolution() {
        let thousandth = Rational::new(1, 1000);
        assert_eq!(rounded(2.000_49, &thousandth), Rational::from(2));
        assert_eq!(rounded(-1.5, &thousandth), Rational::new(-3, 2));
        assert!(rounded(1e300, &thousandth).is_positive());
        assert!(rounded(f64::INFINITY, &thousandth).is_positive());
        // Regression: with a resolution too fine for a float, twelve seconds became nine.
        let fine = Rational::new(1, 1_000_000_000_000_000);
        assert_eq!(rounded(12.0, &fine), Rational::from(12));
        assert_eq!(rounded(-12.5, &fine), Rational::new(-25, 2));
    }
}
