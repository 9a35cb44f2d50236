//! Expected durations of actions in a world, for plans.

use elbowroom_model::problem::{ExpectedDuration, ExpectedDurations};
use elbowroom_num::Rational;

use super::{Rule, WorldModel};
use crate::draw::{Distribution, Purpose, keyed};

/// Number of samples for the mean of a distribution with a minimum or a maximum.
const SAMPLES: u32 = 1000;

/// Seed of these samples, far from seeds that users choose.
const SEED: u64 = 0x6d65_616e_0000_0000;

impl WorldModel {
    /// Returns the mean durations of actions, in the form for plans, with three significant digits. Delays before the
    /// starts are not included. A mean in seconds that is not above `epsilon`, the separation of happenings, is too
    /// short for plans, which then have the duration of the domain.
    pub fn expected_durations(&self, epsilon: &Rational) -> ExpectedDurations {
        let rules = self.durations.iter().map(|(actions, rule)| {
            let (factor, seconds) = match (rule.expected(), rule.is_relative) {
                (Some(mean), true) => (mean, Rational::ZERO),
                (Some(mean), false) if mean > *epsilon => (Rational::ZERO, mean),
                _ => (Rational::ONE, Rational::ZERO),
            };
            ExpectedDuration {
                actions: actions.clone(),
                factor,
                seconds,
            }
        });
        ExpectedDurations {
            rules: rules.collect(),
            ..ExpectedDurations::default()
        }
    }

    /// Returns the same world for plans with [its expected durations](Self::expected_durations) as planned durations:
    /// multiples of planned durations are divided by their mean.
    #[must_use]
    pub fn around_expected_durations(&self) -> Self {
        let mut world = self.clone();
        for (_, rule) in &mut world.durations {
            if let Some(mean) = rule.expected().filter(|_| rule.is_relative) {
                rule.divide_by(mean.to_f64());
            }
        }
        world
    }
}

impl Rule {
    /// Returns the mean, with three significant digits; `None` if it is not positive.
    fn expected(&self) -> Option<Rational> {
        let mean = if self.minimum.is_none() && self.maximum.is_none() {
            self.distribution.mean()
        } else {
            let unit = Self {
                is_relative: false,
                ..self.clone()
            };
            let resolution = Rational::new(1, 1_000_000);
            let mut rng = keyed(SEED, "", 0, Purpose::Duration);
            let draws =
                (0..SAMPLES).map(|_| unit.draw(&Rational::ONE, &resolution, &mut rng).to_f64());
            draws.sum::<f64>() / f64::from(SAMPLES)
        };
        let rounded: f64 = format!("{mean:.2e}").parse().ok()?;
        Rational::from_f64_as_written(rounded).filter(Rational::is_positive)
    }

    fn divide_by(&mut self, divisor: f64) {
        self.distribution.divide_by(divisor);
        for limit in [&mut self.minimum, &mut self.maximum].into_iter().flatten() {
            *limit /= divisor;
        }
    }
}

impl Distribution {
    /// Returns the mean.
    fn mean(&self) -> f64 {
        match self {
            Self::Constant(value) => *value,
            Self::Normal { mean, .. } | Self::LogNormal { mean, .. } => *mean,
            Self::Uniform { from, to } => f64::midpoint(*from, *to),
            Self::Triangular { from, mode, to } => (from + mode + to) / 3.0,
            Self::Exponential { from, mean } => from + mean,
            Self::Gamma { from, shape, scale } => from + shape * scale,
            #[expect(clippy::cast_precision_loss, reason = "the length of a list")]
            Self::Empirical(values) => values.iter().sum::<f64>() / values.len() as f64,
        }
    }

    /// Divides the quantity by a positive number.
    fn divide_by(&mut self, divisor: f64) {
        let parameters: Vec<&mut f64> = match self {
            Self::Constant(value) => vec![value],
            Self::Normal { mean, deviation } | Self::LogNormal { mean, deviation } => {
                vec![mean, deviation]
            }
            Self::Uniform { from, to } => vec![from, to],
            Self::Triangular { from, mode, to } => vec![from, mode, to],
            Self::Exponential { from, mean } => vec![from, mean],
            Self::Gamma { from, scale, .. } => vec![from, scale],
            Self::Empirical(values) => values.iter_mut().collect(),
        };
        for parameter in parameters {
            *parameter /= divisor;
        }
    }
}

#[cfg(test)]
mod tests {
    use elbowroom_model::pattern::ActionPattern;
    use elbowroom_num::Rational;

    use super::Rule;
    use crate::draw::{Distribution, Purpose, keyed};
    use crate::model::WorldModel;

    /// For each distribution, with and without limits: the mean of the same draws, and the same durations if they are
    /// drawn as multiples of the expected duration.
    #[test]
    fn expected_duration_is_the_mean_and_keeps_the_distribution() {
        let distributions = [
            Distribution::Constant(2.6),
            Distribution::Normal {
                mean: 2.6,
                deviation: 0.4,
            },
            Distribution::LogNormal {
                mean: 1.3,
                deviation: 0.4,
            },
            Distribution::Uniform { from: 0.5, to: 2.0 },
            Distribution::Triangular {
                from: 0.5,
                mode: 1.0,
                to: 3.0,
            },
            Distribution::Exponential {
                from: 0.5,
                mean: 1.0,
            },
            Distribution::Gamma {
                from: 0.5,
                shape: 2.0,
                scale: 0.5,
            },
            Distribution::Empirical(vec![1.0, 1.5, 4.0]),
        ];
        let planned = Rational::from(10);
        for distribution in distributions {
            for maximum in [None, Some(1.75)] {
                let rule = Rule {
                    distribution: distribution.clone(),
                    minimum: None,
                    maximum,
                    is_relative: true,
                };
                let mut world = WorldModel::without_deviations();
                let all = ActionPattern::new(None, None);
                world.durations.push((all, rule));
                let rule = &world.expected_durations(&Rational::ZERO).rules[0];
                let expected = &planned * &rule.factor + &rule.seconds;
                let around = world.around_expected_durations();
                let (mut sum, count) = (0.0, 4000);
                for seed in 0..count {
                    let rng = || keyed(seed, "go", 0, Purpose::Duration);
                    let (drawn, again) = (
                        world.duration("(go)", &planned, &mut rng()),
                        around.duration("(go)", &expected, &mut rng()),
                    );
                    assert!(
                        (&drawn - &again).abs() <= Rational::new(1, 500),
                        "{drawn} {again}"
                    );
                    sum += drawn.to_f64();
                }
                let (mean, expected) = (sum / 4000.0, expected.to_f64());
                assert!(
                    (mean / expected - 1.0).abs() < 0.05,
                    "{distribution:?} {maximum:?}: {mean} {expected}"
                );
            }
        }
    }

    #[test]
    fn too_short_means_leave_the_durations_of_the_domain() {
        let epsilon = Rational::new(1, 1000);
        let cases = [("0", true), ("0.001", true), ("0.002", false)];
        for (mean, is_domain) in cases {
            let rule = Rule {
                distribution: Distribution::Constant(mean.parse().expect("a number")),
                minimum: None,
                maximum: None,
                is_relative: false,
            };
            let mut world = WorldModel::without_deviations();
            world.durations.push((ActionPattern::new(None, None), rule));
            let rule = &world.expected_durations(&epsilon).rules[0];
            assert_eq!(rule.factor == Rational::ONE, is_domain, "{mean}");
            assert_eq!(rule.seconds.is_zero(), is_domain, "{mean}");
        }
    }
}
