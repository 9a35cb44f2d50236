//! Dispatching of an STN plan: the common part of all executors that use a temporal network.
//!
//! A time point is *ready* when everything that must come before it has been observed. It is
//! started as soon as its window opens (paper 1, Algorithm 2, lines 6 to 10). Executed time points
//! are fixed in the network. With [`PropagationReach::WholeNetwork`], this updates the windows of
//! all others, including deadlines. The work per event is proportional to the number of windows
//! that change.

mod decide;
mod explain;
mod interference;
mod observe;
mod overrun;
mod progress;
mod projection;
mod retry;

pub(crate) use decide::{in_words, replan};
pub(crate) use overrun::{EndAssumption, Overdue};

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use elbowroom_model::Task;
use elbowroom_model::ground::{Action, Body, DurationConstraint};
use elbowroom_num::Rational;
use elbowroom_plan::uncertain::{ConstraintRole, Impossible, PlanNetwork};
use elbowroom_plan::{
    Bound, Constraint, InstanceId, Node, NodeId, Schedule, StnPlan, network_node,
};
use elbowroom_stn::{ConsistentNetwork, Network};

use crate::executor::{Planned, PreparedPlan, StepId};
use crate::reason::{Cause, Evidence, Reason, Subject};
use crate::separation::Separation;
use crate::window_propagation::{NetworkLimit, WindowPropagation, constraints_of_steps};
use overrun::BoundViolations;
use progress::PlanProgress;
use retry::Retry;

/// Finite bounds of a constraint.
pub(crate) type Bounds = (Option<Rational>, Option<Rational>);

/// The reach of constraint propagation: the whole network, or only the neighbours of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PropagationReach {
    WholeNetwork,
    OneHop,
}

/// For each part of the network, the position of the plan's constraint that it comes from.
#[derive(Clone, Debug)]
struct Sources {
    /// For each constraint of the network; `None` if it comes from no constraint of the plan.
    requirements: Vec<Option<usize>>,
    /// For each contingent link.
    links: Vec<usize>,
}

impl Sources {
    fn of(&self, behind: NetworkLimit) -> Option<usize> {
        match behind {
            NetworkLimit::Constraint(id) => self.requirements.get(id.index()).copied().flatten(),
            NetworkLimit::Link(link) => self.links.get(link.index()).copied(),
        }
    }
}

fn describe_constraint(mission: &PreparedPlan, index: usize) -> Evidence {
    let plan = &mission.plan.plan;
    explain::describe_constraint(&mission.task, plan, &mission.origin, index)
}

/// Returns the reason for rejecting a plan whose network is not controllable: the conflicting
/// constraints.
fn contradiction(mission: &PreparedPlan, sources: &Sources, behind: &[NetworkLimit]) -> Reason {
    let mut reason = Reason::new(Cause::Late).about(Subject::NoSchedule);
    let indices = behind.iter().filter_map(|behind| sources.of(*behind));
    reason.evidence = indices
        .map(|index| describe_constraint(mission, index))
        .collect();
    reason.evidence.dedup();
    reason
}

/// State of the dispatch of a plan.
#[derive(Clone, Debug)]
pub(crate) struct Dispatch {
    task: Arc<Task>,
    plan: StnPlan,
    /// The actions, with nominal values for the open parameters.
    actions: Vec<Arc<Action>>,
    nominal: Schedule,
    /// The time on the world's clock when the plan's clock reads 0.
    origin: Rational,
    epsilon: Rational,
    horizon: WindowPropagation,
    sources: Sources,
    /// Start and end node of each instance; the same node twice if it is instantaneous.
    ends: Vec<[NodeId; 2]>,
    /// Bounds on the duration of each instance.
    durations: Vec<Bounds>,
    progress: PlanProgress,
    /// For each instance, the bounds on its duration that depend on numbers
    /// ([`decide::numeric_duration_bounds`]).
    numbers_of_durations: BTreeMap<InstanceId, Vec<DurationConstraint>>,
    /// The times, on the plan's clock, at which instances were commanded whose start has not been
    /// observed.
    commanded_unstarted: BTreeMap<InstanceId, Rational>,
    /// Coming timed initials with their times, the last one first.
    timed: Vec<(Rational, NodeId)>,
    /// Instances that were running before the plan began. The plan contains only their remainder.
    resumed: BTreeSet<InstanceId>,
    /// Failed starts that are to be retried.
    retries: BTreeMap<NodeId, Retry>,
    /// Violations of the network's bounds since the network was last known to be executable.
    bound_violations: BoundViolations,
    /// The happenings that starts are separated from; `None` if the network orders all interfering happenings.
    separation: Option<Separation>,
}

