//! What every schedule of a plan has to satisfy, written out so that others can check values: the
//! sliders of a page do.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use elbowroom_envelope::linear::{Factor, Linear};
use elbowroom_envelope::obligations::{
    BadCase, Difference, Inequality, Obligation, Obligations, OverAll, Requirement,
};
use elbowroom_envelope::reduction::Reduction;
use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_plan::{
    Bound, Constraint, DecoupledEnvelope, NodeId, ParametrizedPlan, Side, network_node,
};
use elbowroom_stn::{ConsistentNetwork, Windows};
use serde::{Deserialize, Serialize};

use super::timeline::relaxed;
use crate::explain::Explainer;

/// Larger plans are not written out: too many nodes.
const MOST_TIMES: usize = 400;
/// Larger plans are not written out: too many inequalities.
const MOST_ROWS: usize = 5_000;
/// How many places of a moment inside an action are told apart.
const MOST_CUTS: usize = 64;

/// The times and parameters of a plan, and what they must satisfy.
///
/// With values for the parameters, the plan works exactly if the network has a schedule and no
/// requirement can be broken in any of its schedules. Rows are texts such as
/// `t3 + -1*t1 + -1*p0 <= 0`: a sum of products of numbers, times (`t3` is the fourth of
/// [`times`](Self::times)) and parameters (`p0` is the first of the answer's), and `<=` or `<`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Inequalities {
    /// The labels of the time points, as in STN plan files. The first is time zero. Requirements
    /// may use one more: a moment inside an action.
    pub times: Vec<String>,
    /// Bounds on differences of times.
    pub network: Vec<NetworkRow>,
    /// What must hold in every schedule.
    pub requirements: Vec<RequirementRow>,
}

/// A bound on a difference of times.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct NetworkRow {
    /// The inequality.
    pub row: String,
    /// Whether it says that something takes at least so long.
    pub is_need: bool,
    /// What takes so long, or what it must fit into; `None` for mere orderings.
    pub words: Option<String>,
}

/// A requirement, with all the ways in which it can be broken.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RequirementRow {
    /// What is required.
    pub words: String,
    /// Whether it is the order of two happenings. If that is broken, nothing follows from the rest:
    /// in another order the plan may work, too.
    pub is_order: bool,
    /// Broken if, for one of these, all inequalities hold at once.
    pub broken_if: Vec<Vec<String>>,
}

impl Inequalities {
    /// Those of a plan; `None` if they are too many, or beyond writing out.
    pub fn of(explainer: &Explainer<'_>) -> Option<Self> {
        let (task, plan) = (explainer.task, explainer.plan);
        if plan.plan.nodes.len() > MOST_TIMES {
            return None;
        }
        let nominal = plan.nominal();
        let zero = network_node(NodeId::ZERO);
        let schedule = ConsistentNetwork::try_from(plan.plan.network(&nominal)).ok()?;
        let schedule = schedule.earliest_schedule(zero);
        let schedule = schedule.times().iter().cloned().collect();
        let reduction = Reduction::new(plan);
        let obligations =
            Obligations::compile(task, plan, &schedule, &reduction.substitution).ok()?;
        let mut requirements: Vec<RequirementRow> = obligations
            .direct
            .iter()
            .map(|obligation| requirement(task, plan, obligation))
            .collect();
        let order = Order::of(plan, &obligations.over_all)?;
        for over_all in &obligations.over_all {
            let obligation = Obligation {
                requirement: Requirement::OverAll {
                    instance: over_all.instance,
                    condition: over_all.condition.clone(),
                },
                bad_cases: unfolded(task, plan, over_all, &order)?,
            };
            requirements.push(requirement(task, plan, &obligation));
        }
        let network = network(explainer);
        let cases = requirements.iter().flat_map(|it| &it.broken_if);
        let rows = network.len() + cases.map(Vec::len).sum::<usize>();
        (rows <= MOST_ROWS).then(|| Self {
            times: plan
                .plan
                .nodes()
                .map(|(node, _)| plan.plan.node_label(node))
                .collect(),
            network,
            requirements,
        })
    }
}

fn requirement(task: &Task, plan: &ParametrizedPlan, obligation: &Obligation) -> RequirementRow {
    let rows = |case: &BadCase| {
        let differences = case.differences.iter().map(difference_row);
        differences
            .chain(case.inequalities.iter().map(inequality_row))
            .collect()
    };
    RequirementRow {
        words: obligation.requirement.describe(task, &plan.plan),
        is_order: matches!(obligation.requirement, Requirement::Separation { .. }),
        broken_if: obligation.bad_cases.iter().map(rows).collect(),
    }
}

