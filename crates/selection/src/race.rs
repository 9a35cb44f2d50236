//! Comparison of success rates of several plans with few samples.

use std::cmp::Reverse;

/// Number of samples at the end of each round.
const ROUNDS: [u64; 4] = [50, 100, 200, 400];

/// Lag beyond which a plan is dropped, in standard deviations of the difference.
const SIGNIFICANT_LAG: u64 = 2;

/// Results of a plan in the samples from 0 on.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Tally {
    results: Vec<bool>,
}

impl Tally {
    pub(super) fn samples(&self) -> u64 {
        self.results.len() as u64
    }

    pub(super) fn successes(&self) -> u64 {
        self.results.iter().filter(|success| **success).count() as u64
    }

    pub(super) fn is_behind(&self, other: &Self) -> bool {
        is_behind(&self.results, &other.results)
    }

    /// Returns `true` if this plan's true lead over `other` may be one sample in `margin`, within
    /// the statistical error of the samples.
    fn may_be_ahead(&self, other: &Self, margin: u64) -> bool {
        let (own, theirs) = differences(&self.results, &other.results);
        let least = self.samples().min(other.samples()) / margin;
        // Tests whether the gap to the required lead is significant.
        let missing = (least + theirs).saturating_sub(own);
        missing.pow(2) <= SIGNIFICANT_LAG.pow(2) * (own + theirs + 1)
    }
}

/// Returns `true` if `results` are significantly behind `others` in the samples that both have:
/// McNemar's test of the samples with a single success.
pub fn is_behind(results: &[bool], others: &[bool]) -> bool {
    let (own, theirs) = differences(results, others);
    theirs > own && (theirs - own).pow(2) > SIGNIFICANT_LAG.pow(2) * (theirs + own)
}

/// Returns the numbers of samples with success of only the first, and of only the second.
fn differences(results: &[bool], others: &[bool]) -> (u64, u64) {
    let pairs = || results.iter().zip(others);
    let own = pairs().filter(|(own, other)| **own && !**other).count() as u64;
    let theirs = pairs().filter(|(own, other)| !**own && **other).count() as u64;
    (own, theirs)
}

/// Rules of a race.
pub(super) struct Rules<'a> {
    /// Number of samples at the end of each round.
    pub(super) rounds: &'a [u64],
    /// `true` to drop half of the remaining plans after each round (sequential halving; Karnin,
    /// Koren & Somekh, ICML 2013), except the first plan.
    pub(super) is_halving: bool,
    /// The lead over the first plan that a plan needs to be preferred: one sample in `margin`.
    /// Plans that are significantly short of this lead are dropped.
    pub(super) margin: Option<u64>,
}

impl Default for Rules<'static> {
    fn default() -> Self {
        Self {
            rounds: &ROUNDS,
            is_halving: false,
            margin: None,
        }
    }
}

/// Keeps the better half of the plans, and the first plan.
fn better_half(tallies: &[Tally], racing: &mut Vec<usize>) {
    let most = racing.len().div_ceil(2);
    let mut best = racing.clone();
    best.sort_by_key(|place| Reverse(tallies[*place].successes()));
    best.truncate(most);
    racing.retain(|place| *place == 0 || best.contains(place));
}

/// Returns the tallies of `count` plans, and the position of the most successful one; of several,
/// the first.
///
/// `try_out` returns the success of a plan in a sample, or `None` to end the race. All plans have
/// the same samples (common random numbers), so that they differ by their quality and not by the
/// random seed. Plans that are significantly behind get no further samples (racing; Maron & Moore,
/// NIPS 1993).
pub(super) fn race(
    count: usize,
    rules: &Rules<'_>,
    try_out: &mut dyn FnMut(usize, u64) -> Option<bool>,
) -> (Vec<Tally>, usize) {
    let mut tallies = vec![Tally::default(); count];
    let mut racing: Vec<usize> = (0..count).collect();
    let mut leader = 0;
    for &most in rules.rounds {
        for &place in &racing {
            for sample in tallies[place].samples()..most {
                let Some(success) = try_out(place, sample) else {
                    return (tallies, leader);
                };
                tallies[place].results.push(success);
            }
        }
        leader = index_of_best(&tallies, &racing);
        let best = tallies[leader].clone();
        racing.retain(|place| !tallies[*place].is_behind(&best));
        if rules.is_halving {
            better_half(&tallies, &mut racing);
        }
        if let Some(margin) = rules.margin {
            let may_win =
                |place: &usize| *place == 0 || tallies[*place].may_be_ahead(&tallies[0], margin);
            racing.retain(may_win);
        }
        // No plan can be ahead of one that always succeeds.
        if racing.len() < 2 || best.successes() == best.samples() {
            break;
        }
    }
    (tallies, leader)
}