impl Dispatch {
    /// Creates the dispatch of a plan. `bounds` returns the bounds of each constraint. The executor
    /// is assumed to choose all times.
    ///
    /// # Errors
    /// If no times satisfy the bounds.
    pub(crate) fn new(
        mission: &PreparedPlan,
        sight: PropagationReach,
        bounds: &dyn Fn(&Constraint) -> Bounds,
    ) -> Result<Self, Box<Reason>> {
        let plan = &mission.plan.plan;
        let (network, sources) = network(plan, bounds);
        let sources = Sources {
            requirements: sources,
            links: Vec::new(),
        };
        let horizon = match sight {
            PropagationReach::OneHop => WindowPropagation::one_hop(network),
            PropagationReach::WholeNetwork => match ConsistentNetwork::try_from(network) {
                Ok(network) => WindowPropagation::whole_network(network),
                Err(cycle) => {
                    let behind: Vec<NetworkLimit> = cycle
                        .constraints
                        .iter()
                        .copied()
                        .map(NetworkLimit::Constraint)
                        .collect();
                    let mut reason = contradiction(mission, &sources, &behind);
                    reason.by = Some(-cycle.total);
                    return Err(Box::new(reason));
                }
            },
        };
        Ok(Self::with_horizon(mission, horizon, sources, bounds))
    }

    /// Creates the dispatch of a plan whose contingent durations (according to `reading`) are
    /// decided by the world.
    ///
    /// # Errors
    /// If the network is not dynamically controllable: the conflicting constraints.
    pub(crate) fn with_contingent_durations(
        mission: &PreparedPlan,
        reading: &dyn Fn(&Constraint) -> ConstraintRole,
    ) -> Result<Self, Box<Reason>> {
        let plan = &mission.plan.plan;
        let network = plan
            .uncertain_network(reading)
            .map_err(|Impossible(index)| {
                let mut reason = Reason::new(Cause::Late).about(Subject::UnsatisfiableConstraint);
                reason.evidence = vec![describe_constraint(mission, index)];
                Box::new(reason)
            })?;
        let sources = Sources {
            requirements: network.requirements,
            links: network.links,
        };
        let form = mission.dispatchable_cache.get_or_compute(network.network);
        let form = form.map_err(|behind| Box::new(contradiction(mission, &sources, &behind)))?;
        let horizon = WindowPropagation::dispatchable(form);
        let bounds = |constraint: &Constraint| bounds_of(reading(constraint));
        Ok(Self::with_horizon(mission, horizon, sources, &bounds))
    }

    /// Replaces the network by one with other readings of the constraints. Executed time points
    /// keep their times; the others cannot happen before `now`.
    ///
    /// # Errors
    /// If the new network is not dynamically controllable: the conflicting constraints of the plan.
    pub(crate) fn with_bounds(
        &mut self,
        now: &Rational,
        reading: &dyn Fn(&Constraint) -> ConstraintRole,
    ) -> Result<(), Vec<Evidence>> {
        let known = self.plan.constraints.len();
        let network = self.remaining_network(now, reading);
        let network = network.map_err(|Impossible(index)| vec![self.describe_constraint(index)])?;
        let own = |index: &usize| *index < known;
        let sources = Sources {
            requirements: network
                .requirements
                .iter()
                .map(|index| index.filter(own))
                .collect(),
            links: network.links,
        };
        let form = network.network.into_executable();
        let form = form.map_err(|(_, conflict)| {
            let mut behind: Vec<Evidence> = constraints_of_steps(&conflict.steps)
                .iter()
                .filter_map(|limit| sources.of(*limit))
                .map(|index| self.describe_constraint(index))
                .collect();
            behind.dedup();
            behind
        })?;
        let mut horizon = WindowPropagation::dispatchable(Arc::new(form));
        for (node, _) in self.plan.nodes() {
            if let Some(time) = self.execution_time(node) {
                let _ = horizon.fix(network_node(node), time);
            }
        }
        let pending = |node: &NodeId| !self.timed.iter().any(|(_, timed)| timed == node);
        for (node, what) in self.plan.nodes() {
            if matches!(what, Node::Timed(_)) && pending(&node) {
                let _ = horizon.fix(network_node(node), self.nominal_time(node));
            }
        }
        self.horizon = horizon;
        self.sources = sources;
        self.bound_violations = BoundViolations::default();
        let bounds = |constraint: &Constraint| bounds_of(reading(constraint));
        self.durations = durations(&self.plan, &bounds);
        Ok(())
    }

