//! Rates at which facts change by themselves, per second: [`learn`].
//!
//! A fact that becomes false at a rate of λ per second while it is true does so after an
//! exponentially distributed time, independently of the past. It is therefore irrelevant when the
//! fact became true, or that an action ends that period. Only two numbers matter: the seconds for
//! which the fact was true, and how many times it became false by itself. The maximum likelihood
//! estimate of the rate is the second divided by the first. Given the time, the number of changes
//! is Poisson distributed.

use std::collections::BTreeMap;

/// Exposure of a fact to changes in one direction.
#[derive(Clone, Debug, PartialEq)]
pub struct Exposure {
    /// The fact: `(open office)`.
    pub fact: String,
    /// Truth value after a change.
    pub becomes: bool,
    /// Time with the opposite truth value, in seconds, during which a change was possible.
    pub seconds: f64,
    /// Number of changes.
    pub changes: u64,
}

/// Number of changes and exposure time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rate {
    /// Number of changes.
    pub changes: u64,
    /// Exposure time in seconds.
    pub seconds: f64,
}

/// Changes of the facts of one predicate, in one direction.
#[derive(Clone, Debug, PartialEq)]
pub struct Changes {
    /// The predicate: `open`.
    pub predicate: String,
    /// Truth value after a change.
    pub becomes: bool,
    /// Rate of all facts together.
    pub all: Rate,
    /// Rate of each fact with exposure time, by its name: `(open office)`.
    pub facts: Vec<(String, Rate)>,
    /// `true` if each fact has its own rate, instead of one rate for all.
    pub has_rate_per_fact: bool,
}

impl Rate {
    /// Returns the maximum likelihood estimate of the rate, per second; `None` without exposure
    /// time.
    pub fn per_second(self) -> Option<f64> {
        (self.seconds > 0.0).then(|| float(self.changes) / self.seconds)
    }

    /// Returns an interval that contains the true rate with a probability of at least 95 % (Garwood
    /// 1936). At its lower end, this number of changes or more has probability 1/40, and at its
    /// upper end, this number or fewer. `None` without exposure time.
    pub fn interval(self) -> Option<(f64, f64)> {
        const TAIL: f64 = 0.025;
        if self.seconds <= 0.0 {
            return None;
        }
        let counts = Counts::new(self.changes);
        let lower = match self.changes {
            0 => 0.0,
            changes => {
                let fewer = Counts::new(changes - 1);
                root(changes, |mean| 1.0 - fewer.at_most(mean) < TAIL)
            }
        };
        let upper = root(self.changes, |mean| counts.at_most(mean) > TAIL);
        Some((lower / self.seconds, upper / self.seconds))
    }

    /// Returns the log-likelihood at the estimated rate, without the terms that do not depend on
    /// the grouping of facts.
    fn log_likelihood(self) -> f64 {
        match self.per_second() {
            Some(rate) if rate > 0.0 => float(self.changes) * (rate.ln() - 1.0),
            _ => 0.0,
        }
    }
}

/// Poisson probabilities of a number of changes.
struct Counts {
    count: u64,
    /// ln(count!)
    log_factorial: f64,
}

impl Counts {
    fn new(count: u64) -> Self {
        Self {
            count,
            log_factorial: (2..=count).map(|factor| float(factor).ln()).sum(),
        }
    }

    /// Returns P(X ≤ count) for a Poisson variable X with this mean.
    fn at_most(&self, mean: f64) -> f64 {
        if mean <= 0.0 {
            return 1.0;
        }
        let own = (float(self.count) * mean.ln() - mean - self.log_factorial).exp();
        // Sums from the term of `count` away from the mean, so that terms decrease.
        if float(self.count) < mean {
            let mut sum = 0.0;
            let mut term = own;
            let mut count = self.count;
            while term > 1e-18 {
                sum += term;
                if count == 0 {
                    break;
                }
                term *= float(count) / mean;
                count -= 1;
            }
            sum
        } else {
            let mut above = 0.0;
            let mut count = self.count + 1;
            let mut term = own * mean / float(count);
            while term > 1e-18 {
                above += term;
                count += 1;
                term *= mean / float(count);
            }
            1.0 - above
        }
    }
}

