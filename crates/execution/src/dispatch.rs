//! Dispatching an STN plan: what all executors that go by a temporal network have in common.
//!
//! A time point is *ready* when everything that must come before it has been observed; it is
//! started as soon as its window opens (paper 1, Algorithm 2, lines 6 to 10). Time points that
//! have happened are fixed in the network, and with a whole [`Horizon`] that moves the windows of
//! all others, deadlines included. Work per event is in proportion to the windows that move.

mod explain;
mod news;
mod progress;
mod retry;
mod watch;

pub(crate) use watch::{in_words, replan, unmet};

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use elbowroom_model::Task;
use elbowroom_model::ground::{Action, Body};
use elbowroom_num::Rational;
use elbowroom_plan::{Bound, Constraint, InstanceId, Node, NodeId, StnPlan, network_node};
use elbowroom_stn::{ConsistentNetwork, Network};

use crate::executor::{Mission, Planned, StepId};
use crate::horizon::Horizon;
use crate::reason::{Cause, Reason};
use progress::Progress;
use retry::Retry;

/// Finite bounds of a constraint.
pub(crate) type Bounds = (Option<Rational>, Option<Rational>);

/// How far to look; see [`Horizon`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sight {
    Whole,
    OneHop,
}

/// A plan being dispatched.
#[derive(Clone, Debug)]
pub(crate) struct Dispatch {
    task: Arc<Task>,
    plan: StnPlan,
    /// The actions, with nominal values for what is left open.
    actions: Vec<Arc<Action>>,
    nominal: Vec<Rational>,
    /// What the world's clock reads when the plan's reads 0.
    origin: Rational,
    epsilon: Rational,
    horizon: Horizon,
    /// For each constraint of the network, the plan's constraint that it comes from.
    sources: Vec<Option<usize>>,
    /// For each instance its start and end; twice the same if it is instantaneous.
    ends: Vec<[NodeId; 2]>,
    /// For each instance, the bounds on its duration.
    durations: Vec<Bounds>,
    /// For each instance, the plan's constraints that bound its duration.
    bounding: Vec<Vec<usize>>,
    /// What the durations of some instances may be once they run.
    when_running: BTreeMap<InstanceId, Bounds>,
    progress: Progress,
    /// Instances that were under way before the plan began: of these it knows the rest.
    resumed: BTreeSet<InstanceId>,
    /// Starts that have failed and are to be tried again.
    retries: BTreeMap<NodeId, Retry>,
}

impl Dispatch {
    /// Takes up a plan. `bounds` says what a constraint of the plan is taken for.
    ///
    /// # Errors
    /// When no times satisfy these.
    pub(crate) fn new(
        mission: &Mission,
        sight: Sight,
        bounds: &dyn Fn(&Constraint) -> Bounds,
    ) -> Result<Self, Box<Reason>> {
        let plan = mission.plan.plan.clone();
        let at_nominal = plan.at(&mission.plan.nominal());
        let ends = ends_of(&plan);
        let (network, sources) = network(&plan, bounds);
        let mut durations = vec![(None, None); plan.instances.len()];
        let mut bounding = vec![Vec::new(); plan.instances.len()];
        for (index, constraint) in plan.constraints.iter().enumerate() {
            if let Some(id) = duration_of(&plan, constraint) {
                bounding[id.index()].push(index);
                let known: &mut Bounds = &mut durations[id.index()];
                *known = both(std::mem::take(known), bounds(constraint));
            }
        }
        let horizon = match sight {
            Sight::OneHop => Horizon::one_hop(network),
            Sight::Whole => match ConsistentNetwork::try_from(network) {
                Ok(network) => Horizon::whole(network),
                Err(cycle) => {
                    let ids = cycle.constraints.iter();
                    let behind = ids.filter_map(|id| sources.get(id.index()).copied().flatten());
                    let mut reason =
                        Reason::new(Cause::Late).about("no times satisfy the plan's constraints");
                    reason.behind = behind
                        .map(|index| explain::words(&mission.task, &plan, index))
                        .collect();
                    reason.by = Some(-cycle.total);
                    return Err(Box::new(reason));
                }
            },
        };
        let progress = Progress::new(&plan, &at_nominal.constraints);
        let mut dispatch = Self {
            task: Arc::clone(&mission.task),
            actions: at_nominal
                .instances
                .into_iter()
                .map(|instance| Arc::new(instance.action))
                .collect(),
            plan,
            nominal: mission.nominal.clone(),
            origin: mission.origin.clone(),
            epsilon: mission.epsilon.clone(),
            horizon,
            sources,
            ends,
            durations,
            bounding,
            when_running: BTreeMap::new(),
            progress,
            resumed: mission
                .running
                .keys()
                .map(|step| InstanceId(step.0))
                .collect(),
            retries: BTreeMap::new(),
        };
        dispatch.begin(&mission.running);
        Ok(dispatch)
    }

