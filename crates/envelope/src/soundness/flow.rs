//! The greatest value of a linear expression over the schedules of a network.
//!
//! `max Σ c_k t_k` subject to `t_to - t_from <= w` is the dual of a transshipment problem: send
//! flow along the constraints, `c_k` units into each node, at cost `w` a unit. Its cheapest flow
//! is found by successive shortest paths, exactly and without a tableau, and the flow itself is
//! the proof of the maximum: the constraints, weighted by their flow, add up to it.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use elbowroom_num::Rational;
use elbowroom_stn::{ConsistentNetwork, ConstraintId, NodeId, Weight};

/// The flow along each constraint, by its number.
pub(crate) type Flow = Vec<Rational>;

/// The cheapest flow that brings `demand[k]` units net into each node `k` (the demands add up to
/// zero), and a schedule at which the expression is greatest; `None` if there is none: then it has
/// no greatest value.
///
/// The search begins at the network's present schedule. The nearer that is to such a one, the
/// shorter are the paths.
pub(crate) fn cheapest<W: Weight>(
    network: &ConsistentNetwork<W>,
    demand: &[Rational],
) -> Option<(Flow, Vec<W>)> {
    let mut search = Search {
        network,
        flow: vec![Rational::ZERO; network.network().constraints().len()],
        // A schedule `t` satisfies `t_to - t_from <= w`: reduced costs are non-negative from the
        // beginning.
        potential: network.schedule().times().to_vec(),
        reached: vec![None; network.network().node_count()],
        touched: Vec::new(),
    };
    let mut demand = demand.to_vec();
    // Where no more has to leave, nothing will have to later.
    let mut first = 0;
    while let Some(offset) = demand[first..].iter().position(Rational::is_negative) {
        let source = first + offset;
        first = source;
        let (sink, steps) = search.nearest(NodeId(u32::try_from(source).ok()?), &demand)?;
        let mut amount = (-&demand[source]).min(demand[sink.index()].clone());
        for step in &steps {
            if let Step::Back(id) = step {
                amount = amount.min(search.flow[id.index()].clone());
            }
        }
        for step in &steps {
            match step {
                Step::Along(id) => search.flow[id.index()] += &amount,
                Step::Back(id) => search.flow[id.index()] -= &amount,
            }
        }
        demand[source] += &amount;
        demand[sink.index()] -= &amount;
    }
    // No constraint is cheaper than the difference of its nodes' potentials.
    Some((search.flow, search.potential))
}

/// One step of a path in the residual network.
#[derive(Clone, Copy)]
enum Step {
    /// More flow along the constraint.
    Along(ConstraintId),
    /// Less flow along the constraint.
    Back(ConstraintId),
}

struct Search<'a, W> {
    network: &'a ConsistentNetwork<W>,
    flow: Flow,
    /// Invariant: no residual step is cheaper than the difference of its nodes' potentials.
    potential: Vec<W>,
    /// What is known of the nodes during a search for a path; nothing between two of them.
    reached: Vec<Option<Reached<W>>>,
    /// The nodes of which something is known.
    touched: Vec<NodeId>,
}

/// A node that a path leads to.
#[derive(Clone)]
struct Reached<W> {
    distance: W,
    /// The last step, and the node before it; `None` at the source.
    step: Option<(Step, NodeId)>,
    is_final: bool,
}

impl<W: Weight> Search<'_, W> {
    /// The node with open demand nearest to `source`, and the way there. Dijkstra's algorithm with
    /// reduced costs; the potentials are brought up to date.
    ///
    /// Takes time for the nodes that are nearer, and none for the others: potentials matter only by
    /// their differences, so those of the nearer ones are lowered instead of raising all.
    fn nearest(&mut self, source: NodeId, demand: &[Rational]) -> Option<(NodeId, Vec<Step>)> {
        let found = self.explore(source, demand);
        let path = found.map(|(sink, reach)| {
            for node in &self.touched {
                if let Some(own) = &self.reached[node.index()]
                    && own.distance < reach
                {
                    let potential = &mut self.potential[node.index()];
                    *potential = potential.plus(&own.distance.minus(&reach));
                }
            }
            let mut path = Vec::new();
            let mut node = sink;
            while let Some((step, before)) =
                self.reached[node.index()].as_ref().and_then(|it| it.step)
            {
                path.push(step);
                node = before;
            }
            (sink, path)
        });
        for node in self.touched.drain(..) {
            self.reached[node.index()] = None;
        }
        path
    }

    /// Looks for that node, and says how far it is.
    fn explore(&mut self, source: NodeId, demand: &[Rational]) -> Option<(NodeId, W)> {
        let network = self.network.network();
        let mut queue = BinaryHeap::from([Reverse((W::zero(), source))]);
        self.touched.push(source);
        self.reached[source.index()] = Some(Reached {
            distance: W::zero(),
            step: None,
            is_final: false,
        });
        while let Some(Reverse((distance, node))) = queue.pop() {
            let own = self.reached[node.index()].as_mut()?;
            if std::mem::replace(&mut own.is_final, true) {
                continue;
            }
            if demand[node.index()].is_positive() {
                return Some((node, distance));
            }
            let along = network
                .leaving(node)
                .map(|id| (Step::Along(id), network.constraint(id).to));
            let back = network
                .entering(node)
                .filter(|id| self.flow[id.index()].is_positive())
                .map(|id| (Step::Back(id), network.constraint(id).from));
            for (step, far) in along.chain(back) {
                let known = &mut self.reached[far.index()];
                if known.as_ref().is_some_and(|known| known.is_final) {
                    continue;
                }
                let cost = match step {
                    Step::Along(id) => network.constraint(id).bound.clone(),
                    Step::Back(id) => network.constraint(id).bound.negated(),
                };
                let reduced = cost
                    .plus(&self.potential[node.index()])
                    .minus(&self.potential[far.index()]);
                let candidate = distance.plus(&reduced);
                if known.is_none() {
                    self.touched.push(far);
                }
                if known.as_ref().is_none_or(|old| candidate < old.distance) {
                    // Nothing is nearer than what is no farther than the nearest of the queue: from
                    // a good schedule, many nodes are as near, and need not be looked at.
                    let is_nearest = candidate == distance && demand[far.index()].is_positive();
                    if !is_nearest {
                        queue.push(Reverse((candidate.clone(), far)));
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
