//! Temporal network of a plan with uncontrollable durations.

use elbowroom_num::Rational;
use elbowroom_stn::uncertain::{ContingentLink, UncertainNetwork};
use elbowroom_stn::{ConstraintId, Network};

use crate::decoupled_envelope::DecoupledEnvelope;
use crate::network::network_node;
use crate::parameter::ParametrizedPlan;
use crate::stn_plan::{Bound, Constraint, Node, NodeId, StnPlan};
use crate::valuation::ParameterId;

/// Interpretation of a plan's constraint for an executor: a requirement or a contingent link.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ConstraintRole {
    /// The executor has to satisfy `lower <= to - from <= upper`; `None` means no bound.
    Requirement {
        /// Least difference.
        lower: Option<Rational>,
        /// Greatest difference.
        upper: Option<Rational>,
    },
    /// The world decides the difference between `lower` and `upper`. It is observed when `to`
    /// happens.
    Contingent {
        /// Least difference; not negative.
        lower: Rational,
        /// Greatest difference; `None` if there is none.
        upper: Option<Rational>,
    },
    /// The constraint cannot be satisfied: it depends on a value that is never observed and has no
    /// limit.
    Impossible,
}

impl ConstraintRole {
    /// Returns the requirement of exactly this difference.
    pub fn exactly(difference: &Rational) -> Self {
        Self::Requirement {
            lower: Some(difference.clone()),
            upper: Some(difference.clone()),
        }
    }
}

/// A plan's network, and the origins of its parts. Nodes keep their positions.
#[derive(Clone, Debug)]
pub struct PlanNetwork {
    /// The network.
    pub network: UncertainNetwork,
    /// For each requirement, the position of its constraint in the plan; `None` if it only requires
    /// that a node is at 0 or later.
    pub requirements: Vec<Option<usize>>,
    /// For each contingent link, the position of its constraint in the plan.
    pub links: Vec<usize>,
}

/// A constraint that cannot be satisfied ([`ConstraintRole::Impossible`]), by position in the plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Impossible(pub usize);

impl PlanNetwork {
    /// Returns the plan's constraint of a requirement.
    pub fn constraint_of(&self, id: ConstraintId) -> Option<usize> {
        self.requirements.get(id.index()).copied().flatten()
    }
}

impl StnPlan {
    /// Returns the plan as a network. `reading` interprets each constraint.
    ///
    /// Only durations of actions and times of timed initials can be contingent. Each has one node
    /// that the world decides. A second contingent reading of the same node counts as a
    /// requirement.
    ///
    /// # Errors
    /// A constraint that cannot be satisfied.
    pub fn uncertain_network(
        &self,
        reading: &dyn Fn(&Constraint) -> ConstraintRole,
    ) -> Result<PlanNetwork, Impossible> {
        let mut network = Network::with_nodes(self.nodes.len());
        let mut requirements = Vec::new();
        let mut links: Vec<ContingentLink> = Vec::new();
        let mut sources = Vec::new();
        let mut is_end = vec![false; self.nodes.len()];
        for (index, constraint) in self.constraints.iter().enumerate() {
            let (from, to) = (network_node(constraint.from), network_node(constraint.to));
            let (lower, upper) = match reading(constraint) {
                ConstraintRole::Impossible => return Err(Impossible(index)),
                ConstraintRole::Contingent { lower, upper }
                    if self.is_controlled_by_world(constraint) && !is_end[to.index()] =>
                {
                    is_end[to.index()] = true;
                    links.push(ContingentLink {
                        activation: from,
                        end: to,
                        lower,
                        upper,
                    });
                    sources.push(index);
                    continue;
                }
                ConstraintRole::Contingent { lower, upper } => (Some(lower), upper),
                ConstraintRole::Requirement { lower, upper } => (lower, upper),
            };
            if let Some(lower) = lower {
                network.add(elbowroom_stn::Constraint::at_least(from, to, lower));
                requirements.push(Some(index));
            }
            if let Some(upper) = upper {
                network.add(elbowroom_stn::Constraint::at_most(from, to, upper));
                requirements.push(Some(index));
            }
        }
        let zero = network_node(NodeId::ZERO);
        for (node, _) in self.nodes().skip(1) {
            if !is_end[node.index()] {
                let node = network_node(node);
                network.add(elbowroom_stn::Constraint::at_least(
                    zero,
                    node,
                    Rational::ZERO,
                ));
                requirements.push(None);
            }
        }
        Ok(PlanNetwork {
            network: UncertainNetwork::new(network, links)
                .expect("links lead from starts to ends, or from zero to timed initials"),
            requirements,
            links: sources,
        })
    }

