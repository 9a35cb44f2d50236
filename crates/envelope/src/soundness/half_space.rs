//! Derivation of a [`Row`] for other boxes from a violated obligation.
//!
//! Let the bad case be one inequality in differences of times that are parameters. Then it is a
//! linear function of the parameters: for every value in a box inside the envelope there is some
//! schedule, and in each schedule these differences equal the values. So the worst corner of the
//! box decides, and every box inside the envelope satisfies one linear inequality in its ends.
//!
//! An over-all condition is read at a moment anywhere inside its action. The moment is taken
//! arbitrarily close to one of the events around it, if that is a possible place.

use std::collections::{BTreeMap, VecDeque};

use elbowroom_num::{Delta, Interval, Rational};
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, NodeId, ParameterId, ParametrizedPlan, Side};
use elbowroom_stn::ConsistentNetwork;

use super::violation_case::add_times;
use super::{Broken, Soundness};
use crate::linear::Linear;
use crate::obligations::{BadCase, Difference};
use crate::reduction::Reduction;
use crate::row::Row;

/// Time as a function of the parameters: `time of a root + offset + Σ factor · parameter`.
#[derive(Clone, Debug)]
struct AffineTime {
    root: usize,
    factors: BTreeMap<ParameterId, Rational>,
    offset: Rational,
}

impl Soundness {
    /// Returns, for each of these violations in `envelope`, the row that every box inside the
    /// robustness envelope satisfies because of it; `None` if it is not linear.
    pub(crate) fn rows(
        &self,
        plan: &ParametrizedPlan,
        broken: &[Broken],
        envelope: &DecoupledEnvelope,
    ) -> Vec<Option<Row>> {
        let places = affine_times(&self.reduction);
        let widest = self.schedules_in(&DecoupledEnvelope::ranges(plan));
        let cases = broken.iter().map(|broken| &broken.case);
        cases
            .map(|case| self.row(plan, case, envelope, (&places, widest.as_ref())))
            .collect()
    }

    fn row(
        &self,
        plan: &ParametrizedPlan,
        case: &BadCase,
        envelope: &DecoupledEnvelope,
        (places, widest): (&[AffineTime], Option<&ConsistentNetwork<Delta>>),
    ) -> Option<Row> {
        let row = |expression: &Linear, is_strict: bool| {
            let row = half_space(&self.reduction, places, expression, is_strict)?;
            (!row.holds_in(envelope)).then_some(row)
        };
        match (&case.differences[..], &case.inequalities[..]) {
            ([], [inequality]) => row(&inequality.expression, inequality.is_strict),
            ([difference], []) => {
                let mut expression = Linear::difference(difference.from, difference.to);
                expression.constant = -&difference.bound;
                row(&expression, difference.is_strict)
            }
            (differences, [inequality]) => {
                let moment = NodeId::from(plan.plan.nodes.len());
                let mut events: Vec<NodeId> = differences
                    .iter()
                    .flat_map(|difference| [difference.from, difference.to])
                    .filter(|node| *node != moment)
                    .collect();
                events.sort_unstable();
                events.dedup();
                events.into_iter().find_map(|event| {
                    let expression = at(&inequality.expression, moment, event)?;
                    // The moment is only close to the event, so the bound itself need not be
                    // reached.
                    let row = row(&expression, true)?;
                    let is_possible = widest.is_some_and(|network| {
                        self.can_be_near_event(network, case, moment, event)
                    }) || self.is_possible(plan, case, &row, moment, event);
                    is_possible.then_some(row)
                })
            }
            _ => None,
        }
    }

    /// Returns `true` if the moment can be arbitrarily close to the event, for the values at which
    /// a box that contains the nominal values violates the row.
    fn is_possible(
        &self,
        plan: &ParametrizedPlan,
        case: &BadCase,
        row: &Row,
        moment: NodeId,
        event: NodeId,
    ) -> bool {
        let mut corner = DecoupledEnvelope::point(&plan.nominal());
        for end in row.factors.keys() {
            let own = plan.parameter(end.parameter);
            let mut interval = Interval::point(own.nominal.clone());
            match end.side {
                Side::Lower => interval.lower = own.range.lower.clone(),
                Side::Upper => interval.upper = own.range.upper.clone(),
            }
            corner = corner.with_interval(end.parameter, interval);
        }
        self.schedules_in(&corner)
            .is_some_and(|network| self.can_be_near_event(&network, case, moment, event))
    }

    /// Returns the network of all schedules for values in a box, if there are any.
    fn schedules_in(&self, envelope: &DecoupledEnvelope) -> Option<ConsistentNetwork<Delta>> {
        let network = self.reduction.network(envelope).network;
        // Relative to the nominal schedule, nodes that are far apart in time are also far apart in
        // the search for shortest paths.
        let times = self.reduction.class_times(&self.schedule).into_iter();
        let known = elbowroom_stn::Schedule::new(times.map(Delta::from).collect());
        if known.holds_in(&network) {
            return ConsistentNetwork::with_schedule(network, known);
        }
        ConsistentNetwork::try_from(network).ok()
    }