    /// Returns the network of the remaining plan. Executed time points keep their times; the others
    /// cannot happen before `now`.
    fn remaining_network(
        &self,
        now: &Rational,
        reading: &dyn Fn(&Constraint) -> ConstraintRole,
    ) -> Result<PlanNetwork, Impossible> {
        let has_happened = |node: NodeId| self.execution_time(node).is_some();
        // The executor does not decide when a running action ends, so ends have no lower bound at
        // `now`.
        let waits = |what: Node| !matches!(what, Node::End(_));
        let plan = self
            .plan
            .remainder(now, |node| self.execution_time(node), waits);
        plan.uncertain_network(&|constraint| {
            if constraint.from == NodeId::ZERO && constraint.reason == elbowroom_plan::Reason::Given
            {
                // These include constraints of the plan itself; their bounds are kept as they are.
                let (lower, upper) = constant_bounds(constraint);
                return ConstraintRole::Requirement { lower, upper };
            }
            if has_happened(constraint.from) && has_happened(constraint.to) {
                return ConstraintRole::Requirement {
                    lower: None,
                    upper: None,
                };
            }
            reading(constraint)
        })
    }

    /// Returns the latest end of a running action with which the remaining plan has a schedule, on
    /// the world's clock. Contingent links may take any time within their reading. `None` if there
    /// is no limit, or no schedule. Takes time in proportion to the plan.
    pub(crate) fn latest_end(
        &self,
        id: InstanceId,
        now: &Rational,
        reading: &dyn Fn(&Constraint) -> ConstraintRole,
    ) -> Option<Rational> {
        self.latest_end_in_network(&self.possible_schedules(now, reading)?, id)
    }

    /// Returns the same for a network from [`Dispatch::possible_schedules`].
    pub(crate) fn latest_end_in_network(
        &self,
        network: &ConsistentNetwork,
        id: InstanceId,
    ) -> Option<Rational> {
        let origin = network_node(NodeId::ZERO);
        let end = network_node(self.ends[id.index()][1]);
        let latest = network.distance(origin, end)?;
        Some(self.to_world_time(&latest))
    }

    /// Returns the schedules of the remaining plan as a consistent network; `None` if there are
    /// none. Contingent links may take any time within their reading.
    pub(crate) fn possible_schedules(
        &self,
        now: &Rational,
        reading: &dyn Fn(&Constraint) -> ConstraintRole,
    ) -> Option<ConsistentNetwork> {
        let rest = self
            .remaining_network(&self.to_plan_time(now), reading)
            .ok()?
            .network;
        let mut network = rest.requirements().clone();
        for link in rest.links() {
            let (from, to) = (link.activation, link.end);
            network.add(elbowroom_stn::Constraint::at_least(
                from,
                to,
                link.lower.clone(),
            ));
            if let Some(upper) = &link.upper {
                network.add(elbowroom_stn::Constraint::at_most(from, to, upper.clone()));
            }
        }
        ConsistentNetwork::try_from(network).ok()
    }

