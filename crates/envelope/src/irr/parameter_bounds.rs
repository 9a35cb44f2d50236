//! Bounds on the differences that parameters are.

use elbowroom_num::Rational;
use elbowroom_plan::{Bound, BoxEnd, Constraint, NodeId, ParameterId, ParametrizedPlan, Side};

/// Limits on the reach of ends from single constraints of the plan.
///
/// If a parameter is the difference of two times, other bounds on this difference limit it. These
/// limits are quick to compute, and often they are the only ones.
pub(super) struct ParameterBounds {
    /// By parameter: the greatest reach of its lower and its upper end.
    max_reach: Vec<[Option<Rational>; 2]>,
}

impl ParameterBounds {
    pub(super) fn new(plan: &ParametrizedPlan) -> Self {
        let constraints = &plan.plan.constraints;
        let mut differences: Vec<Vec<(NodeId, ParameterId)>> =
            vec![Vec::new(); plan.plan.nodes.len()];
        for (from, to, parameter) in constraints.iter().filter_map(difference) {
            differences[to.index()].push((from, parameter));
        }
        let mut bounds = Self {
            max_reach: vec![[None, None]; plan.parameters.len()],
        };
        for constraint in constraints {
            let (from, to) = (constraint.from, constraint.to);
            let [least, most] = [&constraint.lower, &constraint.upper].map(finite);
            for parameter in with_ends(&differences, (from, to)) {
                bounds.add(parameter, Side::Lower, least.map(|least| -least));
                bounds.add(parameter, Side::Upper, most.cloned());
            }
            for parameter in with_ends(&differences, (to, from)) {
                bounds.add(parameter, Side::Lower, most.cloned());
                bounds.add(parameter, Side::Upper, least.map(|least| -least));
            }
        }
        bounds
    }

    /// Limits the reach of an end.
    fn add(&mut self, parameter: ParameterId, side: Side, reach: Option<Rational>) {
        let Some(reach) = reach else { return };
        let most = &mut self.max_reach[parameter.index()][side.index()];
        if most.as_ref().is_none_or(|most| reach < *most) {
            *most = Some(reach);
        }
    }

    /// Returns `true` if no value at that reach has a schedule; `None` is infinitely far.
    pub(super) fn exclude(&self, end: BoxEnd, reach: Option<&Rational>) -> bool {
        let most = &self.max_reach[end.parameter.index()][end.side.index()];
        most.as_ref()
            .is_some_and(|most| reach.is_none_or(|reach| reach > most))
    }
}

/// Returns the parameter that a constraint defines as the difference of its nodes' times.
fn difference(constraint: &Constraint) -> Option<(NodeId, NodeId, ParameterId)> {
    let parameter = constraint.lower.parameter()?;
    let is_whole = constraint.upper.parameter() == Some(parameter);
    is_whole.then_some((constraint.from, constraint.to, parameter))
}

/// Returns the parameters that are the difference of these times. `differences` lists, for each
/// node, those with the node as the later one.
fn with_ends(
    differences: &[Vec<(NodeId, ParameterId)>],
    (from, to): (NodeId, NodeId),
) -> impl Iterator<Item = ParameterId> {
    let those = differences[to.index()].iter();
    those
        .filter(move |(start, _)| *start == from)
        .map(|&(_, parameter)| parameter)
}

fn finite(bound: &Bound) -> Option<&Rational> {
    match bound {
        Bound::Finite(value) => Some(value),
        Bound::Infinite | Bound::Parameter(_) => None,
    }
}
