//! Maximum likelihood fits of distributions to right-censored samples, and the choice of a family.

use elbowroom_sim::Distribution;

use crate::survival::{Sample, SurvivalFunction, float};

/// A distribution with its goodness of fit.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// The distribution.
    pub distribution: Distribution,
    /// Its mean.
    pub mean: f64,
    /// The standard error of the mean; `None` if the family provides none.
    pub standard_error: Option<f64>,
    /// The logarithm of the probability of the samples, for intervals of the width of the
    /// resolution.
    pub log_likelihood: f64,
    /// Akaike's criterion, corrected for small samples (Hurvich & Tsai 1989); lower is better.
    pub aicc: f64,
    /// `true` if the distance to the product-limit estimate is significant at the 1 % level
    /// (Lilliefors's limit for large samples, 1.035 / √n).
    pub is_doubtful: bool,
}

/// Lilliefors's limit at the 1 % level for large samples, times √n. It was derived for normal
/// distributions with fitted parameters, and is used for the other families as well.
const LILLIEFORS: f64 = 1.035;

/// Minimum number of observed values for the test of a family.
const FEWEST_TO_REJECT: usize = 20;

/// Returns the family with the best corrected Akaike criterion: constant, normal, lognormal or
/// uniform. If that family is doubtful and no sample was censored above the observed values,
/// returns the empirical distribution.
///
/// Probabilities are those of the interval of width `resolution` around a value, so that equal
/// values have probability 1 in a constant distribution. Returns `None` if all samples are
/// censored.
pub fn best(samples: &[Sample], resolution: f64) -> Option<Fit> {
    let fits = [
        constant(samples, resolution),
        normal(samples, resolution),
        lognormal(samples, resolution),
        uniform(samples, resolution),
    ];
    let mut best: Option<Fit> = None;
    for fit in fits.into_iter().flatten() {
        if best.as_ref().is_none_or(|best| fit.aicc < best.aicc) {
            best = Some(fit);
        }
    }
    let best = best?;
    if best.is_doubtful
        && let Some(values) = empirical(samples)
    {
        return Some(values);
    }
    Some(best)
}

fn observed(samples: &[Sample]) -> impl Iterator<Item = f64> + Clone + '_ {
    let observed = samples.iter().filter(|sample| !sample.is_censored);
    observed.map(|sample| sample.value)
}

fn censored_values(samples: &[Sample]) -> impl Iterator<Item = f64> + Clone + '_ {
    let censored = samples.iter().filter(|sample| sample.is_censored);
    censored.map(|sample| sample.value)
}

/// Returns the log-likelihood of a distribution with this density and survival function.
fn log_likelihood(
    samples: &[Sample],
    resolution: f64,
    density: impl Fn(f64) -> f64,
    survival: impl Fn(f64) -> f64,
) -> f64 {
    let within = observed(samples).map(|value| (density(value) * resolution).min(1.0).ln());
    let beyond = censored_values(samples).map(|value| survival(value).ln());
    within.chain(beyond).sum()
}

fn aicc(log_likelihood: f64, parameters: usize, samples: usize) -> f64 {
    let (k, n) = (float(parameters), float(samples));
    let correction = if n > k + 1.0 {
        2.0 * k * (k + 1.0) / (n - k - 1.0)
    } else {
        f64::INFINITY
    };
    2.0 * k - 2.0 * log_likelihood + correction
}

fn fit(
    samples: &[Sample],
    distribution: Distribution,
    (mean, standard_error): (f64, Option<f64>),
    parameters: usize,
    log_likelihood: f64,
    survival: impl Fn(f64) -> f64,
) -> Fit {
    let count = observed(samples).count();
    let distance = distance(samples, survival);
    Fit {
        distribution,
        mean,
        standard_error,
        log_likelihood,
        aicc: aicc(log_likelihood, parameters, samples.len()),
        is_doubtful: count >= FEWEST_TO_REJECT && distance * float(count).sqrt() > LILLIEFORS,
    }
}

/// Returns the largest distance between a survival function and the product-limit estimate.
fn distance(samples: &[Sample], survival: impl Fn(f64) -> f64) -> f64 {
    let estimate = SurvivalFunction::of(samples);
    let mut before = 1.0;
    let mut most: f64 = 0.0;
    for (value, after) in estimate.steps() {
        let own = survival(*value);
        most = most.max((own - before).abs()).max((own - after).abs());
        before = *after;
    }
    most
}