    /// Returns `true` if a constraint bounds a difference that the world can decide: the duration
    /// of an action, or the time of a timed initial.
    pub fn is_controlled_by_world(&self, constraint: &Constraint) -> bool {
        let node = |id: NodeId| self.nodes[id.index()];
        match (node(constraint.from), node(constraint.to)) {
            (Node::Start(start), Node::End(end)) => start == end,
            (Node::Zero, Node::Timed(_)) => true,
            _ => false,
        }
    }
}

impl ParametrizedPlan {
    /// Returns the interpretation of a constraint for an executor. The executor knows that each
    /// parameter is in its interval. It commands the planned duration at an action's start if the
    /// duration is not uncertain ([`commanded_durations`](Self::commanded_durations)). It observes the value of a duration when
    /// the action ends, the time of a timed initial when it happens, and other bounds never.
    ///
    /// A parameter that bounds several differences may have a different value in each. This is
    /// stricter than necessary.
    pub fn role(&self, constraint: &Constraint, envelope: &DecoupledEnvelope) -> ConstraintRole {
        if let Some(planned) = self.commanded_duration(constraint) {
            return ConstraintRole::exactly(planned);
        }
        let least = |id: ParameterId| envelope.interval(id).lower.value().cloned();
        let greatest = |id: ParameterId| envelope.interval(id).upper.value().cloned();
        if let (Bound::Parameter(lower), Bound::Parameter(upper)) =
            (&constraint.lower, &constraint.upper)
            && lower == upper
            && self.plan.is_controlled_by_world(constraint)
            && let Some(least) = least(*lower).filter(|least| !least.is_negative())
        {
            return ConstraintRole::Contingent {
                lower: least,
                upper: greatest(*lower),
            };
        }
        // The constraint has to hold for all values.
        let lower = match &constraint.lower {
            Bound::Infinite => None,
            Bound::Finite(value) => Some(value.clone()),
            Bound::Parameter(id) => match greatest(*id) {
                None => return ConstraintRole::Impossible,
                greatest => greatest,
            },
        };
        let upper = match &constraint.upper {
            Bound::Infinite => None,
            Bound::Finite(value) => Some(value.clone()),
            Bound::Parameter(id) => match least(*id) {
                None => return ConstraintRole::Impossible,
                least => least,
            },
        };
        ConstraintRole::Requirement { lower, upper }
    }

    /// Returns the duration that the executor commands at the action's start, if the constraint
    /// bounds this duration. The executor cannot make the end depend on later events.
    pub fn commanded_duration(&self, constraint: &Constraint) -> Option<&Rational> {
        let node = |id: NodeId| self.plan.nodes[id.index()];
        match (node(constraint.from), node(constraint.to)) {
            (Node::Start(start), Node::End(end)) if start == end => {
                self.commanded_durations.get(&start)
            }
            _ => None,
        }
    }

    /// Returns the plan's network for an executor that relies on a box; see
    /// [`ParametrizedPlan::role`].
    ///
    /// # Errors
    /// A constraint that cannot be satisfied for all values in the box.
    pub fn uncertain_network(
        &self,
        envelope: &DecoupledEnvelope,
    ) -> Result<PlanNetwork, Impossible> {
        let reading = |constraint: &Constraint| self.role(constraint, envelope);
        self.plan.uncertain_network(&reading)
    }
}
