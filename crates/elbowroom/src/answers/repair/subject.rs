//! The changeable quantities of a plan, as parameters of its network.

use std::sync::Arc;

use elbowroom_envelope::Changeable;
use elbowroom_model::ground::{Change as Effect, DurationConstraint, Expression};
use elbowroom_model::problem::Comparison;
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_num::{End, Interval, Rational};
use elbowroom_plan::deorder::{DeorderError, unordered};
use elbowroom_plan::parametrize::{ParametrizeError, Selection, Target, VarySpec, vary};
use elbowroom_plan::{
    Bound, Constraint, InstanceId, Node, NodeId, Parameter, ParameterId, ParameterKind,
    ParametrizedPlan, Reason, Schedule, Side, StnPlan, Valuation,
};

use super::RepairRequest;
use crate::AnyPlan;
use crate::pipeline::PipelineError;

/// Default cost per unit of a duration, which the world decides.
const DURATION_WEIGHT: i64 = 2;
/// Default cost per unit of a bound that separates time points.
const SEPARATION_WEIGHT: i64 = 10;

/// A plan whose changeable quantities are parameters.
pub(super) struct Subject {
    /// The task with separate timed initials.
    pub(super) task: Task,
    pub(super) plan: ParametrizedPlan,
    /// Number of the plan's own parameters; the others were opened for the repair.
    pub(super) own_parameters: usize,
    /// The times of a plan with fixed times, which order its interfering actions.
    pub(super) times: Option<Schedule>,
    pub(super) changeable: Vec<Changeable>,
    /// The plan before quantities were opened, whose actions have the duration constraints of the
    /// domain.
    original: StnPlan,
    /// The opened bounds of an STN plan file, described in words.
    pub(super) bounds: Vec<(ParameterId, String)>,
}

impl Subject {
    pub(super) fn new(request: &RepairRequest) -> Result<Self, PipelineError> {
        if let Some(feature) = request.task.unsupported_by_analysis() {
            return Err(DeorderError::Unsupported { feature }.into());
        }
        let task = request.task.with_separate_timed_initials();
        let (closed, times) = match &request.plan {
            AnyPlan::TimeTriggered(plan) => {
                let unordered = unordered(&task, plan);
                let closed = ParametrizedPlan::closed(&task, unordered.plan);
                (closed, Some(unordered.times))
            }
            AnyPlan::Stn(plan) => (with_separate_timed_initials(&task, plan), None),
        };
        let nominal = times.clone().unwrap_or_else(|| durations_of(&closed));
        let specs = if request.change.is_empty() {
            default_quantities(&task, &closed)
        } else {
            request.change.clone()
        };
        let kept = vary(&task, closed.clone(), &nominal, &request.keep)?;
        let kept = &kept.parameters[closed.parameters.len()..];
        let is_kept = |kind: ParameterKind| kept.iter().any(|own| own.kind == kind);
        let mut subject = Self {
            original: closed.plan.clone(),
            plan: vary(&task, closed.clone(), &nominal, &specs)?,
            own_parameters: closed.parameters.len(),
            task,
            times,
            changeable: Vec::new(),
            bounds: Vec::new(),
        };
        for index in closed.parameters.len()..subject.plan.parameters.len() {
            let id = ParameterId::from(index);
            let kind = subject.plan.parameter(id).kind;
            if let ParameterKind::Duration(instance) = kind {
                subject.check_openable(&closed, id, instance, &specs)?;
            }
            if is_kept(kind) {
                subject.restore_range(&closed, id);
            } else {
                let free = subject.free(&closed, id);
                subject.add(id, free, None);
            }
        }
        if request.change.is_empty() {
            for index in 0..closed.parameters.len() {
                let id = ParameterId::from(index);
                let parameter = subject.plan.parameter(id);
                if !is_kept(parameter.kind) {
                    let free = Interval::point(parameter.nominal.clone());
                    let is_duration = matches!(parameter.kind, ParameterKind::Duration(_));
                    let weight = if is_duration { DURATION_WEIGHT } else { 1 };
                    subject.add(id, free, Some(weight));
                }
            }
            subject.open_bounds(&is_kept);
        }
        Ok(subject)
    }

    fn add(&mut self, parameter: ParameterId, free: Interval, weight: Option<i64>) {
        let weight = weight.map(Rational::from);
        let given = || self.plan.parameter(parameter).weight.clone();
        self.changeable.push(Changeable {
            parameter,
            free_range: free,
            weight: weight.unwrap_or_else(given),
        });
    }