/// Fits a constant: all observed values must be equal, and no censored one greater.
fn constant(samples: &[Sample], resolution: f64) -> Option<Fit> {
    let value = observed(samples).next()?;
    let is_same = observed(samples).all(|other| (other - value).abs() <= resolution / 2.0);
    let is_passed = censored_values(samples).any(|other| other > value + resolution / 2.0);
    if !is_same || is_passed {
        return None;
    }
    Some(Fit {
        distribution: Distribution::Constant(value),
        mean: value,
        standard_error: None,
        log_likelihood: 0.0,
        // One parameter. With at most two samples, no family is better.
        aicc: if samples.len() > 2 {
            aicc(0.0, 1, samples.len())
        } else {
            2.0
        },
        is_doubtful: false,
    })
}

fn normal(samples: &[Sample], resolution: f64) -> Option<Fit> {
    let (mean, deviation, error) = location_and_scale(samples)?;
    let survival = |value: f64| upper_tail((value - mean) / deviation);
    let density = |value: f64| standard_density((value - mean) / deviation) / deviation;
    let likelihood = log_likelihood(samples, resolution, density, survival);
    let distribution = Distribution::Normal { mean, deviation };
    Some(fit(
        samples,
        distribution,
        (mean, Some(error)),
        2,
        likelihood,
        survival,
    ))
}

fn lognormal(samples: &[Sample], resolution: f64) -> Option<Fit> {
    if observed(samples).any(|value| value <= 0.0) {
        return None;
    }
    // A sample censored at 0 or below contains no information.
    let logarithms: Vec<Sample> = samples
        .iter()
        .filter(|sample| sample.value > 0.0)
        .map(|sample| Sample {
            value: sample.value.ln(),
            ..*sample
        })
        .collect();
    let (location, scale, error) = location_and_scale(&logarithms)?;
    let survival = |value: f64| {
        if value <= 0.0 {
            1.0
        } else {
            upper_tail((value.ln() - location) / scale)
        }
    };
    let density = |value: f64| standard_density((value.ln() - location) / scale) / (scale * value);
    let likelihood = log_likelihood(samples, resolution, density, survival);
    let mean = (location + scale * scale / 2.0).exp();
    let deviation = mean * (scale * scale).exp_m1().sqrt();
    if !mean.is_finite() || !deviation.is_finite() {
        return None;
    }
    let distribution = Distribution::LogNormal { mean, deviation };
    // By the delta method, with the scale treated as known.
    let error = Some(mean * error);
    Some(fit(
        samples,
        distribution,
        (mean, error),
        2,
        likelihood,
        survival,
    ))
}

/// Fits a uniform distribution between the least and the greatest observed value. Censored values
/// must lie below the greatest.
fn uniform(samples: &[Sample], resolution: f64) -> Option<Fit> {
    let from = observed(samples).reduce(f64::min)?;
    let to = observed(samples).reduce(f64::max)?;
    if to - from <= resolution || censored_values(samples).any(|value| value >= to) {
        return None;
    }
    let survival = |value: f64| ((to - value) / (to - from)).clamp(0.0, 1.0);
    let density = |_: f64| 1.0 / (to - from);
    let likelihood = log_likelihood(samples, resolution, density, survival);
    let distribution = Distribution::Uniform { from, to };
    let mean = f64::midpoint(from, to);
    Some(fit(
        samples,
        distribution,
        (mean, None),
        2,
        likelihood,
        survival,
    ))
}

/// Returns the empirical distribution, weighted by the product-limit estimate: a value after
/// censored ones has a greater weight. Returns `None` if a sample was censored above the greatest
/// value.
fn empirical(samples: &[Sample]) -> Option<Fit> {
    /// Maximum number of copies of a value, as a multiple of the number of samples.
    const MAX_COPIES: f64 = 8.0;
    let survival = SurvivalFunction::of(samples);
    let last = survival.steps().last()?;
    if last.1 > 1e-9 {
        return None;
    }
    let mut before = 1.0;
    let mut masses = Vec::new();
    for (value, after) in survival.steps() {
        masses.push((*value, before - after));
        before = *after;
    }
    let count = float(samples.len());
    let mut values = Vec::new();
    let mut likelihood = 0.0;
    let mut sum = 0.0;
    for (value, mass) in &masses {
        let copies = (mass * count).round().clamp(1.0, MAX_COPIES * count);
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a whole number of at least 1"
        )]
        values.extend(std::iter::repeat_n(*value, copies as usize));
        let here = observed(samples).filter(|own| own.total_cmp(value).is_eq());
        likelihood += float(here.count()) * mass.ln();
        sum += value * mass;
    }
    for value in censored_values(samples) {
        likelihood += survival.at(value).max(f64::MIN_POSITIVE).ln();
    }
    Some(Fit {
        distribution: Distribution::Empirical(values),
        mean: sum,
        standard_error: None,
        log_likelihood: likelihood,
        aicc: aicc(
            likelihood,
            masses.len().min(samples.len() - 1),
            samples.len(),
        ),
        is_doubtful: false,
    })
}

