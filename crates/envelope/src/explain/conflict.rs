//! Explanations for plans without a schedule: the durations that are too long, and the bound that
//! they exceed.

use std::collections::BTreeMap;

use elbowroom_num::{Accumulator, Rational};
use elbowroom_plan::{
    Bound, Constraint, NodeId, Origin, ParameterId, Reason, Side, StnPlan, Valuation,
};

use super::Explainer;

/// Constraints that contradict each other, with a description.
pub(super) struct Conflict {
    /// Description of the conflict: the durations that exceed a bound.
    pub(super) reason: String,
    /// Excess of the durations over the bound.
    pub(super) excess: Rational,
    /// The negative cycle of bounds.
    cycle: Vec<Origin>,
}

/// Known conflicts of a plan. Usually, a single conflict limits many ends.
#[derive(Debug, Default)]
pub struct KnownConflicts {
    conflicts: Vec<KnownConflict>,
    /// The conflicts of each parameter.
    by_parameter: BTreeMap<ParameterId, Vec<usize>>,
}

/// A conflict whose description does not depend on the values.
#[derive(Debug)]
struct KnownConflict {
    cycle: Vec<Origin>,
    reason: String,
}

impl KnownConflicts {
    /// Returns the reason why the plan has no schedule at these values, where only the parameter
    /// deviates too far. Empty if the plan has a schedule.
    pub(super) fn reason(
        &mut self,
        explainer: &Explainer<'_>,
        id: ParameterId,
        valuation: &Valuation,
    ) -> String {
        let plan = &explainer.plan.plan;
        let own = self.by_parameter.get(&id).into_iter().flatten();
        let seen = own.map(|index| &self.conflicts[*index]);
        for seen in seen {
            if is_too_long(plan, &seen.cycle, valuation) {
                return seen.reason.clone();
            }
        }
        let Some(Conflict { reason, cycle, .. }) = find(explainer, valuation) else {
            return String::new();
        };
        let mut parameters = Vec::new();
        for edge in cycle.iter().map(|origin| Edge::of(plan, *origin)) {
            match edge.bound() {
                Some((constraint, Bound::Parameter(id)))
                    if plan.duration_of(constraint).is_some() =>
                {
                    parameters.push(*id);
                }
                // The description contains the value.
                Some((_, Bound::Parameter(_))) => return reason,
                Some(_) | None => {}
            }
        }
        for id in parameters {
            self.by_parameter
                .entry(id)
                .or_default()
                .push(self.conflicts.len());
        }
        self.conflicts.push(KnownConflict {
            cycle,
            reason: reason.clone(),
        });
        reason
    }
}

