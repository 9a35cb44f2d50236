//! The executors: one file each, and the list of all.
//!
//! To add one, write a file with its [`Executor`] and its [`ExecutorEntry`] entry, and add a line to
//! [`EXECUTORS`]. The command line, its help, `docs/reference/executors.md` and the captions of reports are
//! generated from that list.

mod adaptable;
mod esterel;
mod fixed;
mod guarantee_status;
mod guarded;
mod happening_choice;
mod live;
mod lookahead;
mod policy;
mod stn;

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use elbowroom_num::Rational;
use elbowroom_probability::Likelihoods;

pub use adaptable::OrderCache;
pub use lookahead::PolicyTableCache;

use crate::action_values::ActionValues;
use crate::executor::PlanForm;
use crate::executor::{Decided, Decision, Executor};
use crate::plan_comparison::PlanComparator;
use crate::preparation::RegionOracle;
use crate::reason::{Cause, Reason, Subject};
use crate::rollout::RolloutEvaluator;

/// The default executor. It abandons a plan only if the remaining plan fails even when executed
/// nominally; `docs/reference/executors.md` compares it with the baselines.
pub const DEFAULT_EXECUTOR: &str = live::REGISTERED.name;

/// All executors, in the order used by help and reports.
pub const EXECUTORS: &[ExecutorEntry] = &[
    fixed::REGISTERED,
    stn::REGISTERED,
    guarded::REGISTERED,
    live::REGISTERED,
    esterel::REGISTERED,
    adaptable::REGISTERED,
    lookahead::REGISTERED,
    policy::REGISTERED,
];

/// The registry entry of an executor: name, documentation and constructor.
#[derive(Clone, Copy, Debug)]
pub struct ExecutorEntry {
    /// Its name.
    pub name: &'static str,
    /// The meaning of the argument, the number after the name and a colon, if it takes one.
    pub argument: Option<&'static str>,
    /// `true` if the argument is optional.
    pub is_optional: bool,
    /// A summary, in one sentence.
    pub summary: &'static str,
    /// The paper on which it is based.
    pub paper: &'static str,
    /// The services that it uses.
    pub needs: Needs,
    /// The roles in which other components use it.
    pub roles: &'static [Role],
    /// Constructor.
    make: fn(Option<Rational>, ExecutorServices) -> Box<dyn Executor>,
}

/// The services that an executor uses. It receives only these ([`ExecutorServices`]). Without a service that is not
/// available, it executes its plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Needs {
    /// The form of a plan that it requires.
    pub plan: PlanForm,
    /// The comparison of the remaining plan with other plans ([`PlanComparator`]).
    pub odds: Need,
    /// The values of all moves ([`ActionValues`]).
    pub action_values: bool,
    /// The simulation of possible moves ([`RolloutEvaluator`]), if there are no action values.
    pub rollouts: bool,
    /// The most likely order of the plan's actions, by likelihoods. First plans are then compared in
    /// that order. Executors without this need do not use likelihoods.
    pub orders: bool,
}

/// Condition under which an executor uses a service.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// It does not use the service.
    Never,
    /// It uses the service if it has an argument, and cannot be run with an argument without it.
    WithArgument,
    /// It uses the service if it is available.
    Always,
}

/// A role in which other components use executors, without an argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Rollouts consider it for a new plan. Its preparation may take long.
    FirstPlan,
    /// Rollouts consider it for the remaining plan. Its preparation is fast.
    RemainingPlan,
    /// Executes plans that are evaluated in samples: new plans in rollouts, and plans in `odds`.
    Evaluation,
    /// Replans at the first deviation, so that samples show many new plans.
    EarlyReplanning,
}

impl Role {
    /// All roles, with their names in documents.
    pub const NAMES: &[(Self, &str)] = &[
        (Self::FirstPlan, "first plan"),
        (Self::RemainingPlan, "remaining plan"),
        (Self::Evaluation, "evaluation"),
        (Self::EarlyReplanning, "early replanning"),
    ];
}

impl Needs {
    /// Creates the needs of an executor that uses only a plan of this form.
    pub const fn plan(plan: PlanForm) -> Self {
        Self {
            plan,
            odds: Need::Never,
            action_values: false,
            rollouts: false,
            orders: false,
        }
    }
}

