//! The decision for a number of failures, and the greatest number.

use std::ops::ControlFlow;

use elbowroom_stn::uncertain::UncertainNetwork;

use super::{DeadlineFailure, FaultNetwork, Layers, stretched, with_failures};

/// Greatest number of failures that is searched.
pub const MAX_FAULTS: usize = 32;

/// Greatest number of combinations of failures that are checked one by one.
const MAX_COMBINATIONS: usize = 200;

/// Number of undecided numbers of failures after which the search ends.
const MAX_UNDECIDED: usize = 3;

/// Decision about a number of failures.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FaultVerdict {
    /// One strategy works for all of them.
    Controllable,
    /// No strategy works if each attempt fails that often. With the deadline that is missed, if
    /// only deadlines bound the times from above.
    Defeated(Vec<usize>, Option<DeadlineFailure>),
    /// Neither is proved.
    Undecided,
}

/// Bounds on the greatest number of failures that one strategy survives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultLimit {
    /// It survives so many; `None` if not even the durations in the box.
    pub at_least: Option<usize>,
    /// No strategy survives more; `None` if there is no proof for any number up to
    /// [`MAX_FAULTS`].
    pub at_most: Option<usize>,
}

/// Decides whether one strategy works for all durations and at most `k` failures.
pub fn decide(network: &FaultNetwork, k: usize) -> FaultVerdict {
    if let Some(layers) = Layers::new(network) {
        match layers.failure(k) {
            None => return FaultVerdict::Controllable,
            Some(missed) if layers.is_exact() => {
                return FaultVerdict::Defeated(missed.failures.clone(), Some(missed));
            }
            Some(_) => {}
        }
    }
    if stretched(network, k).is_some_and(|network| is_controllable(&network)) {
        return FaultVerdict::Controllable;
    }
    for failures in combinations(network, k) {
        let single = with_failures(network, &failures);
        if single.is_some_and(|network| !is_controllable(&network)) {
            return FaultVerdict::Defeated(failures, None);
        }
    }
    FaultVerdict::Undecided
}

/// Returns the greatest number of failures that one strategy survives, up to `most`. `flow` can end
/// the search.
pub fn fault_limit(
    network: &FaultNetwork,
    most: usize,
    flow: &mut dyn FnMut() -> ControlFlow<()>,
) -> FaultLimit {
    let mut limit = FaultLimit {
        at_least: None,
        at_most: None,
    };
    let mut undecided = 0;
    for k in 0..=most.min(MAX_FAULTS) {
        if flow().is_break() {
            break;
        }
        match decide(network, k) {
            FaultVerdict::Controllable if undecided == 0 => limit.at_least = Some(k),
            FaultVerdict::Controllable => {}
            FaultVerdict::Undecided => {
                undecided += 1;
                if undecided == MAX_UNDECIDED {
                    break;
                }
            }
            FaultVerdict::Defeated(..) => {
                limit.at_most = k.checked_sub(1);
                break;
            }
        }
    }
    limit
}

fn is_controllable(network: &UncertainNetwork) -> bool {
    match network.to_integer_network() {
        Some(whole) => whole.network.is_dynamically_controllable(),
        None => network.is_dynamically_controllable(),
    }
}

/// Returns combinations of at most `k` failures: all of them, or if these are too many, those of one
/// action each.
fn combinations(network: &FaultNetwork, k: usize) -> Vec<Vec<usize>> {
    let mut all = vec![vec![0; network.attempts.len()]];
    for (index, attempt) in network.attempts.iter().enumerate() {
        let mut more = Vec::new();
        for own in &all {
            let left = k - own.iter().sum::<usize>();
            for failures in 1..=attempt.retries.min(left) {
                let mut own = own.clone();
                own[index] = failures;
                more.push(own);
            }
        }
        all.extend(more);
        if all.len() > MAX_COMBINATIONS {
            return single_combinations(network, k);
        }
    }
    // Those with most failures are the hardest.
    all.sort_by_key(|own| std::cmp::Reverse(own.iter().sum::<usize>()));
    all
}

fn single_combinations(network: &FaultNetwork, k: usize) -> Vec<Vec<usize>> {
    let none = vec![0; network.attempts.len()];
    let mut all = vec![none.clone()];
    for (index, attempt) in network.attempts.iter().enumerate() {
        let failures = attempt.retries.min(k);
        if failures > 0 && all.len() <= MAX_COMBINATIONS {
            let mut own = none.clone();
            own[index] = failures;
            all.push(own);
        }
    }
    all
}
