//! Random durations of contingent links, drawn from a seed.

use elbowroom_network::{Correlation, Duration, NetworkFile};
use elbowroom_num::Rational;
use elbowroom_sim::draw::{Distribution, Purpose, keyed, rounded};
use elbowroom_stn::uncertain::LinkId;
use rand_chacha::ChaCha8Rng;

use super::simulate::{Durations, SimulationError};

/// Minimum number of decimal units in the width of a distribution. Drawn values are multiples of the
/// unit.
const STEPS: i64 = 1000;

/// Source of random durations for runs.
pub(super) struct Draws<'a> {
    file: &'a NetworkFile,
    seed: u64,
    /// The sources by link.
    sources: Vec<Source>,
    groups: Vec<Group>,
}

/// The source of a link's random durations.
struct Source {
    distribution: Distribution,
    resolution: Rational,
    /// Bounds on drawn values.
    least: Rational,
    most: Option<Rational>,
}

/// Correlated normal durations: each is its mean plus a linear combination of independent draws.
struct Group {
    links: Vec<LinkId>,
    /// The Cholesky factor: lower triangular, by rows.
    factors: Vec<Vec<f64>>,
}

impl<'a> Draws<'a> {
    pub(super) fn new(
        file: &'a NetworkFile,
        seed: u64,
        durations: Durations,
    ) -> Result<Self, SimulationError> {
        let sources = file
            .network
            .link_ids()
            .map(|id| Source::of(file, id, durations));
        let groups = match durations {
            Durations::Given => file.correlations.iter().map(Group::of).collect(),
            Durations::Uniform => Vec::new(),
        };
        Ok(Self {
            file,
            seed,
            sources: sources.collect::<Result<_, _>>()?,
            groups,
        })
    }

    /// Returns the durations in one run, by link.
    pub(super) fn run(&self, run: u64) -> Vec<Rational> {
        let mut drawn: Vec<Rational> = self
            .file
            .network
            .link_ids()
            .zip(&self.sources)
            .map(|(id, source)| {
                let value = source.distribution.draw(&mut self.random(id, run));
                source.round_to_resolution(value)
            })
            .collect();
        for group in &self.groups {
            let bell = Distribution::Normal {
                mean: 0.0,
                deviation: 1.0,
            };
            let independent: Vec<f64> = group
                .links
                .iter()
                .map(|&id| bell.draw(&mut self.random(id, run)))
                .collect();
            for (&id, factors) in group.links.iter().zip(&group.factors) {
                let source = &self.sources[id.index()];
                let Distribution::Normal { mean, deviation } = source.distribution else {
                    continue;
                };
                let sum: f64 = factors.iter().zip(&independent).map(|(a, b)| a * b).sum();
                drawn[id.index()] = source.round_to_resolution(mean + deviation * sum);
            }
        }
        drawn
    }

    /// Returns a generator that depends only on the seed, the link's end and the run.
    fn random(&self, id: LinkId, run: u64) -> ChaCha8Rng {
        let end = self.file.point(self.file.network.link(id).end);
        keyed(self.seed, end, run, Purpose::Duration)
    }
}

impl Source {
    fn of(file: &NetworkFile, id: LinkId, durations: Durations) -> Result<Self, SimulationError> {
        let link = file.network.link(id);
        let given = match durations {
            Durations::Given => file.durations[id.index()].as_ref(),
            Durations::Uniform => None,
        };
        let Some(given) = given else {
            let Some(upper) = &link.upper else {
                return Err(SimulationError {
                    activation: file.point(link.activation).to_owned(),
                    end: file.point(link.end).to_owned(),
                    is_given: file.durations[id.index()].is_some(),
                });
            };
            return Ok(Self {
                distribution: Distribution::Uniform {
                    from: link.lower.to_f64(),
                    to: upper.to_f64(),
                },
                resolution: decimal_unit(&(upper - &link.lower)),
                least: link.lower.clone(),
                most: Some(upper.clone()),
            });
        };
        let (distribution, width) = match given {
            Duration::Normal { mean, deviation } => (
                Distribution::Normal {
                    mean: mean.to_f64(),
                    deviation: deviation.to_f64(),
                },
                deviation.clone(),
            ),
            Duration::Uniform { from, to } => (
                Distribution::Uniform {
                    from: from.to_f64(),
                    to: to.to_f64(),
                },
                to - from,
            ),
            Duration::Exponential { from, mean } => (
                Distribution::Exponential {
                    from: from.to_f64(),
                    mean: mean.to_f64(),
                },
                mean.clone(),
            ),
            Duration::Gamma { from, shape, scale } => (
                Distribution::Gamma {
                    from: from.to_f64(),
                    shape: shape.to_f64(),
                    scale: scale.to_f64(),
                },
                scale.clone(),
            ),
        };
        Ok(Self {
            distribution,
            resolution: decimal_unit(&width),
            // Durations are not negative.
            least: Rational::ZERO,
            most: None,
        })
    }

    fn round_to_resolution(&self, value: f64) -> Rational {
        let value = rounded(value, &self.resolution).max(self.least.clone());
        match &self.most {
            Some(most) => value.min(most.clone()),
            None => value,
        }
    }
}

/// Returns a decimal unit small enough that the width has at least [`STEPS`] units.
fn decimal_unit(width: &Rational) -> Rational {
    let ten = Rational::from(10);
    let mut unit = Rational::ONE;
    while width.is_positive() && &unit * Rational::from(STEPS) > *width {
        unit = unit / &ten;
    }
    unit
}

impl Group {
    /// Computes the Cholesky decomposition. If the matrix is not positive semidefinite, negative
    /// diagonal entries count as 0, and correlations with them are dropped.
    #[allow(
        clippy::needless_range_loop,
        reason = "rows and columns of two matrices at once"
    )]
    fn of(correlation: &Correlation) -> Self {
        let size = correlation.links.len();
        let mut factors = vec![vec![0.0; size]; size];
        for row in 0..size {
            for column in 0..=row {
                let known: f64 = (0..column)
                    .map(|at| factors[row][at] * factors[column][at])
                    .sum();
                let rest = correlation.matrix[row][column].to_f64() - known;
                factors[row][column] = if row == column {
                    f64::max(rest, 0.0).sqrt()
                } else if factors[column][column] > 0.0 {
                    rest / factors[column][column]
                } else {
                    0.0
                };
            }
        }
        Self {
            links: correlation.links.clone(),
            factors,
        }
    }
}
