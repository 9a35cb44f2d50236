//! The greatest value of a linear expression over the schedules of a network.
//!
//! `max Σ c_k t_k` subject to `t_to - t_from <= w` is the dual of a transshipment problem: send
//! flow along the constraints, `c_k` units into each node, at cost `w` a unit. Its cheapest flow is
//! found by successive shortest paths, exactly and without a tableau. The flow itself is the proof
//! of the maximum: the constraints, weighted by their flow, add up to it.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use elbowroom_num::Rational;
use elbowroom_stn::{
    ConsistentNetwork, Constraint, ConstraintId, Network, NodeId, Schedule, Weight,
};

/// The flow along each constraint with a non-zero flow.
pub(crate) type Flow = BTreeMap<ConstraintId, Rational>;

/// Net number of units that have to flow into each node; nodes with 0 are left out.
pub(crate) type Demand = BTreeMap<NodeId, Rational>;

/// Computes the cheapest flow that brings `demand[k]` units net into each node `k` (the demands add
/// up to zero). Also returns a schedule that maximises the expression, as differences to the
/// network's present schedule. `None` if there is no flow: then the expression is unbounded.
///
/// The search begins at the network's present schedule. The closer it is to a maximum, the shorter
/// the paths are. The workspace may only be shared by networks with the same first `lasting`
/// constraints.
pub(crate) fn cheapest<W: Weight>(
    network: &ConsistentNetwork<W>,
    lasting: usize,
    mut demand: Demand,
    workspace: &mut Workspace<W>,
) -> Option<(Flow, Vec<(NodeId, W)>)> {
    workspace.resize(network.network(), lasting);
    let mut search = Search {
        network,
        lasting,
        flow: Flow::new(),
        workspace,
    };
    if search.is_known_unsatisfiable(&demand) {
        return None;
    }
    let is_met = search.satisfy_demand(&mut demand);
    let flow = search.flow;
    let moved = workspace.take_moved();
    // No constraint is cheaper than the difference of its nodes' potentials.
    is_met.then_some((flow, moved))
}

/// One step of a path in the residual network.
#[derive(Clone, Copy, Debug)]
enum Step {
    /// More flow along the constraint.
    Along(ConstraintId),
    /// Less flow along the constraint.
    Back(ConstraintId),
}

/// Data about nodes during a search, reused to save allocations. Only `components` is kept between
/// searches.
#[derive(Debug)]
pub(crate) struct Workspace<W> {
    /// The potentials of nodes that differ from their times in the network's present schedule.
    potential: Vec<Option<W>>,
    /// The nodes with such a potential.
    moved: Vec<NodeId>,
    /// Result of the current search for a path, by node.
    reached: Vec<Option<Reached<W>>>,
    /// Nodes with an entry in `reached`.
    touched: Vec<NodeId>,
    /// For each node of a lasting constraint, the strongly connected component by these
    /// constraints, named by one node. Constraints lead to the same component, or to a greater one.
    components: Vec<NodeId>,
}

struct Search<'a, 'b, W> {
    network: &'a ConsistentNetwork<W>,
    lasting: usize,
    flow: Flow,
    /// Invariant: no residual step is cheaper than the difference of its nodes' potentials. A
    /// schedule `t` satisfies `t_to - t_from <= w`, so its times as potentials satisfy the
    /// invariant initially.
    workspace: &'b mut Workspace<W>,
}

/// Node that a path leads to.
#[derive(Clone, Debug)]
struct Reached<W> {
    distance: W,
    /// The last step, and the node before it; `None` at the source.
    step: Option<(Step, NodeId)>,
    is_final: bool,
}

impl<W> Default for Workspace<W> {
    fn default() -> Self {
        Self {
            potential: Vec::new(),
            moved: Vec::new(),
            reached: Vec::new(),
            touched: Vec::new(),
            components: Vec::new(),
        }
    }
}

impl<W: Weight> Workspace<W> {
    fn resize(&mut self, network: &Network<W>, lasting: usize) {
        let node_count = network.node_count();
        if self.components.is_empty() {
            let lasting = network.constraints()[..lasting].iter();
            let mut lasting = lasting.map(|constraint| (constraint.from, constraint.to));
            self.components = components(node_count, &mut lasting);
        }
        self.potential.resize_with(node_count, || None);
        self.reached.resize_with(node_count, || None);
    }

    /// Returns a node's potential, which is its time in the present schedule unless it was changed.
    fn potential<'a>(&'a self, node: NodeId, present: &'a Schedule<W>) -> &'a W {
        let own = self.potential[node.index()].as_ref();
        own.unwrap_or(&present[node])
    }

