//! The linear program of a state, which decides if feasible times exist, and which times are best.
//!
//! The search uses ticks, to which all fixed times are rounded down. The times of a plan are
//! computed exactly.

use std::cell::RefCell;
use std::rc::Rc;

use elbowroom_model::problem::Comparison;
use elbowroom_num::simplex::{Optimum, Simplex, VariableId};
use elbowroom_num::{Delta, Rational};

use super::super::bound::MetricBound;
use super::super::compile::{Compiled, Metric};
use super::super::expressions::{Form, Symbolic};
use super::super::formula::Numeric;
use super::super::network::{Network, NodeId};
use super::super::state::State;
use super::super::time::{NEVER, Ticks};
use super::super::tuning::Technique;
use super::{projected, windows};

/// Exact data of the nodes of a network, which stores them in ticks.
#[derive(Debug, Default)]
pub(crate) struct Exact {
    /// The minimum distances between nodes.
    pub(crate) distances: Vec<(NodeId, NodeId, Rational)>,
    /// The ends of the actions that were running in the situation.
    pub(crate) ends: Vec<KnownEnd>,
}

/// Bounds on the end of an action that was running in the situation, by its duration alone. Its
/// start may be off the grid.
#[derive(Debug)]
pub(crate) struct KnownEnd {
    pub(crate) node: NodeId,
    /// The earliest and the latest time in the network.
    pub(crate) rounded: (Ticks, Ticks),
    pub(crate) earliest: Rational,
    /// `None` if there is no bound.
    pub(crate) latest: Option<Rational>,
}

impl KnownEnd {
    /// Returns the exact earliest time, given the network's bound `floor`, which may have another
    /// cause.
    pub(crate) fn after(&self, floor: Ticks, compiled: &Compiled) -> Rational {
        if floor > self.rounded.0 {
            let other = not_before(floor, compiled);
            other.max(self.earliest.clone())
        } else {
            self.earliest.clone()
        }
    }

    /// Returns the exact latest time, given the network's bound `latest`.
    fn before(&self, latest: Ticks, compiled: &Compiled) -> Option<Rational> {
        if latest < self.rounded.1 {
            Some(compiled.scale.units(latest))
        } else {
            self.latest.clone()
        }
    }
}

/// Returns a time that is no earlier than a fixed time, given the tick to which the fixed time was
/// rounded down. Happenings that can happen immediately happen at the situation's time.
pub(crate) fn not_before(floor: Ticks, compiled: &Compiled) -> Rational {
    let is_free = floor <= compiled.now;
    let slack = i64::from(!compiled.is_exact && !is_free);
    compiled.earliest(floor + slack)
}

/// Returns the exact distance of two nodes, given one bound that is known exactly, and the
/// network's distance `rounded`, which may have another cause.
pub(crate) fn exact_distance(
    rounded: &Rational,
    known: &Rational,
    compiled: &Compiled,
) -> Rational {
    if rounded - known >= compiled.scale.units(1) {
        rounded.clone()
    } else {
        known.clone()
    }
}

/// Limit on the metric, if it depends on times.
pub(super) struct Limit<'a> {
    /// The metric without the time.
    pub(super) spent: Form,
    /// Weight of each unit of time, from the beginning to the end of the plan.
    pub(super) time: Rational,
    pub(super) bound: &'a MetricBound,
}

impl Limit<'_> {
    /// Returns the comparison of the metric with zero as a demand: without `constant`, plus the
    /// number returned.
    pub(super) fn as_demand(&self, constant: &Rational) -> (Rational, Comparison) {
        let comparison = if self.bound.may_equal {
            Comparison::AtMost
        } else {
            Comparison::Less
        };
        (constant - &self.bound.value, comparison)
    }

    pub(super) fn allows(&self, spent: &Rational) -> bool {
        let (difference, comparison) = self.as_demand(spent);
        comparison.holds(&difference, &Rational::ZERO)
    }
}

