//! Descriptions of results about a plan in words.

mod adversary;
mod conflict;
mod control;
mod timed;

pub use conflict::KnownConflicts;

use elbowroom_model::Task;
use elbowroom_model::validate::{self, Verdict};
use elbowroom_num::{Interval, Rational};
use elbowroom_plan::{
    DecoupledEnvelope, InstanceId, Node, NodeId, ParameterId, ParameterKind, ParametrizedPlan,
    Schedule, Side, Valuation, network_node,
};
use elbowroom_stn::{ConsistentNetwork, Constraint};

use crate::obligations::Requirement;
use crate::soundness::{Broken, Counterexample};
use crate::{Limit, Objection, Oracle};

/// The reason for a finite end without a limit.
pub const ANY_FINITE: &str = "every greater finite deviation is inside as well, but no fixed \
                              schedule is valid for all of them";

/// Describes results about one plan in words.
#[derive(Clone, Copy, Debug)]
pub struct Explainer<'a> {
    /// The task.
    pub task: &'a Task,
    /// The explained plan.
    pub plan: &'a ParametrizedPlan,
}

/// An explanation of a failure of a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Explanation {
    /// The reason, without the numbers of the example: several boxes that fail for one reason have
    /// the same text.
    pub reason: String,
    /// Size of the violation, if it is a single number.
    pub shortfall: Option<Shortfall>,
    /// Values of the parameters in an example of the failure.
    pub valuation: Valuation,
    /// Times of the nodes in the example; `None` if there is no schedule at all.
    pub schedule: Option<Schedule>,
    /// The validator's verdict on that schedule.
    pub verdict: Option<String>,
    /// If there is a schedule for all values, but no executor can find it in time: strategies of
    /// the world against an executor that starts everything as early as possible, and against one
    /// that starts everything as late as possible.
    pub strategies: Vec<String>,
}

impl Explanation {
    /// Returns `true` if the only known problem is that processes and events take another course.
    /// The plan may also work with it.
    pub fn may_be_harmless(&self, task: &Task) -> bool {
        let is_accepted = self.schedule.is_some() && self.verdict.is_none();
        is_accepted && !task.autonomous().is_empty()
    }
}

/// Size of a violation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Shortfall {
    /// A happening can be late by this time.
    Time(Rational),
    /// A happening can be late by any time.
    Unbounded,
    /// A comparison fails by this amount.
    Amount(Rational),
}

impl Shortfall {
    /// Returns the number; `None` if there is no limit.
    pub fn value(&self) -> Option<&Rational> {
        match self {
            Self::Time(value) | Self::Amount(value) => Some(value),
            Self::Unbounded => None,
        }
    }
}

impl<'a> Explainer<'a> {
    /// Creates an explainer for this plan.
    pub fn new(task: &'a Task, plan: &'a ParametrizedPlan) -> Self {
        Self { task, plan }
    }

    /// Explains why a box is not inside the envelope, with an example.
    pub fn objection(
        &self,
        oracle: &Oracle,
        refused: &DecoupledEnvelope,
        objection: &Objection,
    ) -> Explanation {
        match objection {
            Objection::NoSchedule(valuation) => self.no_schedule(valuation),
            Objection::Broken(broken) => {
                let example = oracle
                    .worst_case(refused, broken)
                    .filter(|worst| self.verdict(worst).is_some())
                    .or_else(|| oracle.counterexample(refused, broken));
                self.violation(broken, example)
            }
            Objection::Uncontrollable(conflict) => Explanation {
                strategies: self.adversary_strategies(refused),
                ..self.without_example(self.uncontrollable_in(conflict, refused))
            },
        }
    }

    /// Explains why the plan has no schedule at these values. The explanation is empty if it has
    /// one.
    pub fn no_schedule(&self, valuation: &Valuation) -> Explanation {
        let conflict = conflict::find(self, valuation);
        Explanation {
            reason: conflict
                .as_ref()
                .map_or_else(String::new, |c| c.reason.clone()),
            shortfall: conflict.map(|conflict| Shortfall::Time(conflict.excess)),
            valuation: valuation.clone(),
            schedule: None,
            verdict: None,
            strategies: Vec::new(),
        }
    }

