//! Adversarial world: it chooses the worst durations within a box.

use std::collections::BTreeMap;

use elbowroom_execution::ActionHandle;
use elbowroom_execution::run::TimeoutRule;
use elbowroom_num::Rational;
use elbowroom_plan::uncertain::PlanNetwork;
use elbowroom_plan::{InstanceId, Node, NodeId, Schedule, StnPlan, network_node};
use elbowroom_sim::{DurationController, StartedAction};
use elbowroom_stn::NodeId as NetworkNode;
use elbowroom_stn::uncertain::{Adversary, UncertainNetwork};

/// An [`Adversary`] behind the port of [`elbowroom_sim`]. It observes starts, and decides when
/// actions end.
///
/// Actions outside the plan, and durations that the box does not leave open, are as planned. Every
/// action ends by its time-out. If time-outs are off, an action with an infinite interval ends
/// after a long but finite time.
#[derive(Clone, Debug)]
pub struct AdversarialWorld {
    adversary: Adversary,
    plan: StnPlan,
    /// For each action's name, its instances, by start time without deviations.
    instances: BTreeMap<String, Vec<InstanceId>>,
    /// The time of each node that has happened.
    happened: Vec<Option<Rational>>,
    /// Timed initials, with their times.
    timed: Vec<(NodeId, Rational)>,
    /// The running actions.
    running: BTreeMap<ActionHandle, InstanceId>,
    /// End times of the actions that the adversary does not control.
    ends: BTreeMap<ActionHandle, Rational>,
}

impl AdversarialWorld {
    /// Creates an adversary of a plan with this network with uncertainty
    /// ([`ParametrizedPlan::uncertain_network`](elbowroom_plan::ParametrizedPlan::uncertain_network)).
    /// `nominal` is the schedule without deviations, `timeout` the latest end of each action.
    pub fn new(
        plan: &StnPlan,
        network: &PlanNetwork,
        nominal: &Schedule,
        timeout: &TimeoutRule,
    ) -> Self {
        let time = |node: NodeId| &nominal[node];
        let mut order: Vec<InstanceId> = (0..plan.instances.len()).map(InstanceId::from).collect();
        order.sort_by_key(|id| (time(plan.start(*id)), *id));
        let mut instances: BTreeMap<String, Vec<InstanceId>> = BTreeMap::new();
        for id in order {
            let name = plan.instance(id).action.name.clone();
            instances.entry(name).or_default().push(id);
        }
        let timed = plan
            .nodes()
            .filter(|(_, what)| matches!(what, Node::Timed(_)));
        let all = (0..plan.instances.len()).map(InstanceId::from);
        let latest = all.filter_map(|id| {
            let planned = time(plan.end(id)) - time(plan.start(id));
            let action = &plan.instance(id).action.name;
            Some((network_node(plan.end(id)), timeout.of(action, &planned)?))
        });
        let latest = latest.collect();
        let mut happened = vec![None; plan.nodes.len()];
        happened[NodeId::ZERO.index()] = Some(Rational::ZERO);
        Self {
            adversary: Adversary::new(
                with_finite_links(&network.network, &latest),
                network_node(NodeId::ZERO),
            ),
            timed: timed.map(|(node, _)| (node, time(node).clone())).collect(),
            plan: plan.clone(),
            instances,
            happened,
            running: BTreeMap::new(),
            ends: BTreeMap::new(),
        }
    }

    fn instance(&self, begun: &StartedAction<'_>) -> Option<InstanceId> {
        let place = usize::try_from(begun.occurrence).ok()?;
        self.instances.get(&begun.action.name)?.get(place).copied()
    }

    fn end_of(&self, instance: InstanceId) -> NodeId {
        self.plan.end(instance)
    }
}

/// Returns the network with finite contingent links. An unbounded link gets an upper bound longer
/// than all other bounds together, which is sufficient for every conflict. The ends in `latest` are
/// also bounded by it.
fn with_finite_links(
    network: &UncertainNetwork,
    latest: &BTreeMap<NetworkNode, Rational>,
) -> UncertainNetwork {
    let mut longest = Rational::ONE;
    for constraint in network.requirements().constraints() {
        longest = &longest + &constraint.bound.abs();
    }
    for link in network.links() {
        longest = &longest + &link.lower;
        longest = link.upper.iter().fold(longest, |sum, upper| &sum + upper);
    }
    let mut links = network.links().to_vec();
    for link in &mut links {
        let upper = link.upper.get_or_insert_with(|| longest.clone());
        if let Some(latest) = latest.get(&link.end) {
            let latest = latest.max(&link.lower);
            if *upper > *latest {
                upper.clone_from(latest);
            }
        }
    }
    UncertainNetwork::new(network.requirements().clone(), links)
        .expect("the links are those of a network, and none has become empty")
}

impl DurationController for AdversarialWorld {
    fn on_start(&mut self, now: &Rational, begun: &StartedAction<'_>) {
        let instance = self.instance(begun);
        if let Some(instance) = instance {
            let start = self.plan.start(instance);
            self.happened[start.index()] = Some(now.clone());
            self.running.insert(begun.ticket, instance);
        }
        let is_spoiled = instance.is_some_and(|instance| {
            let end = network_node(self.end_of(instance));
            self.adversary.network().is_contingent(end)
        });
        if let Some(planned) = begun.planned.filter(|_| begun.is_open && !is_spoiled) {
            self.ends.insert(begun.ticket, now + planned);
        }
    }

    fn on_end(&mut self, now: &Rational, ticket: ActionHandle) {
        self.ends.remove(&ticket);
        if let Some(instance) = self.running.remove(&ticket) {
            let end = self.end_of(instance);
            self.happened[end.index()] = Some(now.clone());
        }
    }

    fn due_ends(&mut self, now: &Rational) -> Vec<ActionHandle> {
        self.timed.retain(|(node, time)| {
            let is_past = time <= now;
            if is_past {
                self.happened[node.index()] = Some(time.clone());
            }
            !is_past
        });
        let due = self.ends.iter().filter(|(_, end)| *end <= now);
        let mut ending: Vec<ActionHandle> = due.map(|(ticket, _)| *ticket).collect();
        for ticket in &ending {
            self.ends.remove(ticket);
        }
        if self.running.is_empty() {
            return ending;
        }
        let links = self.adversary.ends_now(now, &self.happened);
        for (ticket, instance) in &self.running {
            let end = network_node(self.end_of(*instance));
            let link = self.adversary.network().ending_at(end);
            if link.is_some_and(|link| links.contains(&link)) {
                ending.push(*ticket);
            }
        }
        ending
    }

    fn next_check(&self, now: &Rational) -> Option<Rational> {
        let timed = self.timed.iter().map(|(_, time)| time.clone());
        let ends = self.ends.values().cloned();
        let look = self.adversary.next_query_time(now, &self.happened);
        timed
            .chain(ends)
            .chain(look)
            .filter(|time| time > now)
            .min()
    }
}