/// Returns the greatest mean for which `holds` is true. `holds` must be true near 0 and false from
/// some mean on.
fn root(count: u64, holds: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, float(count).max(1.0));
    while holds(high) {
        low = high;
        high *= 2.0;
    }
    for _ in 0..100 {
        let middle = f64::midpoint(low, high);
        if holds(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Estimates rates for predicates with at least one fact that has changed by itself, in both
/// directions, sorted by name. Akaike's criterion decides if the facts of a predicate share one
/// rate or have separate rates: each additional rate must increase the log-likelihood by more than
/// 1.
pub fn learn(exposures: &[Exposure]) -> Vec<Changes> {
    let mut found: BTreeMap<(&str, bool), BTreeMap<&str, Rate>> = BTreeMap::new();
    for exposure in exposures {
        let name = exposure.fact.trim_matches(['(', ')']);
        let predicate = name.split_whitespace().next().unwrap_or_default();
        let facts = found.entry((predicate, exposure.becomes)).or_default();
        let rate = facts.entry(&exposure.fact).or_default();
        rate.changes += exposure.changes;
        rate.seconds += exposure.seconds;
    }
    let has_changed = |predicate: &str| {
        let both = [false, true].map(|becomes| found.get(&(predicate, becomes)));
        let mut rates = both.into_iter().flatten().flat_map(BTreeMap::values);
        rates.any(|rate| rate.changes > 0)
    };
    let changed = found
        .iter()
        .filter(|((predicate, _), _)| has_changed(predicate));
    changed
        .map(|((predicate, becomes), facts)| {
            let facts = facts.iter().filter(|(_, rate)| rate.seconds > 0.0);
            let facts: Vec<(String, Rate)> = facts
                .map(|(fact, rate)| ((*fact).to_owned(), *rate))
                .collect();
            let all = facts.iter().fold(Rate::default(), |all, (_, rate)| Rate {
                changes: all.changes + rate.changes,
                seconds: all.seconds + rate.seconds,
            });
            let apart: f64 = facts.iter().map(|(_, rate)| rate.log_likelihood()).sum();
            let gain = apart - all.log_likelihood();
            let more = facts.len().saturating_sub(1);
            Changes {
                predicate: (*predicate).to_owned(),
                becomes: *becomes,
                all,
                has_rate_per_fact: more > 0 && gain > float(more as u64),
                facts,
            }
        })
        .collect()
}

impl Changes {
    /// Returns the changes and the exposure time for the estimate of a fact's rate.
    pub fn rate_of(&self, fact: &str) -> Rate {
        let own = self.facts.iter().find(|(name, _)| name == fact);
        match own {
            Some((_, own)) if self.has_rate_per_fact => *own,
            _ => self.all,
        }
    }

    /// Returns the rates of all facts that have a positive one.
    pub fn rates(&self) -> impl Iterator<Item = (&str, f64)> {
        let facts = self.facts.iter().filter_map(|(fact, _)| {
            let rate = self.rate_of(fact).per_second()?;
            Some((fact.as_str(), rate))
        });
        facts.filter(|(_, rate)| *rate > 0.0)
    }
}

#[allow(
    clippy::cast_precision_loss,
    reason = "logs have far fewer than 2^52 changes"
)]
fn float(count: u64) -> f64 {
    count as f64
}

#[cfg(test)]
mod tests {
    use super::{Exposure, Rate, learn};
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn intervals_match_published_tables() {
        // Garwood (1936), as in tables of exact limits for Poisson counts.
        for (changes, lower, upper) in [
            (0, 0.0, 3.6889),
            (1, 0.0253, 5.5716),
            (5, 1.6235, 11.6683),
            (10, 4.7954, 18.3904),
            (50, 37.1110, 65.9189),
            (100, 81.3639, 121.6272),
        ] {
            let rate = Rate {
                changes,
                seconds: 2.0,
            };
            let (low, high) = rate.interval().unwrap();
            assert!((2.0 * low - lower).abs() < 1e-3, "{changes}: {low}");
            assert!((2.0 * high - upper).abs() < 1e-3, "{changes}: {high}");
        }
        assert_eq!(Rate::default().interval(), None);
    }

    #[test]
    fn many_changes_have_a_narrow_interval() {
        let rate = Rate {
            changes: 1_000_000,
            seconds: 1000.0,
        };
        let (low, high) = rate.interval().unwrap();
        assert!((low - 998.04).abs() < 0.01 && (high - 1001.96).abs() < 0.01);
    }

    /// For 20, 50 and 200 traces of half a minute, at three rates, the interval contains the true
    /// rate at least as often as stated, up to three standard errors of 2,000 samples.
    #[test]
    fn intervals_have_their_nominal_coverage() {
        const TRIES: u32 = 2_000;
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for traces in [20.0, 50.0, 200.0] {
            for truth in [0.001, 0.01, 0.1] {
                let seconds = 30.0 * traces;
                let holds = |rng: &mut ChaCha8Rng| {
                    let (mut at, mut changes) = (0.0, 0);
                    loop {
                        at -= (1.0 - rng.random::<f64>()).ln() / truth;
                        if at > seconds {
                            break;
                        }
                        changes += 1;
                    }
                    let (lower, upper) = Rate { changes, seconds }.interval().unwrap();
                    lower <= truth && truth <= upper
                };
                let held: u32 = (0..TRIES).map(|_| u32::from(holds(&mut rng))).sum();
                let share = f64::from(held) / f64::from(TRIES);
                let error = (0.95 * 0.05 / f64::from(TRIES)).sqrt();
                assert!(share >= 0.95 - 3.0 * error, "{traces} at {truth}: {share}");
            }
        }
    }

    fn exposure(fact: &str, becomes: bool, changes: u64, seconds: f64) -> Exposure {
        Exposure {
            fact: fact.to_owned(),
            becomes,
            seconds,
            changes,
        }
    }

    #[test]
    fn facts_with_different_rates_are_separated() {
        let alike = [
            exposure("(works m1)", false, 5, 100.0),
            exposure("(works m2)", false, 7, 100.0),
            exposure("(works m1)", true, 0, 50.0),
            exposure("(at rover depot)", false, 0, 100.0),
        ];
        let learnt = learn(&alike);
        let names: Vec<_> = learnt
            .iter()
            .map(|it| (it.predicate.as_str(), it.becomes))
            .collect();
        assert_eq!(names, [("works", false), ("works", true)]);
        assert!(!learnt[0].has_rate_per_fact);
        let rates: Vec<_> = learnt[0].rates().collect();
        assert_eq!(rates, [("(works m1)", 0.06), ("(works m2)", 0.06)]);
        assert_eq!(learnt[1].rates().count(), 0);
        let differ = [
            exposure("(works m1)", false, 1, 100.0),
            exposure("(works m2)", false, 19, 100.0),
        ];
        let learnt = learn(&differ);
        assert!(learnt[0].has_rate_per_fact);
        let rates: Vec<_> = learnt[0].rates().collect();
        assert_eq!(rates, [("(works m1)", 0.01), ("(works m2)", 0.19)]);
    }
}
