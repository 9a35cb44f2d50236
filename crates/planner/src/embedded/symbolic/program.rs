//! The linear program of a state: whether there are times for it, and which ones are the best.

use elbowroom_model::problem::Comparison;
use elbowroom_num::simplex::{Optimum, Simplex, VariableId};
use elbowroom_num::{Delta, Rational};

use super::super::bound::MetricBound;
use super::super::compile::{Compiled, Metric};
use super::super::expressions::Form;
use super::super::formula::Numeric;
use super::super::network::{Network, NodeId};
use super::super::state::State;
use super::super::time::NEVER;

/// Whether there are times that meet all demands and the network, and leave what has been spent
/// within the limit.
pub(crate) fn is_possible(
    state: &State,
    compiled: &Compiled,
    limit: Option<(&Metric, &MetricBound)>,
) -> bool {
    let Some(symbolic) = &state.symbolic else {
        return true;
    };
    let limit = limit.filter(|(metric, _)| metric.only_grows);
    let is_limited = limit.is_some() && !symbolic.courses.is_empty();
    if !symbolic.has_demands() && !is_limited {
        return true;
    }
    let (mut program, times, end) = program(&state.network, &symbolic.demands, compiled, &[]);
    if is_limited
        && let Some((metric, limit)) = limit
        && let Some((row, constant)) = objective(state, metric, &times, end)
    {
        let left = &limit.value - &constant;
        let row = program.define(&row);
        let bound = if limit.may_equal {
            Delta::from(left)
        } else {
            Delta::just_below(left)
        };
        program.assert_upper(row, bound, 0);
    }
    program.check().is_ok()
}

/// Times that meet all demands and the network; what `exact` says of distances from one node to
/// another replaces the network's rounded numbers. The metric is as low as it can be, and then the
/// last one is as early as possible.
pub(crate) fn solve(
    state: &State,
    compiled: &Compiled,
    exact: &[(NodeId, NodeId, Rational)],
) -> Option<Vec<Rational>> {
    let symbolic = state.symbolic.as_ref()?;
    let (mut program, times, end) = program(&state.network, &symbolic.demands, compiled, exact);
    let objective = compiled
        .metric
        .as_ref()
        .and_then(|metric| objective(state, metric, &times, end));
    if let Some((row, _)) = objective {
        let least = program.minimize(&row).ok()?;
        // Where it has no minimum, as far as these happenings go, the makespan alone decides.
        if let Optimum::Value(least) = least {
            let row = program.define(&row);
            program.assert_upper(row, least, 0);
        }
    }
    program.minimize(&[(end, Rational::ONE)]).ok()?;
    let model = program.model();
    let times: Vec<Rational> = times
        .iter()
        .map(|time| model[time.index()].clone())
        .collect();
    let is_met = |(form, comparison): &(Form, Comparison)| {
        comparison.holds(&form.at(&times), &Rational::ZERO)
    };
    symbolic.demands.iter().all(is_met).then_some(times)
}

/// The metric, as far as it has been spent: a row of the program, and a constant. `None` if times
/// have no bearing on it, or it is not linear in them.
fn objective(
    state: &State,
    metric: &Metric,
    times: &[VariableId],
    end: VariableId,
) -> Option<(Vec<(VariableId, Rational)>, Rational)> {
    let symbolic = state.symbolic.as_ref()?;
    let Numeric::Linear(values) = &metric.values else {
        return None;
    };
    let mut sum = Form::constant(&values.constant + &state.cost);
    for (fluent, weight) in &values.terms {
        if let Some(value) = &state.values[*fluent as usize] {
            sum.constant += weight * value;
        } else if let Some(course) = symbolic.course(*fluent) {
            if !course.rate.is_zero() {
                return None;
            }
            sum = sum.plus(weight, &course.base);
        }
    }
    let mut row: Vec<(VariableId, Rational)> = sum
        .terms
        .into_iter()
        .map(|(node, coefficient)| (times[usize::from(node)], coefficient))
        .collect();
    // The end is not before the last happening, but need not be at it.
    if metric.time.is_positive() {
        row.push((end, metric.time.clone()));
    }
    (!row.is_empty()).then_some((row, sum.constant))
}

/// The linear program, the variables of its nodes, and one that is not before any of them.
fn program(
    network: &Network,
    demands: &[(Form, Comparison)],
    compiled: &Compiled,
    exact: &[(NodeId, NodeId, Rational)],
) -> (Simplex, Vec<VariableId>, VariableId) {
    let scale = compiled.scale;
    let mut program = Simplex::new();
    let times: Vec<VariableId> = network.bounds().map(|_| program.add_variable()).collect();
    let end = program.add_variable();
    for (&time, (floor, latest)) in times.iter().zip(network.bounds()) {
        let earliest = if latest > floor {
            compiled.earliest(floor)
        } else {
            scale.units(floor)
        };
        program.assert_lower(time, Delta::from(earliest), 0);
        if latest < NEVER {
            program.assert_upper(time, Delta::from(scale.units(latest)), 0);
        }
        let after = [(end, Rational::ONE), (time, Rational::from(-1))];
        let after = program.define(&after);
        program.assert_lower(after, Delta::ZERO, 0);
    }
    let mut distances: Vec<(NodeId, NodeId, Rational)> = network
        .edges()
        .map(|(from, to, distance)| (from, to, scale.units(distance)))
        .collect();
    for (from, to, distance) in exact {
        for edge in &mut distances {
            if (edge.0, edge.1) == (*from, *to) {
                edge.2.clone_from(distance);
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
        let row = program.define(&row);
        let bound = -&form.constant;
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
    (program, times, end)
}