    /// Rejects opening a duration whose constraint in the domain depends on the plan's course.
    fn check_openable(
        &self,
        closed: &ParametrizedPlan,
        id: ParameterId,
        instance: InstanceId,
        specs: &[VarySpec],
    ) -> Result<(), ParametrizeError> {
        let is_open = self.free(closed, id) == Interval::at_least(Rational::ZERO);
        let body = self.original.instance(instance).action.durative();
        if !is_open || body.is_none_or(|body| body.duration.is_empty()) {
            return Ok(());
        }
        let spec = specs
            .iter()
            .find(|spec| matches!(spec.target, Target::Durations | Target::Duration(_)));
        Err(ParametrizeError::NothingMatches {
            spec: spec.map(ToString::to_string).unwrap_or_default(),
            why: format!(
                "the duration of {} depends on values that change during the plan",
                self.original.instance(instance).action.name
            ),
        })
    }

    /// Returns the values of an opened parameter that cost nothing.
    fn free(&self, closed: &ParametrizedPlan, id: ParameterId) -> Interval {
        let parameter = self.plan.parameter(id);
        let ParameterKind::Duration(instance) = parameter.kind else {
            return Interval::point(parameter.nominal.clone());
        };
        let own = closed.plan.constraints.iter();
        let mut own = own.filter(|own| closed.plan.duration_of(own) == Some(instance));
        let end = |bound: &Bound| match bound {
            Bound::Finite(value) => End::Closed(value.clone()),
            Bound::Infinite | Bound::Parameter(_) => End::Infinite,
        };
        own.next().map_or_else(
            || Interval::point(parameter.nominal.clone()),
            |own| Interval {
                lower: end(&own.lower),
                upper: end(&own.upper),
            },
        )
    }

    /// Restores the original range of an opened parameter, which keeps its name.
    fn restore_range(&mut self, closed: &ParametrizedPlan, id: ParameterId) {
        let free = self.free(closed, id);
        let parameter = &mut self.plan.parameters[id.index()];
        parameter.range = free.clone();
        let nominal = &mut parameter.nominal;
        if let Some(least) = free.lower.value().filter(|least| *nominal < **least) {
            nominal.clone_from(least);
        }
        if let Some(most) = free.upper.value().filter(|most| *nominal > **most) {
            nominal.clone_from(most);
        }
        // It can still vary within the range that the domain allows.
        self.changeable.push(Changeable {
            parameter: id,
            free_range: free,
            weight: Rational::ONE,
        });
    }

    /// Opens the bounds that an STN plan file gives.
    fn open_bounds(&mut self, is_kept: &dyn Fn(ParameterKind) -> bool) {
        for index in 0..self.plan.plan.constraints.len() {
            let constraint = self.plan.plan.constraints[index].clone();
            if constraint.reason != Reason::Given {
                continue;
            }
            let duration = self.plan.plan.duration_of(&constraint);
            if let (Some(instance), Bound::Finite(value)) = (duration, &constraint.lower)
                && constraint.lower == constraint.upper
            {
                let kind = ParameterKind::Duration(instance);
                if is_kept(kind) {
                    continue;
                }
                let id = self.parameter(kind, value, Interval::at_least(Rational::ZERO));
                self.plan.plan.free_duration(instance);
                let bounds = &mut self.plan.plan.constraints[index];
                bounds.lower = Bound::Parameter(id);
                bounds.upper = Bound::Parameter(id);
                self.add(id, Interval::point(value.clone()), Some(DURATION_WEIGHT));
                continue;
            }
            if duration.is_some_and(|own| is_kept(ParameterKind::Duration(own))) {
                continue;
            }
            for side in Side::BOTH {
                self.open_bound(index, side, duration.is_some());
            }
        }
    }

    fn open_bound(&mut self, index: usize, side: Side, is_duration: bool) {
        let constraint = &self.plan.plan.constraints[index];
        let bound = match side {
            Side::Lower => &constraint.lower,
            Side::Upper => &constraint.upper,
        };
        let Bound::Finite(value) = bound.clone() else {
            return;
        };
        let words = self.describe_bound_between(constraint.from, constraint.to, side);
        // The order of the two time points is kept.
        let range = if value.is_negative() {
            Interval::EVERYTHING
        } else {
            Interval::at_least(Rational::ZERO)
        };
        let id = self.parameter(ParameterKind::Bound, &value, range);
        let constraint = &mut self.plan.plan.constraints[index];
        match side {
            Side::Lower => constraint.lower = Bound::Parameter(id),
            Side::Upper => constraint.upper = Bound::Parameter(id),
        }
        let weight = match side {
            _ if is_duration => DURATION_WEIGHT,
            Side::Lower => SEPARATION_WEIGHT,
            Side::Upper => 1,
        };
        self.add(id, Interval::point(value), Some(weight));
        self.bounds.push((id, words));
    }

    fn parameter(
        &mut self,
        kind: ParameterKind,
        nominal: &Rational,
        range: Interval,
    ) -> ParameterId {
        let id = ParameterId::from(self.plan.parameters.len());
        self.plan.parameters.push(Parameter {
            name: format!("bound {}", id.index()),
            kind,
            nominal: nominal.clone(),
            weight: Rational::ONE,
            range,
        });
        id
    }

