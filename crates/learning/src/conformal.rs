//! Intervals that contain the next value with a stated probability, for any distribution: split
//! conformal prediction (Vovk, Gammerman & Shafer 2005; Lei et al. 2018).
//!
//! The only assumption is that past and future values are exchangeable.

use crate::survival::{Sample, float};

/// An interval around a nominal value; an end may be infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    /// The planned value.
    pub nominal: f64,
    /// The lower end, at most `nominal`.
    pub lower: f64,
    /// The upper end, at least `nominal`.
    pub upper: f64,
}

impl Band {
    /// Returns the band with both sides multiplied by `factor`.
    #[must_use]
    pub fn stretched(self, factor: f64) -> Self {
        let side = |side: f64| if side == 0.0 { 0.0 } else { side * factor };
        Self {
            lower: self.nominal - side(self.nominal - self.lower),
            upper: self.nominal + side(self.upper - self.nominal),
            ..self
        }
    }

    /// Returns the least stretching factor that makes the band contain the value. For a censored
    /// sample, the band must contain every possible value. Infinite if no factor suffices.
    pub fn score(&self, sample: Sample) -> f64 {
        if sample.is_censored {
            // The value may be any greater one: the score below is that of the bound, and the
            // distance above is unlimited.
            let above = if self.upper.is_infinite() {
                0.0
            } else {
                f64::INFINITY
            };
            return above.max(self.exact_score(sample.value.min(self.nominal)));
        }
        self.exact_score(sample.value)
    }

    fn exact_score(&self, value: f64) -> f64 {
        let (distance, side) = if value >= self.nominal {
            (value - self.nominal, self.upper - self.nominal)
        } else {
            (self.nominal - value, self.nominal - self.lower)
        };
        if distance <= 0.0 || side.is_infinite() {
            0.0
        } else if side <= 0.0 {
            f64::INFINITY
        } else {
            distance / side
        }
    }
}

/// Returns the stretching factor that makes a band contain the next value with probability `1 -
/// miss`: the ⌈(n + 1)(1 − miss)⌉-th smallest score of the calibration samples. Infinite if there
/// are fewer than [`min_samples`].
pub fn factor(band: Band, calibration: &[Sample], miss: f64) -> f64 {
    let mut scores: Vec<f64> = calibration
        .iter()
        .map(|sample| band.score(*sample))
        .collect();
    scores.sort_by(f64::total_cmp);
    let rank = (float(scores.len() + 1) * (1.0 - miss) - 1e-9).ceil();
    if rank < 1.0 {
        return 0.0;
    }
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a whole number between 1 and one more than the samples"
    )]
    let rank = rank as usize;
    scores.get(rank - 1).copied().unwrap_or(f64::INFINITY)
}

/// Returns the number of calibration samples that [`factor`] needs for a finite result.
pub fn min_samples(miss: f64) -> usize {
    if miss <= 0.0 {
        return usize::MAX;
    }
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "not negative; larger values become the largest number"
    )]
    let fewest = (1.0 / miss - 1.0 - 1e-9).ceil().max(0.0) as usize;
    fewest
}

/// Divides a probability of failure among bands. Each share is proportional to the fraction of the
/// training samples outside its band, with one miss added so that it is positive. The shares add up
/// to `miss`.
pub fn allotment(bands: &[(Band, Vec<Sample>)], miss: f64) -> Vec<f64> {
    let weights: Vec<f64> = bands
        .iter()
        .map(|(band, training)| {
            let outside = training.iter().filter(|sample| band.score(**sample) > 1.0);
            float(outside.count() + 1) / float(training.len() + 2)
        })
        .collect();
    let sum: f64 = weights.iter().sum();
    weights
        .into_iter()
        .map(|weight| miss * weight / sum)
        .collect()
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};

    use super::*;

    #[test]
    fn coverage_holds_for_any_distribution() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let band = Band {
            nominal: 1.0,
            lower: 0.0,
            upper: 3.0,
        };
        // A distribution with a heavy upper tail.
        let mut draw = || Sample::observed(1.0 / rng.random::<f64>().max(1e-9));
        for (count, miss) in [(20, 0.1), (50, 0.05), (200, 0.2)] {
            let trials = 4_000;
            let mut hits = 0;
            for _ in 0..trials {
                let calibration: Vec<Sample> = (0..count).map(|_| draw()).collect();
                let factor = factor(band, &calibration, miss);
                hits += usize::from(band.score(draw()) <= factor);
            }
            let rate = float(hits) / float(trials);
            // Three standard deviations of the sampling error.
            let slack = 3.0 * (miss * (1.0 - miss) / float(trials)).sqrt();
            assert!(rate >= 1.0 - miss - slack, "{count} {miss}: {rate}");
            assert!(
                rate <= 1.0 - miss + 1.0 / float(count + 1) + slack,
                "{rate}"
            );
        }
    }

    #[test]
    fn too_few_samples_give_infinite_factor() {
        let band = Band {
            nominal: 1.0,
            lower: 0.0,
            upper: 3.0,
        };
        let samples = vec![Sample::observed(1.0); 18];
        assert!(factor(band, &samples, 0.05).is_infinite());
        assert_eq!(min_samples(0.05), 19);
        let samples = vec![Sample::observed(1.0); 19];
        assert!(factor(band, &samples, 0.05).abs() < 1e-12);
    }

    #[test]
    fn censored_sample_counts_as_infinite() {
        let band = Band {
            nominal: 10.0,
            lower: 8.0,
            upper: 15.0,
        };
        assert!(band.score(Sample::censored(9.0)).is_infinite());
        let open = Band {
            upper: f64::INFINITY,
            ..band
        };
        assert!((open.score(Sample::censored(9.0)) - 0.5).abs() < 1e-12);
        assert!(open.score(Sample::censored(12.0)).abs() < 1e-12);
    }
}
