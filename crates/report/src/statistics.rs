//! Proportions and means of many runs.

use serde::{Deserialize, Serialize};

/// A proportion: successes out of a count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Proportion {
    /// Number of successes.
    pub successes: u64,
    /// Number of trials.
    pub count: u64,
}

/// The quantile of the normal distribution that leaves 2.5 % on each side.
const NORMAL_975: f64 = 1.959_963_984_540_054;

impl Proportion {
    /// Returns the proportion, between 0 and 1; `None` without trials.
    pub fn share(self) -> Option<f64> {
        (self.count > 0).then(|| float(self.successes) / float(self.count))
    }

    /// Returns Wilson's 95 % interval for the underlying probability (Wilson 1927). Unlike the
    /// textbook interval it makes sense for 0 of n and n of n.
    pub fn wilson(self) -> Option<(f64, f64)> {
        let share = self.share()?;
        let (n, z) = (float(self.count), NORMAL_975);
        let middle = share + z * z / (2.0 * n);
        let half = z * (share * (1.0 - share) / n + z * z / (4.0 * n * n)).sqrt();
        let scale = 1.0 + z * z / n;
        let clamp = |value: f64| value.clamp(0.0, 1.0);
        Some((
            clamp((middle - half) / scale),
            clamp((middle + half) / scale),
        ))
    }

    /// Adds a trial.
    pub fn add(&mut self, is_success: bool) {
        self.count += 1;
        self.successes += u64::from(is_success);
    }

    /// Adds the trials of `other`.
    pub fn merge(&mut self, other: Self) {
        self.successes += other.successes;
        self.count += other.count;
    }
}

/// A mean of integers. Sum and count are exact, so the order of merging does not matter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mean {
    /// The sum.
    pub sum: u64,
    /// Number of values.
    pub count: u64,
}

impl Mean {
    /// Adds a value.
    pub fn add(&mut self, value: u64) {
        self.sum += value;
        self.count += 1;
    }

    /// Returns the mean; `None` without values.
    pub fn value(self) -> Option<f64> {
        (self.count > 0).then(|| float(self.sum) / float(self.count))
    }

    /// Adds the values of `other`.
    pub fn merge(&mut self, other: Self) {
        self.sum += other.sum;
        self.count += other.count;
    }
}

/// Returns the two-sided p-value of McNemar's exact test: the probability that discordant pairs are
/// divided at least as unevenly if both sides are equally likely. Returns 1 if there are none.
pub fn mcnemar(first: u64, second: u64) -> f64 {
    let count = first + second;
    // ln C(n, k) − n ln 2, from k = 0 on, so that no intermediate term overflows or underflows.
    let mut logarithm = -float(count) * std::f64::consts::LN_2;
    let mut tail = 0.0;
    for k in 0..=first.min(second) {
        tail += logarithm.exp();
        logarithm += float(count - k).ln() - float(k + 1).ln();
    }
    (2.0 * tail).min(1.0)
}

#[allow(
    clippy::cast_precision_loss,
    reason = "counts of runs are far below 2^52"
)]
fn float(count: u64) -> f64 {
    count as f64
}

#[cfg(test)]
mod tests {
    use super::{Proportion, mcnemar};

    /// Computes the sum of the definition in integer arithmetic.
    fn mcnemar_by_counting(first: u64, second: u64) -> f64 {
        let (count, most) = (first + second, first.min(second));
        let few = (0_u32..1 << count).filter(|bits| u64::from(bits.count_ones()) <= most);
        let all = f64::from(1_u32 << count);
        (2.0 * f64::from(u32::try_from(few.count()).unwrap()) / all).min(1.0)
    }

    #[test]
    fn mcnemar_matches_exact_counting() {
        for first in 0..8 {
            for second in 0..8 {
                let counted = mcnemar_by_counting(first, second);
                let computed = mcnemar(first, second);
                assert!(
                    (computed - counted).abs() < 1e-12,
                    "{first} {second}: {computed} {counted}"
                );
            }
        }
        let many = mcnemar(49_000, 51_000);
        assert!(many > 0.0 && many < 1e-9, "{many}");
    }

    #[test]
    fn wilson_interval_matches_published_values() {
        // Newcombe (1998), table I: 81 of 263, and 0 of 20, without continuity correction.
        let (lower, upper) = Proportion {
            successes: 81,
            count: 263,
        }
        .wilson()
        .unwrap();
        assert!((lower - 0.2553).abs() < 5e-5 && (upper - 0.3662).abs() < 5e-5);
        let (lower, upper) = Proportion {
            successes: 0,
            count: 20,
        }
        .wilson()
        .unwrap();
        assert!(lower.abs() < 1e-12 && (upper - 0.1611).abs() < 5e-5);
        assert_eq!(Proportion::default().wilson(), None);
    }
}