    /// Removes and returns the potentials that differ from the times of the present schedule.
    fn take_moved(&mut self) -> Vec<(NodeId, W)> {
        let moved = self.moved.drain(..);
        moved
            .filter_map(|node| Some((node, self.potential[node.index()].take()?)))
            .collect()
    }
}

impl<W: Weight> Search<'_, '_, W> {
    /// Returns `true` if [no flow](is_endless) meets the demand, as far as that is known without a
    /// search.
    fn is_known_unsatisfiable(&self, demand: &Demand) -> bool {
        let assumed = &self.network.network().constraints()[self.lasting..];
        let mut left = assumed.iter().map(|constraint| constraint.from);
        is_unsatisfiable(demand, &self.workspace.components, &mut left)
    }

    /// Meets the demand along one cheapest path after the other. Returns `false` if there is none.
    fn satisfy_demand(&mut self, demand: &mut Demand) -> bool {
        let sources = demand.iter().filter(|(_, amount)| amount.is_negative());
        let sources: Vec<NodeId> = sources.map(|(node, _)| *node).collect();
        // A source whose demand is met stays met.
        for source in sources {
            while let Some(left) = demand.get(&source).filter(|left| left.is_negative()) {
                let left = -left;
                let Some((sink, steps)) = self.nearest(source, demand) else {
                    return false;
                };
                let mut amount = left.min(demand[&sink].clone());
                for step in &steps {
                    if let Step::Back(id) = step {
                        amount = amount.min(self.flow[id].clone());
                    }
                }
                for step in &steps {
                    match step {
                        Step::Along(id) => *self.flow.entry(*id).or_default() += &amount,
                        Step::Back(id) => *self.flow.entry(*id).or_default() -= &amount,
                    }
                }
                *demand.entry(source).or_default() += &amount;
                *demand.entry(sink).or_default() -= &amount;
            }
        }
        true
    }

    /// Returns the node with open demand nearest to `source`, and the path to it. Dijkstra's
    /// algorithm with reduced costs; updates the potentials.
    ///
    /// Only nodes that are nearer take time. Potentials matter only by their differences, so those
    /// of the nearer nodes are lowered instead of raising all others.
    fn nearest(&mut self, source: NodeId, demand: &Demand) -> Option<(NodeId, Vec<Step>)> {
        let found = self.explore(source, demand);
        let workspace = &mut *self.workspace;
        let path = found.map(|(sink, reach)| {
            for node in &workspace.touched {
                if let Some(own) = &workspace.reached[node.index()]
                    && own.distance < reach
                {
                    let potential = &mut workspace.potential[node.index()];
                    let present = if let Some(present) = &*potential {
                        present
                    } else {
                        workspace.moved.push(*node);
                        &self.network.schedule()[*node]
                    };
                    *potential = Some(present.plus(&own.distance.minus(&reach)));
                }
            }
            let mut path = Vec::new();
            let mut node = sink;
            while let Some((step, before)) = workspace.reached[node.index()]
                .as_ref()
                .and_then(|it| it.step)
            {
                path.push(step);
                node = before;
            }
            (sink, path)
        });
        for node in workspace.touched.drain(..) {
            workspace.reached[node.index()] = None;
        }
        path
    }

    /// Searches for that node. Returns it with its distance.
    fn explore(&mut self, source: NodeId, demand: &Demand) -> Option<(NodeId, W)> {
        let (network, present) = (self.network.network(), self.network.schedule());
        let workspace = &mut *self.workspace;
        let is_wanted = |node: NodeId| demand.get(&node).is_some_and(Rational::is_positive);
        // Ties go to nodes with fewer steps, because many nodes may be as near as the source.
        let mut queue = BinaryHeap::from([Reverse((W::zero(), 0_u32, source))]);
        workspace.touched.push(source);
        workspace.reached[source.index()] = Some(Reached {
            distance: W::zero(),
            step: None,
            is_final: false,
        });
        while let Some(Reverse((distance, steps, node))) = queue.pop() {
            let own = workspace.reached[node.index()].as_mut()?;
            if std::mem::replace(&mut own.is_final, true) {
                continue;
            }
            if is_wanted(node) {
                return Some((node, distance));
            }
            let along = network
                .leaving(node)
                .map(|id| (Step::Along(id), network.constraint(id).to));
            let back = network
                .entering(node)
                .filter(|id| self.flow.get(id).is_some_and(Rational::is_positive))
                .map(|id| (Step::Back(id), network.constraint(id).from));
            for (step, far) in along.chain(back) {
                let known = &workspace.reached[far.index()];
                if known.as_ref().is_some_and(|known| known.is_final) {
                    continue;
                }
                let cost = match step {
                    Step::Along(id) => network.constraint(id).bound.clone(),
                    Step::Back(id) => network.constraint(id).bound.negated(),
                };
                let reduced = cost
                    .plus(workspace.potential(node, present))
                    .minus(workspace.potential(far, present));
                let candidate = distance.plus(&reduced);
                let known = &mut workspace.reached[far.index()];
                if known.is_none() {
                    workspace.touched.push(far);
                }
                if known.as_ref().is_none_or(|old| candidate < old.distance) {
                    // A node as near as the head of the queue is the nearest one. From a good
                    // schedule, many nodes are equally near, and need not be examined.
                    let is_nearest = candidate == distance && is_wanted(far);
                    if !is_nearest {
                        queue.push(Reverse((candidate.clone(), steps + 1, far)));
                    }
                    *known = Some(Reached {
                        distance: candidate,
                        step: Some((step, node)),
                        is_final: false,
                    });
                    if is_nearest {
                        return Some((far, distance));
                    }
                }
            }
        }
        None
    }
}