    fn with_horizon(
        mission: &PreparedPlan,
        horizon: WindowPropagation,
        sources: Sources,
        bounds: &dyn Fn(&Constraint) -> Bounds,
    ) -> Self {
        let plan = mission.plan.plan.clone();
        let nominal = mission.plan.nominal();
        let ends = ends_of(&plan);
        let durations = durations(&plan, bounds);
        let progress = PlanProgress::new(&plan, &plan.constraints_at(&nominal));
        let timed = plan
            .nodes()
            .filter(|(_, what)| matches!(what, Node::Timed(_)));
        let mut timed: Vec<_> = timed
            .map(|(node, _)| (mission.nominal[node].clone(), node))
            .collect();
        timed.sort_by(|one, other| other.cmp(one));
        let mut dispatch = Self {
            task: Arc::clone(&mission.task),
            actions: plan.actions_at(&nominal),
            plan,
            nominal: mission.nominal.clone(),
            origin: mission.origin.clone(),
            epsilon: mission.task.epsilon().clone(),
            horizon,
            sources,
            ends,
            durations,
            progress,
            numbers_of_durations: decide::numeric_duration_bounds(mission),
            commanded_unstarted: BTreeMap::new(),
            timed,
            resumed: mission.running.keys().map(|step| step.instance()).collect(),
            retries: BTreeMap::new(),
            bound_violations: BoundViolations::default(),
            separation: None,
        };
        dispatch.begin(&mission.running);
        dispatch
    }

    /// Marks time 0 and the starts of the running actions as executed.
    fn begin(&mut self, running: &BTreeMap<StepId, crate::event::ActionHandle>) {
        if let WindowPropagation::Dispatchable(_) = self.horizon {
            // In other horizons, the origin is always executed.
            let _ = self
                .horizon
                .fix(network_node(NodeId::ZERO), &Rational::ZERO);
        }
        self.progress
            .record_execution(&self.plan, NodeId::ZERO, &Rational::ZERO);
        for step in running.keys() {
            let id = step.instance();
            let start = self.ends[id.index()][0];
            // The plan contains the remainder of a running action, which begins with the plan.
            let _ = self.horizon.fix(network_node(start), &Rational::ZERO);
            self.progress
                .record_execution(&self.plan, start, &Rational::ZERO);
            self.progress.ready.remove(&start);
            self.progress.running.insert(id);
        }
    }

    /// Executes the timed initials up to `now`, on the plan's clock.
    fn pass_time(&mut self, now: &Rational) {
        while let Some((time, node)) = self.timed.pop_if(|(time, _)| *time <= *now) {
            if let WindowPropagation::Dispatchable(_) = self.horizon {
                let _ = self.horizon.fix(network_node(node), &time);
            }
        }
    }

    /// Returns the plan.
    pub(crate) fn plan(&self) -> &StnPlan {
        &self.plan
    }

    /// Returns the action of an instance.
    pub(crate) fn action(&self, id: InstanceId) -> &Arc<Action> {
        &self.actions[id.index()]
    }

    /// Returns the planned duration of an instance.
    pub(crate) fn nominal_duration(&self, id: InstanceId) -> Rational {
        let [start, end] = self.ends[id.index()];
        &self.nominal[end] - &self.nominal[start]
    }

    /// Returns the start and the end node of an instance.
    pub(crate) fn start_and_end_nodes(&self, id: InstanceId) -> [NodeId; 2] {
        self.ends[id.index()]
    }

    /// Returns the name of the plan's own bounds on an instance's duration, for reasons.
    fn duration_subject(&self, id: InstanceId) -> Subject {
        if self.resumed.contains(&id) {
            Subject::RemainingDuration
        } else {
            Subject::Duration
        }
    }

    /// Returns the time at which a node was executed, on the plan's clock.
    pub(crate) fn execution_time(&self, node: NodeId) -> Option<&Rational> {
        self.progress.executed[node.index()].as_ref()
    }

    /// Instances that have started, or were commanded to, and have not ended.
    pub(crate) fn running(&self) -> &BTreeSet<InstanceId> {
        &self.progress.running
    }

    /// Returns the time at which a node happens if nothing deviates, on the plan's clock.
    pub(crate) fn nominal_time(&self, node: NodeId) -> &Rational {
        &self.nominal[node]
    }