    /// Returns the changed problem, and the plan with these values and times.
    pub(super) fn repaired(
        &self,
        values: &Valuation,
        schedule: &Schedule,
    ) -> (Task, TimeTriggeredPlan) {
        let groups = 0..self.task.timed().len();
        let moved = groups.map(|index| schedule[self.plan.plan.timed(index)].clone());
        let initial = self.plan.initial.iter();
        let initial = initial.map(|(fluent, id)| (*fluent, values[*id].clone()));
        let task = self.task.with_numbers(&moved.collect::<Vec<_>>(), initial);
        let mut plan = self.plan.plan.at(values);
        for own in &self.changeable {
            let ParameterKind::Duration(instance) = self.plan.parameter(own.parameter).kind else {
                continue;
            };
            let value = &values[own.parameter];
            let allowed = self.original.instance(instance).action.durative();
            let duration = match allowed {
                // A duration that the domain allows keeps its constraint.
                Some(body) if own.free_range.contains(value) => body.duration.clone(),
                _ => vec![DurationConstraint {
                    comparison: Comparison::Equal,
                    bound: Expression::Constant(value.clone()),
                    at_end: false,
                }],
            };
            let action = &mut plan.instances[instance.index()].action;
            if let elbowroom_model::ground::Body::Durative(body) = &mut Arc::make_mut(action).body {
                body.duration = duration;
            }
        }
        (task, plan.scheduled(schedule))
    }
}

/// Returns all quantities that may change by default.
fn default_quantities(task: &Task, plan: &ParametrizedPlan) -> Vec<VarySpec> {
    let spec = |target, weight: i64| VarySpec {
        text: String::new(),
        target,
        weight: Some(Rational::from(weight)),
        range: None,
    };
    let durations = plan.plan.constraints.iter().filter_map(|own| {
        let Reason::Duration(instance) = own.reason else {
            return None;
        };
        let is_free = own.upper == Bound::Infinite && own.lower == Bound::Finite(Rational::ZERO);
        let label = plan.plan.instance(instance).label.clone();
        let target = Target::Duration(Selection::Named(label));
        (!is_free).then(|| spec(target, DURATION_WEIGHT))
    });
    let timed = task.timed().iter().flat_map(|own| &own.changes);
    let timed = timed.map(|change| {
        let problem = task.problem();
        let (name, objects) = match change {
            Effect::Add(fact) | Effect::Delete(fact) => {
                let (predicate, objects) = task.atom(*fact);
                (problem.predicates[predicate.index()].name.clone(), objects)
            }
            Effect::Update { fluent, .. } => {
                let (function, objects) = task.application(*fluent);
                (problem.functions[function.index()].name.clone(), objects)
            }
        };
        let objects = objects.iter();
        let objects = objects.map(|object| problem.objects[object.index()].name.clone());
        let atom = [name].into_iter().chain(objects).collect();
        let only_deletions = matches!(change, Effect::Delete(_));
        spec(
            Target::Timed {
                atom,
                only_deletions,
            },
            1,
        )
    });
    durations.chain(timed).collect()
}

/// Returns an STN plan whose timed initials are those of the task.
fn with_separate_timed_initials(task: &Task, plan: &ParametrizedPlan) -> ParametrizedPlan {
    let mut apart = plan.clone();
    let is_action = |node: &Node| !matches!(node, Node::Timed(_));
    let count = plan
        .plan
        .nodes
        .iter()
        .filter(|node| is_action(node))
        .count();
    // Timed initials come last, and only the bounds on their own times mention them.
    apart.plan.nodes.truncate(count);
    apart
        .plan
        .constraints
        .retain(|own| own.from.index() < count && own.to.index() < count);
    for (index, timed) in task.timed().iter().enumerate() {
        apart.plan.constraints.push(Constraint {
            from: NodeId::ZERO,
            to: NodeId::from(apart.plan.nodes.len()),
            lower: Bound::Finite(timed.time.clone()),
            upper: Bound::Finite(timed.time.clone()),
            reason: Reason::Timed(index),
        });
        apart.plan.nodes.push(Node::Timed(index));
    }
    apart
}

/// Returns a time for each node such that differences of starts and ends are the durations in the
/// file. The plan need not have a schedule.
fn durations_of(plan: &ParametrizedPlan) -> Schedule {
    let mut times = vec![Rational::ZERO; plan.plan.nodes.len()];
    let nominal = plan.nominal();
    for constraint in &plan.plan.constraints {
        if plan.plan.duration_of(constraint).is_some() {
            let bound = constraint
                .lower
                .at(&nominal)
                .or_else(|| constraint.upper.at(&nominal));
            times[constraint.to.index()] = bound.unwrap_or_default();
        }
    }
    times.into_iter().collect()
}
