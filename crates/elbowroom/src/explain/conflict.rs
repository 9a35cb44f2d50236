//! Explanations for plans without a schedule: the durations that are too long, and the bound that
//! they exceed.

use std::collections::BTreeMap;

use elbowroom_num::{Rational, Total};
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
pub(crate) struct Seen {
    conflicts: Vec<SeenConflict>,
    /// The conflicts of each parameter.
    of: BTreeMap<ParameterId, Vec<usize>>,
}

/// A conflict whose description does not depend on the values.
#[derive(Debug)]
struct SeenConflict {
    cycle: Vec<Origin>,
    reason: String,
}

impl Seen {
    /// Returns the reason why the plan has no schedule at these values, where only the parameter
    /// deviates too far. Empty if the plan has a schedule.
    pub(super) fn reason(
        &mut self,
        explainer: &Explainer<'_>,
        id: ParameterId,
        valuation: &Valuation,
    ) -> String {
        let plan = &explainer.plan.plan;
        let own = self.of.get(&id).into_iter().flatten();
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
            self.of.entry(id).or_default().push(self.conflicts.len());
        }
        self.conflicts.push(SeenConflict {
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
    Beginning,
    /// The lower bound of a constraint.
    AtLeast(&'a Constraint),
    /// The upper bound of a constraint.
    AtMost(&'a Constraint),
}

impl<'a> Edge<'a> {
    fn of(plan: &'a StnPlan, origin: Origin) -> Self {
        match origin {
            Origin::Beginning => Self::Beginning,
            Origin::AtLeast(index) => Self::AtLeast(&plan.constraints[index]),
            Origin::AtMost(index) => Self::AtMost(&plan.constraints[index]),
        }
    }

    /// Returns the constraint and its bound.
    fn bound(self) -> Option<(&'a Constraint, &'a Bound)> {
        match self {
            Self::Beginning => None,
            Self::AtLeast(constraint) => Some((constraint, &constraint.lower)),
            Self::AtMost(constraint) => Some((constraint, &constraint.upper)),
        }
    }
}

/// Returns `true` if a cycle of bounds is negative at these values, so that there is no schedule.
/// `false` if one of the bounds is infinite.
fn is_too_long(plan: &StnPlan, cycle: &[Origin], valuation: &Valuation) -> bool {
    let mut room = Total::default();
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
            Edge::AtMost(_) | Edge::Beginning => room.add(value),
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
    let mut rooms: Vec<Room> = Vec::new();
    for (position, origin) in walked.iter().enumerate() {
        match origin {
            Edge::Beginning => {}
            Edge::AtLeast(constraint) => needs.extend(need(explainer, constraint, valuation)),
            Edge::AtMost(constraint) => {
                let next = walked[(position + 1) % walked.len()];
                rooms.push(room(explainer, constraint, next, valuation));
            }
        }
    }
    needs.reverse();
    let mut orders = walked
        .iter()
        .filter_map(|origin| own_order(explainer, *origin, valuation));
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
    pub(crate) fn bound_words(&self, constraint: &Constraint, side: Side) -> Option<String> {
        let nominal = self.plan.nominal();
        match side {
            Side::Lower => need(self, constraint, &nominal),
            Side::Upper => Some(match room(self, constraint, Edge::Beginning, &nominal) {
                Room::Action(words) | Room::Limit(words) => words,
            }),
        }
    }
}

impl Explainer<'_> {
    /// Describes a sum of bounds: actions with the durations `takes` must fit into actions with the
    /// durations `gives` and into fixed bounds. Each bound is the position of a constraint of the
    /// plan, and a side of it. Bounds that are parameters are ignored.
    pub(crate) fn sum_words(
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
        let mut orders =
            constraints(Side::Lower).filter_map(|it| own_order(self, Edge::AtLeast(it), &nominal));
        if takes.is_empty()
            && let Some(order) = orders.next()
        {
            return Some(order);
        }
        let mut needs = takes;
        for constraint in constraints(Side::Lower) {
            if matches!(constraint.lower, Bound::Finite(_)) {
                needs.extend(need(self, constraint, &nominal));
            }
        }
        let mut rooms: Vec<Room> = gives.into_iter().map(Room::Action).collect();
        for constraint in constraints(Side::Upper) {
            if matches!(constraint.upper, Bound::Finite(_)) {
                let comes_before =
                    |it: &&Constraint| it.to == constraint.to && it.from != constraint.from;
                let next = constraints(Side::Lower).find(comes_before);
                let next = next.map_or(Edge::Beginning, Edge::AtLeast);
                rooms.push(room(self, constraint, next, &nominal));
            }
        }
        let into_actions = |room: &Room| match room {
            Room::Action(name) => Some(name.clone()),
            Room::Limit(_) => None,
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
                    "steps that must be apart have to fit into {}",
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
enum Room {
    /// The duration of an action that contains the chain.
    Action(String),
    /// Another upper bound, such as a deadline.
    Limit(String),
}

/// Forms the sentence: `A, B must fit into C`, or `deadline of D at 60, because A, B must be over
/// before it`.
fn sentence(needs: &[String], rooms: &[Room]) -> String {
    let needs = needs.join(", ");
    let mut actions = Vec::new();
    let mut limits = Vec::new();
    for room in rooms {
        match room {
            Room::Action(name) => actions.push(name.as_str()),
            Room::Limit(words) => limits.push(words.as_str()),
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
        (false, true, false) => format!("{limits}, because {needs} must be over before it"),
        (false, false, true) => format!("{needs} must fit into {actions}"),
        (false, false, false) => format!("{limits}, and {needs} must fit into {actions}"),
    }
}

/// Describes an edge that orders the start and the end of one action: because they interfere, or
/// because of trajectory constraints, processes or events.
fn own_order(explainer: &Explainer<'_>, origin: Edge<'_>, valuation: &Valuation) -> Option<String> {
    let Edge::AtLeast(constraint) = origin else {
        return None;
    };
    let id = explainer.plan.plan.duration_of(constraint)?;
    match constraint.reason {
        Reason::Interference => Some(explainer.own_separation()),
        Reason::Course | Reason::Pinned => {
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
fn need(
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
            plan.node_words(explainer.task, constraint.to),
            least.to_decimal(6)
        )
    } else {
        format!(
            "at least {} from {} to {}",
            least.to_decimal(6),
            plan.node_words(explainer.task, constraint.from),
            plan.node_words(explainer.task, constraint.to),
        )
    })
}

/// Describes the time that an upper bound allows. `next` is the next edge of the cycle.
fn room(
    explainer: &Explainer<'_>,
    constraint: &Constraint,
    next: Edge<'_>,
    valuation: &Valuation,
) -> Room {
    let plan = &explainer.plan.plan;
    if let Reason::Timed(index) = constraint.reason {
        let before = match next {
            Edge::AtLeast(after) => after.from,
            Edge::AtMost(_) | Edge::Beginning => constraint.to,
        };
        return Room::Limit(explainer.deadline(before, index));
    }
    if let Some(id) = explainer.plan.plan.duration_of(constraint) {
        return Room::Action(explainer.action_name(id).to_owned());
    }
    let most = constraint.upper.at(valuation).unwrap_or_default();
    let to = plan.node_words(explainer.task, constraint.to);
    Room::Limit(if constraint.from == NodeId::ZERO {
        let deadline = explainer.deadline_behind(constraint.to, &most);
        deadline.unwrap_or_else(|| format!("{to} at {} or before", most.to_decimal(6)))
    } else {
        let from = plan.node_words(explainer.task, constraint.from);
        format!("at most {} from {from} to {to}", most.to_decimal(6))
    })
}
