//! Execution of a dispatchable network.

mod bound_violation;

use std::collections::BTreeSet;
use std::sync::Arc;

use elbowroom_num::Rational;

use super::graph::EdgeId;
use super::{Dispatchable, LinkId, Step};
use crate::{NodeId, Weight, WindowEnd, count_step};

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
    /// For each node, the number of its predecessors that have not happened.
    missing: Vec<u32>,
    /// For each node, the nodes that wait for it.
    after: Vec<Vec<NodeId>>,
    /// For each node that has not happened, its window by the events so far, and the edge that
    /// implies each end.
    windows: Vec<[Option<(W, EdgeId)>; 2]>,
    /// For each node, its active waits. The waits of nodes that the world decides on are not
    /// enforced; they restrict the times that the remaining network allows.
    waits: Vec<Vec<ActiveWait<W>>>,
    /// For each link, the nodes with a wait for its end.
    waiting_for: Vec<Vec<NodeId>>,
    /// Nodes that the executor chooses and whose predecessors have all happened.
    ready: BTreeSet<NodeId>,
    /// Running links that may end later than their upper bound, each with its latest end; `None` if
    /// it has none.
    extended_links: Vec<(LinkId, Option<W>)>,
}

#[derive(Clone, Debug)]
struct ActiveWait<W> {
    link: LinkId,
    /// Latest end of the wait; `None` if only the link's end ends it.
    until: Option<W>,
    edge: EdgeId,
}

/// Event outside its window.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Missed<W = Rational> {
    /// The event's node.
    pub node: NodeId,
    /// The end of the window that was missed.
    pub end: WindowEnd,
    /// Limit that this end of the window set.
    pub limit: W,
    /// Amount of the violation; positive.
    pub amount: W,
    /// Path of constraints that implies the limit. It begins at the event to which the limit is
    /// relative.
    pub implying_path: Vec<Step<W>>,
    /// `true` if the time violates only the bounds of the link that ends at the node, and no other
    /// constraint. The remaining network may then still be executable: see [`Dispatcher::stays_executable`].
    pub is_only_link: bool,
}

impl<W: Weight> Dispatcher<W> {
    /// Creates a dispatcher without past events.
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
            extended_links: Vec::new(),
            form,
        }
    }

    /// Returns the dispatchable network that it executes.
    pub fn form(&self) -> &Dispatchable<W> {
        &self.form
    }

    /// Returns the time at which a node happened.
    pub fn event_time(&self, node: NodeId) -> Option<&W> {
        self.happened[node.index()].as_ref()
    }

    /// Returns the nodes that the executor chooses and whose predecessors have all happened.
    pub fn ready(&self) -> impl Iterator<Item = NodeId> + '_ {
        self.ready.iter().copied()
    }

    /// Returns `true` if all predecessors of a node have happened.
    pub fn is_ready(&self, node: NodeId) -> bool {
        self.ready.contains(&node)
    }

    /// Returns the window of a node that has not happened, by the events so far. Once the node is
    /// ready, the window is complete.
    pub fn window(&self, node: NodeId) -> (Option<&W>, Option<&W>) {
        let [earliest, latest] = &self.windows[node.index()];
        (
            earliest.as_ref().map(|(time, _)| time),
            latest.as_ref().map(|(time, _)| time),
        )
    }

    /// Returns the time at which a ready node may happen if nothing happens before: its window is
    /// open then, and its waits are over.
    ///
    /// # Errors
    /// The link whose end the node has to wait for without limit.
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

    /// Returns the link of the node's longest active wait.
    pub fn waits_for(&self, node: NodeId) -> Option<LinkId> {
        let waits = self.own_waits(node).iter();
        waits
            .max_by_key(|wait| (wait.until.is_none(), wait.until.clone()))
            .map(|wait| wait.link)
    }

    /// Returns the waits of a node that the executor enforces.
    fn own_waits(&self, node: NodeId) -> &[ActiveWait<W>] {
        if self.form.network().is_contingent(node) {
            return &[];
        }
        &self.waits[node.index()]
    }

    /// Returns the path that implies the earliest, or the latest, time of a node, from the event
    /// that it is relative to.
    pub fn implying_path(&self, node: NodeId, end: WindowEnd) -> Vec<Step<W>> {
        let window = &self.windows[node.index()][end as usize];
        let mut last = window.as_ref().map(|(time, edge)| (time, *edge));
        if end == WindowEnd::Earliest {
            for wait in self.own_waits(node) {
                let is_later = match (&wait.until, &last) {
                    (Some(until), Some((time, _))) => until > *time,
                    _ => true,
                };
                if is_later {
                    let steps = self.form.implying_path(wait.edge);
                    return steps;
                }
            }
        }
        last.take()
            .map(|(_, edge)| self.form.implying_path(edge))
            .unwrap_or_default()
    }

    /// Records that the node happens, or was observed, at `time`. The event is recorded in any
    /// case.
    ///
    /// # Errors
    /// If that is outside its window.
    pub fn record(&mut self, node: NodeId, time: &W) -> Result<(), Missed<W>> {
        let missed = self.violation(node, time);
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
            self.extended_links.retain(|(other, _)| *other != link);
            for waiting in std::mem::take(&mut self.waiting_for[link.index()]) {
                self.waits[waiting.index()].retain(|wait| wait.link != link);
            }
        }
        missed.map_or(Ok(()), Err)
    }

    /// Adds the limit that a node may not happen before, or after, `time`.
    fn limit(&mut self, node: NodeId, end: WindowEnd, time: &W, edge: EdgeId) {
        let form = Arc::clone(&self.form);
        let mut limited = vec![(node, edge)];
        while let Some((node, edge)) = limited.pop() {
            count_step();
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
                    // The node waits for these, although they may happen at the same time.
                    limited.extend_from_slice(form.not_after(node));
                }
            }
        }
    }

    fn violation(&self, node: NodeId, time: &W) -> Option<Missed<W>> {
        let (earliest, latest) = self.bounds(node);
        let missed = |end, limit: &W, by: W| Missed {
            node,
            end,
            limit: limit.clone(),
            amount: by,
            implying_path: self.implying_path(node, end),
            is_only_link: self.permits(node, time),
        };
        if let Some(earliest) = earliest.filter(|earliest| time < earliest) {
            return Some(missed(WindowEnd::Earliest, &earliest, earliest.minus(time)));
        }
        let latest = latest.filter(|latest| time > latest)?;
        Some(missed(WindowEnd::Latest, &latest, time.minus(&latest)))
    }

    /// Returns the window of a node, including the bounds of the link that ends there.
    pub fn bounds(&self, node: NodeId) -> (Option<W>, Option<W>) {
        let (earliest, latest) = self.window(node);
        let (mut earliest, mut latest) = (earliest.cloned(), latest.cloned());
        if let Some(id) = self.form.network().ending_at(node) {
            let link = self.form.network().link(id);
            if let Some(begun) = self.event_time(link.activation) {
                let least = begun.plus(&link.lower);
                let most = self.latest_end(id, begun);
                earliest = earliest.into_iter().chain([least]).max();
                latest = latest.into_iter().chain(most).min();
            }
        }
        (earliest, latest)
    }
}
