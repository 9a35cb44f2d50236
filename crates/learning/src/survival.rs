//! Right-censored samples: values that were observed, and values of which only a lower bound is
//! known, because the action was cancelled or failed before it could end.

/// One value, or a lower bound of one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The value, or what it is greater than.
    pub value: f64,
    /// Whether `value` is only a lower bound (right-censored).
    pub is_censored: bool,
}

impl Sample {
    /// A value that was observed.
    pub fn observed(value: f64) -> Self {
        Self {
            value,
            is_censored: false,
        }
    }

    /// A value that is greater than this.
    pub fn censored(value: f64) -> Self {
        Self {
            value,
            is_censored: true,
        }
    }

    /// The sample in another unit.
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
    /// The estimate from these samples, which must be finite.
    pub fn of(samples: &[Sample]) -> Self {
        let mut sorted = samples.to_vec();
        // At the same value, what was observed comes before what was cut off there.
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

    /// The probability of a greater value.
    pub fn at(&self, value: f64) -> f64 {
        let after = self.steps.partition_point(|(step, _)| *step <= value);
        match after {
            0 => 1.0,
            _ => self.steps[after - 1].1,
        }
    }

    /// The observed values in increasing order, each with the probability of being greater.
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
    fn a_worked_example_by_hand() {
        // At 3 one of 5 ends, at 5 one of 3 (4 was cut off), at 8 the last one that is left but
        // one.
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
