//! Requirements on every schedule of a plan, as linear inequalities.
//!
//! `Obligations::compile` runs the plan symbolically, once, in the order of a nominal schedule.
//! That order is enough: the schedules of a network with boxed parameters form a convex set, so if
//! two interfering happenings are at least ε apart in all of them, one always comes first. The
//! separation itself is an obligation. If it holds, every value that a happening reads is one fixed
//! expression in times and parameters (paper 1's `enc_eff` without its disjunctions). The only
//! undecided question is which commuting happenings come before a moment *inside* an action, where
//! its over-all condition is read ([`OverAll`]).
//!
//! An obligation is violated in exactly the schedules of its [`BadCase`]s.

mod compile;
mod dnf;
mod goal;
mod over_all;
mod precedence;
mod separation;
mod timeline;

use elbowroom_model::Task;
use elbowroom_model::ground::{Condition, FluentId};
use elbowroom_num::{Rational, work};

use crate::linear::Linear;
use elbowroom_plan::{InstanceId, NodeId, ParameterId, Schedule, StnPlan, Valuation};

pub use over_all::OverAll;
pub(crate) use separation::interfering_in_order;

/// `to - from <= bound`, or `<` when strict.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// The time point subtracted.
    pub from: NodeId,
    /// The time point it is subtracted from.
    pub to: NodeId,
    /// Greatest difference.
    pub bound: Rational,
    /// `true` if the bound itself is excluded.
    pub is_strict: bool,
}

impl Difference {
    /// Returns `earlier < later`.
    pub fn before(earlier: NodeId, later: NodeId) -> Self {
        Self {
            from: later,
            to: earlier,
            bound: Rational::ZERO,
            is_strict: true,
        }
    }

    /// Returns `earlier <= later`.
    pub fn not_after(earlier: NodeId, later: NodeId) -> Self {
        Self {
            from: later,
            to: earlier,
            bound: Rational::ZERO,
            is_strict: false,
        }
    }
}

/// `expression <= 0`, or `< 0` when strict.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Inequality {
    /// The left-hand side.
    pub expression: Linear,
    /// `true` if zero itself is excluded.
    pub is_strict: bool,
}

impl Inequality {
    /// Returns `true` if the inequality holds for these times (by node) and parameters.
    pub fn holds(&self, times: &Schedule, parameters: &Valuation) -> bool {
        let value = self.expression.value(times, parameters);
        value.is_negative() || (value.is_zero() && !self.is_strict)
    }
}

/// One way to violate an obligation: all of these constraints hold at once.
///
/// Nodes are those of the plan and, in over-all conditions, [`StnPlan::nodes`]`.len()` for the
/// moment at which the condition is read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BadCase {
    /// Constraints on differences of times.
    pub differences: Vec<Difference>,
    /// Other linear constraints.
    pub inequalities: Vec<Inequality>,
}

/// A requirement on every schedule.
#[derive(Clone, Debug, PartialEq)]
pub enum Requirement {
    /// Two interfering happenings are at least ε apart; `first` comes first.
    Separation {
        /// The earlier happening.
        first: NodeId,
        /// The later happening.
        second: NodeId,
    },
    /// A condition holds on arrival at a happening.
    Condition {
        /// The happening.
        node: NodeId,
        /// The condition, one conjunct.
        condition: Condition,
    },
    /// A condition holds at every moment inside an action.
    OverAll {
        /// The action.
        instance: InstanceId,
        /// The condition, one conjunct.
        condition: Condition,
    },
    /// The action's duration satisfies its constraints.
    Duration {
        /// The action.
        instance: InstanceId,
        /// Index of the duration constraint; `None` for `>= 0`.
        constraint: Option<usize>,
    },
    /// A number that an effect needs is defined.
    Defined {
        /// Happening that needs the number.
        node: NodeId,
    },
    /// A happening changes a fluent in one way only, unless all its changes are increases and
    /// decreases.
    SingleUpdate {
        /// The happening.
        node: NodeId,
        /// The fluent.
        fluent: FluentId,
    },
    /// Processes and events keep their nominal course.
    Autonomous {
        /// The happening after which it would change.
        after: NodeId,
        /// The course, in words: `the event (boil) happens`.
        course: String,
    },
    /// The goal holds at the end.
    Goal {
        /// The condition, one conjunct.
        condition: Condition,
    },
}

/// Requirement with all the ways to violate it.
#[derive(Clone, Debug, PartialEq)]
pub struct Obligation {
    /// The requirement.
    pub requirement: Requirement,
    /// The obligation is violated exactly when one of these holds.
    pub bad_cases: Vec<BadCase>,
}

