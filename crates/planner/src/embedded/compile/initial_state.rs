//! The initial situation in compiled form.

use elbowroom_model::{RunningAction, Situation};
use elbowroom_num::{End, Rational};

use super::Action;
use super::times::known_duration;
use crate::embedded::time::{Scale, Ticks};

/// A compiled situation: its state and its running actions.
#[derive(Clone, Debug)]
pub(crate) struct InitialState {
    /// Exact time.
    pub(crate) time: Rational,
    /// Facts by their compiled numbers. The truth of derived facts is not set.
    pub(crate) facts: Vec<bool>,
    pub(crate) values: Vec<Option<Rational>>,
    /// Cost so far, for the metric.
    pub(crate) cost: Rational,
    /// The running actions: the first actions, in their order.
    pub(crate) running: Vec<Running>,
}

/// A running action.
#[derive(Clone, Debug)]
pub(crate) struct Running {
    pub(crate) start: Ticks,
    /// Exact start time, which may be off the grid.
    pub(crate) exact_start: Rational,
    pub(crate) least: Ticks,
    pub(crate) most: Option<Ticks>,
    /// The duration, if only one is possible.
    pub(crate) duration: Option<Rational>,
}

/// Returns the running actions of a situation, and whether their times are on the grid.
pub(super) fn running(situation: &Situation, scale: Scale) -> (Vec<Running>, bool) {
    let mut is_exact = true;
    let running = situation.running.iter().map(|running| {
        let (running, exact) = one(running, &situation.time, scale);
        is_exact &= exact;
        running
    });
    (running.collect(), is_exact)
}

fn one(running: &RunningAction, now: &Rational, scale: Scale) -> (Running, bool) {
    let (start, start_is_exact) = scale.floor(&running.start);
    let (least, least_is_exact) = match &running.duration.lower {
        End::Infinite => (0, true),
        End::Closed(value) => scale.ceil(value),
        End::Open(value) => (scale.floor(value).0 + 1, false),
    };
    let elapsed = now - &running.start;
    let (most, most_is_exact) = match &running.duration.upper {
        End::Infinite => (None, true),
        End::Closed(value) => {
            let (ticks, is_exact) = scale.floor(value);
            (Some(ticks), is_exact)
        }
        End::Open(value) => (Some(scale.ceil(value).0 - 1), false),
    };
    // No value exists between two ticks: a duration that is still possible is rounded up to the
    // next one.
    let can_end = running
        .duration
        .upper
        .value()
        .is_none_or(|upper| *upper >= elapsed);
    let least = least.max(scale.ceil(&elapsed).0);
    let most = most.map(|most| if can_end { most.max(least) } else { most });
    let running = Running {
        start,
        exact_start: running.start.clone(),
        least,
        most,
        duration: known_duration(running).cloned(),
    };
    (running, start_is_exact && least_is_exact && most_is_exact)
}

/// Returns `true` if all fluents that change continuously at the beginning have a value.
pub(super) fn has_values_to_change(
    actions: &[Action],
    running: usize,
    values: &[Option<Rational>],
) -> bool {
    let flows = actions[..running].iter().flat_map(|action| &action.flows);
    flows
        .filter(|flow| flow.rate.value(values, None).is_some())
        .all(|flow| values[flow.fluent as usize].is_some())
}
