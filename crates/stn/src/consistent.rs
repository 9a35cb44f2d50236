//! A network with its proof of consistency, tightened and relaxed step by step.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use elbowroom_num::Rational;

use crate::{Constraint, ConstraintId, NegativeCycle, Network, NodeId, Schedule, Weight};

/// Network with a schedule that satisfies all its constraints.
#[derive(Clone, Debug)]
pub struct ConsistentNetwork<W = Rational> {
    network: Network<W>,
    schedule: Schedule<W>,
    repair: Repair<W>,
    /// The previous times of moved nodes, in order, if they are recorded.
    previous_times: Option<Vec<(NodeId, W)>>,
}

/// A snapshot of the size of a network, to go back to.
///
/// Checkpoints nest: going back to one makes all later ones void.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Checkpoint {
    node_count: usize,
    constraint_count: usize,
    /// Number of recorded moves.
    moves: usize,
}

impl<W: Weight> Default for ConsistentNetwork<W> {
    fn default() -> Self {
        Self::new()
    }
}

impl<W: Weight> TryFrom<Network<W>> for ConsistentNetwork<W> {
    type Error = NegativeCycle<W>;

    fn try_from(network: Network<W>) -> Result<Self, NegativeCycle<W>> {
        let schedule = network.consistency()?;
        let mut repair = Repair::default();
        repair.resize(network.node_count());
        Ok(Self {
            network,
            schedule,
            repair,
            previous_times: None,
        })
    }
}

impl<W: Weight> ConsistentNetwork<W> {
    /// Creates a network without nodes.
    pub fn new() -> Self {
        Self {
            network: Network::new(),
            schedule: Schedule::new(Vec::new()),
            repair: Repair::default(),
            previous_times: None,
        }
    }

    /// Creates the network with this schedule; `None` if the schedule violates a constraint.
    pub fn with_schedule(network: Network<W>, schedule: Schedule<W>) -> Option<Self> {
        if !schedule.holds_in(&network) {
            return None;
        }
        let mut repair = Repair::default();
        repair.resize(network.node_count());
        Some(Self {
            network,
            schedule,
            repair,
            previous_times: None,
        })
    }

    /// Returns the nodes and constraints.
    pub fn network(&self) -> &Network<W> {
        &self.network
    }

    /// Returns the network without the schedule.
    pub fn into_network(self) -> Network<W> {
        self.network
    }

    /// Returns a schedule that satisfies every constraint. It depends on the order of additions.
    pub fn schedule(&self) -> &Schedule<W> {
        &self.schedule
    }

    /// Adds a time point without constraints.
    pub fn add_node(&mut self) -> NodeId {
        let node = self.network.add_node();
        self.resize();
        node
    }

    /// Adds a time point without constraints that happens at `time` in the present schedule. It
    /// only moves when later constraints require it.
    pub fn add_node_at(&mut self, time: W) -> NodeId {
        let node = self.add_node();
        self.schedule.set(node, time);
        node
    }

    /// Adds a constraint, unless it contradicts the others. In that case the network stays as it
    /// was.
    ///
    /// Takes time in proportion to the nodes that the constraint moves (Cotton & Maler, SAT 2006).
    ///
    /// # Errors
    /// A cycle of negative length. Its first constraint is the rejected one, with the identifier
    /// that it would have received.
    pub fn add(&mut self, constraint: Constraint<W>) -> Result<ConstraintId, NegativeCycle<W>> {
        let before = self.checkpoint();
        let id = self.network.add(constraint);
        let repaired = self.repair.after_adding(
            id,
            &self.network,
            &mut self.schedule,
            &mut self.previous_times,
        );
        if let Err(cycle) = repaired {
            self.undo_to(before);
            return Err(cycle);
        }
        Ok(id)
    }

    /// Returns the current state, for [`undo_to`](Self::undo_to).
    pub fn checkpoint(&self) -> Checkpoint {
        Checkpoint {
            node_count: self.network.node_count(),
            constraint_count: self.network.constraints().len(),
            moves: self.previous_times.as_ref().map_or(0, Vec::len),
        }
    }

    /// Removes all nodes and constraints added since `checkpoint`.
    ///
    /// The schedule does not change: it also satisfies the remaining constraints.
    pub fn undo_to(&mut self, checkpoint: Checkpoint) {
        self.network
            .truncate(checkpoint.node_count, checkpoint.constraint_count);
        self.resize();
    }

    /// Records the times of nodes from now on, so that [`restore`](Self::restore) can restore
    /// them. All earlier checkpoints become invalid.
    pub fn record_times(&mut self) {
        self.previous_times = Some(Vec::new());
    }