    /// Returns the window of a node, on the world's clock.
    pub(crate) fn window_of(&self, node: NodeId) -> Bounds {
        let (earliest, latest) = self.horizon.window(network_node(node));
        let world = |time: Rational| self.to_world_time(&time);
        (earliest.map(world), latest.map(world))
    }

    /// Converts a time from the world's clock to the plan's clock.
    pub(crate) fn to_plan_time(&self, time: &Rational) -> Rational {
        time - &self.origin
    }

    /// Converts a time from the plan's clock to the world's clock.
    pub(crate) fn to_world_time(&self, time: &Rational) -> Rational {
        time + &self.origin
    }

    /// Returns the window of a step's start or end, on the world's clock.
    pub(crate) fn planned(&self, step: StepId, is_end: bool) -> Option<Planned> {
        let node = self.ends.get(step.instance().index())?[usize::from(is_end)];
        let (earliest, latest) = self.window_of(node);
        Some(Planned { earliest, latest })
    }
}

/// Returns the bounds on the duration of each instance.
fn durations(plan: &StnPlan, bounds: &dyn Fn(&Constraint) -> Bounds) -> Vec<Bounds> {
    let mut durations = vec![(None, None); plan.instances.len()];
    for constraint in &plan.constraints {
        if let Some(id) = plan.duration_of(constraint) {
            let known: &mut Bounds = &mut durations[id.index()];
            *known = intersection(std::mem::take(known), bounds(constraint));
        }
    }
    durations
}

fn bounds_of(reading: ConstraintRole) -> Bounds {
    match reading {
        ConstraintRole::Requirement { lower, upper } => (lower, upper),
        ConstraintRole::Contingent { lower, upper } => (Some(lower), upper),
        ConstraintRole::Impossible => (None, None),
    }
}

/// Returns the intersection of both.
fn intersection(one: Bounds, other: Bounds) -> Bounds {
    let lower = one.0.into_iter().chain(other.0).max();
    (lower, one.1.into_iter().chain(other.1).min())
}

fn ends_of(plan: &StnPlan) -> Vec<[NodeId; 2]> {
    let mut ends = vec![[NodeId::ZERO; 2]; plan.instances.len()];
    for (node, what) in plan.nodes() {
        match what {
            Node::Start(id) => ends[id.index()][0] = node,
            Node::End(id) => ends[id.index()][1] = node,
            Node::Instant(id) => ends[id.index()] = [node; 2],
            Node::Zero | Node::Timed(_) => {}
        }
    }
    ends
}

/// Returns the network of a plan and, for each of its constraints, the position of the plan's
/// constraint that it comes from.
fn network(
    plan: &StnPlan,
    bounds: &dyn Fn(&Constraint) -> Bounds,
) -> (Network, Vec<Option<usize>>) {
    let mut network = Network::with_nodes(plan.nodes.len());
    let mut sources = Vec::new();
    let zero = network_node(NodeId::ZERO);
    for (node, _) in plan.nodes().skip(1) {
        network.add(elbowroom_stn::Constraint::at_least(
            zero,
            network_node(node),
            Rational::ZERO,
        ));
        sources.push(None);
    }
    for (index, constraint) in plan.constraints.iter().enumerate() {
        let (from, to) = (network_node(constraint.from), network_node(constraint.to));
        let (lower, upper) = bounds(constraint);
        if let Some(lower) = lower {
            network.add(elbowroom_stn::Constraint::at_least(from, to, lower));
            sources.push(Some(index));
        }
        if let Some(upper) = upper {
            network.add(elbowroom_stn::Constraint::at_most(from, to, upper));
            sources.push(Some(index));
        }
    }
    (network, sources)
}

/// Returns the bounds of a constraint without parameters.
pub(crate) fn constant_bounds(constraint: &Constraint) -> Bounds {
    let value = |bound: &Bound| match bound {
        Bound::Finite(value) => Some(value.clone()),
        Bound::Infinite | Bound::Parameter(_) => None,
    };
    (value(&constraint.lower), value(&constraint.upper))
}

/// Returns `true` if the action is instantaneous.
pub(crate) fn is_instantaneous(action: &Action) -> bool {
    matches!(action.body, Body::Instantaneous(_))
}
