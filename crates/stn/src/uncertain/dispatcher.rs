//! Executing a dispatchable network.

mod beyond;

use std::collections::BTreeSet;
use std::sync::Arc;

use elbowroom_num::Rational;

use super::graph::EdgeId;
use super::{Dispatchable, LinkId, Step};
use crate::{NodeId, Weight, WindowEnd, spend_step};

/// Executes a [`Dispatchable`] network by the rules of RTE* (Hunsberger & Posenato, ICAART 2024):
///
/// - a point may happen when all its predecessors have happened, its window has opened, and none of
///   its waits is active any more;
/// - a wait is over when the link's end has happened, or when its time is up;
/// - an event updates the windows of its neighbours only.
///
/// It has no clock: the caller reports events with their times, and queries the points that may
/// happen. An event costs time in proportion to the edges at its node.
#[derive(Clone, Debug)]
pub struct Dispatcher<W = Rational> {
    form: Arc<Dispatchable<W>>,
    happened: Vec<Option<W>>,
    /// For each node, how many of those before it have not happened.
    missing: Vec<u32>,
    /// For each node, those that wait for it to happen.
    after: Vec<Vec<NodeId>>,
    /// For each node that has not happened, its window, as far as events have shown it, and the
    /// edge that each end comes by.
    windows: Vec<[Option<(W, EdgeId)>; 2]>,
    /// For each node, its active waits. The waits of nodes that the world decides on are not
    /// enforced; they restrict the times that the remaining network allows.
    waits: Vec<Vec<ActiveWait<W>>>,
    /// For each link, the nodes with a wait for its end.
    waiting_for: Vec<Vec<NodeId>>,
    /// Nodes that the executor chooses and that have all behind them that must come before.
    ready: BTreeSet<NodeId>,
    /// Running links that may end later than their upper bound, each with its latest end; `None` if
    /// it has none.
    prolonged: Vec<(LinkId, Option<W>)>,
}

#[derive(Clone, Debug)]
struct ActiveWait<W> {
    link: LinkId,
    /// The time at which it is over at the latest; `None` if only the link's end ends it.
    until: Option<W>,
    edge: EdgeId,
}

/// Something happened outside its window.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Missed<W = Rational> {
    /// The event's node.
    pub node: NodeId,
    /// The end of the window that was missed.
    pub end: WindowEnd,
    /// Limit that this end of the window set.
    pub limit: W,
    /// By how much it was missed; positive.
    pub by: W,
    /// The path behind that end, from the event that it counts from.
    pub behind: Vec<Step<W>>,
    /// `true` if the time violates only the bounds of the link that ends at the node, and no other
    /// constraint. The remaining network may then still be executable: see [`Dispatcher::bears`].
    pub is_only_link: bool,
}

impl<W: Weight> Dispatcher<W> {
    /// Nothing has happened yet.
    pub fn new(form: Arc<Dispatchable<W>>) -> Self {
        let count = form.network().requirements().node_count();
        let mut missing = vec![0; count];
        let mut after = vec![Vec::new(); count];
        let mut ready = BTreeSet::new();
        for node in form.network().requirements().nodes() {
            if form.network().is_contingent(node) {
                continue;
            }
            for before in form.before(node) {
                after[before.index()].push(node);
                missing[node.index()] += 1;
            }
            if missing[node.index()] == 0 {
                ready.insert(node);
            }
        }
        Self {
            happened: vec![None; count],
            missing,
            after,
            windows: vec![[None, None]; count],
            waits: vec![Vec::new(); count],
            waiting_for: vec![Vec::new(); form.network().links().len()],
            ready,
            prolonged: Vec::new(),
            form,
        }
    }

    /// The dispatchable network that it executes.
    pub fn form(&self) -> &Dispatchable<W> {
        &self.form
    }

    /// The time at which a node happened.
    pub fn happened(&self, node: NodeId) -> Option<&W> {
        self.happened[node.index()].as_ref()
    }

