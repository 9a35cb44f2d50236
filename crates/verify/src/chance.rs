//! Distributions in certificates, and points of contact of bounds on probabilities.

use elbowroom_num::{Rational, log_concave};
use serde::{Deserialize, Serialize};

use crate::number::Exact;

/// Distribution of a parameter: a density that is cut on both sides, or a list of values.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Chance {
    /// Density before it is cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub density: Option<Shape>,
    /// Minimum: lesser values become this one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub minimum: Option<Exact>,
    /// Maximum: greater values become this one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub maximum: Option<Exact>,
    /// Values are rounded to multiples of this resolution. An interval is extended by half of it at
    /// both ends.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resolution: Option<Exact>,
    /// Equally likely values, if there is no density.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub values: Vec<Exact>,
}

/// A density.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Shape {
    /// Constant density between two values.
    Uniform {
        /// The least value.
        from: Exact,
        /// The greatest value.
        to: Exact,
    },
    /// Density that increases up to the mode and decreases after it.
    Triangular {
        /// The least value.
        from: Exact,
        /// The mode.
        mode: Exact,
        /// The greatest value.
        to: Exact,
    },
    /// Normal distribution.
    Normal {
        /// The mean.
        mean: Exact,
        /// The standard deviation.
        deviation: Exact,
    },
    /// Exponential distribution, shifted by `from`.
    Exponential {
        /// The least value.
        from: Exact,
        /// Mean before the shift.
        mean: Exact,
    },
    /// Lognormal distribution.
    Lognormal {
        /// The mean of the logarithm.
        location: Exact,
        /// The standard deviation of the logarithm.
        spread: Exact,
    },
}

/// Point of contact of a linear bound on the logarithm of a probability, exact or approximate.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Touch {
    /// The interval with these deviations of its ends below and above the nominal value.
    At([Exact; 2]),
    /// For a list of values: the probability at the point of contact.
    Mass(Exact),
    /// No point of contact: the bound is that no probability exceeds 1.
    Nowhere,
}

impl Chance {
    /// Converts the distribution to a form for exact computation. Returns `None` if it is invalid.
    pub(crate) fn to_exact(&self) -> Option<log_concave::LogConcaveDistribution> {
        let Some(shape) = &self.density else {
            let values = self.values.iter().map(|own| own.0.clone());
            let alone =
                self.minimum.is_none() && self.maximum.is_none() && self.resolution.is_none();
            return log_concave::LogConcaveDistribution::values(values.collect()).filter(|_| alone);
        };
        let number = |own: &Exact| own.0.clone();
        let density = match shape {
            Shape::Uniform { from, to } => log_concave::Density::Uniform {
                from: number(from),
                to: number(to),
            },
            Shape::Triangular { from, mode, to } => log_concave::Density::Triangular {
                from: number(from),
                mode: number(mode),
                to: number(to),
            },
            Shape::Normal { mean, deviation } => log_concave::Density::Normal {
                mean: number(mean),
                deviation: number(deviation),
            },
            Shape::Exponential { from, mean } => log_concave::Density::Exponential {
                from: number(from),
                mean: number(mean),
            },
            Shape::Lognormal { location, spread } => log_concave::Density::Lognormal {
                location: number(location),
                spread: number(spread),
            },
        };
        let resolution = self.resolution.as_ref().filter(|own| own.0.is_positive())?;
        if !self.values.is_empty() {
            return None;
        }
        let cuts = [&self.minimum, &self.maximum].map(|cut| cut.as_ref().map(number));
        let [minimum, maximum] = cuts;
        log_concave::LogConcaveDistribution::dense(density, minimum, maximum, &resolution.0)
    }
}

impl From<&log_concave::LogConcaveDistribution> for Chance {
    fn from(own: &log_concave::LogConcaveDistribution) -> Self {
        let exact = |number: &Rational| Exact(number.clone());
        match own {
            log_concave::LogConcaveDistribution::Values(values) => Self {
                values: values.iter().map(exact).collect(),
                ..Self::default()
            },
            log_concave::LogConcaveDistribution::Dense(dense) => Self {
                density: Some(match &dense.density {
                    log_concave::Density::Uniform { from, to } => Shape::Uniform {
                        from: exact(from),
                        to: exact(to),
                    },
                    log_concave::Density::Triangular { from, mode, to } => Shape::Triangular {
                        from: exact(from),
                        mode: exact(mode),
                        to: exact(to),
                    },
                    log_concave::Density::Normal { mean, deviation } => Shape::Normal {
                        mean: exact(mean),
                        deviation: exact(deviation),
                    },
                    log_concave::Density::Exponential { from, mean } => Shape::Exponential {
                        from: exact(from),
                        mean: exact(mean),
                    },
                    log_concave::Density::Lognormal { location, spread } => Shape::Lognormal {
                        location: exact(location),
                        spread: exact(spread),
                    },
                }),
                minimum: dense.minimum.as_ref().map(exact),
                maximum: dense.maximum.as_ref().map(exact),
                resolution: Some(Exact(&dense.margin * &Rational::from(2))),
                values: Vec::new(),
            },
        }
    }
}

impl From<&log_concave::TangentPoint> for Touch {
    fn from(own: &log_concave::TangentPoint) -> Self {
        match own {
            log_concave::TangentPoint::At([below, above]) => {
                Self::At([Exact(below.clone()), Exact(above.clone())])
            }
            log_concave::TangentPoint::Mass(mass) => Self::Mass(Exact(mass.clone())),
            log_concave::TangentPoint::NoContact => Self::Nowhere,
        }
    }
}
