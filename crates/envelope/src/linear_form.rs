//! The conditions on the schedules of a plan as linear inequalities, with over-all conditions
//! expanded. Pages and other programs use them to check values.

use std::collections::BTreeMap;

use elbowroom_model::Task;
use elbowroom_num::{Interval, Rational};
use elbowroom_plan::{
    Bound, Constraint, DecoupledEnvelope, NodeId, ParameterId, ParametrizedPlan, Side, Valuation,
    network_node,
};
use elbowroom_stn::{ConsistentNetwork, Network, Windows};

use crate::linear::Linear;
use crate::obligations::{
    BadCase, Difference, Inequality, Obligation, Obligations, OverAll, Refusal, Requirement,
};
use crate::reduction::Reduction;

/// A plan's network and requirements, for values in a box.
///
/// The plan works with values of the box exactly if the network has a schedule and no bad case
/// holds in any of its schedules.
#[derive(Clone, Debug)]
pub struct LinearForm {
    /// The bounds on differences of times, including that no happening is before time zero.
    pub network: Vec<NetworkBound>,
    /// The requirements, with all their bad cases. These may refer to a moment inside an action:
    /// the node after the plan's last.
    pub obligations: Vec<Obligation>,
}

/// A bound on a difference of times.
#[derive(Clone, Debug)]
pub struct NetworkBound {
    /// An inequality that holds in every schedule.
    pub inequality: Inequality,
    /// The position of the plan's constraint, and its side; `None` if the bound only states that a
    /// node is not before time 0.
    pub source: Option<(usize, Side)>,
}

impl LinearForm {
    /// Computes the form of a plan for the values in `values`. Happenings have the order that they
    /// have at `around`. At most `most_places` positions of a moment inside an action relative to
    /// events are distinguished.
    ///
    /// # Errors
    /// When there is no schedule at `around`, or the plan is beyond exact analysis.
    pub fn new(
        task: &Task,
        plan: &ParametrizedPlan,
        values: &DecoupledEnvelope,
        around: &Valuation,
        most_places: usize,
    ) -> Result<Self, Refusal> {
        let zero = network_node(NodeId::ZERO);
        let schedule = ConsistentNetwork::try_from(plan.plan.network(around));
        let schedule = schedule.map_err(|_| Refusal::NoNominalSchedule)?;
        let schedule = schedule.earliest_schedule(zero);
        let schedule = schedule.times().iter().cloned().collect();
        let reduction = Reduction::new(plan);
        let compiled =
            Obligations::compile(task, plan, (&schedule, around), &reduction.substitution)?;
        let order = Order::of(plan, values, &compiled.over_all)?;
        let mut obligations = compiled.direct;
        for over_all in &compiled.over_all {
            obligations.push(Obligation {
                requirement: Requirement::OverAll {
                    instance: over_all.instance,
                    condition: over_all.condition.clone(),
                },
                bad_cases: expand_positions(task, plan, over_all, &order, most_places)?,
            });
        }
        Ok(Self {
            network: bounds(plan),
            obligations,
        })
    }
}

/// Returns a difference of times as an inequality.
pub fn inequality(difference: &Difference) -> Inequality {
    let mut expression = Linear::difference(difference.from, difference.to);
    expression.constant = -&difference.bound;
    Inequality {
        expression,
        is_strict: difference.is_strict,
    }
}

/// Returns the plan's own bounds.
fn bounds(plan: &ParametrizedPlan) -> Vec<NetworkBound> {
    let nodes = plan.plan.nodes().skip(1);
    let mut bounds: Vec<NetworkBound> = nodes
        .map(|(node, _)| NetworkBound {
            inequality: inequality(&Difference::not_after(NodeId::ZERO, node)),
            source: None,
        })
        .collect();
    for (index, constraint) in plan.plan.constraints.iter().enumerate() {
        for side in Side::BOTH {
            bounds.extend(bound(constraint, side).map(|expression| NetworkBound {
                inequality: Inequality {
                    expression,
                    is_strict: false,
                },
                source: Some((index, side)),
            }));
        }
    }
    bounds
}

/// Returns one side of a constraint as an expression that is at most zero; `None` if it has no
/// bound on that side.
fn bound(constraint: &Constraint, side: Side) -> Option<Linear> {
    let (bound, from, to) = match side {
        Side::Lower => (&constraint.lower, constraint.to, constraint.from),
        Side::Upper => (&constraint.upper, constraint.from, constraint.to),
    };
    let sign = match side {
        Side::Lower => Rational::ONE,
        Side::Upper => Rational::from(-1),
    };
    let mut expression = Linear::difference(from, to);
    match bound {
        Bound::Infinite => return None,
        Bound::Finite(value) => expression.add_scaled(&Linear::constant(value.clone()), &sign),
        Bound::Parameter(id) => expression.add_scaled(&Linear::parameter(*id), &sign),
    }
    Some(expression)
}

