//! The cheapest change of a plan's quantities with which the plan works.
//!
//! A plan works with some values of its quantities if it has a valid schedule in which interfering
//! actions come in the order that they have in the plan. Timed initials may come before or after
//! actions, as it fits. What this asks for is learnt bit by bit, like the cuts of [`best`](crate::best()):
//!
//! - A linear program knows the plan's bounds and orders. Its variables are the times of all
//!   happenings and the quantities that may change; it makes the cost of their changes least.
//! - Its schedule is put before the judge. If that accepts it, it is the cheapest repair.
//! - If not, some [obligation](crate::obligations) is broken. What breaks it is a conjunction of
//!   inequalities in which expressions go by the order of the schedule. So in each valid schedule
//!   one of these is false, or some happenings come in another order: these are the cases into which the search
//!   branches, the one with the least cost first.
//!
//! No case is left out, and each linear program is a lower bound on the cost in its case, so the
//! first schedule that the judge accepts is proven to be the cheapest.

mod flaw;
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
use flaw::{Finder, Flaw};
use orders::Orders;
use program::{Program, Solved};

/// A parameter of the plan that a repair may change.
#[derive(Clone, Debug, PartialEq)]
pub struct Changeable {
    /// The parameter. Its range, as far as it is closed, is not left; open ends count as closed.
    pub parameter: ParameterId,
    /// Values that cost nothing: the nominal value, or what the domain allows.
    pub free: Interval,
    /// The cost of each unit by which the value lies outside of `free`; positive.
    pub weight: Rational,
}

/// What stands in the way of a cheaper repair, or of any.
#[derive(Clone, Debug, PartialEq)]
pub enum Hindrance {
    /// One side of the plan's constraint at this position.
    Bound(usize, Side),
    /// Nothing happens before time zero.
    Beginning,
    /// Two interfering happenings keep their order, at least ε apart.
    Order(NodeId, NodeId),
    /// Something that every valid schedule satisfies.
    Requirement(Requirement),
    /// The parameter stays in its range, or does not change at all.
    Range(ParameterId),
}

/// The cheapest repair.
#[derive(Clone, Debug, PartialEq)]
pub struct Repair {
    /// The values of all parameters.
    pub values: Valuation,
    /// A valid schedule, as early as can be at this cost.
    pub schedule: Schedule,
    /// What the changes cost: the sum of weight times deviation.
    pub cost: Rational,
    /// No repair costs less than this. It is the cost, unless that comes arbitrarily near to the
    /// bound without reaching it.
    pub bound: Rational,
    /// What makes the repair cost so much: inequalities that add up to the bound, each with its
    /// multiplier.
    pub because: Vec<(Hindrance, Rational)>,
}

/// Why a search for a repair ended.
#[derive(Clone, Debug, PartialEq)]
pub enum RepairRun {
    /// There is a repair, and none is cheaper.
    Repaired {
        /// The repair.
        repair: Repair,
        /// How many linear programs were solved; none if nothing has to change.
        cases: usize,
    },
    /// No values within the ranges make the plan work in its order.
    Impossible {
        /// What stands in the way where the least was changed; each entry alone or all together.
        because: Vec<Hindrance>,
    },
    /// The judge rejects a plan in which every obligation is met: it breaks something that no
    /// obligation stands for.
    Unexplained {
        /// The values.
        values: Valuation,
        /// The schedule.
        schedule: Schedule,
    },
    /// It was ended before anything was found.
    Stopped {
        /// Whether it was told to; otherwise there were too many cases.
        is_cancelled: bool,
        /// No repair costs less.
        bound: Rational,
    },
}

/// Limits of a search.
#[derive(Clone, Debug)]
pub struct RepairLimits {
    /// The search is stopped after this number of linear programs.
    pub cases: usize,
    /// The search is stopped once it is known that no repair costs less than this.
    pub below: Option<Rational>,
}

impl Default for RepairLimits {
    fn default() -> Self {
        Self {
            cases: 4_000,
            below: None,
        }
    }
}

/// A case that has been solved and not yet been looked at.
struct Open {
    /// The rows that hold in it besides those that always do.
    rows: Vec<usize>,
    /// The happenings whose order it decides.
    decided: BTreeSet<(NodeId, NodeId)>,
    solved: Solved,
}

