//! Conversions of a plan to its temporal network, and of a schedule to a plan with fixed times.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::ground::{Action, Body, Expression};
use elbowroom_model::problem::Unknown;
use elbowroom_model::{Step, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_stn::Network;

use crate::numbers::numbers_by_id;
use crate::stn_plan::{Bound, Constraint, Instance, Node, NodeId, Reason, StnPlan};
use crate::valuation::{ParameterId, Valuation};

/// A time for each node of an [`StnPlan`], by position.
///
/// A [`Valuation`] is a different type, so the two cannot be confused:
///
/// ```compile_fail
/// # fn times(plan: &elbowroom_plan::StnPlan, schedule: &elbowroom_plan::Schedule) {
/// plan.network(schedule);
/// # }
/// ```
///
/// ```
/// # fn times(plan: &elbowroom_plan::StnPlan, schedule: &elbowroom_plan::Schedule) {
/// plan.scheduled(schedule);
/// # }
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Schedule {
    numbers: Vec<Rational>,
}

numbers_by_id!(Schedule, NodeId);

/// Nodes keep their positions in [`StnPlan::network`].
impl From<elbowroom_stn::Schedule> for Schedule {
    fn from(schedule: elbowroom_stn::Schedule) -> Self {
        Self::new(schedule.into_times())
    }
}

/// Nodes keep their positions in [`StnPlan::network`].
impl From<Schedule> for elbowroom_stn::Schedule {
    fn from(schedule: Schedule) -> Self {
        Self::new(schedule.numbers)
    }
}

/// Returns the node of [`StnPlan::network`] for a node of the plan.
pub fn network_node(node: NodeId) -> elbowroom_stn::NodeId {
    elbowroom_stn::NodeId(node.0)
}

/// Origin of a constraint of [`StnPlan::network`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// A node comes at 0 or later.
    Beginning,
    /// The lower bound of the plan's constraint at this position.
    AtLeast(usize),
    /// The upper bound of the plan's constraint at this position.
    AtMost(usize),
}

impl StnPlan {
    /// Returns the plan's network for these values of the parameters. Nodes keep their positions.
    pub fn network(&self, valuation: &Valuation) -> Network {
        self.network_with_origins(valuation).0
    }

    /// Like [`Self::network`], with the origin of each of the network's constraints, by
    /// [`ConstraintId`](elbowroom_stn::ConstraintId).
    pub fn network_with_origins(&self, valuation: &Valuation) -> (Network, Vec<Origin>) {
        let mut network = Network::with_nodes(self.nodes.len());
        let mut origins = Vec::with_capacity(self.nodes.len() + 2 * self.constraints.len());
        let zero = network_node(NodeId::ZERO);
        for (node, _) in self.nodes().skip(1) {
            network.add(elbowroom_stn::Constraint::at_least(
                zero,
                network_node(node),
                Rational::ZERO,
            ));
            origins.push(Origin::Beginning);
        }
        for (index, constraint) in self.constraints.iter().enumerate() {
            let (from, to) = (network_node(constraint.from), network_node(constraint.to));
            if let Some(lower) = constraint.lower.at(valuation) {
                network.add(elbowroom_stn::Constraint::at_least(from, to, lower));
                origins.push(Origin::AtLeast(index));
            }
            if let Some(upper) = constraint.upper.at(valuation) {
                network.add(elbowroom_stn::Constraint::at_most(from, to, upper));
                origins.push(Origin::AtMost(index));
            }
        }
        (network, origins)
    }

    /// Returns the plan with these values in place of its parameters.
    #[must_use]
    pub fn at(&self, valuation: &Valuation) -> Self {
        let actions = self.actions_at(valuation);
        let instances = self.instances.iter().zip(actions);
        Self {
            instances: instances
                .map(|(instance, action)| Instance {
                    label: instance.label.clone(),
                    action,
                })
                .collect(),
            nodes: self.nodes.clone(),
            constraints: self.constraints_at(valuation),
        }
    }