    /// Returns the reason why an end of a parameter's interval cannot move further; `None` if there
    /// is none.
    pub fn limit(&self, id: ParameterId, side: Side, limit: &Limit) -> Option<String> {
        self.limit_with_known_conflicts((id, side), limit, &mut KnownConflicts::default())
    }

    /// Does the same, reusing the conflicts in `seen` that were computed for other ends.
    pub fn limit_with_known_conflicts(
        &self,
        (id, side): (ParameterId, Side),
        limit: &Limit,
        seen: &mut KnownConflicts,
    ) -> Option<String> {
        match limit {
            Limit::Unbounded => None,
            Limit::AnyFinite => Some(ANY_FINITE.to_owned()),
            Limit::Range => Some(self.range(id, side)),
            Limit::Undecided => Some("there are too many cases to decide".to_owned()),
            Limit::Objection(objection) => Some(match objection {
                Objection::NoSchedule(valuation) => seen.reason(self, id, valuation),
                Objection::Broken(broken) => self.requirement(&broken.requirement),
                Objection::Uncontrollable(conflict) => self.uncontrollable(conflict),
            }),
        }
    }

    fn violation(&self, broken: &Broken, example: Option<Counterexample>) -> Explanation {
        let reason = self.requirement(&broken.requirement);
        let Some(mut example) = example else {
            return self.without_example(reason);
        };
        let shortfall = match &broken.requirement {
            Requirement::Separation { first, second } => {
                let mut late = example.clone();
                let shortfall = self.delay_first(&mut late, *first, *second);
                // The reverse order may be harmless; a distance below ε never is.
                if self.verdict(&late).is_some() || self.verdict(&example).is_none() {
                    example = late;
                }
                shortfall
            }
            _ => shortfall(broken, &example),
        };
        Explanation {
            reason,
            shortfall,
            verdict: self.verdict(&example),
            valuation: example.valuation,
            schedule: Some(example.schedule),
            strategies: Vec::new(),
        }
    }

    fn without_example(&self, reason: String) -> Explanation {
        Explanation {
            reason,
            shortfall: None,
            valuation: self.plan.nominal(),
            schedule: None,
            verdict: None,
            strategies: Vec::new(),
        }
    }

    /// Gives the example a schedule where `first` comes as late as possible relative to `second`,
    /// or 1 later if there is no limit.
    fn delay_first(
        &self,
        example: &mut Counterexample,
        first: NodeId,
        second: NodeId,
    ) -> Option<Shortfall> {
        let network = self.plan.plan.network(&example.valuation);
        let mut network = ConsistentNetwork::try_from(network).ok()?;
        let (first, second) = (network_node(first), network_node(second));
        let most = network.distance(second, first);
        let late = most.clone().unwrap_or(Rational::ONE);
        network
            .add(Constraint::at_least(second, first, late))
            .ok()?;
        let schedule = network.earliest_schedule(network_node(NodeId::ZERO));
        example.schedule = schedule.into();
        Some(most.map_or(Shortfall::Unbounded, |most| {
            Shortfall::Time(&most + self.task.epsilon())
        }))
    }

    /// Returns the validator's objection to the plan at these values with the earliest times.
    /// `None` if the validator has none, if it cannot check the plan because a number outside the plan is open,
    /// or if there is no schedule.
    pub fn verdict_at(&self, valuation: Valuation) -> Option<String> {
        let network = self.plan.plan.network(&valuation);
        let network = ConsistentNetwork::try_from(network).ok()?;
        let schedule = network.earliest_schedule(network_node(NodeId::ZERO)).into();
        self.verdict(&Counterexample {
            valuation,
            schedule,
            moment: None,
        })
    }