/// Looks for the cheapest values of some parameters with which the plan has a valid schedule.
///
/// `order`, if there is one, gives each node a time: interfering actions keep the order that they
/// have there. Without it they keep the order that the plan's bounds give them, and all orders that
/// these leave open are searched. Parameters that are not among `changeable` keep their nominal values. `judge` says
/// whether the plan with these values and times is valid; `flow`, asked between linear programs,
/// whether to go on.
///
/// # Errors
/// When the plan holds something beyond exact linear reasoning; the message names it.
pub fn repair(
    task: &Task,
    plan: &ParametrizedPlan,
    order: Option<&Schedule>,
    changeable: &[Changeable],
    limits: &RepairLimits,
    judge: &mut dyn FnMut(&Valuation, &Schedule) -> bool,
    flow: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<RepairRun, Refusal> {
    let orders = Orders::new(task, plan, order);
    if let Some((values, schedule)) = unchanged(plan, changeable, task, &orders)
        && judge(&values, &schedule)
    {
        let repair = Repair {
            values,
            schedule,
            cost: Rational::ZERO,
            bound: Rational::ZERO,
            because: Vec::new(),
        };
        return Ok(RepairRun::Repaired { repair, cases: 0 });
    }
    let mut program = Program::new(plan, changeable, task.epsilon(), &orders.kept);
    let reduction = Reduction::new(plan);
    let finder = Finder {
        task,
        plan,
        orders: &orders,
        substitution: &reduction.substitution,
    };
    let mut cases = 1;
    let mut open = match program.solve(&[]) {
        Ok(solved) => vec![Open {
            rows: Vec::new(),
            decided: BTreeSet::new(),
            solved,
        }],
        Err(because) => return Ok(RepairRun::Impossible { because }),
    };
    // What stood in the way in the case that was given up first: the one with the least change.
    let mut hopeless: Option<Vec<Hindrance>> = None;
    while let Some(case) = take_cheapest(&mut open) {
        let cost = &case.solved.cost.real;
        let is_dear = limits.below.as_ref().is_some_and(|below| cost >= below);
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
        if judge(values, schedule) {
            let repair = Repair {
                cost: program.cost_of(values),
                values: values.clone(),
                schedule: schedule.clone(),
                bound: cost.real.clone(),
                because: because.clone(),
            };
            return Ok(RepairRun::Repaired { repair, cases });
        }
        match finder.find(values, schedule, &case.decided)? {
            Flaw::None => {
                return Ok(RepairRun::Unexplained {
                    values: values.clone(),
                    schedule: schedule.clone(),
                });
            }
            Flaw::Hopeless(requirement) => {
                hopeless.get_or_insert_with(|| vec![Hindrance::Requirement(requirement)]);
            }
            Flaw::Cases {
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
                            open.push(Open {
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

/// The earliest schedule with the nominal values, or the free ones nearest to them, if there is one: often nothing
/// else is needed, and it takes no linear program.
fn unchanged(
    plan: &ParametrizedPlan,
    changeable: &[Changeable],
    task: &Task,
    orders: &Orders,
) -> Option<(Valuation, Schedule)> {
    let mut values = plan.nominal();
    for own in changeable {
        let value = &mut values[own.parameter];
        let [least, most] = Side::BOTH.map(|side| side.of(&own.free).value());
        if let Some(end) = least.filter(|least| *value < **least) {
            value.clone_from(end);
        }
        if let Some(end) = most.filter(|most| *value > **most) {
            value.clone_from(end);
        }
    }
    let mut network = plan.plan.network(&values);
    for &(first, second) in &orders.kept {
        let (first, second) = (network_node(first), network_node(second));
        network.add(Constraint::at_least(first, second, task.epsilon().clone()));
    }
    let network = ConsistentNetwork::try_from(network).ok()?;
    let schedule = network.earliest_schedule(network_node(NodeId::ZERO));
    Some((values, schedule.into()))
}

/// The case of least cost; of several the one that was opened last, which is the most decided.
fn take_cheapest(open: &mut Vec<Open>) -> Option<Open> {
    let cost = |case: &Open| -> Delta { case.solved.cost.clone() };
    let best = (0..open.len()).rev().min_by_key(|&at| cost(&open[at]))?;
    Some(open.remove(best))
}
