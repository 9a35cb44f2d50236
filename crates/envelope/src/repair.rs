//! The cheapest change of a plan's quantities that makes the plan work.
//!
//! A plan works with some values of its quantities if it has a valid schedule with the plan's order
//! of interfering actions. Timed initials may come before or after actions, as needed. The search
//! learns the requirements step by step, like the cuts of [`best`](crate::best()):
//!
//! - A linear program contains the plan's bounds and orders. Its variables are the times of all
//!   happenings and the quantities that may change. It minimises the cost of their changes.
//! - The validator checks its schedule. If it accepts the schedule, this is the cheapest repair.
//! - Otherwise some [obligation](crate::obligations) is violated. The violation is a conjunction of
//!   inequalities, whose expressions assume the order of the schedule. So in each valid schedule
//!   one of these is false, or some happenings come in another order. The search branches into
//!   these cases, the one with the least cost first.
//!
//! The cases are exhaustive, and each linear program is a lower bound on the cost in its case. So
//! the first schedule that the validator accepts is proven to be the cheapest.

mod defect;
mod moment;
mod orders;
mod program;

use std::collections::BTreeSet;
use std::ops::ControlFlow;

use elbowroom_model::Task;
use elbowroom_num::{Delta, Interval, Rational};
use elbowroom_plan::{
    NodeId, ParameterId, ParametrizedPlan, Schedule, Side, Valuation, network_node,
};
use elbowroom_stn::{ConsistentNetwork, Constraint};

use crate::obligations::{Refusal, Requirement};
use crate::reduction::Reduction;
use defect::{Defect, DefectFinder};
use orders::Orders;
use program::{Program, Solved};

/// Parameter of the plan that a repair may change.
#[derive(Clone, Debug, PartialEq)]
pub struct Changeable {
    /// The parameter. It stays in its range; open ends of the range count as closed.
    pub parameter: ParameterId,
    /// Values without cost: the nominal value, or the values that the domain allows.
    pub free_range: Interval,
    /// Cost per unit of the value's distance from `free`; positive.
    pub weight: Rational,
}

/// Constraint that prevents a cheaper repair, or any repair.
#[derive(Clone, Debug, PartialEq)]
pub enum BindingConstraint {
    /// One side of the plan's constraint at this position.
    Bound(usize, Side),
    /// Nothing happens before time zero.
    TimeZero,
    /// Two interfering happenings keep their order, at least ε apart.
    Order(NodeId, NodeId),
    /// A requirement on every valid schedule.
    Requirement(Requirement),
    /// The parameter stays in its range, or does not change at all.
    Range(ParameterId),
}

/// The cheapest repair.
#[derive(Clone, Debug, PartialEq)]
pub struct Repair {
    /// The values of all parameters.
    pub values: Valuation,
    /// The earliest valid schedule at this cost.
    pub schedule: Schedule,
    /// Cost of the changes: the sum of weight times deviation.
    pub cost: Rational,
    /// Lower bound on the cost of any repair. It equals the cost, unless costs arbitrarily close to
    /// the bound are possible, but not the bound itself.
    pub bound: Rational,
    /// Explanation of the cost: inequalities that add up to the bound, each with its multiplier.
    pub explanation: Vec<(BindingConstraint, Rational)>,
}

/// Result of a search for a repair.
#[derive(Clone, Debug, PartialEq)]
pub enum RepairRun {
    /// A repair was found, and no cheaper one exists.
    Repaired {
        /// The repair.
        repair: Repair,
        /// Number of linear programs solved; 0 if nothing has to change.
        cases: usize,
    },
    /// No values within the ranges make the plan work in its order.
    Impossible {
        /// Constraints that are in conflict in the case with the least change; some or all of them
        /// together.
        because: Vec<BindingConstraint>,
    },
    /// The validator rejects a plan that meets every obligation: the violated requirement has no
    /// obligation.
    Unexplained {
        /// The values.
        values: Valuation,
        /// The schedule.
        schedule: Schedule,
    },
    /// The search was stopped before anything was found.
    Stopped {
        /// `true` if the caller cancelled the search; otherwise a limit was reached.
        is_cancelled: bool,
        /// Lower bound on the cost of any repair.
        bound: Rational,
    },
}

/// Limits of a search.
#[derive(Clone, Debug)]
pub struct RepairLimits {
    /// The search is stopped after this number of linear programs.
    pub cases: usize,
    /// The search is stopped once it is known that no repair costs less than this.
    pub cost_limit: Option<Rational>,
}

impl Default for RepairLimits {
    fn default() -> Self {
        Self {
            cases: 4_000,
            cost_limit: None,
        }
    }
}

/// Solved case that has not been examined yet.
struct OpenCase {
    /// The rows of this case, in addition to those of all cases.
    rows: Vec<usize>,
    /// The happenings whose order it decides.
    decided: BTreeSet<(NodeId, NodeId)>,
    solved: Solved,
}

