//! Distributions of the durations of a plan in a world, for the box with the greatest probability.

use elbowroom_num::Rational;
use elbowroom_num::log_concave::{Density, LogConcaveDistribution};
use elbowroom_plan::{ParameterKind, ParametrizedPlan};
use elbowroom_sim::{Distribution, Rule, WorldModel};

/// Reasons why the probability that durations stay inside a box is unknown.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DistributionError {
    /// There is no world file.
    #[error(
        "the objective `probability` needs a world file with distributions of durations; give \
         one, or choose another objective"
    )]
    NoWorld,
    /// A parameter is not a duration.
    #[error(
        "the objective `probability` supports durations only, not {0}; do not vary it, or choose \
         another objective"
    )]
    NoDuration(String),
    /// No best box can be proved for the distribution of this duration.
    #[error(
        "the objective `probability` does not support gamma distributions, which the world has \
         for the duration of {0}; use a normal or lognormal one, measured `values`, or another \
         objective"
    )]
    Gamma(String),
    /// A parameter of a distribution is not a finite number.
    #[error("the world file has a number for the duration of {0} that is not finite")]
    NoNumber(String),
}

/// Returns the distribution of each parameter of a plan in a world; `None` for a parameter that is
/// always as planned.
///
/// Durations are rounded and truncated as in a simulation. Other random effects of the world
/// (delays, failures, events) are ignored.
///
/// # Errors
/// When a parameter is not a duration, or no best box can be proved for its distribution.
pub fn duration_distributions(
    plan: &ParametrizedPlan,
    world: &WorldModel,
) -> Result<Vec<Option<LogConcaveDistribution>>, DistributionError> {
    let chances = plan.parameters.iter().map(|parameter| {
        let ParameterKind::Duration(instance) = parameter.kind else {
            return Err(DistributionError::NoDuration(parameter.name.clone()));
        };
        let action = &plan.plan.instance(instance).action.name;
        duration_distribution(action, &parameter.nominal, world)
    });
    chances.collect()
}

/// Returns the distribution of the duration of an action in a world; `None` if it is always the
/// planned one.
///
/// # Errors
/// When no best box can be proved for the distribution.
pub fn duration_distribution(
    action: &str,
    planned: &Rational,
    world: &WorldModel,
) -> Result<Option<LogConcaveDistribution>, DistributionError> {
    let Some(rule) = world.duration_rule(action) else {
        return Ok(None);
    };
    if matches!(rule.distribution, Distribution::Gamma { .. }) {
        return Err(DistributionError::Gamma(action.to_owned()));
    }
    let chance = distribution_of_rule(rule, planned, &world.resolution);
    chance
        .ok_or_else(|| DistributionError::NoNumber(action.to_owned()))
        .map(Some)
}

/// Returns the distribution of a duration by a rule; `None` if a parameter of the rule is not
/// finite.
fn distribution_of_rule(
    rule: &Rule,
    planned: &Rational,
    resolution: &Rational,
) -> Option<LogConcaveDistribution> {
    let exact = Rational::from_f64_as_written;
    let scale = if rule.is_relative {
        planned.clone()
    } else {
        Rational::ONE
    };
    // The duration is positive if the planned one is.
    let floor = planned.min(resolution).clone();
    let cut = |value: Option<f64>| value.map_or(Some(None), |own| Some(Some(exact(own)? * &scale)));
    let (minimum, maximum) = (cut(rule.minimum)?, cut(rule.maximum)?);
    let always = |value: f64| -> Option<Rational> {
        let mut value = exact(value)? * &scale;
        if let Some(minimum) = &minimum {
            value = value.max(minimum.clone());
        }
        if let Some(maximum) = &maximum {
            value = value.min(maximum.clone());
        }
        let steps = value.checked_div(resolution)? + Rational::new(1, 2);
        Some((steps.floor() * resolution).max(floor.clone()))
    };
    let constant = |value: f64| LogConcaveDistribution::values(vec![always(value)?]);
    let scaled = |value: f64| Some(exact(value)? * &scale);
    if !scale.is_positive() {
        return constant(0.0);
    }
    let density = match &rule.distribution {
        Distribution::Constant(value) => return constant(*value),
        Distribution::Empirical(values) => {
            let values: Option<Vec<Rational>> = values.iter().map(|own| always(*own)).collect();
            return LogConcaveDistribution::values(values?);
        }
        Distribution::Normal { mean, deviation } | Distribution::LogNormal { mean, deviation }
            if *deviation <= 0.0 =>
        {
            return constant(*mean);
        }
        Distribution::Uniform { from, to } | Distribution::Triangular { from, to, .. }
            if from >= to =>
        {
            return constant(*from);
        }
        Distribution::Exponential { from, mean } if *mean <= 0.0 => return constant(*from),
        Distribution::Normal { mean, deviation } => Density::Normal {
            mean: scaled(*mean)?,
            deviation: scaled(*deviation)?,
        },
        Distribution::LogNormal { mean, deviation } => {
            let variance = (deviation / mean).powi(2).ln_1p();
            let location = (mean * scale.to_f64()).ln() - variance / 2.0;
            Density::Lognormal {
                location: exact(location)?,
                spread: exact(variance.sqrt())?,
            }
        }
        Distribution::Uniform { from, to } => Density::Uniform {
            from: scaled(*from)?,
            to: scaled(*to)?,
        },
        Distribution::Triangular { from, mode, to } => Density::Triangular {
            from: scaled(*from)?,
            mode: scaled(*mode)?,
            to: scaled(*to)?,
        },
        Distribution::Exponential { from, mean } => Density::Exponential {
            from: scaled(*from)?,
            mean: scaled(*mean)?,
        },
        Distribution::Gamma { .. } => return None,
    };
    if maximum.as_ref().is_some_and(|maximum| *maximum <= floor) {
        return LogConcaveDistribution::values(vec![floor]);
    }
    let minimum = minimum.map_or(floor.clone(), |minimum| minimum.max(floor));
    LogConcaveDistribution::dense(density, Some(minimum), maximum, resolution)
}