/// Returns `true` if some times satisfy all demands, the network and the limit on the cost. Stores
/// such times in the state.
pub(crate) fn is_possible(
    state: &mut State,
    compiled: &Compiled,
    limit: Option<(&Metric, &MetricBound)>,
) -> bool {
    let Some(symbolic) = &state.symbolic else {
        return true;
    };
    let limit = limit
        .filter(|(metric, _)| metric.only_grows && !symbolic.functions.is_empty())
        .and_then(|(metric, bound)| {
            let (spent, time) = objective(state, metric)?;
            Some(Limit { spent, time, bound })
        });
    if !symbolic.has_demands() && limit.is_none() {
        return true;
    }
    let constraints = Constraints::new(symbolic, compiled, limit.as_ref());
    let Some(times) = windows::place(&mut state.network, &constraints) else {
        return false;
    };
    if let Some(symbolic) = &mut state.symbolic {
        symbolic.times = times;
    }
    true
}

/// The constraints on times beyond those of the network.
pub(super) struct Constraints<'a> {
    pub(super) symbolic: &'a Symbolic,
    pub(super) compiled: &'a Compiled,
    pub(super) limit: Option<&'a Limit<'a>>,
    /// The known distances from a node to all others. All networks of these constraints have the same edges, and
    /// differ in the bounds of nodes.
    distances: RefCell<Vec<Option<Rc<[Ticks]>>>>,
}

impl<'a> Constraints<'a> {
    pub(super) fn new(
        symbolic: &'a Symbolic,
        compiled: &'a Compiled,
        limit: Option<&'a Limit<'a>>,
    ) -> Self {
        Self {
            symbolic,
            compiled,
            limit,
            distances: RefCell::default(),
        }
    }

    /// Returns the minimum distance of each node after `origin`.
    pub(super) fn distances_from(&self, network: &Network, origin: NodeId) -> Rc<[Ticks]> {
        let mut known = self.distances.borrow_mut();
        known.resize(network.node_count(), None);
        let row =
            known[usize::from(origin)].get_or_insert_with(|| network.distances_from(origin).into());
        Rc::clone(row)
    }

    /// Returns times of the happenings in the demands, and of `others`, that extend to times of all
    /// happenings, and satisfy all constraints. Returns `None` if there are none.
    pub(super) fn times(
        &self,
        network: &Network,
        others: &[NodeId],
    ) -> Option<Vec<(NodeId, Rational)>> {
        let compiled = self.compiled;
        // Off the grid, an undelayed happening is later than in the network.
        let is_projected = compiled.tuning.uses(Technique::Projection)
            && compiled.scale.units(compiled.now) == compiled.initial.time;
        if is_projected {
            return projected::times(network, others, self);
        }
        let times = all_times(network, &self.symbolic.demands, compiled, self.limit)?;
        Some((0..).zip(times).collect())
    }
}

/// Returns times of all happenings that solve their linear program.
pub(super) fn all_times(
    network: &Network,
    demands: &[(Form, Comparison)],
    compiled: &Compiled,
    limit: Option<&Limit<'_>>,
) -> Option<Vec<Rational>> {
    let earliest = limit
        .is_none()
        .then(|| earliest_times(network, demands, compiled));
    if let Some(earliest) = earliest.flatten() {
        return Some(earliest);
    }
    let (mut program, times, end) = program(network, demands, compiled, None);
    if let Some(limit) = limit {
        let row = objective_row(&limit.spent, &limit.time, &times, end);
        let (difference, comparison) = limit.as_demand(&limit.spent.constant);
        assert_comparison(&mut program, &row, difference, comparison);
    }
    program.check().ok()?;
    Some(values(&program, &times))
}

fn values(program: &Simplex, variables: &[VariableId]) -> Vec<Rational> {
    let model = program.model();
    let values = variables
        .iter()
        .map(|variable| model[variable.index()].clone());
    values.collect()
}

