//! Detection of changes in the distribution of values: a conformal test martingale (Vovk 2021, the
//! *simple jumper*).
//!
//! While the values are exchangeable, the martingale ever reaches 1/δ with a probability of at most
//! δ (Ville's inequality). It may therefore be tested after each value.

use rand::Rng;

use crate::survival::float;

/// Evidence in the values so far that their distribution has changed.
#[derive(Clone, Debug, PartialEq)]
pub struct Drift {
    /// The largest value of the martingale: the odds that the values have drifted.
    pub evidence: f64,
    /// The position, from 0, of the value at which the evidence first reached the limit.
    pub since: Option<usize>,
}

/// Fraction of the capital that is redistributed among the directions in each step.
const REDISTRIBUTED_FRACTION: f64 = 0.01;

/// Tests values in order of observation. The alarm is raised when the evidence reaches `limit`:
/// with 100, in at most 1 % of the sequences without drift.
///
/// Ties are broken randomly with `rng`.
pub fn drift(values: &[f64], limit: f64, rng: &mut impl Rng) -> Drift {
    let mut sorted: Vec<f64> = Vec::with_capacity(values.len());
    let mut capital = [1.0 / 3.0; 3];
    let mut drift = Drift {
        evidence: 1.0,
        since: None,
    };
    for (position, value) in values.iter().enumerate() {
        let below = sorted.partition_point(|old| old.total_cmp(value).is_lt());
        let up_to = sorted.partition_point(|old| old.total_cmp(value).is_le());
        sorted.insert(up_to, *value);
        let (greater, equal) = (sorted.len() - 1 - up_to, up_to - below + 1);
        let share = (float(greater) + rng.random::<f64>() * float(equal)) / float(sorted.len());
        let total: f64 = capital.iter().sum();
        for (bet, direction) in capital.iter_mut().zip([-1.0, 0.0, 1.0]) {
            *bet = (1.0 - REDISTRIBUTED_FRACTION) * *bet + REDISTRIBUTED_FRACTION / 3.0 * total;
            *bet *= 1.0 + direction * (share - 0.5);
        }
        let total: f64 = capital.iter().sum();
        drift.evidence = drift.evidence.max(total);
        if drift.since.is_none() && total >= limit {
            drift.since = Some(position);
        }
        // The evidence is sufficient.
        if total > 1e12 {
            break;
        }
    }
    drift
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn false_alarm_rate_is_below_limit() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let sequences = 1_000;
        let mut alarms = 0;
        for _ in 0..sequences {
            let values: Vec<f64> = (0..200).map(|_| rng.random::<f64>().powi(3)).collect();
            alarms += usize::from(drift(&values, 20.0, &mut rng).since.is_some());
        }
        // At most 5 %, plus sampling error.
        assert!(alarms <= 70, "{alarms}");
    }

    #[test]
    fn slowdown_is_detected_soon() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let values: Vec<f64> = (0..120)
            .map(|i| rng.random::<f64>() + if i < 60 { 10.0 } else { 11.5 })
            .collect();
        let since = drift(&values, 100.0, &mut rng).since.expect("an alarm");
        assert!((60..100).contains(&since), "{since}");
    }

    #[test]
    fn values_that_are_all_equal_do_not_drift() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        assert_eq!(drift(&[4.0; 100], 100.0, &mut rng).since, None);
        assert_eq!(drift(&[], 100.0, &mut rng).since, None);
    }
}