/// The origin of an edge of the network.
#[derive(Clone, Copy)]
enum Edge<'a> {
    /// Nothing happens before time 0.
    TimeZero,
    /// The lower bound of a constraint.
    AtLeast(&'a Constraint),
    /// The upper bound of a constraint.
    AtMost(&'a Constraint),
}

impl<'a> Edge<'a> {
    fn of(plan: &'a StnPlan, origin: Origin) -> Self {
        match origin {
            Origin::Beginning => Self::TimeZero,
            Origin::AtLeast(index) => Self::AtLeast(&plan.constraints[index]),
            Origin::AtMost(index) => Self::AtMost(&plan.constraints[index]),
        }
    }

    /// Returns the constraint and its bound.
    fn bound(self) -> Option<(&'a Constraint, &'a Bound)> {
        match self {
            Self::TimeZero => None,
            Self::AtLeast(constraint) => Some((constraint, &constraint.lower)),
            Self::AtMost(constraint) => Some((constraint, &constraint.upper)),
        }
    }
}

/// Returns `true` if a cycle of bounds is negative at these values, so that there is no schedule.
/// `false` if one of the bounds is infinite.
fn is_too_long(plan: &StnPlan, cycle: &[Origin], valuation: &Valuation) -> bool {
    let mut room = Accumulator::default();
    for edge in cycle.iter().map(|origin| Edge::of(plan, *origin)) {
        let Some((_, bound)) = edge.bound() else {
            continue;
        };
        let value = match bound {
            Bound::Infinite => return false,
            Bound::Finite(value) => value,
            Bound::Parameter(id) => &valuation[*id],
        };
        match edge {
            Edge::AtLeast(_) => room.add(&-value),
            Edge::AtMost(_) | Edge::TimeZero => room.add(value),
        }
    }
    room.value().is_negative()
}

/// Returns the conflict of the plan's constraints at these values; `None` if there is none.
pub(super) fn find(explainer: &Explainer<'_>, valuation: &Valuation) -> Option<Conflict> {
    let plan = &explainer.plan.plan;
    let (network, origins) = plan.network_with_origins(valuation);
    let negative = network.consistency().err()?;
    let cycle: Vec<Origin> = negative
        .constraints
        .iter()
        .map(|id| origins[id.index()])
        .collect();
    let mut walked: Vec<Edge<'_>> = cycle.iter().map(|id| Edge::of(plan, *id)).collect();
    // The cycle follows lower bounds backwards in time. The description lists them forwards,
    // beginning after an upper bound.
    let first_room = walked.iter().position(|o| matches!(o, Edge::AtMost(_)));
    walked.rotate_left(first_room.unwrap_or(0));
    let mut needs: Vec<String> = Vec::new();
    let mut rooms: Vec<UpperBound> = Vec::new();
    for (position, origin) in walked.iter().enumerate() {
        match origin {
            Edge::TimeZero => {}
            Edge::AtLeast(constraint) => {
                needs.extend(describe_lower_bound(explainer, constraint, valuation));
            }
            Edge::AtMost(constraint) => {
                let next = walked[(position + 1) % walked.len()];
                rooms.push(describe_upper_bound(explainer, constraint, next, valuation));
            }
        }
    }
    needs.reverse();
    let mut orders = walked
        .iter()
        .filter_map(|origin| describe_own_order(explainer, *origin, valuation));
    let reason = orders.next().unwrap_or_else(|| sentence(&needs, &rooms));
    Some(Conflict {
        reason,
        excess: -negative.total,
        cycle,
    })
}

impl Explainer<'_> {
    /// Describes a bound at the nominal values: a lower bound by the time that it takes, an upper
    /// bound by the time that it allows. `None` for mere orderings.
    pub fn describe_bound(&self, constraint: &Constraint, side: Side) -> Option<String> {
        let nominal = self.plan.nominal();
        match side {
            Side::Lower => describe_lower_bound(self, constraint, &nominal),
            Side::Upper => Some(
                match describe_upper_bound(self, constraint, Edge::TimeZero, &nominal) {
                    UpperBound::Action(words) | UpperBound::Limit(words) => words,
                },
            ),
        }
    }
}

impl Explainer<'_> {
    /// Describes a sum of bounds: actions with the durations `takes` must fit into actions with the
    /// durations `gives` and into fixed bounds. Each bound is the position of a constraint of the
    /// plan, and a side of it. Bounds that are parameters are ignored.
    pub fn describe_sum(
        &self,
        takes: Vec<String>,
        gives: Vec<String>,
        bounds: &[(usize, Side)],
    ) -> Option<String> {
        let plan = &self.plan.plan;
        let constraints = |wanted: Side| {
            let own = bounds.iter().filter(move |(_, side)| *side == wanted);
            own.map(|(index, _)| &plan.constraints[*index])
        };
        let nominal = self.plan.nominal();
        let mut orders = constraints(Side::Lower)
            .filter_map(|it| describe_own_order(self, Edge::AtLeast(it), &nominal));
        if takes.is_empty()
            && let Some(order) = orders.next()
        {
            return Some(order);
        }
        let mut needs = takes;
        for constraint in constraints(Side::Lower) {
            if matches!(constraint.lower, Bound::Finite(_)) {
                needs.extend(describe_lower_bound(self, constraint, &nominal));
            }
        }
        let mut rooms: Vec<UpperBound> = gives.into_iter().map(UpperBound::Action).collect();
        for constraint in constraints(Side::Upper) {
            if matches!(constraint.upper, Bound::Finite(_)) {
                let comes_before =
                    |it: &&Constraint| it.to == constraint.to && it.from != constraint.from;
                let next = constraints(Side::Lower).find(comes_before);
                let next = next.map_or(Edge::TimeZero, Edge::AtLeast);
                rooms.push(describe_upper_bound(self, constraint, next, &nominal));
            }
        }
        let into_actions = |room: &UpperBound| match room {
            UpperBound::Action(name) => Some(name.clone()),
            UpperBound::Limit(_) => None,
        };
        if needs.is_empty()
            && let Some(actions) = rooms.iter().map(into_actions).collect::<Option<Vec<_>>>()
            && !actions.is_empty()
        {
            let keeps_apart = |it: &Constraint| {
                let least = it.lower.at(&nominal);
                least.is_some_and(|least| least.is_positive())
            };
            let is_apart = constraints(Side::Lower).any(keeps_apart);
            return Some(if is_apart {
                format!(
                    "steps with a least separation must fit into {}",
                    actions.join(" and ")
                )
            } else {
                "a duration is at least 0".to_owned()
            });
        }
        let says_something = !rooms.is_empty() || needs.len() > 1;
        says_something.then(|| sentence(&needs, &rooms))
    }
}

