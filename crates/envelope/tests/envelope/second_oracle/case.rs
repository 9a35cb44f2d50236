//! Small problem with an STN plan whose numbers are partly open.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use elbowroom_model::ground::{Action, Body, Expression};
use elbowroom_model::problem::{FunctionId, SchemaId, Unknown};
use elbowroom_model::validate::{Settings, Verdict, validate};
use elbowroom_model::{Problem, Task, TimeTriggeredPlan};
use elbowroom_num::{Interval, Rational};
use elbowroom_plan::{
    Bound, Constraint, DecoupledEnvelope, Instance, InstanceId, Node, NodeId, Parameter,
    ParameterId, ParameterKind, ParametrizedPlan, Reason, Schedule, StnPlan, Valuation,
};

use crate::second_oracle::numbers;

/// Bound on the difference of two time points, which are identified by their meaning.
#[derive(Clone, Debug)]
pub(crate) struct Gap {
    pub(crate) from: Node,
    pub(crate) to: Node,
    pub(crate) lower: Bound,
    pub(crate) upper: Bound,
}

/// Problem with a plan that executes each of its actions once.
///
/// `Unknown::Domain(i)` in the problem is parameter `i`. Timed initials have one time per group, in
/// ascending order. All predicates, functions and actions are without arguments.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    pub(crate) problem: Problem,
    pub(crate) gaps: Vec<Gap>,
    pub(crate) parameters: Vec<Parameter>,
    /// Initial values that are parameters.
    pub(crate) initial: BTreeMap<FunctionId, ParameterId>,
    /// Times of timed initials that are parameters, by group.
    pub(crate) timed: BTreeMap<usize, ParameterId>,
    pub(crate) epsilon: Rational,
}

impl Case {
    /// Returns the times of the groups of timed initials.
    pub(crate) fn timed_times(&self) -> Vec<Rational> {
        let mut times: Vec<_> = self.problem.timed.iter().map(|t| t.time.clone()).collect();
        times.sort();
        times.dedup();
        times
    }

    /// Builds the task and the plan for the oracles.
    pub(crate) fn build(&self) -> (Task, ParametrizedPlan) {
        let mut problem = self.problem.clone();
        problem.unknowns = self.parameters.iter().map(|p| p.name.clone()).collect();
        let task = Task::new(problem).with_epsilon(self.epsilon.clone());
        let instances = (0..task.problem().schemas.len()).map(|index| {
            let action = task
                .instantiate(SchemaId::from(index), &[])
                .expect("no arguments");
            Instance {
                label: format!("n{index}"),
                action: Arc::new(action.map_leaves(&mut parameter_of)),
            }
        });
        let instances: Vec<_> = instances.collect();
        let mut plan = StnPlan::unconstrained(&task, instances);
        for (&group, &parameter) in &self.timed {
            let node = plan.timed(group);
            for constraint in plan.constraints.iter_mut().filter(|c| c.to == node) {
                constraint.lower = Bound::Parameter(parameter);
                constraint.upper = Bound::Parameter(parameter);
            }
        }
        for parameter in &self.parameters {
            if let ParameterKind::Duration(instance) = parameter.kind {
                plan.free_duration(instance);
            }
        }
        for gap in &self.gaps {
            plan.constraints.push(Constraint {
                from: node_of(&plan, gap.from),
                to: node_of(&plan, gap.to),
                lower: gap.lower.clone(),
                upper: gap.upper.clone(),
                reason: Reason::Given,
            });
        }
        let initial = self.initial.iter().map(|(&function, &parameter)| {
            let fluent = task.find_fluent(function, &[]).expect("has a value");
            (fluent, parameter)
        });
        let plan = ParametrizedPlan {
            plan,
            parameters: self.parameters.clone(),
            commanded_durations: std::collections::BTreeMap::new(),
            initial: initial.collect(),
            goal: task.goal().map_leaves(&mut parameter_of),
        };
        (task, plan)
    }

    /// Returns the problem with these values in place of its parameters, for the validator.
    pub(crate) fn task_at(&self, valuation: &Valuation) -> Task {
        let mut problem = self.problem.clone();
        numbers::fill(&mut problem, &|index| Some(valuation[index.into()].clone()));
        for (function, arguments, value) in &mut problem.initial_values {
            if let (Some(id), true) = (self.initial.get(function), arguments.is_empty()) {
                *value = valuation[*id].clone();
            }
        }
        let times = self.timed_times();
        for timed in &mut problem.timed {
            let group = times.iter().position(|time| *time == timed.time);
            if let Some(id) = group.and_then(|group| self.timed.get(&group)) {
                timed.time = valuation[*id].clone();
            }
        }
        Task::new(problem).with_epsilon(self.epsilon.clone())
    }

    /// Returns the validator's verdict on a schedule of the plan for these values.
    pub(crate) fn validate(&self, valuation: &Valuation, schedule: &Schedule) -> Verdict {
        let (_, plan) = self.build();
        let scheduled = plan.plan.at(valuation).scheduled(schedule);
        let task = self.task_at(valuation);
        let steps = scheduled.steps.into_iter().map(|mut step| {
            // The same action, in the table of the problem with these values.
            let mut action = task
                .instantiate(step.action.schema, &[])
                .expect("no arguments");
            self.free_duration(&mut action);
            step.action = Arc::new(action);
            step
        });
        let plan = TimeTriggeredPlan {
            steps: steps.collect(),
        };
        validate(&task, &plan, &Settings::default())
    }

