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
/// zero), or `None` if there is none: then the expression has no greatest value.
pub(crate) fn cheapest<W: Weight>(
    network: &ConsistentNetwork<W>,
    demand: &[Rational],
) -> Option<Flow> {
    let mut search = Search {
        network,
        flow: vec![Rational::ZERO; network.network().constraints().len()],
        // A schedule `t` satisfies `t_to - t_from <= w`: reduced costs are non-negative from the
        // beginning.
        potential: network.schedule().times().to_vec(),
    };
    let mut demand = demand.to_vec();
    while let Some(source) = demand.iter().position(Rational::is_negative) {
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
    Some(search.flow)
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
}

impl<W: Weight> Search<'_, W> {
    /// The node with open demand nearest to `source`, and the way there. Dijkstra's algorithm with
    /// reduced costs; the potentials are brought up to date.
    fn nearest(&mut self, source: NodeId, demand: &[Rational]) -> Option<(NodeId, Vec<Step>)> {
        let network = self.network.network();
        let count = network.node_count();
        let mut distances: Vec<Option<W>> = vec![None; count];
        let mut steps: Vec<Option<(Step, NodeId)>> = vec![None; count];
        let mut is_final = vec![false; count];
        let mut queue = BinaryHeap::from([Reverse((W::zero(), source))]);
        distances[source.index()] = Some(W::zero());
        let mut sink = None;
        while let Some(Reverse((distance, node))) = queue.pop() {
            if std::mem::replace(&mut is_final[node.index()], true) {
                continue;
            }
            if demand[node.index()].is_positive() {
                sink = Some((node, distance));
                break;
            }
            let along = network
                .leaving(node)
                .map(|id| (Step::Along(id), network.constraint(id).to));
            let back = network
                .entering(node)
                .filter(|id| self.flow[id.index()].is_positive())
                .map(|id| (Step::Back(id), network.constraint(id).from));
            for (step, far) in along.chain(back) {
                if is_final[far.index()] {
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
                if distances[far.index()]
                    .as_ref()
                    .is_none_or(|old| candidate < *old)
                {
                    queue.push(Reverse((candidate.clone(), far)));
                    distances[far.index()] = Some(candidate);
                    steps[far.index()] = Some((step, node));
                }
            }
        }
        let (sink, reach) = sink?;
        for (potential, distance) in self.potential.iter_mut().zip(&distances) {
            let moved = distance
                .as_ref()
                .map_or(&reach, |distance| distance.min(&reach));
            *potential = potential.plus(moved);
        }
        let mut path = Vec::new();
        let mut node = sink;
        while let Some((step, before)) = steps[node.index()] {
            path.push(step);
            node = before;
        }
        Some((sink, path))
    }
}
