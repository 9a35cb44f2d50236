//! Strong controllability: times fixed beforehand.

use elbowroom_num::Rational;

use super::{Ground, LinkId, UncertainNetwork};
use crate::{Constraint, ConstraintId, Network, NodeId, Schedule, Weight};

/// Requirements that no fixed times satisfy for all durations of the links.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StrongConflict<W = Rational> {
    /// The requirements and the bounds of links that contradict each other, in the order of a
    /// cycle.
    pub grounds: Vec<Ground>,
    /// Length of the cycle; negative. `None` if it is unlimited, because a link has no upper bound.
    pub total: Option<W>,
}

/// Requirement between two points that the executor chooses, with the grounds that imply it.
struct Reduced<W> {
    from: NodeId,
    to: NodeId,
    /// `None` if a link without an upper bound makes it impossible.
    bound: Option<W>,
    grounds: Vec<Ground>,
}

impl<W: Weight> UncertainNetwork<W> {
    /// Returns times for the points that the executor chooses that satisfy every requirement
    /// whatever the links do. The ends of links get the times that they have at their lower bounds.
    ///
    /// A requirement on the end of a link has to hold at the link's worst bound, which leaves a
    /// simple network (Vidal & Fargier 1999).
    ///
    /// # Errors
    /// Requirements that contradict each other.
    pub fn strong(&self) -> Result<Schedule<W>, StrongConflict<W>> {
        let mut network = Network::with_nodes(self.requirements.node_count());
        let mut grounds = Vec::new();
        for id in self.requirements.constraint_ids() {
            let reduced = self.reduced(id);
            let Some(bound) = reduced.bound else {
                return Err(StrongConflict {
                    grounds: reduced.grounds,
                    total: None,
                });
            };
            if reduced.from == reduced.to {
                if bound < W::zero() {
                    return Err(StrongConflict {
                        grounds: reduced.grounds,
                        total: Some(bound),
                    });
                }
                continue;
            }
            network.add(Constraint {
                from: reduced.from,
                to: reduced.to,
                bound,
            });
            grounds.push(reduced.grounds);
        }
        match network.consistency() {
            Ok(mut schedule) => {
                for node in self.requirements.nodes() {
                    let (root, links) = self.chain(node);
                    let lower = links.iter().map(|&link| &self.link(link).lower);
                    let time = lower.fold(schedule[root].clone(), |time, lower| time.plus(lower));
                    schedule.set(node, time);
                }
                Ok(schedule)
            }
            Err(cycle) => Err(StrongConflict {
                grounds: cycle
                    .constraints
                    .iter()
                    .flat_map(|id| grounds[id.index()].clone())
                    .collect(),
                total: Some(cycle.total),
            }),
        }
    }

    /// Returns the executor's point that a node's time counts from, and the links between, in
    /// order.
    fn chain(&self, node: NodeId) -> (NodeId, Vec<LinkId>) {
        let mut links = Vec::new();
        let mut root = node;
        while let Some(link) = self.ending_at(root) {
            links.push(link);
            root = self.link(link).activation;
        }
        links.reverse();
        (root, links)
    }

    /// Returns a requirement in terms of the points that the executor chooses.
    fn reduced(&self, id: ConstraintId) -> Reduced<W> {
        let constraint = self.requirements.constraint(id);
        let (from, from_links) = self.chain(constraint.from);
        let (to, to_links) = self.chain(constraint.to);
        // Links before both points have the same duration for both.
        let shared = from_links
            .iter()
            .zip(&to_links)
            .take_while(|(one, other)| one == other)
            .count();
        let mut bound = Some(constraint.bound.clone());
        let mut grounds = vec![Ground::Requirement(id)];
        for &link in &from_links[shared..] {
            grounds.push(Ground::Early(link));
            bound = bound.map(|bound| bound.plus(&self.link(link).lower));
        }
        for &link in &to_links[shared..] {
            grounds.push(Ground::Late(link));
            let upper = self.link(link).upper.as_ref();
            bound = bound.zip(upper).map(|(bound, upper)| bound.minus(upper));
        }
        Reduced {
            from,
            to,
            bound,
            grounds,
        }
    }
}