/// Everything that must hold in every schedule of a plan.
#[derive(Clone, Debug, Default)]
pub struct Obligations {
    /// Obligations whose bad cases are known.
    pub direct: Vec<Obligation>,
    /// Numeric and compound over-all conditions; their cases are computed on demand.
    pub over_all: Vec<OverAll>,
}

/// Error for a plan or problem that the exact method does not cover.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// A product or quotient is neither linear nor bilinear.
    #[error(
        "{place}: the value of {expression} is not linear in times and parameters; fix one of its factors"
    )]
    NotLinear {
        /// Location in the plan or problem.
        place: String,
        /// The expression.
        expression: String,
    },
    /// A rate changes while it is active.
    #[error("{place}: the rate of change of {fluent} depends on a value that changes later")]
    ChangingRate {
        /// Location in the plan or problem.
        place: String,
        /// The fluent it changes.
        fluent: String,
    },
    /// A conditional effect depends on a condition throughout its action.
    #[error("{place}: a conditional effect with an over-all condition cannot be analysed")]
    GuardOverAll {
        /// Location in the plan or problem.
        place: String,
    },
    /// Too many combinations of conditional effects or alternatives.
    #[error("{place}: more than {limit} combinations of cases")]
    TooManyCases {
        /// Location that the combinations arise from.
        place: String,
        /// Limit on combinations.
        limit: usize,
    },
    /// A derived fact depends on its own negation.
    #[error("{place}: a derived fact depends on its own negation; rewrite the rules without that")]
    Unstratified {
        /// Location that reads the derived fact.
        place: String,
    },
    /// A number is left open that is not one of the plan's parameters.
    #[error("{place}: an open number is not a parameter; vary it or give it a value")]
    OpenNumber {
        /// Location in the plan or problem.
        place: String,
    },
    /// The ends of a parameter's interval do not decide the values between them.
    #[error(
        "parameter {name} is multiplied by itself, by a time that it bounds, or by several \
         numbers of one condition; give it a value, or vary only one of these factors"
    )]
    Coupled {
        /// The parameter.
        name: String,
    },
    /// The behaviour of processes and events is unknown, or cannot be described by linear
    /// inequalities.
    #[error("{place}: {obstacle}")]
    Autonomous {
        /// Location in the plan or problem.
        place: String,
        /// Description of the obstacle.
        obstacle: String,
    },
    /// The plan's network has no schedule at the nominal values.
    #[error("the plan has no schedule at its nominal values")]
    NoNominalSchedule,
    /// The analysis was ended by a stop request ([`work::Stop`]).
    #[error("the analysis was interrupted")]
    Interrupted,
}

impl Refusal {
    /// Returns `None` for an analysis that was interrupted.
    ///
    /// # Errors
    /// For any other refusal.
    pub fn unless_interrupted<T>(analysed: Result<T, Self>) -> Result<Option<T>, Self> {
        match analysed {
            Err(Self::Interrupted) => Ok(None),
            analysed => analysed.map(Some),
        }
    }
}

/// Fails after a stop request. Called before each step that can take long.
pub(crate) fn ensure_not_stopped() -> Result<(), Refusal> {
    if work::is_stopped() {
        return Err(Refusal::Interrupted);
    }
    Ok(())
}

impl Requirement {
    /// Describes the requirement in words.
    pub fn describe(&self, task: &Task, plan: &StnPlan) -> String {
        match self {
            Self::Separation { first, second } => format!(
                "{} must come before {}, by at least ε",
                plan.describe_node(task, *first),
                plan.describe_node(task, *second)
            ),
            Self::Condition { node, condition } => format!(
                "{} needs {}",
                plan.describe_node(task, *node),
                task.describe_condition(condition)
            ),
            Self::OverAll {
                instance,
                condition,
            } => format!(
                "{} needs {} throughout",
                plan.instance(*instance).action.name,
                task.describe_condition(condition)
            ),
            Self::Duration { instance, .. } => {
                format!(
                    "{} must obey its domain's duration",
                    plan.instance(*instance).action.name
                )
            }
            Self::Defined { node } => {
                format!(
                    "{} needs a number that has no value",
                    plan.describe_node(task, *node)
                )
            }
            Self::SingleUpdate { node, fluent } => {
                format!(
                    "{} must not change {} in several ways at the same time",
                    plan.describe_node(task, *node),
                    task.fluent_name(*fluent)
                )
            }
            Self::Autonomous { after, course } => {
                format!("after {}, {course}", plan.describe_node(task, *after))
            }
            Self::Goal { condition } => {
                format!(
                    "the goal {} must hold at the end",
                    task.describe_condition(condition)
                )
            }
        }
    }
}

/// Parameters that are differences of times: `t_second - t_first`.
pub type Substitution = std::collections::BTreeMap<ParameterId, (NodeId, NodeId)>;