/// Returns the earliest time of each happening, if these times satisfy all demands. No linear
/// program is needed then.
fn earliest_times(
    network: &Network,
    demands: &[(Form, Comparison)],
    compiled: &Compiled,
) -> Option<Vec<Rational>> {
    let earliest: Vec<Rational> = network
        .bounds()
        .map(|bounds| window(bounds, compiled, None).0)
        .collect();
    let is_met = |(form, comparison): &(Form, Comparison)| {
        comparison.holds(&form.at(&earliest), &Rational::ZERO)
    };
    // Times rounded to ticks may violate the distances between them.
    let is_kept = |(from, to, distance): (NodeId, NodeId, Ticks)| {
        let gap = &earliest[usize::from(to)] - &earliest[usize::from(from)];
        gap >= compiled.scale.units(distance)
    };
    (demands.iter().all(is_met) && network.edges().all(is_kept)).then_some(earliest)
}

/// Returns times that satisfy all demands and the network. Exact data replace the network's rounded
/// numbers. The metric is minimal, and then the last happening is as early as possible.
pub(crate) fn solve(state: &State, compiled: &Compiled, exact: &Exact) -> Option<Vec<Rational>> {
    let symbolic = state.symbolic.as_ref()?;
    let constraints = Constraints::new(symbolic, compiled, None);
    let (mut program, times, end) =
        program(&state.network, &symbolic.demands, compiled, Some(exact));
    for (node, bounds) in windows::node_bounds(&state.network, &constraints)? {
        let (begin, end) = bounds;
        let time = times[usize::from(node)];
        if begin > compiled.now {
            program.assert_lower(time, Delta::from(compiled.scale.units(begin)), 0);
        }
        if end < NEVER {
            program.assert_upper(time, Delta::from(compiled.scale.units(end)), 0);
        }
    }
    let objective = compiled
        .metric
        .as_ref()
        .and_then(|metric| objective(state, metric));
    if let Some((spent, time)) = objective {
        let row = objective_row(&spent, &time, &times, end);
        let least = program.minimize(&row).ok()?;
        // If it has no minimum over these happenings, only the makespan decides.
        if let Optimum::Value(least) = least {
            let row = program.define(&row);
            program.assert_upper(row, least, 0);
        }
    }
    program.minimize(&[(end, Rational::ONE)]).ok()?;
    let times = values(&program, &times);
    let is_met = |(form, comparison): &(Form, Comparison)| {
        comparison.holds(&form.at(&times), &Rational::ZERO)
    };
    symbolic.demands.iter().all(is_met).then_some(times)
}

/// Returns the metric so far, and the weight of a unit of time. Returns `None` if the metric does
/// not depend on times, or is not linear in them.
fn objective(state: &State, metric: &Metric) -> Option<(Form, Rational)> {
    let symbolic = state.symbolic.as_ref()?;
    let Numeric::Linear(values) = &metric.values else {
        return None;
    };
    let mut sum = Form::constant(&values.constant + &state.cost);
    for (fluent, weight) in &values.terms {
        if let Some(value) = &state.values[*fluent as usize] {
            sum.constant += weight * value;
        } else if let Some(course) = symbolic.linear_function(*fluent) {
            if !course.rate.is_zero() {
                return None;
            }
            sum = sum.plus(weight, &course.base);
        }
    }
    // The end is not before the last happening, but may be after it.
    let time = metric.time.is_positive().then(|| metric.time.clone());
    let time = time.unwrap_or_default();
    (!sum.terms.is_empty() || time.is_positive()).then_some((sum, time))
}

/// Returns the objective as a row of the program, without the constant.
fn objective_row(
    spent: &Form,
    time: &Rational,
    times: &[VariableId],
    end: VariableId,
) -> Vec<(VariableId, Rational)> {
    let terms = spent.terms.iter();
    let mut row: Vec<(VariableId, Rational)> = terms
        .map(|(node, coefficient)| (times[usize::from(*node)], coefficient.clone()))
        .collect();
    if time.is_positive() {
        row.push((end, time.clone()));
    }
    row
}

