//! Right-censored samples: observed values, and lower bounds of values whose actions were cancelled
//! or failed before they ended.

/// An observed value, or a lower bound on a value that was not observed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The value, or its lower bound.
    pub value: f64,
    /// `true` if `value` is only a lower bound (right-censored).
    pub is_censored: bool,
}

impl Sample {
    /// Creates a sample of an observed value.
    pub fn observed(value: f64) -> Self {
        Self {
            value,
            is_censored: false,
        }
    }

    /// Creates a sample that is greater than `value`.
    pub fn censored(value: f64) -> Self {
        Self {
            value,
            is_censored: true,
        }
    }

    /// Returns the sample in another unit.
    #[must_use]
    pub fn over(self, unit: f64) -> Self {
        Self {
            value: self.value / unit,
            ..self
        }
    }
}

/// The product-limit estimate of a survival function (Kaplan & Meier 1958).
#[derive(Clone, Debug, PartialEq)]
pub struct SurvivalFunction {
    /// The observed values in increasing order, each with the probability of being greater.
    steps: Vec<(f64, f64)>,
}

impl SurvivalFunction {
    /// Computes the estimate from these samples, which must be finite.
    pub fn of(samples: &[Sample]) -> Self {
        let mut sorted = samples.to_vec();
        // At equal values, observed samples come before censored ones.
        sorted.sort_by(|a, b| {
            let order = a.value.total_cmp(&b.value);
            order.then(a.is_censored.cmp(&b.is_censored))
        });
        let mut steps: Vec<(f64, f64)> = Vec::new();
        let mut survival = 1.0;
        let mut at_risk = sorted.len();
        let mut rest = sorted.as_slice();
        while let Some(first) = rest.first() {
            let same = |sample: &&Sample| {
                sample.value.total_cmp(&first.value).is_eq() && !sample.is_censored
            };
            let deaths = rest.iter().take_while(same).count();
            if deaths > 0 {
                survival *= 1.0 - float(deaths) / float(at_risk);
                steps.push((first.value, survival));
            }
            let passed = deaths.max(1);
            at_risk -= passed;
            rest = &rest[passed..];
        }
        Self { steps }
    }

    /// Returns the probability of a greater value.
    pub fn at(&self, value: f64) -> f64 {
        let after = self.steps.partition_point(|(step, _)| *step <= value);
        match after {
            0 => 1.0,
            _ => self.steps[after - 1].1,
        }
    }

    /// Returns the observed values in increasing order, each with the probability of being greater.
    pub fn steps(&self) -> &[(f64, f64)] {
        &self.steps
    }
}

pub(crate) fn float(count: usize) -> f64 {
    #[allow(
        clippy::cast_precision_loss,
        reason = "counts of samples are far below 2^53"
    )]
    let float = count as f64;
    float
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn estimate_matches_hand_computed_example() {
        // One of 5 ends at 3, one of 3 at 5 (4 is censored), and the last one at 8 (the other 5 is
        // censored).
        let samples = [
            Sample::observed(3.0),
            Sample::censored(4.0),
            Sample::observed(5.0),
            Sample::censored(5.0),
            Sample::observed(8.0),
        ];
        let survival = SurvivalFunction::of(&samples);
        assert!((survival.at(2.9) - 1.0).abs() < 1e-12);
        assert!((survival.at(3.0) - 0.8).abs() < 1e-12);
        assert!((survival.at(4.5) - 0.8).abs() < 1e-12);
        assert!((survival.at(5.0) - 0.8 * 2.0 / 3.0).abs() < 1e-12);
        assert!(survival.at(8.0).abs() < 1e-12);
    }

    #[test]
    fn without_censoring_it_is_the_empirical_distribution() {
        let samples: Vec<Sample> = [2.0, 7.0, 7.0, 9.0].map(Sample::observed).to_vec();
        let survival = SurvivalFunction::of(&samples);
        assert!((survival.at(7.0) - 0.25).abs() < 1e-12);
        assert!((survival.at(6.0) - 0.75).abs() < 1e-12);
    }
}