    /// Removes the domain's duration constraints of an action whose duration is a parameter.
    fn free_duration(&self, action: &mut Action) {
        let is_free = self.parameters.iter().any(|parameter| {
            matches!(parameter.kind, ParameterKind::Duration(id) if id.index() == action.schema.index())
        });
        if let (true, Body::Durative(body)) = (is_free, &mut action.body) {
            body.duration.clear();
        }
    }
}

fn parameter_of(leaf: &Expression) -> Option<Expression> {
    match leaf {
        Expression::Unknown(Unknown::Domain(index)) => {
            Some(Expression::Unknown(Unknown::Parameter(*index)))
        }
        _ => None,
    }
}

/// Returns the plan's node with that meaning.
pub(crate) fn node_of(plan: &StnPlan, node: Node) -> NodeId {
    let found = plan.nodes().find(|&(_, other)| other == node);
    found.expect("the plan has all its nodes").0
}

/// Returns the instance that a node belongs to.
pub(crate) fn instance_of(node: Node) -> Option<InstanceId> {
    match node {
        Node::Start(id) | Node::End(id) | Node::Instant(id) => Some(id),
        Node::Zero | Node::Timed(_) => None,
    }
}

/// Formats the whole case in PDDL and as an STN plan, for error messages.
impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (task, plan) = self.build();
        writeln!(f, "epsilon {}", self.epsilon)?;
        for parameter in &plan.parameters {
            writeln!(
                f,
                "parameter {} = {} in {}: {:?}",
                parameter.name, parameter.nominal, parameter.range, parameter.kind
            )?;
        }
        let facts: Vec<_> = task.initial().facts.iter().collect();
        let facts: Vec<_> = facts.into_iter().map(|&id| task.fact_name(id)).collect();
        writeln!(f, "init {}", facts.join(" "))?;
        for (&fluent, value) in &task.initial().values {
            let parameter = plan.initial.get(&fluent).map(|id| format!(" p{}", id.0));
            let parameter = parameter.unwrap_or_default();
            writeln!(f, "init {} = {value}{parameter}", task.fluent_name(fluent))?;
        }
        for timed in task.timed() {
            writeln!(f, "at {}: {:?}", timed.time, timed.changes)?;
        }
        for instance in &plan.plan.instances {
            write_action(f, &task, instance)?;
        }
        writeln!(f, "goal {}", task.describe_condition(&plan.goal))?;
        for constraint in &plan.plan.constraints {
            writeln!(
                f,
                "{} - {} in [{:?}, {:?}]",
                plan.plan.node_label(constraint.to),
                plan.plan.node_label(constraint.from),
                constraint.lower,
                constraint.upper
            )?;
        }
        Ok(())
    }
}

fn write_action(f: &mut fmt::Formatter<'_>, task: &Task, instance: &Instance) -> fmt::Result {
    let condition = |condition| task.describe_condition(condition);
    match &instance.action.body {
        Body::Instantaneous(snap) => {
            writeln!(f, "{}: instant", instance.label)?;
            writeln!(f, "  if {}", condition(&snap.condition))?;
            writeln!(f, "  do {:?}", snap.effects)
        }
        Body::Durative(body) => {
            writeln!(f, "{}:", instance.label)?;
            for limit in &body.duration {
                writeln!(
                    f,
                    "  ?duration {} {}{}",
                    limit.comparison.symbol(),
                    task.describe_expression(&limit.bound),
                    if limit.at_end { " at end" } else { "" }
                )?;
            }
            writeln!(f, "  start if {}", condition(&body.start.condition))?;
            writeln!(f, "  start do {:?}", body.start.effects)?;
            writeln!(f, "  over all {}", condition(&body.over_all))?;
            writeln!(f, "  end if {}", condition(&body.end.condition))?;
            writeln!(f, "  end do {:?}", body.end.effects)?;
            for effect in &body.continuous {
                writeln!(
                    f,
                    "  d {} / dt = {}, if {}",
                    task.fluent_name(effect.fluent),
                    task.describe_expression(&effect.rate),
                    condition(&effect.guard.at_start)
                )?;
            }
            Ok(())
        }
    }
}

/// Formats a box, for error messages.
pub(crate) fn show(envelope: &DecoupledEnvelope) -> String {
    let parts: Vec<_> = envelope
        .intervals()
        .iter()
        .map(ToString::to_string)
        .collect();
    parts.join(" x ")
}

/// Returns the box with these intervals.
pub(crate) fn box_of(intervals: Vec<Interval>) -> DecoupledEnvelope {
    let zeros = intervals.iter().map(|_| Rational::ZERO).collect();
    let given = intervals.into_iter().enumerate();
    given.fold(
        DecoupledEnvelope::point(&zeros),
        |all, (index, interval)| all.with_interval(index.into(), interval),
    )
}