    /// Time 0 has happened, and so have the starts of what is running.
    fn begin(&mut self, running: &BTreeMap<StepId, crate::event::Ticket>) {
        self.progress
            .happen(&self.plan, NodeId::ZERO, &Rational::ZERO);
        for step in running.keys() {
            let id = InstanceId(step.0);
            let start = self.ends[id.index()][0];
            // The rest of a running action begins with the plan itself.
            let _ = self.horizon.fix(network_node(start), &Rational::ZERO);
            self.progress.happen(&self.plan, start, &Rational::ZERO);
            self.progress.ready.remove(&start);
            self.progress.running.insert(id);
        }
    }

    /// The plan.
    pub(crate) fn plan(&self) -> &StnPlan {
        &self.plan
    }

    /// What is done in an instance.
    pub(crate) fn action(&self, id: InstanceId) -> &Arc<Action> {
        &self.actions[id.index()]
    }

    /// How long an instance is planned to take.
    pub(crate) fn nominal_duration(&self, id: InstanceId) -> Rational {
        let [start, end] = self.ends[id.index()];
        &self.nominal[end.index()] - &self.nominal[start.index()]
    }

    /// Start and end of an instance.
    pub(crate) fn nodes_of(&self, id: InstanceId) -> [NodeId; 2] {
        self.ends[id.index()]
    }