    /// Returns the validator's objection to the example. `None` if it has none, or if it cannot
    /// check the plan, because a number outside the plan is open.
    fn verdict(&self, example: &Counterexample) -> Option<String> {
        let is_askable = self.plan.parameters.iter().all(|parameter| {
            matches!(
                parameter.kind,
                ParameterKind::Duration(_) | ParameterKind::Constant(_) | ParameterKind::Bound
            )
        });
        if !is_askable {
            return None;
        }
        let plan = self.plan.plan.at(&example.valuation);
        let plan = plan.scheduled(&example.schedule);
        let settings = validate::Settings::default();
        match validate::validate(self.task, &plan, &settings) {
            Verdict::Invalid(violation) => Some(violation.to_string()),
            _ => None,
        }
    }

    /// Describes a requirement.
    pub fn requirement(&self, requirement: &Requirement) -> String {
        let plan = &self.plan.plan;
        let Requirement::Separation { first, second } = requirement else {
            return self.with_names(requirement.describe(self.task, plan));
        };
        let epsilon = self.task.epsilon().to_decimal(6);
        let kind = |node: &NodeId| plan.nodes[node.index()];
        match (kind(first), kind(second)) {
            (Node::Start(start), Node::End(end)) if start == end => self.describe_own_separation(),
            (_, Node::Timed(index)) => self.deadline(*first, index),
            (Node::Timed(index), _) => format!(
                "{} must come {epsilon} after {}{}",
                plan.describe_node(self.task, *second),
                self.timed_change(*second, index),
                self.at_time(index),
            ),
            _ => format!(
                "{} must come {epsilon} before {}",
                plan.describe_node(self.task, *first),
                plan.describe_node(self.task, *second),
            ),
        }
    }

    /// Replaces the numbers of parameters, which a task uses, by their names.
    fn with_names(&self, mut text: String) -> String {
        // In reverse order, because `?parameter1` is a prefix of `?parameter10`.
        for (index, parameter) in self.plan.parameters.iter().enumerate().rev() {
            text = text.replace(&format!("?parameter{index}"), &parameter.name);
        }
        text
    }

    /// Describes a parameter: `duration of (drive rover depot shelf)`.
    pub fn quantity(&self, id: ParameterId) -> String {
        match self.plan.parameter(id).kind {
            ParameterKind::Timed(index) => self.timed_quantity(index),
            _ => self.plan.describe(self.task, id),
        }
    }

    /// Describes the limit of a parameter's range.
    fn range(&self, id: ParameterId, side: Side) -> String {
        let parameter = self.plan.parameter(id);
        let end = side.of(&parameter.range).value();
        let is_natural = parameter.range == Interval::at_least(Rational::ZERO);
        match (end, parameter.kind) {
            (Some(_), ParameterKind::Duration(_)) if is_natural => {
                "a duration is at least 0".to_owned()
            }
            (Some(_), ParameterKind::Constant(_)) if is_natural => {
                "an amount is at least 0".to_owned()
            }
            (Some(end), _) if side == Side::Lower => {
                format!("the domain or --vary allows at least {}", end.to_decimal(6))
            }
            (Some(end), _) => format!("the domain or --vary allows at most {}", end.to_decimal(6)),
            (None, _) => String::new(),
        }
    }

    /// Explains why the duration of an action is at least ε.
    fn describe_own_separation(&self) -> String {
        let epsilon = self.task.epsilon().to_decimal(6);
        format!("an action whose start and end interfere takes at least {epsilon}")
    }

    /// Returns the action of an instance, `(name object …)`.
    pub fn action_name(&self, id: InstanceId) -> &'a str {
        &self.plan.plan.instance(id).action.name
    }
}

/// Returns the size of the example's violation of a requirement on numbers.
fn shortfall(broken: &Broken, example: &Counterexample) -> Option<Shortfall> {
    let [inequality] = broken.case.inequalities.as_slice() else {
        return None;
    };
    let times = example.schedule.iter().chain(&example.moment);
    let times = times.cloned().collect();
    let value = inequality.expression.value(&times, &example.valuation);
    (!value.is_zero()).then(|| Shortfall::Amount(value.abs()))
}
