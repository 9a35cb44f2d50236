//! Distributions in certificates, and where bounds on probabilities touch.

use elbowroom_num::{Rational, chance};
use serde::{Deserialize, Serialize};

use crate::number::Exact;

/// How a parameter is distributed: a density, cut at both sides, or a list of values.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Chance {
    /// The density, before it is cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub density: Option<Shape>,
    /// Lesser values become this.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub minimum: Option<Exact>,
    /// Greater values become this.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub maximum: Option<Exact>,
    /// What values are rounded to multiples of; an interval counts as half of it longer at both ends.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resolution: Option<Exact>,
    /// Without a density: the values, all alike.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub values: Vec<Exact>,
}

/// A density.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Shape {
    /// All values between two numbers alike.
    Uniform {
        /// The least value.
        from: Exact,
        /// The greatest value.
        to: Exact,
    },
    /// Rises to the mode and falls after it.
    Triangular {
        /// The least value.
        from: Exact,
        /// The likeliest value.
        mode: Exact,
        /// The greatest value.
        to: Exact,
    },
    /// Bell-shaped.
    Normal {
        /// The mean.
        mean: Exact,
        /// The standard deviation.
        deviation: Exact,
    },
    /// `from`, and what an exponential distribution adds.
    Exponential {
        /// The least value.
        from: Exact,
        /// The mean of what is added.
        mean: Exact,
    },
    /// The logarithm is normal.
    Lognormal {
        /// The mean of the logarithm.
        location: Exact,
        /// The standard deviation of the logarithm.
        spread: Exact,
    },
}

/// Where a linear bound on the logarithm of a probability touches, or nearly so.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Touch {
    /// At the interval whose ends are so far below and above the nominal value.
    At([Exact; 2]),
    /// For a list of values: where the probability is this.
    Mass(Exact),
    /// Nowhere: no probability is more than 1.
    Nowhere,
}

impl Chance {
    /// The same with numbers that can be reckoned with; `None` if it makes no sense.
    pub(crate) fn reckoned(&self) -> Option<chance::Chance> {
        let Some(shape) = &self.density else {
            let values = self.values.iter().map(|own| own.0.clone());
            let alone =
                self.minimum.is_none() && self.maximum.is_none() && self.resolution.is_none();
            return chance::Chance::values(values.collect()).filter(|_| alone);
        };
        let number = |own: &Exact| own.0.clone();
        let density = match shape {
            Shape::Uniform { from, to } => chance::Density::Uniform {
                from: number(from),
                to: number(to),
            },
            Shape::Triangular { from, mode, to } => chance::Density::Triangular {
                from: number(from),
                mode: number(mode),
                to: number(to),
            },
            Shape::Normal { mean, deviation } => chance::Density::Normal {
                mean: number(mean),
                deviation: number(deviation),
            },
            Shape::Exponential { from, mean } => chance::Density::Exponential {
                from: number(from),
                mean: number(mean),
            },
            Shape::Lognormal { location, spread } => chance::Density::Lognormal {
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
        chance::Chance::dense(density, minimum, maximum, &resolution.0)
    }
}

impl From<&chance::Chance> for Chance {
    fn from(own: &chance::Chance) -> Self {
        let exact = |number: &Rational| Exact(number.clone());
        match own {
            chance::Chance::Values(values) => Self {
                values: values.iter().map(exact).collect(),
                ..Self::default()
            },
            chance::Chance::Dense(dense) => Self {
                density: Some(match &dense.density {
                    chance::Density::Uniform { from, to } => Shape::Uniform {
                        from: exact(from),
                        to: exact(to),
                    },
                    chance::Density::Triangular { from, mode, to } => Shape::Triangular {
                        from: exact(from),
                        mode: exact(mode),
                        to: exact(to),
                    },
                    chance::Density::Normal { mean, deviation } => Shape::Normal {
                        mean: exact(mean),
                        deviation: exact(deviation),
                    },
                    chance::Density::Exponential { from, mean } => Shape::Exponential {
                        from: exact(from),
                        mean: exact(mean),
                    },
                    chance::Density::Lognormal { location, spread } => Shape::Lognormal {
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

impl From<&chance::Touch> for Touch {
    fn from(own: &chance::Touch) -> Self {
        match own {
            chance::Touch::At([below, above]) => {
                Self::At([Exact(below.clone()), Exact(above.clone())])
            }
            chance::Touch::Mass(mass) => Self::Mass(Exact(mass.clone())),
            chance::Touch::Nowhere => Self::Nowhere,
        }
    }
}