fn index_of_best(tallies: &[Tally], racing: &[usize]) -> usize {
    let mut best = racing.first().copied().unwrap_or(0);
    for &place in racing {
        if tallies[place].successes() > tallies[best].successes() {
            best = place;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Plans that succeed in this share of samples. All plans share the random number of a sample.
    fn trials(shares: &[u64]) -> impl FnMut(usize, u64) -> Option<bool> + '_ {
        |place, sample| {
            Some(sample.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32 < (shares[place] << 32) / 100)
        }
    }

    #[test]
    fn likeliest_plan_wins_and_weak_plan_is_dropped_after_first_round() {
        let (tallies, leader) = race(3, &Rules::default(), &mut trials(&[60, 90, 20]));
        assert_eq!(leader, 1);
        assert_eq!(tallies[2].samples(), ROUNDS[0]);
        assert!(tallies[1].successes() * 100 >= 85 * tallies[1].samples());
    }

    #[test]
    fn first_of_equal_plans_wins_after_all_rounds() {
        let (tallies, leader) = race(3, &Rules::default(), &mut trials(&[70, 70, 70]));
        assert_eq!(leader, 0);
        assert_eq!(tallies[0], tallies[2]);
        assert_eq!(tallies[0].samples(), ROUNDS[3]);
    }

    #[test]
    fn plan_without_failures_ends_the_race() {
        let (tallies, leader) = race(2, &Rules::default(), &mut trials(&[90, 100]));
        assert_eq!(leader, 1);
        assert!(tallies[1].samples() < ROUNDS[3]);
    }

    #[test]
    fn interrupted_race_returns_leader_of_last_round() {
        let mut left = 60;
        let (_, leader) = race(2, &Rules::default(), &mut |place, _| {
            left -= 1;
            (left > 0).then_some(place == 1)
        });
        assert_eq!(leader, 0, "no round was over");
    }

    #[test]
    fn halving_drops_half_of_the_plans_except_the_first() {
        let rules = Rules {
            is_halving: true,
            ..Rules::default()
        };
        let (tallies, leader) = race(8, &rules, &mut trials(&[70; 8]));
        assert_eq!(leader, 0);
        let samples: Vec<u64> = tallies.iter().map(Tally::samples).collect();
        assert_eq!(samples, [200, 200, 100, 100, 50, 50, 50, 50]);
        let mut now_and_then = |place, sample| {
            let is_lost = sample % 10 == 0 || place == 0 && sample % 100 == 3;
            Some(!is_lost)
        };
        let (tallies, _) = race(4, &rules, &mut now_and_then);
        let samples: Vec<u64> = tallies.iter().map(Tally::samples).collect();
        assert_eq!(samples, [400, 400, 400, 50]);
    }

    #[test]
    fn plan_that_cannot_gain_the_margin_is_dropped() {
        let rules = Rules {
            rounds: &[400, 800, 1600],
            margin: Some(200),
            ..Rules::default()
        };
        let (tallies, leader) = race(3, &rules, &mut trials(&[70, 70, 73]));
        assert_eq!(leader, 2);
        assert!(tallies[1].samples() < 1600, "it does the same");
        let (tallies, _) = race(2, &rules, &mut trials(&[70, 70]));
        assert!(
            tallies[0].samples() < 1600,
            "nothing is left to be found out"
        );
    }
}
