//! Executability of the remaining network after a link has violated its bounds.
//!
//! Each edge derived from the upper bound of a link ends at the link's activation, or at an earlier
//! time point. Each edge derived from its lower bound requires that something happens before the
//! link's end. While the link is running, both kinds of edges concern past events only. Edges
//! between time points that have not happened do not depend on the link's bounds. So if the bounds
//! turn out to be wrong, the network is still a dispatchable form of the remaining network. Two
//! checks are needed: each neighbour of a past event must have a non-empty window, and, while the
//! link is running, some time points have to wait for its end from now on.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use super::{ActiveWait, Dispatcher};
use crate::uncertain::graph::EdgeId;
use crate::uncertain::{Extended, LinkId};
use crate::{NodeId, Weight, WindowEnd, count_step};

impl<W: Weight> Dispatcher<W> {
    /// Returns the latest end of a link that began at `begun`; `None` if there is none.
    pub(super) fn latest_end(&self, id: LinkId, begun: &W) -> Option<W> {
        if let Some((_, until)) = self.extended_links.iter().find(|(other, _)| *other == id) {
            return until.clone();
        }
        let upper = self.form.network().link(id).upper.as_ref();
        upper.map(|upper| begun.plus(upper))
    }

    /// Returns `true` if a node that the world decides on may happen at `time` by all known
    /// constraints except the bounds of its own link.
    pub(super) fn permits(&self, node: NodeId, time: &W) -> bool {
        let has_happened = |node: &NodeId| self.happened[node.index()].is_some();
        let (earliest, latest) = self.window(node);
        let mut waits = self.waits[node.index()].iter();
        self.form.network().is_contingent(node)
            && earliest.is_none_or(|earliest| earliest <= time)
            && latest.is_none_or(|latest| time <= latest)
            && waits.all(|wait| wait.until.as_ref().is_some_and(|until| until <= time))
            && self.form.before(node).iter().all(has_happened)
    }

    /// Returns `true` if the remaining network is still executable after `node` has happened
    /// outside the bounds of its link, and [nothing else](super::Missed::is_only_link) was
    /// violated. Every neighbour can then still happen, now or later, and the executor satisfies
    /// every requirement as long as the other links stay within their bounds.
    pub fn stays_executable(&self, node: NodeId, now: &W) -> bool {
        let form = &self.form;
        let after = form.leaving(node).map(|(to, ..)| to);
        let before = form.entering(node).map(|(from, ..)| from);
        let mut moved: Vec<NodeId> = after.chain(before).collect();
        while let Some(node) = moved.pop() {
            if self.happened[node.index()].is_some() {
                continue;
            }
            if !self.can_still_happen(node, now) {
                return false;
            }
            moved.extend(form.not_after(node).iter().map(|(first, _)| *first));
        }
        true
    }

    /// Returns `true` if a node that has not happened can happen now or later, by its window, its
    /// waits and its link.
    fn can_still_happen(&self, node: NodeId, now: &W) -> bool {
        let Some((latest, _)) = &self.windows[node.index()][WindowEnd::Latest as usize] else {
            return true;
        };
        if latest < now {
            return false;
        }
        if let Some(id) = self.form.network().ending_at(node) {
            let activation = self.form.network().link(id).activation;
            // A link that is not running has to be activated in time, which the window of its
            // activation ensures.
            return self.event_time(activation).is_none_or(|begun| {
                let last = self.latest_end(id, begun);
                last.is_some_and(|last| last <= *latest)
            });
        }
        let earliest = self.earliest(node);
        earliest.is_ok_and(|earliest| earliest.is_none_or(|earliest| earliest <= latest))
    }

    /// Replaces the latest end of a running link by `until`, or removes it if `until` is `None`,
    /// whatever its upper bound. Time points that depended on that bound wait for the link's end
    /// from now on. Events in the future happen no earlier than `now`.
    ///
    /// Returns `false` and changes nothing if the executor could no longer guarantee every
    /// requirement, or if the link is not running.
    pub fn extend_link(&mut self, id: LinkId, until: Option<&W>, now: &W) -> bool {
        let last = until.cloned().map_or_else(Extended::infinity, Into::into);
        let Ok(waiting) = self.nodes_waiting(id, &last, now) else {
            return false;
        };
        let soonest = Extended::from(now.clone());
        for (node, time, edge) in waiting.known {
            if time <= soonest || self.event_time(node).is_some() {
                continue;
            }
            let known = &mut self.waits[node.index()];
            known.retain(|wait| wait.link != id);
            known.push(ActiveWait {
                link: id,
                until: time.into_finite(),
                edge,
            });
            self.waiting_for[id.index()].push(node);
        }
        self.extended_links.retain(|(other, _)| *other != id);
        self.extended_links.push((id, until.cloned()));
        true
    }

