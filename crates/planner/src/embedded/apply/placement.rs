//! Placement of happenings in time.

use super::super::compile::{Action, Snap};
use super::super::network::{NodeId, SETTLED, Within};
use super::super::state::{OpenAction, State};
use super::super::time::{NEVER, Ticks};
use super::super::tuning::Technique;
use super::Stepper;

/// The time window of a happening, and the nodes that it must follow.
pub(super) struct HappeningWindow {
    pub(super) earliest: Ticks,
    pub(super) latest: Ticks,
    pub(super) after: Vec<(NodeId, Ticks)>,
}

impl Stepper<'_> {
    /// Returns the time window of the snap after all earlier choices.
    pub(super) fn place(&self, state: &State, snap: &Snap) -> HappeningWindow {
        let mut place = HappeningWindow {
            earliest: self.compiled.now,
            latest: self.horizon,
            after: Vec::new(),
        };
        for &(annotation, distance) in &snap.after {
            place.earliest = place
                .earliest
                .max(state.annotations[annotation as usize] + distance);
        }
        for &(annotation, node) in &state.network.marks {
            if let Ok(found) = snap
                .after
                .binary_search_by_key(&annotation, |after| after.0)
            {
                place.after.push((node, snap.after[found].1));
            }
        }
        if self.is_chronological {
            place.earliest = place.earliest.max(state.last.floor);
            if state.last.node != SETTLED {
                place.after.push((state.last.node, 0));
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

    /// Adds the happening to the moment that is not yet complete, if there is one.
    pub(super) fn join(&mut self, state: &mut State, node: NodeId) -> Option<()> {
        self.newest = node;
        let Some(joint) = state.joint.filter(|joint| joint.node != node) else {
            return Some(());
        };
        if node == SETTLED {
            return None;
        }
        state.network.add_edge(joint.node, node, 0).ok()?;
        state.network.add_edge(node, joint.node, 0).ok()
    }

    /// Records the last choice, if choices come in chronological order. Running actions end no
    /// earlier than it.
    pub(super) fn record_last(
        &mut self,
        state: &mut State,
        node: NodeId,
        place: &HappeningWindow,
    ) -> Option<()> {
        self.join(state, node)?;
        if !self.is_chronological {
            return Some(());
        }
        state.last.node = node;
        if node == SETTLED {
            state.last.floor = place.earliest;
            return Some(());
        }
        let State { network, open, .. } = state;
        for open in open.iter().filter(|open| open.most < NEVER) {
            if open.node == SETTLED {
                network.lower_latest(node, open.start + open.most).ok()?;
            } else {
                network.add_edge(node, open.node, -open.most).ok()?;
            }
        }
        Some(())
    }

    /// Constrains the ends of the new running action and the others. If the end of one breaks the
    /// over-all condition of another, the other must have ended by then.
    pub(super) fn constrain_nested_ends(&self, state: &mut State, new: &OpenAction) -> Option<()> {
        if !self.compiled.tuning.uses(Technique::Nesting) {
            return Some(());
        }
        let State { network, open, .. } = state;
        for other in open.iter() {
            for (inner, outer) in [(new, other), (other, new)] {
                let is_bounded = inner.node != SETTLED && outer.node != SETTLED;
                if is_bounded && outer.most < NEVER && self.breaks(outer.action, inner.action) {
                    let distance = inner.least - outer.most;
                    network.add_edge(inner.node, outer.node, distance).ok()?;
                }
            }
        }
        Some(())
    }

    /// Returns `true` if the end of one action makes the over-all condition of another false.
    fn breaks(&self, ending: u32, running: u32) -> bool {
        let end = self.compiled.snap(self.compiled.action(ending).end);
        let over_all = &self.compiled.action(running).over_all.literals;
        over_all.iter().any(|literal| {
            let breaking = if literal.truth() {
                &end.deletes
            } else {
                &end.adds
            };
            breaking.contains(&literal.fact())
        })
    }
}

/// Places a timed initial after the last choice and before all later ones.
pub(super) fn place_timed(state: &mut State, time: Ticks) -> Option<()> {
    if state.last.node == SETTLED {
        if state.last.floor > time {
            return None;
        }
    } else {
        state.network.lower_latest(state.last.node, time).ok()?;
    }
    state.last.floor = time;
    Some(())
}

/// Inserts the happening into the network. It is settled if no other happening can delay it and it
/// delays no other happening.
pub(super) fn insert(
    state: &mut State,
    settles: bool,
    snap: &Snap,
    place: &mut HappeningWindow,
    is_unsettled: bool,
) -> Option<NodeId> {
    if !is_unsettled && place.after.is_empty() && settles {
        if let Some(windows) = snap.dates.windows {
            place.earliest = state.network.in_window(windows, place.earliest)?;
        }
        if place.earliest > place.latest {
            return None;
        }
        for &annotation in &snap.marks {
            let annotation = &mut state.annotations[annotation as usize];
            *annotation = (*annotation).max(place.earliest);
        }
        state.settled_end = state.settled_end.max(place.earliest);
        return Some(SETTLED);
    }
    let node = state
        .network
        .add_node(place.earliest, place.latest, &place.after)
        .ok()?;
    for &annotation in &snap.marks {
        state.network.mark(annotation, node);
    }
    keep_in_windows(state, snap, node)?;
    Some(node)
}

/// Keeps a happening in the windows of its condition.
pub(super) fn keep_in_windows(state: &mut State, snap: &Snap, node: NodeId) -> Option<()> {
    let Some(windows) = snap.dates.windows else {
        return Some(());
    };
    let within = Within {
        windows,
        tail: 0,
        first: node,
        last: node,
    };
    state.network.keep_within(within).ok()
}

/// Keeps two happenings of an action in one window of its over-all condition, with `tail` remaining
/// after the second one.
pub(super) fn keep_within(
    state: &mut State,
    action: &Action,
    [first, last]: [NodeId; 2],
    tail: Ticks,
) -> Option<()> {
    let Some(windows) = action.dates.windows else {
        return Some(());
    };
    let within = Within {
        windows,
        tail,
        first,
        last,
    };
    state.network.keep_within(within).ok()
}

/// Ends an action whose end has been in the network since its start.
pub(super) fn place_known_end(
    state: &mut State,
    snap: &Snap,
    place: &HappeningWindow,
    end: NodeId,
) -> Option<()> {
    for &(from, distance) in &place.after {
        state.network.add_edge(from, end, distance).ok()?;
    }
    state.network.raise_earliest(end, place.earliest).ok()?;
    state.network.lower_latest(end, place.latest).ok()?;
    for &annotation in &snap.marks {
        state.network.mark(annotation, end);
    }
    Some(())
}

/// Projects the network to the nodes that later happenings depend on, if choices come in
/// chronological order: the last choice, the running actions, the marks, and happenings that may
/// move to a later window. Marks that precede the last choice by at least `longest_distance` are
/// dropped, since no later happening needs a separation from them.
pub(super) fn project_past(state: &mut State, longest_distance: Ticks) {
    let last = state.last.node;
    if last == SETTLED || state.open.iter().all(|open| open.node == SETTLED) {
        return settle_all(state);
    }
    let mut kept = vec![last];
    let others = state.open.iter().map(|open| open.node);
    kept.extend(others.filter(|&node| node != SETTLED && node != last));
    for &(_, node) in &state.network.marks {
        if !kept.contains(&node) {
            kept.push(node);
        }
    }
    let network = &mut state.network;
    // Happenings that may have to move to a later window.
    let is_reached = network.reach(kept.iter().copied());
    for within in network.within() {
        for node in [within.first, within.last] {
            if is_reached[node as usize] && !kept.contains(&node) {
                kept.push(node);
            }
        }
    }
    let rename = |node: NodeId, names: &[NodeId]| match node {
        SETTLED => SETTLED,
        node => names[node as usize],
    };
    let names = network.project(&kept);
    state.last.node = rename(last, &names);
    for open in &mut state.open {
        open.node = rename(open.node, &names);
    }
    let last = state.last.node;
    let marks = std::mem::take(&mut network.marks);
    let is_near = |node: NodeId| network.distance(node, last) < longest_distance;
    network.marks = marks.into_iter().filter(|mark| is_near(mark.1)).collect();
}

/// Settles all choices at their earliest times.
fn settle_all(state: &mut State) {
    if state.network.is_empty() {
        return;
    }
    state.settled_end = state.settled_end.max(state.network.earliest_end());
    state.last.floor = state.last.earliest(&state.network);
    state.last.node = SETTLED;
    let annotations = &mut state.annotations;
    state.network.settle_all(&mut |annotation, time| {
        let annotation = &mut annotations[annotation as usize];
        *annotation = (*annotation).max(time);
    });
}

/// Removes the happenings that can no longer be delayed from the network.
pub(super) fn settle(state: &mut State) {
    if state.network.is_empty() {
        return;
    }
    let open = &state.open;
    let mut nodes = open.iter().map(|open| open.node).filter(|&n| n != SETTLED);
    let end = state.network.earliest_end();
    let annotations = &mut state.annotations;
    let names = state.network.settle(&mut nodes, &mut |annotation, time| {
        let annotation = &mut annotations[annotation as usize];
        *annotation = (*annotation).max(time);
    });
    for open in &mut state.open {
        if open.node != SETTLED {
            open.node = names[open.node as usize];
        }
    }
    // The earliest end of the remaining network may be before settled happenings, but the plan
    // cannot end before `end`.
    state.settled_end = state.settled_end.max(end);
}