    /// Returns `true` if the moment can be arbitrarily close to the event in all schedules of a
    /// network. The result also holds for every network with fewer schedules.
    fn can_be_near_event(
        &self,
        network: &ConsistentNetwork<Delta>,
        case: &BadCase,
        moment: NodeId,
        event: NodeId,
    ) -> bool {
        // Just before the event, and just after it, the same other events have happened.
        [true, false].into_iter().any(|is_before| {
            case.differences.iter().all(|difference| {
                entails(
                    &self.reduction,
                    network,
                    difference,
                    moment,
                    event,
                    is_before,
                )
            })
        })
    }
}

/// Returns `true` if a difference holds in all schedules of the network, with the moment just
/// before or just after the event.
fn entails(
    reduction: &Reduction,
    network: &ConsistentNetwork<Delta>,
    difference: &Difference,
    moment: NodeId,
    event: NodeId,
    is_before: bool,
) -> bool {
    let place = |node: NodeId| if node == moment { event } else { node };
    let (from, to) = (place(difference.from), place(difference.to));
    // `to - from <= bound`; moving the moment may help or cost an infinitesimal.
    let helps = (difference.to == moment && is_before) || (difference.from == moment && !is_before);
    let costs = (difference.to == moment && !is_before) || (difference.from == moment && is_before);
    let bound = Delta::from(difference.bound.clone());
    let greatest = if from == to {
        Delta::ZERO
    } else {
        let (from_class, from_offset) = reduction.class_of(from);
        let (to_class, to_offset) = reduction.class_of(to);
        let between = if from_class == to_class {
            Some(Delta::ZERO)
        } else {
            network.distance(from_class, to_class)
        };
        let Some(between) = between else { return false };
        &between + &Delta::from(&to_offset - &from_offset)
    };
    if helps {
        greatest <= bound
    } else if costs || difference.is_strict {
        greatest < bound
    } else {
        greatest <= bound
    }
}

/// Replaces the moment by the event in an expression; `None` if it contains products.
fn at(expression: &Linear, moment: NodeId, event: NodeId) -> Option<Linear> {
    if !expression.products.is_empty() {
        return None;
    }
    let mut placed = expression.clone();
    if let Some(factor) = placed.times.remove(moment) {
        placed.add_time(event, &factor);
    }
    Some(placed)
}

/// Returns the row that `expression <= 0`, or `< 0` when strict, does not hold at the worst corner.
fn half_space(
    reduction: &Reduction,
    places: &[AffineTime],
    expression: &Linear,
    is_strict: bool,
) -> Option<Row> {
    if !expression.products.is_empty() {
        return None;
    }
    let mut roots: BTreeMap<usize, Rational> = BTreeMap::new();
    let parameters = expression.parameters.iter().cloned();
    let mut factors: BTreeMap<ParameterId, Rational> = parameters.collect();
    let mut offset = Rational::ZERO;
    let mut is_placed = true;
    let constant = add_times(reduction, expression, |class, coefficient| {
        let Some(place) = places.get(class.index()) else {
            is_placed = false;
            return;
        };
        *roots.entry(place.root).or_default() += coefficient;
        offset += &place.offset * coefficient;
        for (id, factor) in &place.factors {
            *factors.entry(*id).or_default() += factor * coefficient;
        }
    });
    let zero = places.first()?.root;
    let is_function = roots
        .iter()
        .all(|(&root, sum)| root == zero || sum.is_zero());
    if !is_placed || !is_function {
        return None;
    }
    let factors = factors.into_iter().filter(|(_, factor)| !factor.is_zero());
    let factors = factors.map(|(parameter, factor)| {
        // The worst end is the one that lowers the expression.
        let side = if factor.is_positive() {
            Side::Lower
        } else {
            Side::Upper
        };
        (BoxEnd { parameter, side }, factor.abs())
    });
    Some(Row {
        factors: factors.collect(),
        bound: constant + offset,
        is_strict: !is_strict,
    })
}

/// Returns each class's time as a function of the parameters, as far as differences that are
/// parameters connect the classes; the first class has time zero.
fn affine_times(reduction: &Reduction) -> Vec<AffineTime> {
    let count = reduction.class_count();
    let mut neighbours: Vec<Vec<(usize, ParameterId, Rational, Rational)>> =
        vec![Vec::new(); count];
    for (&parameter, &(from, to)) in &reduction.substitution {
        let (from, from_offset) = reduction.class_of(from);
        let (to, to_offset) = reduction.class_of(to);
        // class of `to` + its offset - class of `from` - its offset = parameter
        let offset = &from_offset - &to_offset;
        let sign = Rational::ONE;
        neighbours[from.index()].push((to.index(), parameter, sign.clone(), offset.clone()));
        neighbours[to.index()].push((from.index(), parameter, -&sign, -&offset));
    }
    let mut places: Vec<Option<AffineTime>> = vec![None; count];
    for root in 0..count {
        if places[root].is_some() {
            continue;
        }
        places[root] = Some(AffineTime {
            root,
            factors: BTreeMap::new(),
            offset: Rational::ZERO,
        });
        let mut queue = VecDeque::from([root]);
        while let Some(class) = queue.pop_front() {
            let Some(here) = places[class].clone() else {
                continue;
            };
            for (next, parameter, sign, offset) in &neighbours[class] {
                if places[*next].is_none() {
                    let mut place = here.clone();
                    *place.factors.entry(*parameter).or_default() += sign;
                    place.offset += offset;
                    places[*next] = Some(place);
                    queue.push_back(*next);
                }
            }
        }
    }
    places.into_iter().flatten().collect()
}