/// Returns the violations of an over-all condition, for each possible position of its moment among
/// the events that it depends on.
fn expand_positions(
    task: &Task,
    plan: &ParametrizedPlan,
    over_all: &OverAll,
    order: &Order,
    most_places: usize,
) -> Result<Vec<BadCase>, Refusal> {
    let mut cuts = Vec::new();
    let events = over_all.events(false);
    if !order.cuts((over_all, &events), most_places, &mut Vec::new(), &mut cuts) {
        return Err(Refusal::TooManyCases {
            place: plan.plan.instance(over_all.instance).action.name.clone(),
            limit: most_places,
        });
    }
    let mut cases = Vec::new();
    for happened in cuts {
        let moment = over_all.moment;
        let mut differences = vec![
            Difference::before(over_all.start, moment),
            Difference::before(moment, over_all.end),
        ];
        let placed = events.iter().zip(&happened);
        differences.extend(placed.map(|(&event, &has_happened)| {
            if has_happened {
                Difference::not_after(event, moment)
            } else {
                Difference::before(moment, event)
            }
        }));
        let cut = |node: NodeId| {
            let position = events.iter().position(|event| *event == node);
            position.is_some_and(|position| happened[position])
        };
        for mut inequalities in over_all.cases(task, &plan.plan, false, &cut)? {
            inequalities.extend(over_all.assumptions.iter().cloned());
            cases.push(BadCase {
                differences: differences.clone(),
                inequalities,
            });
        }
    }
    Ok(cases)
}

/// Orderings of events that hold for all values.
struct Order(BTreeMap<NodeId, Windows>);

impl Order {
    fn of(
        plan: &ParametrizedPlan,
        values: &DecoupledEnvelope,
        over_all: &[OverAll],
    ) -> Result<Self, Refusal> {
        if over_all.is_empty() {
            return Ok(Self(BTreeMap::new()));
        }
        let network = ConsistentNetwork::try_from(relaxed(plan, values));
        let network = network.map_err(|_| Refusal::NoNominalSchedule)?;
        let mut windows = BTreeMap::new();
        for own in over_all {
            for &node in own.events(false).iter().chain([&own.start, &own.end]) {
                let seen_from = || network.windows(network_node(node));
                windows.entry(node).or_insert_with(seen_from);
            }
        }
        Ok(Self(windows))
    }

    fn is_never_after(&self, first: NodeId, second: NodeId) -> bool {
        let seen_from = self.0.get(&second);
        let latest = seen_from.and_then(|windows| windows[network_node(first)].latest.as_ref());
        latest.is_some_and(|latest| *latest <= Rational::ZERO)
    }

    /// Enumerates the sets of events that can have happened at a moment inside the action. Returns
    /// `false` if there are more than `most`.
    fn cuts(
        &self,
        (over_all, events): (&OverAll, &[NodeId]),
        most: usize,
        happened: &mut Vec<bool>,
        found: &mut Vec<Vec<bool>>,
    ) -> bool {
        let Some(&event) = events.get(happened.len()) else {
            found.push(happened.clone());
            return found.len() <= most;
        };
        let placed = events.iter().zip(happened.iter());
        let mut can_be = [
            !self.is_never_after(event, over_all.start),
            !self.is_never_after(over_all.end, event),
        ];
        for (&other, &has_happened) in placed {
            if has_happened {
                can_be[0] &= !self.is_never_after(event, other);
            } else {
                can_be[1] &= !self.is_never_after(other, event);
            }
        }
        for has_happened in [false, true] {
            if can_be[usize::from(has_happened)] {
                happened.push(has_happened);
                let is_complete = self.cuts((over_all, events), most, happened, found);
                happened.pop();
                if !is_complete {
                    return false;
                }
            }
        }
        true
    }
}

/// Returns the network with each parameter free within its interval.
pub fn relaxed(plan: &ParametrizedPlan, envelope: &DecoupledEnvelope) -> Network {
    let mut network = Network::with_nodes(plan.plan.nodes.len());
    let zero = network_node(NodeId::ZERO);
    for (node, _) in plan.plan.nodes().skip(1) {
        network.add(elbowroom_stn::Constraint::at_least(
            zero,
            network_node(node),
            Rational::ZERO,
        ));
    }
    let interval = |id: ParameterId| -> &Interval { envelope.interval(id) };
    for constraint in &plan.plan.constraints {
        let (from, to) = (network_node(constraint.from), network_node(constraint.to));
        let lower = match &constraint.lower {
            Bound::Infinite => None,
            Bound::Finite(value) => Some(value.clone()),
            Bound::Parameter(id) => interval(*id).lower.value().cloned(),
        };
        let upper = match &constraint.upper {
            Bound::Infinite => None,
            Bound::Finite(value) => Some(value.clone()),
            Bound::Parameter(id) => interval(*id).upper.value().cloned(),
        };
        if let Some(lower) = lower {
            network.add(elbowroom_stn::Constraint::at_least(from, to, lower));
        }
        if let Some(upper) = upper {
            network.add(elbowroom_stn::Constraint::at_most(from, to, upper));
        }
    }
    network
}
