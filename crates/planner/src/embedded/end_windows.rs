//! Earliest and latest ends of the running actions, relative to the last choice, where choices come
//! in chronological order.

use super::compile::Compiled;
use super::network::SETTLED;
use super::state::State;
use super::time::{NEVER, Ticks};

/// Ends of the running actions relative to the last choice.
#[derive(Clone, Debug)]
pub(crate) struct EndWindows {
    /// The earliest time of the last choice. New happenings are no earlier.
    pub(crate) now: Ticks,
    /// For each running action, its earliest and its latest end if the last choice happens at
    /// [`now`](Self::now). If it happens later, all of them move equally.
    pub(crate) ends: Vec<(Ticks, Ticks)>,
}

impl EndWindows {
    pub(crate) fn of(compiled: &Compiled, state: &State) -> Self {
        let now = state.last.earliest(&state.network).max(compiled.now);
        let newest = state.last.node;
        let has_timed = (state.timed as usize) < compiled.timed.len() || compiled.windows.is_some();
        let network = &state.network;
        let is_closed = network.is_closed();
        let ends = state.open.iter().map(|open| {
            if open.node == SETTLED {
                let end = if open.most < NEVER {
                    open.start + open.most
                } else {
                    NEVER
                };
                return (now.max(open.start + open.least), end);
            }
            if newest == SETTLED || !is_closed {
                return (now, NEVER);
            }
            // The network bounds the distance between the start and the last choice.
            let shortest = match network.distance(newest, open.node) {
                back if back > -NEVER => (back + open.least).max(0),
                _ => 0,
            };
            // Timed initials do not move.
            if has_timed || open.most >= NEVER {
                return (now + shortest, NEVER);
            }
            let since = network.distance(open.node, newest).max(0);
            (now + shortest, now + open.most - since)
        });
        let ends = ends.collect();
        Self { now, ends }
    }
}
