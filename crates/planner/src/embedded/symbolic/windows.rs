//! Times of a state that satisfy demands on numbers and [windows](super::super::windows).
//!
//! The network moves each happening to the earliest window that the other happenings allow. A
//! demand on numbers may need a later one: a robot that has to charge for longer arrives later. The
//! linear program decides between windows by diving, as in integer programming: its relaxation
//! allows all times from the first window of a happening to the last one. If the solution places a
//! happening in a gap between two windows, it has to be before the gap, or after it if the
//! relaxation then has no solution. Decisions are not revised. Before each decision, the happenings in the demands
//! move to a solution without windows, and all others to the next windows; most demands can be satisfied there.

use elbowroom_num::Rational;

use super::super::network::{Network, NodeId, Within};
use super::super::time::Ticks;
use super::super::windows::Interval;
use super::program::Constraints;

/// Maximum number of decisions between windows for one state. Not measured.
const MAX_DECISIONS: usize = 64;

/// Times in windows.
struct Placement {
    /// Times of the happenings in the demands. They extend to times of all happenings.
    times: Vec<(NodeId, Rational)>,
    /// The interval of each constraint by windows.
    intervals: Vec<Interval>,
}

/// Returns times of the happenings in the demands that extend to times of all happenings, and
/// satisfy the constraints and the windows. Returns `None` if there are none, or none were found
/// within [`MAX_DECISIONS`].
///
/// Happenings move to the selected windows in the network, and are no earlier from then on. So the
/// windows of a state are those of the state before, except for the new happenings. Some plans are
/// lost by that; in these problems, no search proves anything.
pub(super) fn place(
    network: &mut Network,
    constraints: &Constraints<'_>,
) -> Option<Vec<(NodeId, Rational)>> {
    if network.within().is_empty() {
        return constraints.times(network, &[]);
    }
    let placement = select(network.clone(), constraints)?;
    let constrained = network.within().to_vec();
    for (within, (begin, _)) in constrained.iter().zip(placement.intervals) {
        network.raise_earliest(within.first, begin).ok()?;
    }
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
    let placement = select(network.clone(), constraints)?;
    let selected = network.within().iter().zip(placement.intervals);
    let bounds = selected.flat_map(|(within, (begin, end))| {
        let latest = end - within.tail;
        [within.first, within.last].map(|node| (node, (begin, latest)))
    });
    Some(bounds.collect())
}

/// Selects an interval for each constraint by windows.
fn select(mut network: Network, constraints: &Constraints<'_>) -> Option<Placement> {
    for _ in 0..MAX_DECISIONS {
        let intervals = current_intervals(&network)?;
        if let Some(times) = constraints.times(&network.in_intervals(&intervals), &[]) {
            return Some(Placement { times, intervals });
        }
        let (relaxed, nodes) = relaxation(&network, &intervals);
        // Most states without times are detected without the happenings in windows.
        let times = constraints.times(&relaxed, &[])?;
        if let Some(placement) = place_later(&network, &times, constraints) {
            return Some(placement);
        }
        let times = constraints.times(&relaxed, &nodes)?;
        let gap = match selected_intervals(&network, &intervals, constraints, &times) {
            Ok(intervals) => return Some(Placement { times, intervals }),
            Err(gap) => gap,
        };
        match earlier_network(&network, &gap, constraints) {
            Some(earlier) => network = earlier,
            None => network.raise_earliest(gap.within.first, gap.end).ok()?,
        }
    }
    None
}

/// Selects the earliest intervals for which the happenings in the demands are no earlier than in `times`, if some
/// times in these intervals satisfy the demands.
fn place_later(
    network: &Network,
    times: &[(NodeId, Rational)],
    constraints: &Constraints<'_>,
) -> Option<Placement> {
    let mut later = network.clone();
    for (node, time) in times {
        let time = constraints.compiled.scale.ceil(time).0;
        later.raise_earliest(*node, time).ok()?;
    }
    let intervals = current_intervals(&later)?;
    let mut selected = network.clone();
    for (within, (begin, _)) in network.within().iter().zip(&intervals) {
        selected.raise_earliest(within.first, *begin).ok()?;
    }
    let times = constraints.times(&selected.in_intervals(&intervals), &[])?;
    Some(Placement { times, intervals })
}

/// Returns the network with the happenings before the gap, if the relaxed problem then has times.
fn earlier_network(network: &Network, gap: &Gap, constraints: &Constraints<'_>) -> Option<Network> {
    let mut earlier = network.clone();
    earlier
        .lower_latest(gap.within.last, gap.latest_before?)
        .ok()?;
    let intervals = current_intervals(&earlier)?;
    let (relaxed, _) = relaxation(&earlier, &intervals);
    constraints.times(&relaxed, &[]).map(|_| earlier)
}

/// Returns the interval of each constraint by windows at the earliest times.
fn current_intervals(network: &Network) -> Option<Vec<Interval>> {
    let constrained = network.within().iter();
    let intervals = constrained.map(|&within| Some(network.interval_of(within)?.0));
    intervals.collect()
}

/// Returns the network with happenings bounded by the beginning of their current interval and the
/// end of the last one. Also returns the happenings with a later interval.
fn relaxation(network: &Network, current: &[Interval]) -> (Network, Vec<NodeId>) {
    let mut nodes = Vec::new();
    let constrained = network.within().iter().zip(current);
    let relaxed = constrained.map(|(&within, &(begin, end))| {
        let last = network.fitting(within).last().map_or(end, |last| last.1);
        if last > end {
            nodes.extend([within.first, within.last]);
        }
        (begin, last)
    });
    let relaxed: Vec<Interval> = relaxed.collect();
    (network.in_intervals(&relaxed), nodes)
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
    current: &[Interval],
    constraints: &Constraints<'_>,
    times: &[(NodeId, Rational)],
) -> Result<Vec<Interval>, Gap> {
    let scale = constraints.compiled.scale;
    let time_of = |node: NodeId| {
        let place = times.binary_search_by_key(&node, |entry| entry.0);
        place.ok().map(|place| &times[place].1)
    };
    let mut gaps = Vec::new();
    let mut selected = Vec::new();
    for (&within, &current) in network.within().iter().zip(current) {
        let (Some(first), Some(last)) = (time_of(within.first), time_of(within.last)) else {
            // No later interval.
            selected.push(current);
            continue;
        };
        let last = scale.ceil(last).0;
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
