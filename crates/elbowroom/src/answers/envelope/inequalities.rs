//! What every schedule of a plan has to satisfy, written out so that others can check values: the
//! sliders of a page do.

use std::fmt::Write as _;

use elbowroom_envelope::linear::Factor;
use elbowroom_envelope::obligations::{BadCase, Inequality, Obligation, Requirement};
use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_plan::{DecoupledEnvelope, ParametrizedPlan, Side};
use serde::{Deserialize, Serialize};

use crate::explain::Explainer;
use crate::linear_form::{LinearForm, NetworkBound, inequality};

/// Larger plans are not written out: too many nodes.
const MOST_TIMES: usize = 400;
/// Larger plans are not written out: too many inequalities.
const MOST_ROWS: usize = 5_000;
/// How many places of a moment inside an action are told apart.
const MOST_PLACES: usize = 64;

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
        let ranges = DecoupledEnvelope::ranges(plan);
        let form = LinearForm::new(task, plan, &ranges, &plan.nominal(), MOST_PLACES).ok()?;
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

/// A bound, in words where it is more than an ordering.
fn network_row(explainer: &Explainer<'_>, bound: &NetworkBound) -> NetworkRow {
    let constraint = |index: usize| &explainer.plan.plan.constraints[index];
    NetworkRow {
        row: row(&bound.inequality),
        is_need: matches!(bound.source, Some((_, Side::Lower))),
        words: bound
            .source
            .and_then(|(index, side)| explainer.bound_words(constraint(index), side)),
    }
}

/// `expression <= 0`, or `< 0`.
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
