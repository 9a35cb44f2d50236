//! Conditions that have to hold at every moment inside an action.

use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_plan::{NodeId, Schedule, StnPlan, Valuation};

use crate::linear::{Factor, Linear};
use crate::obligations::{Inequality, OverAll, Refusal};

/// Returns alternatives that avoid this schedule's violation of the condition: one of these
/// expressions is `<= 0` (`< 0` when strict) in every valid schedule. `None` if the condition is
/// not violated.
///
/// Between two consecutive events that the condition depends on, the violation is linear in the
/// moment. So the condition holds between them exactly if it holds in the limit at both. If it
/// fails at one of them, either that value changes, or this event is no longer the last one before
/// the moment, or the first one after it.
///
/// # Errors
/// If a value is not linear, or if the violation has several parts.
pub(super) fn avoiding_alternatives(
    task: &Task,
    plan: &StnPlan,
    over_all: &OverAll,
    values: &Valuation,
    schedule: &Schedule,
) -> Result<Option<Vec<(Linear, bool)>>, Refusal> {
    let (start, end) = (over_all.start, over_all.end);
    let is_inside =
        |node: &NodeId| schedule[start] < schedule[*node] && schedule[*node] < schedule[end];
    let events = over_all.events(false);
    let inside = events.iter().copied().filter(is_inside);
    let mut times: Vec<NodeId> = inside.collect();
    times.extend([start, end]);
    times.sort_by(|a, b| schedule[*a].cmp(&schedule[*b]));
    times.dedup_by(|a, b| schedule[*a] == schedule[*b]);
    if !over_all
        .assumptions
        .iter()
        .all(|own| own.holds(schedule, values))
    {
        return Ok(None);
    }
    for pair in times.windows(2) {
        let (since, until) = (pair[0], pair[1]);
        let has_happened = |node: NodeId| schedule[node] <= schedule[since];
        for case in over_all.cases(task, plan, false, &has_happened)? {
            if !holds_between(&case, over_all.moment, [since, until], values, schedule) {
                continue;
            }
            if !over_all.assumptions.is_empty() {
                return Err(several_parts(plan, over_all));
            }
            let is_before = |node: NodeId| schedule[node] <= schedule[since];
            let Some(inequality) = case.first() else {
                return Ok(Some(others(over_all, is_before, since, true)));
            };
            let ends = [(since, true), (until, false)]
                .into_iter()
                .map(|(at, is_first)| {
                    let expression = read_at(&inequality.expression, over_all.moment, at);
                    (at, is_first, expression)
                });
            let mut failing =
                ends.filter(|(_, _, expression)| expression.value(schedule, values).is_negative());
            // If it is not below zero at either end, it is zero throughout, and must not be.
            let (Some((at, is_first, expression)), [_]) = (failing.next(), case.as_slice()) else {
                return Err(several_parts(plan, over_all));
            };
            let mut alternatives = vec![(expression.scaled(&Rational::from(-1)), false)];
            alternatives.extend(others(over_all, is_before, at, is_first));
            return Ok(Some(alternatives));
        }
    }
    Ok(None)
}

fn several_parts(plan: &StnPlan, over_all: &OverAll) -> Refusal {
    Refusal::TooManyCases {
        place: format!(
            "an over-all condition of {} that can fail in several ways at the same time",
            plan.instance(over_all.instance).action.name
        ),
        limit: 1,
    }
}

/// Returns the alternatives that another event than `at` is the last one before the moment
/// (`is_first`), or the first one after it, or that there is no moment between these events.
fn others(
    over_all: &OverAll,
    is_before: impl Fn(NodeId) -> bool,
    at: NodeId,
    is_first: bool,
) -> Vec<(Linear, bool)> {
    let events = over_all.events(false);
    let nodes = events.iter().copied();
    let nodes = nodes.chain([over_all.start, over_all.end]);
    let others = nodes.filter(|&node| node != at).map(|node| {
        // Events that coincide with `at` change nothing.
        if is_before(node) {
            (Linear::difference(node, at), is_first)
        } else {
            (Linear::difference(at, node), !is_first)
        }
    });
    others.collect()
}

/// Returns the expression at a moment that coincides with a node.
fn read_at(expression: &Linear, moment: NodeId, at: NodeId) -> Linear {
    let mut read = expression.clone();
    if let Some(factor) = read.times.remove(moment) {
        read.add_time(at, &factor);
    }
    let products: Vec<_> = read.products.keys().collect();
    for (parameter, factor) in products {
        if factor == Factor::Time(moment)
            && let Some(amount) = read.products.remove((parameter, factor))
        {
            let mut moved = Linear::default();
            if at != NodeId::ZERO {
                moved.products.add((parameter, Factor::Time(at)), &amount);
            }
            read.add_scaled(&moved, &Rational::ONE);
        }
    }
    read
}

/// Returns `true` if all inequalities hold at one moment strictly between two times.
fn holds_between(
    case: &[Inequality],
    moment: NodeId,
    between: [NodeId; 2],
    values: &Valuation,
    schedule: &Schedule,
) -> bool {
    let [since, until] = between.map(|node| &schedule[node]);
    // The interval of moments at which all of them hold, each end with `true` if it is excluded.
    let (mut least, mut most) = ((since.clone(), true), (until.clone(), true));
    for inequality in case {
        let at =
            |node: NodeId| read_at(&inequality.expression, moment, node).value(schedule, values);
        let [begins, stops] = between.map(at);
        let slope = (&stops - &begins) / (until - since);
        let is_strict = inequality.is_strict;
        if slope.is_zero() {
            if begins.is_positive() || (begins.is_zero() && is_strict) {
                return false;
            }
            continue;
        }
        let root = since - &(&begins / &slope);
        if slope.is_positive() {
            if root < most.0 {
                most = (root, is_strict);
            } else if root == most.0 {
                most.1 |= is_strict;
            }
        } else if root > least.0 {
            least = (root, is_strict);
        } else if root == least.0 {
            least.1 |= is_strict;
        }
    }
    least.0 < most.0 || (least.0 == most.0 && !least.1 && !most.1)
}
