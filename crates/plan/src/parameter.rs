//! What is left open in a plan.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::Task;
use elbowroom_model::ground::{Body, Condition, Expression, FluentId};
use elbowroom_model::problem::Unknown;
use elbowroom_num::{Interval, Rational};

use crate::stn_plan::{InstanceId, StnPlan};
use crate::valuation::{ParameterId, Valuation};

/// A quantity left open (γ in paper 1).
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Unique in its plan.
    pub name: String,
    /// Which quantity it is.
    pub kind: ParameterKind,
    /// The value in the original plan (π(γ) in paper 1).
    pub nominal: Rational,
    /// How strongly a search should favour it (ω in paper 1).
    pub weight: Rational,
    /// The values it can take at all; no interval found for it goes beyond.
    pub range: Interval,
}

/// The quantity that a parameter stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterKind {
    /// The duration of an action instance. The domain's duration constraints no longer bind it,
    /// and its action in the plan no longer lists them.
    Duration(InstanceId),
    /// A constant in an action instance: an effect, a condition, a rate.
    Constant(InstanceId),
    /// A number of the domain, the same wherever it occurs.
    Domain,
    /// The value of a fluent at time 0.
    Initial(FluentId),
    /// The time of a group of timed initials: an index into [`Task::timed`].
    Timed(usize),
    /// A bound between two other time points of an STN plan file.
    Bound,
}

/// An STN plan some of whose numbers are parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct ParametrizedPlan {
    /// The plan; its bounds and its actions' expressions may mention parameters.
    pub plan: StnPlan,
    /// The parameters.
    pub parameters: Vec<Parameter>,
    /// Initial values that are parameters.
    pub initial: BTreeMap<FluentId, ParameterId>,
    /// How long those actions are planned to take whose durations are left neither to the world nor
    /// fixed by the domain: the executor tells them at their start.
    pub told: BTreeMap<InstanceId, Rational>,
    /// The goal: the task's, with the domain's unknowns as parameters.
    pub goal: Condition,
}

impl ParameterKind {
    /// The values such a quantity can take when nobody says otherwise, given its nominal value:
    /// times spent and amounts consumed keep their sign.
    pub fn natural_range(self, nominal: &Rational) -> Interval {
        match self {
            Self::Bound | Self::Initial(_) => Interval::EVERYTHING,
            Self::Constant(_) | Self::Domain if nominal.is_negative() => {
                Interval::at_most(Rational::ZERO)
            }
            _ => Interval::at_least(Rational::ZERO),
        }
    }
}

impl ParametrizedPlan {
    /// A plan in which nothing is left open.
    pub fn closed(task: &Task, plan: StnPlan) -> Self {
        Self {
            plan,
            parameters: Vec::new(),
            initial: BTreeMap::new(),
            told: BTreeMap::new(),
            goal: task.goal().clone(),
        }
    }

    /// The instances whose durations are parameters, also where one parameter is the duration of
    /// several.
    pub fn open_durations(&self) -> impl Iterator<Item = (InstanceId, ParameterId)> + '_ {
        let constraints = self.plan.constraints.iter();
        constraints.filter_map(|constraint| {
            let id = constraint.lower.parameter()?;
            let is_set = constraint.upper.parameter() == Some(id);
            let instance = self.plan.duration_of(constraint).filter(|_| is_set)?;
            Some((instance, id))
        })
    }

    /// Returns the plan with planned durations in place of each `?duration` that an action reads before
    /// its end, if its duration is a parameter. The real duration is unknown then
    /// ([`Action::with_planned_duration`]).
    pub(crate) fn with_planned_durations(mut self) -> Self {
        let open: BTreeMap<InstanceId, ParameterId> = self.open_durations().collect();
        for (instance, id) in open {
            let planned = &self.parameters[id.index()].nominal;
            let action = &mut self.plan.instances[instance.index()].action;
            if let Some(known) = action.with_planned_duration(planned) {
                *action = Arc::new(known);
            }
        }
        self
    }

    /// The parameter of that id.
    pub fn parameter(&self, id: ParameterId) -> &Parameter {
        &self.parameters[id.index()]
    }

    /// The parameter of that name.
    pub fn find(&self, name: &str) -> Option<ParameterId> {
        self.parameters
            .iter()
            .position(|p| p.name == name)
            .map(ParameterId::from)
    }

    /// The nominal values.
    pub fn nominal(&self) -> Valuation {
        self.parameters
            .iter()
            .map(|parameter| parameter.nominal.clone())
            .collect()
    }

    /// Whether the plan needs more than facts, one by one: it reads numbers, or throughout an action or a
    /// conditional effect's, something that several facts decide about. If not, the order that deordering keeps and
    /// times are all.
    pub fn reads_more_than_facts(&self, task: &Task) -> bool {
        let reads = |condition: &Condition| {
            let mut reads = false;
            task.visit_fluents_of(condition, &mut |_| reads = true);
            reads
        };
        let is_literal = |condition: &Condition| match condition {
            Condition::Fact(fact) => !task.is_derived(*fact),
            Condition::Not(part) => {
                matches!(**part, Condition::Fact(fact) if !task.is_derived(fact))
            }
            _ => false,
        };
        let has_literals =
            |throughout: &Condition| throughout.conjuncts().into_iter().all(is_literal);
        let mut instances = self.plan.instances.iter();
        reads(&self.goal)
            || instances.any(|instance| match &instance.action.body {
                Body::Instantaneous(snap) => reads(&snap.condition),
                Body::Durative(body) => {
                    let mut effects = body.end.effects.iter();
                    reads(&body.start.condition)
                        || reads(&body.end.condition)
                        || !has_literals(&body.over_all)
                        || !effects.all(|effect| has_literals(&effect.guard.over_all))
                }
            })
    }

    /// Whether how long actions take makes a difference to any number: it stands in an expression,
    /// or something changes continuously.
    pub fn durations_move_numbers(&self) -> bool {
        let is_duration = |leaf: &Expression| match leaf {
            Expression::Duration => true,
            Expression::Unknown(Unknown::Parameter(index)) => {
                let parameter = self.parameters.get(*index as usize);
                parameter.is_some_and(|own| matches!(own.kind, ParameterKind::Duration(_)))
            }
            _ => false,
        };
        self.plan.instances.iter().any(|instance| {
            let body = instance.action.durative();
            let mut mentions = body.is_some_and(|body| !body.continuous.is_empty());
            let _ = instance.action.map_leaves(&mut |leaf| {
                mentions |= is_duration(leaf);
                None
            });
            mentions
        })
    }

    /// The quantity in plain words: `duration of (move a b)`.
    pub fn describe(&self, task: &Task, id: ParameterId) -> String {
        let action = |instance: InstanceId| self.plan.instance(instance).action.name.clone();
        match self.parameter(id).kind {
            ParameterKind::Duration(instance) => format!("duration of {}", action(instance)),
            ParameterKind::Constant(instance) => format!("number in {}", action(instance)),
            ParameterKind::Domain => "number of the domain".to_owned(),
            ParameterKind::Initial(fluent) => format!("initial {}", task.fluent_name(fluent)),
            ParameterKind::Timed(index) => {
                format!(
                    "time of the timed initials at {}",
                    task.timed()[index].time.to_decimal(3)
                )
            }
            ParameterKind::Bound => "bound between two time points".to_owned(),
        }
    }
}