    /// Returns the latest time, `until` at most, that [`extend_link`](Self::extend_link) accepts as the
    /// latest end of a running link; `None` if there is none.
    pub fn extendable_until(&self, id: LinkId, until: &W, now: &W) -> Option<W> {
        let mut last = until.clone();
        while last >= *now {
            match self.nodes_waiting(id, &last.clone().into(), now) {
                Ok(_) => return Some(last),
                // All derived times move with it, so it has to be earlier by at least this much.
                Err(by) => last = last.minus(&by?.into_finite()?),
            }
        }
        None
    }

    /// Returns the nodes that have to wait for the end of a link that ends by `last`.
    ///
    /// # Errors
    /// If `last` is too late: by how much at least, or `None` if an earlier time would not help
    /// either.
    fn nodes_waiting(
        &self,
        id: LinkId,
        last: &Extended<W>,
        now: &W,
    ) -> Result<WaitPropagation<W>, Option<Extended<W>>> {
        let form = &self.form;
        let link = form.network().link(id);
        if self.event_time(link.activation).is_none() || self.event_time(link.end).is_some() {
            return Err(None);
        }
        let soonest = Extended::from(now.clone());
        let mut waiting = WaitPropagation::default();
        self.propagate_backwards(link.end, last, link.end, &mut waiting);
        while let Some((node, time, edge)) = waiting.next() {
            count_step();
            if let Some(happened) = self.event_time(node) {
                let happened = Extended::from(happened.clone());
                if time > happened {
                    return Err(Some(time.minus(&happened)));
                }
                continue;
            }
            if !self.can_still_happen(node, now) {
                return Err(None);
            }
            if time <= soonest {
                continue;
            }
            if let Some(other) = form.network().ending_at(node) {
                let other = form.network().link(other);
                let lower = Extended::from(other.lower.clone());
                if let Some(begun) = self.event_time(other.activation) {
                    let first_end = lower.plus(&begun.clone().into()).max(soonest.clone());
                    if time > first_end {
                        return Err(Some(time.minus(&first_end)));
                    }
                } else {
                    waiting.reach(other.activation, time.minus(&lower), edge);
                }
            }
            self.propagate_backwards(node, &time, link.end, &mut waiting);
        }
        Ok(waiting)
    }

    /// Propagates the earliest time of `node` backwards along edges that are not negative: their
    /// sources may not happen too long before `node`. Skips the end of the link itself.
    fn propagate_backwards(
        &self,
        node: NodeId,
        time: &Extended<W>,
        end: NodeId,
        waiting: &mut WaitPropagation<W>,
    ) {
        for (from, bound, edge) in self.form.entering(node) {
            if from != end && *bound >= W::zero() {
                waiting.reach(from, time.minus(&bound.clone().into()), edge);
            }
        }
    }
}

/// Nodes that have to wait for the end of a link.
struct WaitPropagation<W> {
    /// Nodes, each with the time until which it waits, as far as is known, and the edge that
    /// implies it.
    known: Vec<(NodeId, Extended<W>, EdgeId)>,
    /// Position of each node in that list.
    places: BTreeMap<NodeId, usize>,
    /// Nodes to process, the latest time first, so that each is processed once. The times are
    /// negated.
    open: BinaryHeap<Reverse<(Extended<W>, NodeId)>>,
}

impl<W: Weight> Default for WaitPropagation<W> {
    fn default() -> Self {
        Self {
            known: Vec::new(),
            places: BTreeMap::new(),
            open: BinaryHeap::new(),
        }
    }
}

impl<W: Weight> WaitPropagation<W> {
    fn reach(&mut self, node: NodeId, time: Extended<W>, edge: EdgeId) {
        let next = self.known.len();
        let place = *self.places.entry(node).or_insert(next);
        if self
            .known
            .get(place)
            .is_some_and(|(_, known, _)| time <= *known)
        {
            return;
        }
        self.open.push(Reverse((time.negated(), node)));
        match self.known.get_mut(place) {
            Some(known) => *known = (node, time, edge),
            None => self.known.push((node, time, edge)),
        }
    }

    /// Returns the next node, the time until which it waits, and the edge that implies it.
    fn next(&mut self) -> Option<(NodeId, Extended<W>, EdgeId)> {
        while let Some(Reverse((negated, node))) = self.open.pop() {
            count_step();
            let (_, time, edge) = &self.known[self.places[&node]];
            if time.negated() == negated {
                return Some((node, time.clone(), *edge));
            }
        }
        None
    }
}
