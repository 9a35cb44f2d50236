//! Open quantities of a plan.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::Task;
use elbowroom_model::ground::{Body, Condition, Expression, FluentId};
use elbowroom_model::problem::Unknown;
use elbowroom_num::{Interval, Rational};

use crate::stn_plan::{InstanceId, StnPlan};
use crate::valuation::{ParameterId, Valuation};

/// An open quantity (γ in paper 1).
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Its name, unique in its plan.
    pub name: String,
    /// The quantity.
    pub kind: ParameterKind,
    /// The value in the original plan (π(γ) in paper 1).
    pub nominal: Rational,
    /// Weight of the parameter in a search (ω in paper 1).
    pub weight: Rational,
    /// Range of its possible values. All computed intervals are inside it.
    pub range: Interval,
}

/// Quantity that a parameter represents.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterKind {
    /// The duration of an action instance. The domain's duration constraints no longer apply to it,
    /// and its action in the plan no longer contains them.
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

/// An STN plan with parameters in place of some numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct ParametrizedPlan {
    /// The plan. Its bounds and its actions' expressions may mention parameters.
    pub plan: StnPlan,
    /// The parameters.
    pub parameters: Vec<Parameter>,
    /// Initial values that are parameters.
    pub initial: BTreeMap<FluentId, ParameterId>,
    /// Planned durations of the actions whose durations the executor chooses at their start:
    /// durations that are neither uncertain nor fixed by the domain.
    pub commanded_durations: BTreeMap<InstanceId, Rational>,
    /// The task's goal, with the domain's unknowns as parameters.
    pub goal: Condition,
}

impl ParameterKind {
    /// Returns the default range of such a quantity, given its nominal value: durations and amounts
    /// keep their sign.
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
    /// Creates a plan without open quantities.
    pub fn closed(task: &Task, plan: StnPlan) -> Self {
        Self {
            plan,
            parameters: Vec::new(),
            initial: BTreeMap::new(),
            commanded_durations: BTreeMap::new(),
            goal: task.goal().clone(),
        }
    }

    /// Returns the instances whose durations are parameters, even if one parameter is the duration
    /// of several.
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

    /// Returns the parameter with that id.
    pub fn parameter(&self, id: ParameterId) -> &Parameter {
        &self.parameters[id.index()]
    }

    /// Returns the parameter with that name.
    pub fn find(&self, name: &str) -> Option<ParameterId> {
        self.parameters
            .iter()
            .position(|p| p.name == name)
            .map(ParameterId::from)
    }

    /// Returns the nominal values.
    pub fn nominal(&self) -> Valuation {
        self.parameters
            .iter()
            .map(|parameter| parameter.nominal.clone())
            .collect()
    }

    /// Returns `true` if the plan reads more than single facts: it reads numbers, or over-all
    /// conditions of an action or of a conditional effect that depend on several facts. Otherwise,
    /// the orders of deordering and the times are sufficient.
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

    /// Returns `true` if the durations of actions influence a number: an expression contains a
    /// duration, or a number changes continuously.
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

    /// Returns the quantity in words: `duration of (move a b)`.
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
