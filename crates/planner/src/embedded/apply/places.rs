//! The place of a happening in time.

use super::super::compile::Snap;
use super::super::network::{NodeId, SETTLED};
use super::super::state::State;
use super::super::time::Ticks;
use super::Stepper;

/// When a happening may be.
pub(super) struct Place {
    pub(super) earliest: Ticks,
    pub(super) latest: Ticks,
    pub(super) after: Vec<(NodeId, Ticks)>,
}

impl Stepper<'_> {
    /// When the snap may happen, after all that was chosen before.
    pub(super) fn place(&self, state: &State, snap: &Snap) -> Place {
        let mut place = Place {
            earliest: self.compiled.now,
            latest: self.horizon,
            after: Vec::new(),
        };
        for &(stamp, distance) in &snap.after {
            place.earliest = place.earliest.max(state.stamps[stamp as usize] + distance);
        }
        for &(stamp, node) in &state.network.marks {
            if let Ok(found) = snap.after.binary_search_by_key(&stamp, |after| after.0) {
                place.after.push((node, snap.after[found].1));
            }
        }
        for &(timed, distance) in &snap.before_timed {
            if timed >= state.timed {
                let time = self.compiled.timed[timed as usize].time;
                place.latest = place.latest.min(time - distance);
            }
        }
        place
    }
}

/// Gives the happening its place in time. It is settled if nothing can push it and nothing
/// pushes back.
pub(super) fn insert(
    state: &mut State,
    settles: bool,
    snap: &Snap,
    place: &Place,
    is_unsettled: bool,
) -> Option<NodeId> {
    if !is_unsettled && place.after.is_empty() && settles {
        if place.earliest > place.latest {
            return None;
        }
        for &stamp in &snap.marks {
            let stamp = &mut state.stamps[stamp as usize];
            *stamp = (*stamp).max(place.earliest);
        }
        state.settled_end = state.settled_end.max(place.earliest);
        return Some(SETTLED);
    }
    let node = state
        .network
        .add_node(place.earliest, place.latest, &place.after)
        .ok()?;
    for &stamp in &snap.marks {
        state.network.mark(stamp, node);
    }
    Some(node)
}

/// Lets an action end whose end has been in the network since its start.
pub(super) fn reach_foreseen_end(
    state: &mut State,
    snap: &Snap,
    place: &Place,
    end: NodeId,
) -> Option<()> {
    for &(from, distance) in &place.after {
        state.network.add_edge(from, end, distance).ok()?;
    }
    state.network.delay(end, place.earliest).ok()?;
    state.network.hurry(end, place.latest).ok()?;
    for &stamp in &snap.marks {
        state.network.mark(stamp, end);
    }
    Some(())
}

/// Takes what nothing can push any more out of the network.
pub(super) fn settle(state: &mut State) {
    if state.network.is_empty() {
        return;
    }
    let open = &state.open;
    let mut nodes = open.iter().map(|open| open.node).filter(|&n| n != SETTLED);
    let end = state.network.earliest_end();
    let stamps = &mut state.stamps;
    let names = state.network.settle(&mut nodes, &mut |stamp, time| {
        let stamp = &mut stamps[stamp as usize];
        *stamp = (*stamp).max(time);
    });
    for open in &mut state.open {
        if open.node != SETTLED {
            open.node = names[open.node as usize];
        }
    }
    // At its earliest, what is left may be earlier than what was settled; but it cannot end
    // earlier than it does now.
    state.settled_end = state.settled_end.max(end);
}
