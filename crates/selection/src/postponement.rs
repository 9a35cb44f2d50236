//! Later starts of actions that change numbers which other actions need.
//!
//! Planners start each action as soon as possible. An action that lowers a number may then begin
//! while another one still needs this number, exactly so late that the number suffices until the
//! planned end of the other action. The smallest delay breaks that plan, although nothing requires
//! the early start.

use std::collections::BTreeSet;

use elbowroom_envelope::pipeline;
use elbowroom_model::ground::{Condition, FluentId};
use elbowroom_model::{Footprint, Step, Task, TimeTriggeredPlan};
use elbowroom_plan::deorder::{self, Deordered, without_sides};
use elbowroom_plan::{
    Constraint as StnConstraint, InstanceId, Node, NodeId, Reason, Schedule, StnPlan, Valuation,
    network_node,
};
use elbowroom_stn::{ConsistentNetwork, Constraint};

/// Maximum number of actions of a plan whose starts are postponed.
const MAX_ACTIONS: usize = 64;

/// Returns the plan with later starts of the actions that change numbers, if they can wait: each
/// begins when no action that needs these numbers is running any more. `None` if no start can be
/// postponed.
pub(super) fn postpone(task: &Task, plan: &TimeTriggeredPlan) -> Option<TimeTriggeredPlan> {
    if plan.steps.len() > MAX_ACTIONS {
        return None;
    }
    let deordered = deorder::deorder(task, plan).ok()?;
    let mut ids: Vec<_> = (0..plan.steps.len()).map(InstanceId::from).collect();
    ids.sort_by_key(|id| &deordered.nominal[deordered.plan.start(*id)]);
    let mut network = network_with_planned_durations(task, &deordered)?;
    let mut times = deordered.nominal.clone();
    let mut postponed = None;
    for id in ids {
        let Some((later, new_times)) = postponed_start(task, &deordered, (&network, &times), id)
        else {
            continue;
        };
        let found = with_times(plan, &deordered, &new_times);
        if pipeline::validate_plan(task, &found).is_valid() {
            (network, times) = (later, new_times);
            postponed = Some(found);
        }
    }
    postponed
}

/// Returns a network and a schedule with a later start of the action: no action is running then that
/// needs the numbers that it changes. `None` if that is so already, or if it cannot wait.
fn postponed_start(
    task: &Task,
    deordered: &Deordered,
    (network, times): (&ConsistentNetwork, &Schedule),
    id: InstanceId,
) -> Option<(ConsistentNetwork, Schedule)> {
    let (plan, start) = (&deordered.plan, deordered.plan.start(id));
    let changed = changed_fluents(task, plan, id);
    let others = (0..plan.instances.len()).map(InstanceId::from);
    let mut others: Vec<_> = others
        .filter(|other| *other != id && !changed.is_disjoint(&needed_fluents(task, plan, *other)))
        .collect();
    let mut postponed: Option<(ConsistentNetwork, Schedule)> = None;
    loop {
        let (network, times) = match &postponed {
            Some((network, times)) => (network, times),
            None => (network, times),
        };
        let overlaps = |other: &InstanceId| {
            let [begin, end] = [plan.start(*other), plan.end(*other)].map(|node| &times[node]);
            *begin <= times[start] && times[start] < *end
        };
        let overlapped: Vec<_> = others.extract_if(.., |other| overlaps(other)).collect();
        if overlapped.is_empty() {
            return postponed;
        }
        let mut later = network.clone();
        for other in overlapped {
            let [end, start] = [plan.end(other), start].map(network_node);
            let after = Constraint::at_least(end, start, task.epsilon().clone());
            later.add(after).ok()?;
        }
        let times = schedule(&later, deordered);
        postponed = Some((later, times));
    }
}

/// Returns the fluents that an action changes, unless it has begun already.
fn changed_fluents(task: &Task, plan: &StnPlan, id: InstanceId) -> BTreeSet<FluentId> {
    let body = plan.instance(id).action.durative();
    if body.is_some_and(|body| body.is_running) {
        return BTreeSet::new();
    }
    let nodes = [plan.start(id), plan.end(id)].map(|node| plan.footprint(task, node));
    let changed = nodes.into_iter().flat_map(|it| [it.shifts, it.assigns]);
    changed.flatten().collect()
}

/// Returns the fluents that an action needs throughout or at its end.
fn needed_fluents(task: &Task, plan: &StnPlan, id: InstanceId) -> BTreeSet<FluentId> {
    let Some(body) = plan.instance(id).action.durative() else {
        return BTreeSet::new();
    };
    let conditions = Condition::And(vec![body.over_all.clone(), body.end.condition.clone()]);
    Footprint::of_condition(task, &conditions).reads_fluents
}

/// Returns the network of the plan's orders, with the planned durations. It does not contain the
/// orders between actions that change numbers and over-all conditions, which the validator checks
/// instead.
fn network_with_planned_durations(task: &Task, deordered: &Deordered) -> Option<ConsistentNetwork> {
    let Deordered { plan, nominal, .. } = deordered;
    let (mut plan, _) = without_sides(plan.clone());
    let changes_numbers = |node: NodeId| match plan.nodes[node.index()] {
        Node::Start(id) | Node::End(id) => !changed_fluents(task, &plan, id).is_empty(),
        _ => false,
    };
    let is_kept = |constraint: &StnConstraint| {
        constraint.reason != Reason::OverAll
            || ![constraint.from, constraint.to]
                .into_iter()
                .any(changes_numbers)
    };
    let kept = plan
        .constraints
        .iter()
        .filter(|constraint| is_kept(constraint));
    plan.constraints = kept.cloned().collect();
    let mut network = plan.network(&Valuation::default());
    for index in 0..plan.instances.len() {
        let id = InstanceId::from(index);
        let [start, end] = [plan.start(id), plan.end(id)];
        let duration = &nominal[end] - &nominal[start];
        let [start, end] = [start, end].map(network_node);
        if start != end {
            network.add(Constraint::at_least(start, end, duration.clone()));
            network.add(Constraint::at_most(start, end, duration));
        }
    }
    ConsistentNetwork::try_from(network).ok()
}

/// Returns the earliest schedule whose actions start no sooner than planned, as far as possible.
fn schedule(network: &ConsistentNetwork, deordered: &Deordered) -> Schedule {
    let Deordered { plan, nominal, .. } = deordered;
    let origin = network_node(NodeId::ZERO);
    let mut network = network.clone();
    for index in 0..plan.instances.len() {
        let start = plan.start(InstanceId::from(index));
        let planned = Constraint::at_least(origin, network_node(start), nominal[start].clone());
        // A start that cannot wait is bound by a deadline.
        let _ = network.add(planned);
    }
    network.earliest_schedule(origin).into()
}

/// Returns the plan with the starts of a schedule. Its steps keep their positions.
fn with_times(
    plan: &TimeTriggeredPlan,
    deordered: &Deordered,
    times: &Schedule,
) -> TimeTriggeredPlan {
    let steps = plan.steps.iter().zip(&deordered.instances);
    let steps = steps.map(|(step, id)| Step {
        start: times[deordered.plan.start(*id)].clone(),
        ..step.clone()
    });
    TimeTriggeredPlan {
        steps: steps.collect(),
    }
}
