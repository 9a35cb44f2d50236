//! The inequalities that every schedule of a plan satisfies, written as text so that other programs
//! can check values (such as the sliders of a page).

use std::fmt::Write as _;

use elbowroom_envelope::explain::Explainer;
use elbowroom_envelope::linear::Factor;
use elbowroom_envelope::linear_form::{LinearForm, NetworkBound, inequality};
use elbowroom_envelope::obligations::{BadCase, Inequality, Obligation, Requirement};
use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_plan::{DecoupledEnvelope, ParametrizedPlan, Side};
use serde::{Deserialize, Serialize};

/// Largest number of nodes of a plan whose inequalities are written.
const MAX_TIMES: usize = 400;
/// Largest number of inequalities that are written.
const MAX_ROWS: usize = 5_000;
/// Largest number of positions that are distinguished for a moment inside an action.
const MAX_POSITIONS: usize = 64;

/// The times and parameters of a plan, and the inequalities that they satisfy.
///
/// For given values of the parameters, the plan works exactly if the network has a schedule and no
/// schedule violates a requirement. Rows are texts such as `t3 + -1*t1 + -1*p0 <= 0`: a sum of
/// products of numbers, times (`t3` is the fourth of [`times`](Self::times)) and parameters (`p0`
/// is the first of the answer's), and `<=` or `<`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Inequalities {
    /// The labels of the time points, as in STN plan files. The first is time zero. Requirements
    /// may use one more: a moment inside an action.
    pub times: Vec<String>,
    /// Bounds on differences of times.
    pub network: Vec<NetworkRow>,
    /// Requirements on every schedule.
    pub requirements: Vec<RequirementRow>,
}

/// A bound on a difference of times.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct NetworkRow {
    /// The inequality.
    pub row: String,
    /// `true` if it is a lower bound: something takes at least this long.
    pub is_need: bool,
    /// The bound in words; `None` for mere orderings.
    pub words: Option<String>,
}

/// A requirement, with all ways to violate it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RequirementRow {
    /// The requirement in words.
    pub words: String,
    /// `true` if it is the order of two happenings. A violation of it does not prove that the plan
    /// fails: the plan may also work in another order.
    pub is_order: bool,
    /// The cases of a violation: it is violated if all inequalities of one of them hold.
    pub broken_if: Vec<Vec<String>>,
}

impl Inequalities {
    /// Returns the inequalities of a plan; `None` if there are too many, or if they cannot be
    /// written as rows.
    pub fn of(explainer: &Explainer<'_>) -> Option<Self> {
        let (task, plan) = (explainer.task, explainer.plan);
        if plan.plan.nodes.len() > MAX_TIMES {
            return None;
        }
        let ranges = DecoupledEnvelope::ranges(plan);
        let form = LinearForm::new(task, plan, &ranges, &plan.nominal(), MAX_POSITIONS).ok()?;
        let requirements: Vec<RequirementRow> = form
            .obligations
            .iter()
            .map(|obligation| requirement(task, plan, obligation))
            .collect();
        let network: Vec<NetworkRow> = form
            .network
            .iter()
            .map(|bound| network_row(explainer, bound))
            .collect();
        let cases = requirements.iter().flat_map(|it| &it.broken_if);
        let rows = network.len() + cases.map(Vec::len).sum::<usize>();
        (rows <= MAX_ROWS).then(|| Self {
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
        let differences = case.differences.iter().map(|own| row(&inequality(own)));
        differences
            .chain(case.inequalities.iter().map(row))
            .collect()
    };
    RequirementRow {
        words: obligation.requirement.describe(task, &plan.plan),
        is_order: matches!(obligation.requirement, Requirement::Separation { .. }),
        broken_if: obligation.bad_cases.iter().map(rows).collect(),
    }
}

/// Converts a bound to a row, with a description unless it is a mere ordering.
fn network_row(explainer: &Explainer<'_>, bound: &NetworkBound) -> NetworkRow {
    let constraint = |index: usize| &explainer.plan.plan.constraints[index];
    NetworkRow {
        row: row(&bound.inequality),
        is_need: matches!(bound.source, Some((_, Side::Lower))),
        words: bound
            .source
            .and_then(|(index, side)| explainer.describe_bound(constraint(index), side)),
    }
}

/// Formats `expression <= 0`, or `< 0`.
fn row(inequality: &Inequality) -> String {
    let Inequality {
        expression,
        is_strict,
    } = inequality;
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
    let _ = write!(row, " {} 0", if *is_strict { "<" } else { "<=" });
    row
}