/// Returns the bounds on the time of a node from the network.
fn window(
    (floor, latest): (Ticks, Ticks),
    compiled: &Compiled,
    known: Option<(&Exact, NodeId)>,
) -> (Rational, Option<Rational>) {
    let scale = compiled.scale;
    let end = known.and_then(|(exact, node)| exact.ends.iter().find(|end| end.node == node));
    if let Some(end) = end {
        return (end.after(floor, compiled), end.before(latest, compiled));
    }
    let earliest = match known {
        _ if latest == floor => scale.units(floor),
        Some(_) => not_before(floor, compiled),
        None => compiled.earliest(floor),
    };
    (earliest, (latest < NEVER).then(|| scale.units(latest)))
}

/// Returns the linear program, the variables of its nodes, and one that is not before any of them.
/// `exact` are the exact data, if the times of a plan are computed.
pub(super) fn program(
    network: &Network,
    demands: &[(Form, Comparison)],
    compiled: &Compiled,
    exact: Option<&Exact>,
) -> (Simplex, Vec<VariableId>, VariableId) {
    let scale = compiled.scale;
    let mut program = Simplex::new();
    let times: Vec<VariableId> = network.bounds().map(|_| program.add_variable()).collect();
    let end = program.add_variable();
    for ((node, &time), bounds) in (0..).zip(&times).zip(network.bounds()) {
        let (earliest, latest) = window(bounds, compiled, exact.map(|exact| (exact, node)));
        program.assert_lower(time, Delta::from(earliest), 0);
        if let Some(latest) = latest {
            program.assert_upper(time, Delta::from(latest), 0);
        }
        let after = [(end, Rational::ONE), (time, Rational::from(-1))];
        let after = program.define(&after);
        program.assert_lower(after, Delta::ZERO, 0);
    }
    let mut distances: Vec<(NodeId, NodeId, Rational)> = network
        .edges()
        .map(|(from, to, distance)| (from, to, scale.units(distance)))
        .collect();
    for (from, to, distance) in exact.iter().flat_map(|exact| &exact.distances) {
        for edge in &mut distances {
            if (edge.0, edge.1) == (*from, *to) {
                edge.2 = exact_distance(&edge.2, distance, compiled);
            }
        }
    }
    for (from, to, distance) in distances {
        let difference = [
            (times[usize::from(to)], Rational::ONE),
            (times[usize::from(from)], Rational::from(-1)),
        ];
        let difference = program.define(&difference);
        program.assert_lower(difference, Delta::from(distance), 0);
    }
    for (form, comparison) in demands {
        let row: Vec<(VariableId, Rational)> = form
            .terms
            .iter()
            .map(|(node, coefficient)| (times[usize::from(*node)], coefficient.clone()))
            .collect();
        assert_comparison(&mut program, &row, form.constant.clone(), *comparison);
    }
    (program, times, end)
}

/// Asserts `row + constant comparison 0`.
pub(super) fn assert_comparison(
    program: &mut Simplex,
    row: &[(VariableId, Rational)],
    constant: Rational,
    comparison: Comparison,
) {
    let row = program.define(row);
    let bound = -constant;
    match comparison {
        Comparison::Less => program.assert_upper(row, Delta::just_below(bound), 0),
        Comparison::AtMost => program.assert_upper(row, Delta::from(bound), 0),
        Comparison::Equal => {
            program.assert_upper(row, Delta::from(bound.clone()), 0);
            program.assert_lower(row, Delta::from(bound), 0);
        }
        Comparison::AtLeast => program.assert_lower(row, Delta::from(bound), 0),
        Comparison::Greater => program.assert_lower(row, Delta::just_above(bound), 0),
    }
}