/// Returns location, scale, and the standard error of the location of a normal distribution, fitted
/// to right-censored samples by maximum likelihood. Returns `None` with fewer than two different
/// observed values.
///
/// In the parameters 1/σ and μ/σ the log-likelihood is concave (Olsen 1978), so Newton's method
/// with step halving finds its only maximum.
fn location_and_scale(samples: &[Sample]) -> Option<(f64, f64, f64)> {
    let n = float(observed(samples).count());
    if n < 2.0 {
        return None;
    }
    let mean = observed(samples).sum::<f64>() / n;
    let variance = observed(samples).map(|x| (x - mean).powi(2)).sum::<f64>() / n;
    // Values that are equal up to rounding count as equal.
    if !variance.is_finite() || variance <= (mean.abs() * 1e-12).powi(2) {
        return None;
    }
    // Distances in units of the observed deviation, from the observed mean.
    let unit = variance.sqrt();
    let scaled = |value: f64| (value - mean) / unit;
    let inside: Vec<f64> = observed(samples).map(scaled).collect();
    let beyond: Vec<f64> = censored_values(samples).map(scaled).collect();
    let objective = |delta: f64, gamma: f64| -> f64 {
        let squares: f64 = inside.iter().map(|x| (gamma * x - delta).powi(2)).sum();
        let tails: f64 = beyond
            .iter()
            .map(|x| log_upper_tail(gamma * x - delta))
            .sum();
        n * gamma.ln() - squares / 2.0 + tails
    };
    let (mut delta, mut gamma) = (0.0_f64, 1.0_f64);
    let mut value = objective(delta, gamma);
    let mut information = [n, 0.0, 2.0 * n];
    for _ in 0..200 {
        let mut gradient = [0.0, n / gamma];
        information = [n, 0.0, n / (gamma * gamma)];
        for x in &inside {
            let z = gamma * x - delta;
            gradient[0] += z;
            gradient[1] -= z * x;
            information[1] -= x;
            information[2] += x * x;
        }
        for x in &beyond {
            let z = gamma * x - delta;
            let hazard = inverse_mills(z);
            let slope = hazard * (hazard - z);
            gradient[0] += hazard;
            gradient[1] -= hazard * x;
            information[0] += slope;
            information[1] -= slope * x;
            information[2] += slope * x * x;
        }
        let [a, b, c] = information;
        let determinant = a * c - b * b;
        let step = [
            (c * gradient[0] - b * gradient[1]) / determinant,
            (a * gradient[1] - b * gradient[0]) / determinant,
        ];
        if !step[0].is_finite() || !step[1].is_finite() {
            return None;
        }
        let mut length = 1.0;
        let found = loop {
            let next = (delta + length * step[0], gamma + length * step[1]);
            if next.1 > 0.0 {
                let reached = objective(next.0, next.1);
                if reached >= value {
                    break Some((next, reached));
                }
            }
            length /= 2.0;
            if length < 1e-12 {
                break None;
            }
        };
        let Some((next, reached)) = found else { break };
        let is_over = (reached - value).abs() <= 1e-13 * (1.0 + value.abs());
        (delta, gamma) = next;
        value = reached;
        if is_over {
            break;
        }
    }
    let [a, b, c] = information;
    let determinant = a * c - b * b;
    // μ = δ/γ: its variance by the delta method.
    let slopes = [1.0 / gamma, -delta / (gamma * gamma)];
    let spread = (c * slopes[0] * slopes[0] - 2.0 * b * slopes[0] * slopes[1]
        + a * slopes[1] * slopes[1])
        / determinant;
    let location = mean + unit * delta / gamma;
    let scale = unit / gamma;
    let error = unit * spread.max(0.0).sqrt();
    let is_finite = location.is_finite() && scale.is_finite() && error.is_finite();
    is_finite.then_some((location, scale, error))
}

fn standard_density(z: f64) -> f64 {
    (-z * z / 2.0).exp() / std::f64::consts::TAU.sqrt()
}

/// Returns the probability that a standard normal variable is greater than `z`.
pub(crate) fn upper_tail(z: f64) -> f64 {
    libm::erfc(z / std::f64::consts::SQRT_2) / 2.0
}

/// Returns the hazard of the standard normal distribution, φ(z) / (1 − Φ(z)).
fn inverse_mills(z: f64) -> f64 {
    if z > 30.0 {
        // The first terms of its asymptotic series.
        return z + 1.0 / z - 2.0 / z.powi(3);
    }
    standard_density(z) / upper_tail(z)
}

fn log_upper_tail(z: f64) -> f64 {
    if z > 30.0 {
        return -z * z / 2.0 - (z * std::f64::consts::TAU.sqrt()).ln();
    }
    upper_tail(z).ln()
}

#[cfg(test)]
mod tests;