/// Returns the executors with a role, in the order of the registry.
pub fn with_role(role: Role) -> impl DoubleEndedIterator<Item = ExecutorSpec> {
    let registered = EXECUTORS
        .iter()
        .filter(move |entry| entry.roles.contains(&role));
    registered.map(|registered| ExecutorSpec {
        registered,
        argument: None,
    })
}

/// The services that an executor may use while it executes a plan.
pub struct ExecutorServices {
    /// The whole envelope.
    pub region: Box<dyn RegionOracle>,
    /// The likelihoods of failures and spontaneous changes.
    pub likelihoods: Arc<Likelihoods>,
    /// Comparison with other plans: [`Needs::odds`].
    pub comparator: Option<Box<dyn PlanComparator>>,
    /// Cache of policy tables: results for the same problem and likelihoods from other runs.
    pub policy_cache: PolicyTableCache,
    /// Cache of orders: results for the same plans from other samples of the same scene.
    pub order_cache: Option<OrderCache>,
    /// Values of all moves: [`Needs::action_values`].
    pub action_values: Option<Arc<dyn ActionValues>>,
    /// Simulation of possible moves, if there are no action values: [`Needs::rollouts`].
    pub rollout: Option<Box<dyn RolloutEvaluator>>,
    /// `true` if the run can make new plans.
    pub has_planner: bool,
}

impl ExecutorServices {
    /// Sets the odds.
    #[must_use]
    pub fn with_comparator(self, odds: Option<Box<dyn PlanComparator>>) -> Self {
        Self {
            comparator: odds,
            ..self
        }
    }
}

impl<R: RegionOracle + 'static> From<Box<R>> for ExecutorServices {
    /// Creates means with certain outcomes, without new plans and without comparison of plans.
    fn from(region: Box<R>) -> Self {
        Self {
            region,
            likelihoods: Arc::new(Likelihoods::certain()),
            comparator: None,
            policy_cache: PolicyTableCache::default(),
            order_cache: None,
            action_values: None,
            rollout: None,
            has_planner: false,
        }
    }
}

/// Specification of an executor: `guarded`, `fixed:30`.
#[derive(Clone)]
pub struct ExecutorSpec {
    /// The executor.
    pub registered: &'static ExecutorEntry,
    /// The number after the colon.
    pub argument: Option<Rational>,
}

/// Error in the specification of an executor.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnknownExecutor {
    /// The name is not in the list.
    #[error("unknown executor `{name}`; choose one of {known}")]
    Name {
        /// The name that was asked for.
        name: String,
        /// The names that exist.
        known: String,
    },
    /// The number is missing, superfluous, or invalid.
    #[error("`{text}`: {problem}")]
    Argument {
        /// The text of the specification.
        text: String,
        /// The mistake in it.
        problem: String,
    },
}

impl ExecutorSpec {
    /// Creates the executor, from the envelope alone or from all [`ExecutorServices`].
    pub fn build(&self, means: impl Into<ExecutorServices>) -> Box<dyn Executor> {
        (self.registered.make)(self.argument.clone(), means.into())
    }

    /// Returns the services that the executor uses.
    pub fn needs(&self) -> &'static Needs {
        &self.registered.needs
    }

    /// Returns `true` if the executor searches for plans that are more likely to succeed.
    pub fn needs_odds(&self) -> bool {
        match self.needs().odds {
            Need::Never => false,
            Need::WithArgument => self.argument.is_some(),
            Need::Always => true,
        }
    }

    /// Returns `true` if the executor uses a service that is computed from a model of the world.
    pub fn uses_world_model(&self) -> bool {
        self.needs_odds() || self.needs().action_values || self.needs().rollouts
    }

    /// Returns `true` if the executor cannot be run without a model of the world.
    pub fn requires_world_model(&self) -> bool {
        self.needs().odds == Need::WithArgument && self.argument.is_some()
    }
}

impl PartialEq for ExecutorSpec {
    /// Compares the names, which are unique; function addresses are not compared.
    fn eq(&self, other: &Self) -> bool {
        self.registered.name == other.registered.name && self.argument == other.argument
    }
}