    /// What the plan's own bounds on an instance's duration are about.
    fn duration_in_words(&self, id: InstanceId) -> &'static str {
        if self.resumed.contains(&id) {
            "what was left of its duration"
        } else {
            "duration"
        }
    }

    /// When a node happened, on the plan's clock.
    pub(crate) fn happened(&self, node: NodeId) -> Option<&Rational> {
        self.progress.happened[node.index()].as_ref()
    }

    /// What has started, or was told to, and has not ended.
    pub(crate) fn running(&self) -> &BTreeSet<InstanceId> {
        &self.progress.running
    }

    /// When a node happens if nothing deviates, on the plan's clock.
    pub(crate) fn nominal_time(&self, node: NodeId) -> &Rational {
        &self.nominal[node.index()]
    }

    /// The window of a node, by the world's clock.
    pub(crate) fn window_of(&self, node: NodeId) -> Bounds {
        let (earliest, latest) = self.horizon.window(network_node(node));
        let world = |time: Rational| self.world(&time);
        (earliest.map(world), latest.map(world))
    }

    /// The time by the plan's clock.
    pub(crate) fn local(&self, time: &Rational) -> Rational {
        time - &self.origin
    }

    /// The time by the world's clock.
    pub(crate) fn world(&self, time: &Rational) -> Rational {
        time + &self.origin
    }

    /// The window of a step's start or end, by the world's clock.
    pub(crate) fn planned(&self, step: StepId, is_end: bool) -> Option<Planned> {
        let node = self.ends.get(step.0 as usize)?[usize::from(is_end)];
        let (earliest, latest) = self.window_of(node);
        Some(Planned { earliest, latest })
    }

    /// Once an instance runs, its duration is what the plan leaves open of it and may be anything
    /// within these bounds.
    pub(crate) fn leave_open_when_running(&mut self, id: InstanceId, bounds: Bounds) {
        self.when_running.insert(id, bounds);
    }

    /// An instance runs: see [`Dispatch::leave_open_when_running`].
    fn leave_open(&mut self, id: InstanceId) {
        let Some((lower, upper)) = self.when_running.remove(&id) else {
            return;
        };
        let mut duration = (lower.clone(), upper.clone());
        for index in &self.bounding[id.index()] {
            let constraint = &self.plan.constraints[*index];
            if !is_open(constraint) {
                duration = both(duration, given(constraint));
            }
        }
        self.durations[id.index()] = duration;
        for (id, is_upper) in self.open_bounds(id) {
            let bound = if is_upper {
                upper.clone()
            } else {
                lower.as_ref().map(|lower| -lower)
            };
            self.horizon.loosen(id, bound);
        }
    }

    /// The network's constraints that come from what the plan leaves open of a duration, and
    /// whether each is its upper bound.
    fn open_bounds(&self, id: InstanceId) -> Vec<(elbowroom_stn::ConstraintId, bool)> {
        let [start, _] = self.ends[id.index()];
        let start = network_node(start);
        let network = self.horizon.network();
        let at_start = network.leaving(start).map(|id| (id, true));
        let at_start = at_start.chain(network.entering(start).map(|id| (id, false)));
        let is_own = |(own, _): &(elbowroom_stn::ConstraintId, bool)| {
            let index = self.sources.get(own.index()).copied().flatten();
            index.is_some_and(|index| {
                let is_own = self.bounding[id.index()].contains(&index);
                is_own && is_open(&self.plan.constraints[index])
            })
        };
        at_start.filter(is_own).collect()
    }

    /// Goes by other bounds from now on; what has happened stays.
    ///
    /// # Errors
    /// When no times satisfy these: the plan's constraints that contradict each other, in words.
    pub(crate) fn rebound(
        &mut self,
        bounds: &dyn Fn(&Constraint) -> Bounds,
    ) -> Result<(), Vec<String>> {
        let (mut network, sources) = network(&self.plan, bounds);
        let zero = network_node(NodeId::ZERO);
        for (node, _) in self.plan.nodes().skip(1) {
            if let Some(time) = self.happened(node) {
                let node = network_node(node);
                network.add(elbowroom_stn::Constraint::at_least(
                    zero,
                    node,
                    time.clone(),
                ));
                network.add(elbowroom_stn::Constraint::at_most(zero, node, time.clone()));
            }
        }
        self.sources = sources;
        match ConsistentNetwork::try_from(network) {
            Ok(network) => {
                self.horizon = Horizon::whole(network);
                Ok(())
            }
            Err(cycle) => {
                let ids = cycle.constraints.iter();
                let behind = ids.filter_map(|id| self.sources.get(id.index()).copied().flatten());
                Err(behind
                    .map(|index| explain::words(&self.task, &self.plan, index))
                    .collect())
            }
        }
    }
}

/// What holds if both do.
fn both(one: Bounds, other: Bounds) -> Bounds {
    let lower = one.0.into_iter().chain(other.0).max();
    (lower, one.1.into_iter().chain(other.1).min())
}

/// Whether a constraint says nothing but what a parameter is.
fn is_open(constraint: &Constraint) -> bool {
    matches!(
        (&constraint.lower, &constraint.upper),
        (Bound::Parameter(lower), Bound::Parameter(upper)) if lower == upper
    )
}

/// The instance whose duration a constraint bounds.
pub(crate) fn duration_of(plan: &StnPlan, constraint: &Constraint) -> Option<InstanceId> {
    let node = |id: NodeId| plan.nodes[id.index()];
    match (node(constraint.from), node(constraint.to)) {
        (Node::Start(start), Node::End(end)) if start == end => Some(start),
        _ => None,
    }
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

/// The plan's network, and where each of its constraints comes from.
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

/// The bounds of a constraint without parameters.
pub(crate) fn given(constraint: &Constraint) -> Bounds {
    let value = |bound: &Bound| match bound {
        Bound::Finite(value) => Some(value.clone()),
        Bound::Infinite | Bound::Parameter(_) => None,
    };
    (value(&constraint.lower), value(&constraint.upper))
}

/// Whether an action takes no time.
pub(crate) fn is_instantaneous(action: &Action) -> bool {
    matches!(action.body, Body::Instantaneous(_))
}