    /// Returns the actions of its instances, with these values in place of its parameters.
    /// Instances that share an action in the plan share one in the result.
    pub fn actions_at(&self, valuation: &Valuation) -> Vec<Arc<Action>> {
        let mut known: BTreeMap<usize, usize> = BTreeMap::new();
        let mut actions: Vec<Arc<Action>> = Vec::with_capacity(self.instances.len());
        for instance in &self.instances {
            let address = Arc::as_ptr(&instance.action).addr();
            let action = match known.get(&address) {
                Some(&same) => Arc::clone(&actions[same]),
                None => action_at(&instance.action, valuation),
            };
            known.entry(address).or_insert(actions.len());
            actions.push(action);
        }
        actions
    }

    /// Returns its constraints, with these values in place of its parameters.
    pub fn constraints_at(&self, valuation: &Valuation) -> Vec<Constraint> {
        let at = |bound: &Bound| match bound {
            Bound::Parameter(id) => Bound::Finite(valuation[*id].clone()),
            known => known.clone(),
        };
        let constraints = self.constraints.iter().map(|constraint| Constraint {
            from: constraint.from,
            to: constraint.to,
            lower: at(&constraint.lower),
            upper: at(&constraint.upper),
            reason: constraint.reason.clone(),
        });
        constraints.collect()
    }

    /// Returns the plan with constraints for the state of its execution at `now`. Executed nodes
    /// are fixed at their times. Other nodes for which `waits` is true cannot happen before `now`.
    /// Timed initials keep their times.
    ///
    /// The additional constraints come after the plan's own.
    #[must_use]
    pub fn remainder<'t>(
        &self,
        now: &Rational,
        happened: impl Fn(NodeId) -> Option<&'t Rational>,
        waits: impl Fn(Node) -> bool,
    ) -> Self {
        let mut plan = self.clone();
        for (node, what) in self.nodes().skip(1) {
            let (lower, upper) = match (happened(node), what) {
                (_, Node::Timed(_)) => continue,
                (Some(time), _) => (time, Bound::Finite(time.clone())),
                (None, what) if waits(what) => (now, Bound::Infinite),
                (None, _) => continue,
            };
            plan.constraints.push(Constraint {
                from: NodeId::ZERO,
                to: node,
                lower: Bound::Finite(lower.clone()),
                upper,
                reason: Reason::Given,
            });
        }
        plan
    }

    /// Returns the plan with the fixed times of a schedule. Its steps are in order of start.
    pub fn scheduled(&self, schedule: &Schedule) -> TimeTriggeredPlan {
        let mut steps = Vec::with_capacity(self.instances.len());
        let mut ends = vec![None; self.instances.len()];
        for (node, what) in self.nodes() {
            if let Node::End(id) = what {
                ends[id.index()] = Some(schedule[node].clone());
            }
        }
        for (node, what) in self.nodes() {
            let (Node::Start(id) | Node::Instant(id)) = what else {
                continue;
            };
            let start = schedule[node].clone();
            let action = self.instance(id).action.clone();
            let duration = match action.body {
                Body::Instantaneous(_) => None,
                Body::Durative(_) => ends[id.index()].take().map(|end| end - &start),
            };
            steps.push(Step {
                start,
                action,
                duration,
            });
        }
        Step::sort_by_start(&mut steps);
        TimeTriggeredPlan { steps }
    }
}

/// Returns the action with these values in place of its parameters; the same action if it has none.
fn action_at(action: &Arc<Action>, valuation: &Valuation) -> Arc<Action> {
    let mut is_open = false;
    let at = action.map_leaves(&mut |leaf| match leaf {
        Expression::Unknown(Unknown::Parameter(index)) => {
            is_open = true;
            Some(Expression::Constant(valuation[ParameterId(*index)].clone()))
        }
        _ => None,
    });
    if is_open {
        Arc::new(at)
    } else {
        Arc::clone(action)
    }
}