/// An upper bound on a chain of actions.
enum UpperBound {
    /// The duration of an action that contains the chain.
    Action(String),
    /// Another upper bound, such as a deadline.
    Limit(String),
}

/// Forms the sentence: `A, B must fit into C`, or `deadline of D at 60, because A, B must end before
/// it`.
fn sentence(needs: &[String], rooms: &[UpperBound]) -> String {
    let needs = needs.join(", ");
    let mut actions = Vec::new();
    let mut limits = Vec::new();
    for room in rooms {
        match room {
            UpperBound::Action(name) => actions.push(name.as_str()),
            UpperBound::Limit(words) => limits.push(words.as_str()),
        }
    }
    let (actions, limits) = (actions.join(" and "), limits.join(" and "));
    match (needs.is_empty(), actions.is_empty(), limits.is_empty()) {
        (true, true, _) => limits,
        (true, false, true) => format!("the duration of {actions}"),
        (true, false, false) => format!("{limits}, and the duration of {actions}"),
        // The end comes no later than the start, which only an over-all condition over an empty
        // interval allows.
        (false, true, true) => {
            format!("an over-all condition holds only if {needs} ends as soon as it starts")
        }
        (false, true, false) => format!("{limits}, because {needs} must end before it"),
        (false, false, true) => format!("{needs} must fit into {actions}"),
        (false, false, false) => format!("{limits}, and {needs} must fit into {actions}"),
    }
}

/// Describes an edge that orders the start and the end of one action: because they interfere, or
/// because of trajectory constraints, processes or events.
fn describe_own_order(
    explainer: &Explainer<'_>,
    origin: Edge<'_>,
    valuation: &Valuation,
) -> Option<String> {
    let Edge::AtLeast(constraint) = origin else {
        return None;
    };
    let id = explainer.plan.plan.duration_of(constraint)?;
    match constraint.reason {
        Reason::Interference => Some(explainer.describe_own_separation()),
        Reason::TrajectoryConstraint | Reason::Pinned => {
            let least = constraint.lower.at(valuation)?;
            let is_order = least <= *explainer.task.epsilon();
            is_order.then(|| {
                format!(
                    "{} must not end before it starts",
                    explainer.action_name(id)
                )
            })
        }
        _ => None,
    }
}

/// Describes the time that a lower bound takes; `None` for mere separations.
fn describe_lower_bound(
    explainer: &Explainer<'_>,
    constraint: &Constraint,
    valuation: &Valuation,
) -> Option<String> {
    if let Some(id) = explainer.plan.plan.duration_of(constraint) {
        return Some(explainer.action_name(id).to_owned());
    }
    let least = constraint.lower.at(valuation)?;
    if least <= *explainer.task.epsilon() {
        return None;
    }
    let plan = &explainer.plan.plan;
    Some(if constraint.from == NodeId::ZERO {
        format!(
            "{} not before {}",
            plan.describe_node(explainer.task, constraint.to),
            least.to_decimal(6)
        )
    } else {
        format!(
            "at least {} from {} to {}",
            least.to_decimal(6),
            plan.describe_node(explainer.task, constraint.from),
            plan.describe_node(explainer.task, constraint.to),
        )
    })
}

/// Describes the time that an upper bound allows. `next` is the next edge of the cycle.
fn describe_upper_bound(
    explainer: &Explainer<'_>,
    constraint: &Constraint,
    next: Edge<'_>,
    valuation: &Valuation,
) -> UpperBound {
    let plan = &explainer.plan.plan;
    if let Reason::Timed(index) = constraint.reason {
        let before = match next {
            Edge::AtLeast(after) => after.from,
            Edge::AtMost(_) | Edge::TimeZero => constraint.to,
        };
        return UpperBound::Limit(explainer.deadline(before, index));
    }
    if let Some(id) = explainer.plan.plan.duration_of(constraint) {
        return UpperBound::Action(explainer.action_name(id).to_owned());
    }
    let most = constraint.upper.at(valuation).unwrap_or_default();
    let to = plan.describe_node(explainer.task, constraint.to);
    UpperBound::Limit(if constraint.from == NodeId::ZERO {
        let deadline = explainer.deadline_of_bound(constraint.to, &most);
        deadline.unwrap_or_else(|| format!("{to} at {} or before", most.to_decimal(6)))
    } else {
        let from = plan.describe_node(explainer.task, constraint.from);
        format!("at most {} from {from} to {to}", most.to_decimal(6))
    })
}
