//! Time-outs that follow from learnt durations.

use std::collections::BTreeMap;

use elbowroom_execution::run::TimeoutRule;
use elbowroom_learning::learn::{Durations, Group, Learnt};
use elbowroom_num::Rational;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Number of draws. The longest one counts.
const DRAWS: usize = 10_000;

/// Multiple of the longest duration that is drawn or in the logs.
const SAFETY_FACTOR: f64 = 2.0;

/// Shortest time-out, in seconds.
const SHORTEST_TIMEOUT: i64 = 1;

/// Returns the time-outs that follow from the learnt durations: twice the longest of 10,000 draws and of all that
/// ended in the logs.
/// Other actions have the default. `None` if no duration was learnt.
pub(super) fn of(learnt: &[Learnt]) -> Option<TimeoutRule> {
    let mut actions = BTreeMap::new();
    for action in learnt {
        match &action.durations {
            Durations::Unknown => {}
            Durations::Pooled(group) => {
                actions.extend(absolute(group).map(|rule| (action.name.clone(), rule)));
            }
            Durations::Relative(group) => {
                let rule = limit(group).map(|factor| TimeoutRule::After {
                    factor,
                    at_least: Rational::from(SHORTEST_TIMEOUT),
                });
                actions.extend(rule.map(|rule| (action.name.clone(), rule)));
            }
            Durations::PerAction(groups) => {
                let rules = groups.iter();
                actions.extend(
                    rules.filter_map(|(name, group)| Some((name.clone(), absolute(group)?))),
                );
            }
        }
    }
    let others = Box::new(TimeoutRule::default());
    (!actions.is_empty()).then_some(TimeoutRule::ByAction { actions, others })
}

fn absolute(group: &Group) -> Option<TimeoutRule> {
    let at_least = limit(group)?.max(Rational::from(SHORTEST_TIMEOUT));
    let factor = Rational::ZERO;
    Some(TimeoutRule::After { factor, at_least })
}

/// Returns the limit on a duration, or on its multiple of the planned one, rounded up to two
/// digits.
fn limit(group: &Group) -> Option<Rational> {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let drawn = (0..DRAWS).map(|_| group.fit.distribution.draw(&mut rng));
    // A censored duration may be that of an action that never reported its end.
    let seen = group.samples.iter().filter(|sample| !sample.is_censored);
    let seen = seen.map(|sample| sample.value);
    let longest = drawn.chain(seen).fold(0.0, f64::max);
    rounded_up(SAFETY_FACTOR * longest)
}

fn rounded_up(value: f64) -> Option<Rational> {
    if !value.is_finite() || value <= 0.0 {
        return None;
    }
    let unit = 10_f64.powf(value.log10().floor() - 1.0);
    // Minus a small margin, because 12 units may be slightly more than 12 in binary.
    let digits = (value / unit - 1e-9).ceil();
    let text = format!("{:.3}", (digits * unit).max(0.001));
    text.parse().ok()
}