/// The ways in which an over-all condition can be broken, for each place that its moment can have
/// among the events that it depends on.
fn unfolded(
    task: &Task,
    plan: &ParametrizedPlan,
    over_all: &OverAll,
    order: &Order,
) -> Option<Vec<BadCase>> {
    let mut cuts = Vec::new();
    order.cuts(over_all, &mut Vec::new(), &mut cuts)?;
    let mut cases = Vec::new();
    for happened in cuts {
        let moment = over_all.moment;
        let mut differences = vec![
            Difference::before(over_all.start, moment),
            Difference::before(moment, over_all.end),
        ];
        let events = over_all.events.iter().zip(&happened);
        differences.extend(events.map(|(&event, &has_happened)| {
            if has_happened {
                Difference::not_after(event, moment)
            } else {
                Difference::before(moment, event)
            }
        }));
        let cut = |node: NodeId| {
            let position = over_all.events.iter().position(|event| *event == node);
            position.is_some_and(|position| happened[position])
        };
        for mut inequalities in over_all.cases(task, &plan.plan, &cut).ok()? {
            inequalities.extend(over_all.assumptions.iter().cloned());
            cases.push(BadCase {
                differences: differences.clone(),
                inequalities,
            });
        }
    }
    Some(cases)
}

/// Which events come first whatever the values.
struct Order(BTreeMap<NodeId, Windows>);

impl Order {
    fn of(plan: &ParametrizedPlan, over_all: &[OverAll]) -> Option<Self> {
        if over_all.is_empty() {
            return Some(Self(BTreeMap::new()));
        }
        let ranges = DecoupledEnvelope::ranges(plan);
        let network = ConsistentNetwork::try_from(relaxed(plan, &ranges)).ok()?;
        let mut windows = BTreeMap::new();
        for own in over_all {
            for &node in own.events.iter().chain([&own.start, &own.end]) {
                let seen_from = || network.windows(network_node(node));
                windows.entry(node).or_insert_with(seen_from);
            }
        }
        Some(Self(windows))
    }

    fn is_never_after(&self, first: NodeId, second: NodeId) -> bool {
        let seen_from = self.0.get(&second);
        let latest = seen_from.and_then(|windows| windows[network_node(first)].latest.as_ref());
        latest.is_some_and(|latest| *latest <= Rational::ZERO)
    }

    /// Which of the events can have happened at a moment inside the action, in all ways.
    fn cuts(
        &self,
        over_all: &OverAll,
        happened: &mut Vec<bool>,
        found: &mut Vec<Vec<bool>>,
    ) -> Option<()> {
        let Some(&event) = over_all.events.get(happened.len()) else {
            found.push(happened.clone());
            return (found.len() <= MOST_CUTS).then_some(());
        };
        let placed = over_all.events.iter().zip(happened.iter());
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
                self.cuts(over_all, happened, found)?;
                happened.pop();
            }
        }
        Some(())
    }
}

/// The plan's own bounds. That nothing happens before time zero is one of them.
fn network(explainer: &Explainer<'_>) -> Vec<NetworkRow> {
    let plan = &explainer.plan.plan;
    let mut rows: Vec<NetworkRow> = plan
        .nodes()
        .skip(1)
        .map(|(node, _)| NetworkRow {
            row: difference_row(&Difference::not_after(NodeId::ZERO, node)),
            is_need: false,
            words: None,
        })
        .collect();
    for constraint in &plan.constraints {
        for side in Side::BOTH {
            let Some(row) = bound_row(constraint, side) else {
                continue;
            };
            rows.push(NetworkRow {
                row,
                is_need: side == Side::Lower,
                words: explainer.bound_words(constraint, side),
            });
        }
    }
    rows
}

/// One side of a constraint; `None` if there is no bound on that side.
fn bound_row(constraint: &Constraint, side: Side) -> Option<String> {
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
    Some(row(&expression, false))
}

fn difference_row(difference: &Difference) -> String {
    let mut expression = Linear::difference(difference.from, difference.to);
    expression.constant = -&difference.bound;
    row(&expression, difference.is_strict)
}

fn inequality_row(inequality: &Inequality) -> String {
    row(&inequality.expression, inequality.is_strict)
}

/// `expression <= 0`, or `< 0`.
fn row(expression: &Linear, is_strict: bool) -> String {
    let mut row = String::new();
    let mut term = |coefficient: &Rational, factors: &str| {
        let separator = if row.is_empty() { "" } else { " + " };
        let _ = if *coefficient == Rational::ONE {
            write!(row, "{separator}{factors}")
        } else {
            write!(row, "{separator}{coefficient}*{factors}")
        };
    };
    for (node, coefficient) in &expression.times {
        term(coefficient, &format!("t{}", node.index()));
    }
    for (id, coefficient) in &expression.parameters {
        term(coefficient, &format!("p{}", id.index()));
    }
    for ((id, factor), coefficient) in &expression.products {
        let other = match factor {
            Factor::Time(node) => format!("t{}", node.index()),
            Factor::Parameter(other) => format!("p{}", other.index()),
        };
        term(coefficient, &format!("p{}*{other}", id.index()));
    }
    if !expression.constant.is_zero() || row.is_empty() {
        let separator = if row.is_empty() { "" } else { " + " };
        let _ = write!(row, "{separator}{}", expression.constant);
    }
    let _ = write!(row, " {} 0", if is_strict { "<" } else { "<=" });
    row
}
