//! Values in a box without a schedule, by branching.
//!
//! Each bound is first taken at its worst, independently of the others of its parameter, except
//! that no path uses a parameter to another time point and directly back. If there is no negative
//! cycle, all values have a schedule. If a negative cycle uses no parameter in both directions, its
//! bounds are at their worst all at once, for some values. Otherwise one such parameter is set to
//! one end, then to the other: the values with a schedule form a convex set.

use std::collections::BTreeMap;

use elbowroom_num::{End, Interval, Rational};
use elbowroom_plan::{Bound, DecoupledEnvelope, ParametrizedPlan};

/// Limit on branches that are examined.
const MAX_BRANCHES: usize = 200_000;

/// A multiple of infinity, and a number.
type Extended = (i64, Rational);

/// Upper bound on the time from `from` to `to`.
struct Edge {
    from: usize,
    to: usize,
    bound: Limit,
}

enum Limit {
    Number(Rational),
    /// The value of the parameter, times 1 or -1.
    Parameter(usize, i64),
}

/// Returns `true` if some values in the box have no schedule; `None` if the check takes too long.
pub(crate) fn are_missing(plan: &ParametrizedPlan, envelope: &DecoupledEnvelope) -> Option<bool> {
    let edges = edges(plan);
    let mut branches: Vec<BTreeMap<usize, Extended>> = vec![BTreeMap::new()];
    for _ in 0..MAX_BRANCHES {
        let Some(chosen) = branches.pop() else {
            return Some(false);
        };
        let worst = |edge: &Edge| match &edge.bound {
            Limit::Number(value) => (0, value.clone()),
            Limit::Parameter(index, sign) => match chosen.get(index) {
                Some(value) => times(value, *sign),
                None => least(&envelope.intervals()[*index], *sign),
            },
        };
        let Some(cycle) = negative_cycle(&edges, &worst) else {
            continue;
        };
        let mut weight = (0, Rational::ZERO);
        let mut multiples: BTreeMap<usize, i64> = BTreeMap::new();
        for edge in &cycle {
            match &edges[*edge].bound {
                Limit::Number(_) => weight = plus(&weight, &worst(&edges[*edge])),
                Limit::Parameter(index, sign) => *multiples.entry(*index).or_default() += sign,
            }
        }
        for (index, multiple) in multiples {
            let share = match chosen.get(&index) {
                Some(value) => times(value, multiple),
                None => least(&envelope.intervals()[index], multiple),
            };
            weight = plus(&weight, &share);
        }
        if weight < (0, Rational::ZERO) {
            return Some(true);
        }
        // Its bounds on the cycle were not all at their worst at once.
        let torn = cycle.iter().find_map(|edge| match edges[*edge].bound {
            Limit::Parameter(index, sign) if !chosen.contains_key(&index) => cycle
                .iter()
                .any(|other| matches!(edges[*other].bound, Limit::Parameter(i, s) if i == index && s != sign))
                .then_some(index),
            _ => None,
        });
        let index = torn.expect("else the cycle has the weight for which it was found");
        for sign in [1, -1] {
            let end = times(&least(&envelope.intervals()[index], sign), sign);
            let mut branch = chosen.clone();
            branch.insert(index, end);
            branches.push(branch);
        }
    }
    None
}

fn edges(plan: &ParametrizedPlan) -> Vec<Edge> {
    let mut edges = Vec::new();
    for node in 1..plan.plan.nodes.len() {
        // No time is negative.
        let bound = Limit::Number(Rational::ZERO);
        edges.push(Edge {
            from: node,
            to: 0,
            bound,
        });
    }
    for constraint in &plan.plan.constraints {
        let (from, to) = (constraint.from.index(), constraint.to.index());
        let ways = [
            (from, to, &constraint.upper, 1),
            (to, from, &constraint.lower, -1),
        ];
        for (from, to, bound, sign) in ways {
            let bound = match bound {
                Bound::Infinite => continue,
                Bound::Finite(value) => Limit::Number(value * Rational::from(sign)),
                Bound::Parameter(id) => Limit::Parameter(id.index(), sign),
            };
            edges.push(Edge { from, to, bound });
        }
    }
    edges
}

/// Returns the least of `multiple` times a value in the interval.
fn least(interval: &Interval, multiple: i64) -> Extended {
    let end = |end: &End, infinite: i64| match end.value() {
        Some(value) => (0, value.clone()),
        None => (infinite, Rational::ZERO),
    };
    let ends = [end(&interval.lower, -1), end(&interval.upper, 1)];
    let [lower, upper] = ends.map(|end| times(&end, multiple));
    lower.min(upper)
}

fn times(value: &Extended, multiple: i64) -> Extended {
    (value.0 * multiple, &value.1 * Rational::from(multiple))
}

fn plus(a: &Extended, b: &Extended) -> Extended {
    (a.0 + b.0, &a.1 + &b.1)
}

/// Returns `true` if a path may contain both edges, one after the other.
fn may_follow(first: &Edge, second: &Edge) -> bool {
    let goes_back = match (&first.bound, &second.bound) {
        (Limit::Parameter(a, _), Limit::Parameter(b, _)) => a == b && second.to == first.from,
        _ => false,
    };
    first.to == second.from && !goes_back
}

/// Returns the edges of a cycle of negative weight, by Bellman and Ford's algorithm on paths by
/// their last edge.
fn negative_cycle(edges: &[Edge], weight: &dyn Fn(&Edge) -> Extended) -> Option<Vec<usize>> {
    let weights: Vec<_> = edges.iter().map(weight).collect();
    let followers: Vec<Vec<usize>> = edges
        .iter()
        .map(|first| {
            let all = 0..edges.len();
            all.filter(|&second| may_follow(first, &edges[second]))
                .collect()
        })
        .collect();
    let mut distance = weights.clone();
    let mut before: Vec<Option<usize>> = vec![None; edges.len()];
    let mut last = None;
    for _ in 0..=edges.len() {
        last = None;
        for first in 0..edges.len() {
            for &second in &followers[first] {
                let here = plus(&distance[first], &weights[second]);
                if here < distance[second] {
                    distance[second] = here;
                    before[second] = Some(first);
                    last = Some(second);
                }
            }
        }
        last?;
    }
    let back = |edge: usize| before[edge].expect("its distance has been shortened");
    let mut edge = last?;
    for _ in 0..edges.len() {
        edge = back(edge);
    }
    let mut cycle = vec![edge];
    let mut earlier = back(edge);
    while earlier != edge {
        cycle.push(earlier);
        earlier = back(earlier);
    }
    Some(cycle)
}
