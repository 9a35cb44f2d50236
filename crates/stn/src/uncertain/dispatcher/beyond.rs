//! What happens beyond the bounds of a link, and whether the rest can be executed all the same.
//!
//! Everything that was found from the upper bound of a link is an edge to its activation, or to what comes before that;
//! everything that was found from its lower bound says what has to happen before its end. Once the link is under way,
//! both are about what has happened, and edges between time points that have not happened do not depend on its bounds. So
//! where they turn out to be wrong, the form stays a form of the rest. What remains to be seen is whether each time
//! point next to what has happened has room left, and, while the link goes on, which time points have to wait for its end
//! now.

use std::collections::{BTreeMap, BinaryHeap};
use std::sync::Arc;

use super::{ActiveWait, Dispatcher};
use crate::uncertain::graph::EdgeId;
use crate::uncertain::{Extended, LinkId};
use crate::{NodeId, Weight, WindowEnd};

impl<W: Weight> Dispatcher<W> {
    /// When a link that began then ends at the latest; `None` if there is no such time.
    pub(super) fn last_end(&self, id: LinkId, begun: &W) -> Option<W> {
        if let Some(until) = self.prolonged.get(&id) {
            return until.clone();
        }
        let upper = self.form.network().link(id).upper.as_ref();
        upper.map(|upper| begun.plus(upper))
    }

    /// Whether all that is known of a node that the world decides on permits that it happens then, but for the bounds of
    /// its own link.
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

    /// Whether all goes on to work after a node has happened outside the bounds of its link, and
    /// [nothing else](super::Missed::is_only_link): everything next to it can still happen, now or later, and whatever
    /// other links do within their bounds the executor satisfies every requirement.
    pub fn bears(&self, node: NodeId, now: &W) -> bool {
        let form = &self.form;
        let after = form.leaving(node).map(|(to, ..)| to);
        let before = form.entering(node).map(|(from, ..)| from);
        let mut moved: Vec<NodeId> = after.chain(before).collect();
        while let Some(node) = moved.pop() {
            if self.happened[node.index()].is_some() {
                continue;
            }
            if !self.has_room(node, now) {
                return false;
            }
            moved.extend(form.not_after(node).iter().map(|(first, _)| *first));
        }
        true
    }

    /// Whether a node that has not happened can happen now or later, as far as its window, its waits and its link know.
    fn has_room(&self, node: NodeId, now: &W) -> bool {
        let Some((latest, _)) = &self.windows[node.index()][WindowEnd::Latest as usize] else {
            return true;
        };
        if latest < now {
            return false;
        }
        if let Some(id) = self.form.network().ending_at(node) {
            let activation = self.form.network().link(id).activation;
            // What is not under way has to be begun in time: its activation has room, or not.
            return self.happened(activation).is_none_or(|begun| {
                let last = self.last_end(id, begun);
                last.is_some_and(|last| last <= *latest)
            });
        }
        let earliest = self.earliest(node);
        earliest.is_ok_and(|earliest| earliest.is_none_or(|earliest| earliest <= latest))
    }

    /// Takes a link that is under way for one that ends by `until`, or whenever it likes, whatever its upper bound says.
    /// Time points that could have relied on that bound wait for its end from now on. Nothing that has not happened
    /// happens before `now`.
    ///
    /// `false`, and nothing is changed, if the executor could not be sure any more to satisfy every requirement.
    pub fn prolong(&mut self, id: LinkId, until: Option<&W>, now: &W) -> bool {
        let form = Arc::clone(&self.form);
        let link = form.network().link(id);
        let until = until.cloned();
        let last = until.clone().map_or_else(Extended::infinity, Into::into);
        let soonest = Extended::from(now.clone());
        // For each node that has to wait for the link's end: until when, and the edge by which that follows.
        let mut waits: BTreeMap<NodeId, (Extended<W>, EdgeId)> = BTreeMap::new();
        // Latest first, so that what is found first of a node is what there is to find.
        let mut open: BinaryHeap<(Extended<W>, NodeId, EdgeId)> = BinaryHeap::new();
        let before = |time: &Extended<W>, node: NodeId| {
            let edges = form.entering(node);
            let edges = edges.filter(|(from, bound, _)| **bound >= W::zero() && *from != link.end);
            let times = edges.map(|(from, bound, edge)| {
                let bound = Extended::from(bound.clone());
                (time.minus(&bound), from, edge)
            });
            times.collect::<Vec<_>>()
        };
        open.extend(before(&last, link.end));
        while let Some((time, node, edge)) = open.pop() {
            if let Some(happened) = self.happened(node) {
                if time > Extended::from(happened.clone()) {
                    return false;
                }
                continue;
            }
            if !self.has_room(node, now) {
                return false;
            }
            if time <= soonest || waits.contains_key(&node) {
                continue;
            }
            if let Some(other) = form.network().ending_at(node) {
                let other = form.network().link(other);
                let lower = Extended::from(other.lower.clone());
                if let Some(begun) = self.happened(other.activation) {
                    let first_end = lower.plus(&begun.clone().into());
                    if time > first_end.max(soonest.clone()) {
                        return false;
                    }
                } else {
                    open.push((time.minus(&lower), other.activation, edge));
                }
            }
            open.extend(before(&time, node));
            waits.insert(node, (time, edge));
        }
        for (node, (time, edge)) in waits {
            let known = &mut self.waits[node.index()];
            known.retain(|wait| wait.link != id);
            known.push(ActiveWait {
                link: id,
                until: time.into_finite(),
                edge,
            });
            self.waiting_for[id.index()].push(node);
        }
        self.prolonged.insert(id, until);
        true
    }
}