    /// Returns the nodes that have moved since the recording of times began.
    pub fn moved(&self) -> impl Iterator<Item = NodeId> + '_ {
        self.previous_times.iter().flatten().map(|(node, _)| *node)
    }

    /// Like [`undo_to`](Self::undo_to), but also restores the times that nodes had at `checkpoint`,
    /// if they were [remembered](Self::record_times). Takes time in proportion to the moves since
    /// then.
    ///
    /// Without this call, times only ever decrease, a little with each constraint that is tried.
    /// With this call, their range is limited by the remaining constraints and those tried since.
    /// Machine integers can then be used as weights without overflow.
    pub fn restore(&mut self, checkpoint: Checkpoint) {
        for (node, time) in self
            .previous_times
            .iter_mut()
            .flat_map(|it| it.drain(checkpoint.moves..).rev())
        {
            if node.index() < self.network.node_count() {
                self.schedule.set(node, time);
            }
        }
        self.undo_to(checkpoint);
        debug_assert!(self.schedule.holds_in(&self.network));
    }

    /// Moves nodes to other times. All constraints have to hold at these times.
    pub fn reschedule(&mut self, times: impl IntoIterator<Item = (NodeId, W)>) {
        for (node, time) in times {
            if let Some(former) = &mut self.previous_times {
                former.push((node, self.schedule[node].clone()));
            }
            self.schedule.set(node, time);
        }
        debug_assert!(self.schedule.holds_in(&self.network));
    }

    fn resize(&mut self) {
        self.schedule.resize(self.network.node_count());
        self.repair.resize(self.network.node_count());
    }
}

/// Workspace of [`ConsistentNetwork::add`], reused to save allocations.
///
/// Invariant: between additions, nothing is proposed and the queue is empty.
#[derive(Clone, Debug)]
struct Repair<W> {
    /// An earlier time for a node, and the constraint that requires it.
    proposed: Vec<Option<(W, ConstraintId)>>,
    /// `true` if the proposed time is final.
    is_final: Vec<bool>,
    /// The nodes with a proposal.
    moved: Vec<NodeId>,
    /// Nodes to process, ordered by how much they move: the largest step back first.
    queue: BinaryHeap<Reverse<(W, NodeId)>>,
}

impl<W: Ord> Default for Repair<W> {
    fn default() -> Self {
        Self {
            proposed: Vec::new(),
            is_final: Vec::new(),
            moved: Vec::new(),
            queue: BinaryHeap::new(),
        }
    }
}

impl<W: Weight> Repair<W> {
    fn resize(&mut self, node_count: usize) {
        self.proposed.resize_with(node_count, || None);
        self.is_final.resize(node_count, false);
    }

    /// Moves nodes back in time until the constraint `added` also holds, if that is possible.
    fn after_adding(
        &mut self,
        added: ConstraintId,
        network: &Network<W>,
        schedule: &mut Schedule<W>,
        former: &mut Option<Vec<(NodeId, W)>>,
    ) -> Result<(), NegativeCycle<W>> {
        let outcome = self.propose(added, network, schedule);
        self.queue.clear();
        for node in self.moved.drain(..) {
            self.is_final[node.index()] = false;
            let proposed = self.proposed[node.index()].take();
            if let (Ok(()), Some((time, _))) = (&outcome, proposed) {
                if let Some(former) = former {
                    former.push((node, schedule[node].clone()));
                }
                schedule.set(node, time);
            }
        }
        outcome
    }

    /// Runs Dijkstra's algorithm over the slack of the constraints, from the new constraint's `to`.
    ///
    /// If the new constraint's `from` has to move, there is a negative cycle.
    fn propose(
        &mut self,
        added: ConstraintId,
        network: &Network<W>,
        schedule: &Schedule<W>,
    ) -> Result<(), NegativeCycle<W>> {
        let anchor = network.constraint(added).from;
        self.tighten(added, anchor, network, schedule)?;
        while let Some(Reverse((_, node))) = self.queue.pop() {
            if std::mem::replace(&mut self.is_final[node.index()], true) {
                continue;
            }
            for id in network.leaving(node) {
                self.tighten(id, anchor, network, schedule)?;
            }
        }
        Ok(())
    }

    /// Proposes an earlier time for the `to` of one constraint, if it needs one.
    fn tighten(
        &mut self,
        id: ConstraintId,
        anchor: NodeId,
        network: &Network<W>,
        schedule: &Schedule<W>,
    ) -> Result<(), NegativeCycle<W>> {
        let Constraint { from, to, bound } = network.constraint(id);
        if self.is_final[to.index()] {
            return Ok(());
        }
        let limit = self.time(*from, schedule).plus(bound);
        if limit >= *self.time(*to, schedule) {
            return Ok(());
        }
        let step = limit.minus(&schedule[*to]);
        if *to == anchor {
            let constraints = self.path(anchor, id, network);
            return Err(NegativeCycle {
                constraints,
                total: step,
            });
        }
        if self.proposed[to.index()].is_none() {
            self.moved.push(*to);
        }
        self.proposed[to.index()] = Some((limit, id));
        self.queue.push(Reverse((step, *to)));
        Ok(())
    }

    /// Returns the proposed time, or the present one.
    fn time<'a>(&'a self, node: NodeId, schedule: &'a Schedule<W>) -> &'a W {
        match &self.proposed[node.index()] {
            Some((time, _)) => time,
            None => &schedule[node],
        }
    }

    /// Returns the constraints that moved one node after the other, from `anchor` up to `last`.
    fn path(&self, anchor: NodeId, last: ConstraintId, network: &Network<W>) -> Vec<ConstraintId> {
        let mut path = vec![last];
        let mut node = network.constraint(last).from;
        while node != anchor {
            let (_, id) = self.proposed[node.index()]
                .as_ref()
                .expect("only nodes with a proposal move others");
            path.push(*id);
            node = network.constraint(*id).from;
        }
        path.reverse();
        path
    }
}