/// Searches for the cheapest values of some parameters that give the plan a valid schedule.
///
/// `order`, if present, gives each node a time, and interfering actions keep that order. Without it
/// they keep the order that the plan's bounds imply, and all orders that are left open are
/// searched. Parameters that are not in `changeable` keep their nominal values. `accepts` returns
/// `true` if the plan with these values and times is valid. `flow` is polled between linear
/// programs, and can end the search.
///
/// # Errors
/// If the plan contains something beyond exact linear reasoning; the message names it.
pub fn repair(
    task: &Task,
    plan: &ParametrizedPlan,
    order: Option<&Schedule>,
    changeable: &[Changeable],
    limits: &RepairLimits,
    accepts: &mut dyn FnMut(&Valuation, &Schedule) -> bool,
    flow: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<RepairRun, Refusal> {
    let orders = Orders::new(task, plan, order);
    if let Some((values, schedule)) = unchanged(plan, changeable, task, &orders)
        && accepts(&values, &schedule)
    {
        let repair = Repair {
            values,
            schedule,
            cost: Rational::ZERO,
            bound: Rational::ZERO,
            explanation: Vec::new(),
        };
        return Ok(RepairRun::Repaired { repair, cases: 0 });
    }
    let mut program = Program::new(plan, changeable, task.epsilon(), &orders.fixed_pairs);
    let reduction = Reduction::new(plan);
    let finder = DefectFinder {
        task,
        plan,
        orders: &orders,
        substitution: &reduction.substitution,
    };
    let mut cases = 1;
    let mut open = match program.solve(&[]) {
        Ok(solved) => vec![OpenCase {
            rows: Vec::new(),
            decided: BTreeSet::new(),
            solved,
        }],
        Err(because) => return Ok(RepairRun::Impossible { because }),
    };
    // Constraints in conflict in the first case without a solution, which has the least change.
    let mut hopeless: Option<Vec<BindingConstraint>> = None;
    while let Some(case) = take_cheapest(&mut open) {
        let cost = &case.solved.cost.real;
        let is_dear = limits
            .cost_limit
            .as_ref()
            .is_some_and(|below| cost >= below);
        let is_over = is_dear || cases > limits.cases;
        if is_over || flow().is_break() {
            return Ok(RepairRun::Stopped {
                is_cancelled: !is_over,
                bound: cost.clone(),
            });
        }
        let Solved {
            cost,
            values,
            schedule,
            because,
        } = &case.solved;
        if accepts(values, schedule) {
            let repair = Repair {
                cost: program.cost_of(values),
                values: values.clone(),
                schedule: schedule.clone(),
                bound: cost.real.clone(),
                explanation: because.clone(),
            };
            return Ok(RepairRun::Repaired { repair, cases });
        }
        match finder.find(values, schedule, &case.decided)? {
            Defect::None => {
                return Ok(RepairRun::Unexplained {
                    values: values.clone(),
                    schedule: schedule.clone(),
                });
            }
            Defect::Unrepairable(requirement) => {
                hopeless.get_or_insert_with(|| vec![BindingConstraint::Requirement(requirement)]);
            }
            Defect::Cases {
                alternatives,
                decides,
            } => {
                for (expression, is_strict, hindrance) in alternatives {
                    let row = program.row(&expression, is_strict, hindrance)?;
                    let mut rows = case.rows.clone();
                    rows.push(row);
                    cases += 1;
                    match program.solve(&rows) {
                        Ok(solved) => {
                            let mut decided = case.decided.clone();
                            decided.extend(decides);
                            open.push(OpenCase {
                                rows,
                                decided,
                                solved,
                            });
                        }
                        Err(because) => {
                            hopeless.get_or_insert(because);
                        }
                    }
                }
            }
        }
    }
    Ok(RepairRun::Impossible {
        because: hopeless.unwrap_or_default(),
    })
}

/// Returns the earliest schedule with the nominal values, or the free ones nearest to them, if
/// there is one. Often this is already the repair, and it needs no linear program.
fn unchanged(
    plan: &ParametrizedPlan,
    changeable: &[Changeable],
    task: &Task,
    orders: &Orders,
) -> Option<(Valuation, Schedule)> {
    let mut values = plan.nominal();
    for own in changeable {
        let value = &mut values[own.parameter];
        let [least, most] = Side::BOTH.map(|side| side.of(&own.free_range).value());
        if let Some(end) = least.filter(|least| *value < **least) {
            value.clone_from(end);
        }
        if let Some(end) = most.filter(|most| *value > **most) {
            value.clone_from(end);
        }
    }
    let mut network = plan.plan.network(&values);
    for &(first, second) in &orders.fixed_pairs {
        let (first, second) = (network_node(first), network_node(second));
        network.add(Constraint::at_least(first, second, task.epsilon().clone()));
    }
    let network = ConsistentNetwork::try_from(network).ok()?;
    let schedule = network.earliest_schedule(network_node(NodeId::ZERO));
    Some((values, schedule.into()))
}

/// Removes the case of least cost. Ties go to the newest case, which has the most decisions.
fn take_cheapest(open: &mut Vec<OpenCase>) -> Option<OpenCase> {
    let cost = |case: &OpenCase| -> Delta { case.solved.cost.clone() };
    let best = (0..open.len()).rev().min_by_key(|&at| cost(&open[at]))?;
    Some(open.remove(best))
}
