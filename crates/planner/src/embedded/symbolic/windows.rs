//! Times of a state that satisfy demands on numbers and [windows](super::super::windows).
//!
//! The network moves each happening to the earliest window that the other happenings allow. A
//! demand on numbers may need a later one: a robot that has to charge for longer arrives later. The
//! linear program decides between windows by branch and bound (Land & Doig, Econometrica 28, 1960).
//! Its relaxation allows all times from the first window of a happening to the last one. If the
//! solution places a happening in a gap between two windows, it has to be before the gap or after
//! it.

use elbowroom_num::Rational;

use super::super::network::{Network, NodeId, Within};
use super::super::time::Ticks;
use super::super::windows::Interval;
use super::program::Constraints;

/// Maximum number of linear programs for the windows of one state.
const MAX_PROGRAMS: u32 = 32;

/// As [`MAX_PROGRAMS`], for the last state of a plan.
const MAX_PROGRAMS_OF_PLAN: u32 = 1_024;

/// Times in windows.
struct Placement {
    /// Times of the happenings in the demands. They extend to times of all happenings.
    times: Vec<(NodeId, Rational)>,
    /// The interval of each constraint by windows.
    intervals: Vec<Interval>,
}

/// Returns times of the happenings in the demands that extend to times of all happenings, and
/// satisfy the constraints and the windows. Returns `None` if there are none, or none were found
/// within [`MAX_PROGRAMS`]. Happenings that cannot be in an early window for any times move to a
/// later one in the network.
pub(super) fn place(
    network: &mut Network,
    constraints: &Constraints<'_>,
) -> Option<Vec<(NodeId, Rational)>> {
    let mut programs = MAX_PROGRAMS;
    let placement = place_within(network, constraints, &mut programs)?;
    Some(placement.times)
}

/// Returns for the first and the last happening of each constraint by windows its earliest and its
/// latest time in the interval that was selected for it.
pub(super) fn node_bounds(
    network: &Network,
    constraints: &Constraints<'_>,
) -> Option<Vec<(NodeId, Interval)>> {
    if network.within().is_empty() {
        return Some(Vec::new());
    }
    let mut programs = MAX_PROGRAMS_OF_PLAN;
    let placement = place_within(&mut network.clone(), constraints, &mut programs)?;
    let selected = network.within().iter().zip(placement.intervals);
    let bounds = selected.flat_map(|(within, (begin, end))| {
        let latest = end - within.tail;
        [within.first, within.last].map(|node| (node, (begin, latest)))
    });
    Some(bounds.collect())
}

fn place_within(
    network: &mut Network,
    constraints: &Constraints<'_>,
    programs: &mut u32,
) -> Option<Placement> {
    loop {
        *programs = programs.checked_sub(1)?;
        let earliest = intervals(network, |_, current| current)?;
        let times = if earliest.is_empty() {
            constraints.times(network, &[])
        } else {
            constraints.times(&network.in_intervals(&earliest), &[])
        };
        if let Some(times) = times {
            return Some(Placement {
                times,
                intervals: earliest,
            });
        }
        if earliest.is_empty() {
            return None;
        }
        *programs = programs.checked_sub(1)?;
        let last_end = |within: &Within, (begin, end): Interval| {
            let last = network.fitting(*within).last();
            (begin, last.map_or(end, |last| last.1))
        };
        let relaxed = intervals(network, last_end)?;
        let constrained = network.within().iter();
        let nodes: Vec<NodeId> = constrained.flat_map(|w| [w.first, w.last]).collect();
        let times = constraints.times(&network.in_intervals(&relaxed), &nodes)?;
        let gap = match selected_intervals(network, constraints, &times) {
            Ok(intervals) => return Some(Placement { times, intervals }),
            Err(gap) => gap,
        };
        let mut before = network.clone();
        if let Some(latest) = gap.latest_before
            && before.lower_latest(gap.within.last, latest).is_ok()
            && let Some(placement) = place_within(&mut before, constraints, programs)
        {
            return Some(placement);
        }
        network.raise_earliest(gap.within.first, gap.end).ok()?;
    }
}

/// Returns an interval for each constraint by windows, derived from the one of the earliest times.
fn intervals(
    network: &Network,
    derive: impl Fn(&Within, Interval) -> Interval,
) -> Option<Vec<Interval>> {
    let constrained = network.within().iter();
    let intervals = constrained.map(|within| {
        let (current, _) = network.interval_of(*within)?;
        Some(derive(within, current))
    });
    intervals.collect()
}

/// A gap between two intervals that contains happenings.
struct Gap {
    within: Within,
    /// The latest time of the last happening in an interval before the gap.
    latest_before: Option<Ticks>,
    end: Ticks,
}

/// Returns the intervals that contain the happenings at these times, or the first gap that does.
fn selected_intervals(
    network: &Network,
    constraints: &Constraints<'_>,
    times: &[(NodeId, Rational)],
) -> Result<Vec<Interval>, Gap> {
    let scale = constraints.compiled.scale;
    let time_of = |node: NodeId| {
        let place = times.binary_search_by_key(&node, |entry| entry.0);
        let place = place.expect("the program contains all happenings with windows");
        &times[place].1
    };
    let mut gaps = Vec::new();
    let mut selected = Vec::new();
    for &within in network.within() {
        let (first, last) = (time_of(within.first), scale.ceil(time_of(within.last)).0);
        let mut latest_before = None;
        let interval = network.fitting(within).find(|(_, end)| {
            let is_reached = last <= end - within.tail;
            if !is_reached {
                latest_before = Some(end - within.tail);
            }
            is_reached
        });
        let interval = interval.expect("the last interval bounds all times");
        selected.push(interval);
        if interval.0 > scale.floor(first).0 {
            let gap = Gap {
                within,
                latest_before,
                end: interval.0,
            };
            gaps.push((first, gap));
        }
    }
    let earliest = gaps.into_iter().min_by(|left, right| left.0.cmp(right.0));
    earliest.map_or(Ok(selected), |(_, gap)| Err(gap))
}