/// Returns, for each node, its strongly connected component by these constraints, named by one
/// node. Constraints lead to the same component, or to a greater one.
fn components(
    node_count: usize,
    constraints: &mut dyn Iterator<Item = (NodeId, NodeId)>,
) -> Vec<NodeId> {
    // Only the ends of the constraints matter, not their bounds.
    let mut network: Network<i128> = Network::with_nodes(node_count);
    for (from, to) in constraints {
        network.add(Constraint::at_most(from, to, 0));
    }
    let nodes: Vec<NodeId> = network.nodes().collect();
    let components = network.components();
    components.into_iter().map(|number| nodes[number]).collect()
}

/// Returns `true` if a set of nodes without outgoing constraints has a net demand to send units
/// out. There is then no flow, but the search for a path would visit the whole network before it
/// fails.
///
/// The sets considered are a component and all greater ones, provided that none of the nodes in
/// `left`, where other constraints begin, belongs to them.
fn is_unsatisfiable(
    demand: &Demand,
    components: &[NodeId],
    left: &mut dyn Iterator<Item = NodeId>,
) -> bool {
    let component = |node: NodeId| components.get(node.index()).copied();
    let left = left.filter_map(component).max();
    // Sums of demands by component.
    let mut inside = Demand::new();
    for (node, amount) in demand {
        if let Some(own) = component(*node).filter(|own| left.is_none_or(|left| *own > left)) {
            *inside.entry(own).or_default() += amount;
        }
    }
    let mut sum = Rational::ZERO;
    inside.values().rev().any(|amount| {
        sum += amount;
        sum.is_negative()
    })
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Returns a network of six nodes with the schedule 0, 1, 2, ….
    fn network(random: &mut ChaCha8Rng) -> Network<i64> {
        let mut network = Network::with_nodes(6);
        for _ in 0..random.random_range(4..12) {
            let [from, to] = [(); 2].map(|()| NodeId(random.random_range(0..6)));
            let least = i64::from(to.0) - i64::from(from.0);
            let bound = least + random.random_range(0..4);
            network.add(Constraint { from, to, bound });
        }
        network
    }

    #[test]
    fn unsatisfiable_demand_has_no_flow() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let (mut endless, mut unmet) = (0, 0);
        for _ in 0..20_000 {
            let own = network(&mut random);
            let lasting = random.random_range(0..=own.constraint_ids().len());
            let own = ConsistentNetwork::try_from(own).expect("it has a schedule");
            let mut demand = Demand::new();
            for _ in 0..random.random_range(1..4) {
                let amount = Rational::from(random.random_range(1..3));
                for sign in [1, -1] {
                    let node = NodeId(random.random_range(0..6));
                    *demand.entry(node).or_default() += &(&amount * &Rational::from(sign));
                }
            }
            let mut workspace = Workspace::default();
            workspace.resize(own.network(), lasting);
            let mut search = Search {
                network: &own,
                lasting,
                flow: Flow::new(),
                workspace: &mut workspace,
            };
            let is_endless = search.is_known_unsatisfiable(&demand);
            let is_met = search.satisfy_demand(&mut demand.clone());
            assert!(!(is_endless && is_met), "{own:?} {lasting} {demand:?}");
            endless += usize::from(is_endless);
            unmet += usize::from(!is_met);
        }
        assert!(
            endless > 1_000 && unmet > endless && unmet < 19_000,
            "{endless} of {unmet}"
        );
    }
}