impl Default for ExecutorSpec {
    /// [`DEFAULT_EXECUTOR`].
    fn default() -> Self {
        Self {
            registered: &live::REGISTERED,
            argument: None,
        }
    }
}

impl fmt::Debug for ExecutorSpec {
    /// Writes the specification, because function addresses differ between processes.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ExecutorSpec({self})")
    }
}

impl fmt::Display for ExecutorSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.registered.name)?;
        match &self.argument {
            Some(argument) => write!(f, ":{argument}"),
            None => Ok(()),
        }
    }
}

impl FromStr for ExecutorSpec {
    type Err = UnknownExecutor;

    /// Parses `NAME`, `NAME:NUMBER` or `NAME(NUMBER)`.
    fn from_str(text: &str) -> Result<Self, UnknownExecutor> {
        let (name, argument) = match text.trim().split_once([':', '(']) {
            Some((name, argument)) => (name, Some(argument.trim_end_matches(')').trim())),
            None => (text.trim(), None),
        };
        let registered = EXECUTORS.iter().find(|known| known.name == name.trim());
        let Some(registered) = registered else {
            let known: Vec<String> = EXECUTORS.iter().map(ExecutorEntry::usage).collect();
            return Err(UnknownExecutor::Name {
                name: name.to_owned(),
                known: known.join(", "),
            });
        };
        let wrong = |problem: String| UnknownExecutor::Argument {
            text: text.to_owned(),
            problem,
        };
        let argument = match (registered.argument, argument) {
            (None, None) => None,
            (None, Some(_)) => return Err(wrong(format!("`{name}` does not accept a number"))),
            (Some(_), None) if registered.is_optional => None,
            (Some(meaning), None) => {
                return Err(wrong(format!(
                    "expected a {meaning}, as in `{}`",
                    registered.example()
                )));
            }
            (Some(meaning), Some(argument)) => {
                let number = argument.trim_end_matches('%').parse::<Rational>();
                let number = number.map_err(|error| wrong(format!("{meaning}: {error}")))?;
                if number.is_negative() {
                    return Err(wrong(format!("{meaning} must not be negative")));
                }
                Some(number)
            }
        };
        Ok(Self {
            registered,
            argument,
        })
    }
}

impl ExecutorEntry {
    /// Returns its syntax in specifications: `guarded`, `fixed:X`, `live[:X]`.
    pub fn usage(&self) -> String {
        match self.argument {
            Some(_) if self.is_optional => format!("{}[:X]", self.name),
            Some(_) => format!("{}:X", self.name),
            None => self.name.to_owned(),
        }
    }

    /// Returns a valid specification: `guarded`, `fixed:30`, `live`.
    pub fn example(&self) -> String {
        match self.argument {
            Some(_) if !self.is_optional => format!("{}:30", self.name),
            _ => self.name.to_owned(),
        }
    }
}

/// Returns the decision of an executor that has no plan.
fn without_plan() -> Decided {
    Decided {
        decision: Decision::Replan,
        reason: Reason::new(Cause::PlanDone).about(Subject::NoPlan),
    }
}

#[cfg(test)]
mod tests {
    use super::{EXECUTORS, ExecutorSpec};

    #[test]
    fn executor_names_round_trip() {
        for text in [
            "fixed:0",
            "fixed:30",
            "fixed:5/2",
            "stn",
            "guarded",
            "live",
            "live:5",
            "esterel",
            "adaptable",
            "lookahead",
            "policy",
        ] {
            let spec: ExecutorSpec = text.parse().unwrap();
            assert_eq!(spec.to_string(), text);
        }
        assert_eq!(
            "fixed(30%)".parse::<ExecutorSpec>().unwrap().to_string(),
            "fixed:30"
        );
    }

    #[test]
    fn unknown_name_error_lists_known_names() {
        let error = "gaurded".parse::<ExecutorSpec>().unwrap_err().to_string();
        for known in EXECUTORS {
            assert!(error.contains(&known.usage()), "{error}");
        }
        for wrong in ["fixed", "fixed:-1", "fixed:much", "stn:3"] {
            assert!(wrong.parse::<ExecutorSpec>().is_err(), "{wrong}");
        }
    }
}