    /// The nodes that the executor chooses and that have all behind them that must come before.
    pub fn ready(&self) -> impl Iterator<Item = NodeId> + '_ {
        self.ready.iter().copied()
    }

    /// Returns `true` if all predecessors of a node have happened.
    pub fn is_ready(&self, node: NodeId) -> bool {
        self.ready.contains(&node)
    }

    /// The window of a node that has not happened, as far as events have shown it: once it is
    /// ready it is all that there is to know.
    pub fn window(&self, node: NodeId) -> (Option<&W>, Option<&W>) {
        let [earliest, latest] = &self.windows[node.index()];
        (
            earliest.as_ref().map(|(time, _)| time),
            latest.as_ref().map(|(time, _)| time),
        )
    }

    /// When a ready node may happen if nothing happens before: its window is open then, and its
    /// waits are over.
    ///
    /// # Errors
    /// The link whose end it waits for however long that takes.
    pub fn earliest(&self, node: NodeId) -> Result<Option<&W>, LinkId> {
        let mut earliest = self.windows[node.index()][WindowEnd::Earliest as usize]
            .as_ref()
            .map(|(time, _)| time);
        for wait in self.own_waits(node) {
            let until = wait.until.as_ref().ok_or(wait.link)?;
            if earliest.is_none_or(|known| until > known) {
                earliest = Some(until);
            }
        }
        Ok(earliest)
    }

    /// The link whose end a node waits for longest at present.
    pub fn waits_for(&self, node: NodeId) -> Option<LinkId> {
        let waits = self.own_waits(node).iter();
        waits
            .max_by_key(|wait| (wait.until.is_none(), wait.until.clone()))
            .map(|wait| wait.link)
    }

    /// The waits of a node that the executor sees to.
    fn own_waits(&self, node: NodeId) -> &[ActiveWait<W>] {
        if self.form.network().is_contingent(node) {
            return &[];
        }
        &self.waits[node.index()]
    }

    /// The path that keeps a node from happening earlier, or later: from the event that it counts
    /// from.
    pub fn behind(&self, node: NodeId, end: WindowEnd) -> Vec<Step<W>> {
        let window = &self.windows[node.index()][end as usize];
        let mut last = window.as_ref().map(|(time, edge)| (time, *edge));
        if end == WindowEnd::Earliest {
            for wait in self.own_waits(node) {
                let is_later = match (&wait.until, &last) {
                    (Some(until), Some((time, _))) => until > *time,
                    _ => true,
                };
                if is_later {
                    let steps = self.form.behind(wait.edge);
                    return steps;
                }
            }
        }
        last.take()
            .map(|(_, edge)| self.form.behind(edge))
            .unwrap_or_default()
    }

    /// The node happens, or has been observed to have happened, at `time`. It is taken for a fact
    /// in any case.
    ///
    /// # Errors
    /// When that is outside its window.
    pub fn happen(&mut self, node: NodeId, time: &W) -> Result<(), Missed<W>> {
        let missed = self.missed(node, time);
        if self.happened[node.index()].replace(time.clone()).is_some() {
            return missed.map_or(Ok(()), Err);
        }
        self.ready.remove(&node);
        self.waits[node.index()].clear();
        for later in std::mem::take(&mut self.after[node.index()]) {
            let missing = &mut self.missing[later.index()];
            *missing -= 1;
            if *missing == 0 && self.happened[later.index()].is_none() {
                self.ready.insert(later);
            }
        }
        let form = Arc::clone(&self.form);
        for (to, bound, edge) in form.leaving(node) {
            self.limit(to, WindowEnd::Latest, &time.plus(bound), edge);
        }
        for (from, bound, edge) in form.entering(node) {
            self.limit(from, WindowEnd::Earliest, &time.minus(bound), edge);
        }
        for wait in form.waits_at(node) {
            let end = form.network().link(wait.link).end;
            if self.happened[wait.node.index()].is_none() && self.happened[end.index()].is_none() {
                self.waiting_for[wait.link.index()].push(wait.node);
                self.waits[wait.node.index()].push(ActiveWait {
                    link: wait.link,
                    until: wait.delay.as_ref().map(|delay| time.plus(delay)),
                    edge: wait.edge,
                });
            }
        }
        if let Some(link) = form.network().ending_at(node) {
            self.prolonged.retain(|(other, _)| *other != link);
            for waiting in std::mem::take(&mut self.waiting_for[link.index()]) {
                self.waits[waiting.index()].retain(|wait| wait.link != link);
            }
        }
        missed.map_or(Ok(()), Err)
    }

    /// A node may not happen before, or after, `time`.
    fn limit(&mut self, node: NodeId, end: WindowEnd, time: &W, edge: EdgeId) {
        let form = Arc::clone(&self.form);
        let mut limited = vec![(node, edge)];
        while let Some((node, edge)) = limited.pop() {
            spend_step();
            if self.happened[node.index()].is_some() {
                continue;
            }
            let known = &mut self.windows[node.index()][end as usize];
            let is_news = known.as_ref().is_none_or(|(known, _)| match end {
                WindowEnd::Earliest => time > known,
                WindowEnd::Latest => time < known,
            });
            if is_news {
                *known = Some((time.clone(), edge));
                if end == WindowEnd::Latest {
                    // The node waits for these although they may fall together.
                    limited.extend_from_slice(form.not_after(node));
                }
            }
        }
    }

    fn missed(&self, node: NodeId, time: &W) -> Option<Missed<W>> {
        let (earliest, latest) = self.bounds(node);
        let missed = |end, limit: &W, by: W| Missed {
            node,
            end,
            limit: limit.clone(),
            by,
            behind: self.behind(node, end),
            is_only_link: self.permits(node, time),
        };
        if let Some(earliest) = earliest.filter(|earliest| time < earliest) {
            return Some(missed(WindowEnd::Earliest, &earliest, earliest.minus(time)));
        }
        let latest = latest.filter(|latest| time > latest)?;
        Some(missed(WindowEnd::Latest, &latest, time.minus(&latest)))
    }

    /// The window of a node, with the bounds of the link that ends there.
    pub fn bounds(&self, node: NodeId) -> (Option<W>, Option<W>) {
        let (earliest, latest) = self.window(node);
        let (mut earliest, mut latest) = (earliest.cloned(), latest.cloned());
        if let Some(id) = self.form.network().ending_at(node) {
            let link = self.form.network().link(id);
            if let Some(begun) = self.happened(link.activation) {
                let least = begun.plus(&link.lower);
                let most = self.last_end(id, begun);
                earliest = earliest.into_iter().chain([least]).max();
                latest = latest.into_iter().chain(most).min();
            }
        }
        (earliest, latest)
    }
}
