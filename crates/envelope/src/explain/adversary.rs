//! Simulated strategies of an adversarial world in a box that is not dynamically controllable.

use elbowroom_num::Rational;
use elbowroom_plan::uncertain::PlanNetwork;
use elbowroom_plan::{DecoupledEnvelope, InstanceId, Node, NodeId, network_node};
use elbowroom_stn::uncertain::Adversary;
use elbowroom_stn::{ConsistentNetwork, Constraint, IncrementalWindows, OutOfWindow};

use super::Explainer;

/// Maximum number of rounds of a play. Only a network without limits reaches it.
const MAX_ROUNDS: usize = 10_000;

/// Policy of an executor without foresight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Policy {
    /// Starts actions as early as the windows allow.
    Early,
    /// Starts actions as late as the windows allow.
    Late,
}

/// The result of a play of the executor against the world.
struct Play {
    /// The happenings so far, in order.
    happened: Vec<(Rational, NodeId)>,
    /// The violated window.
    violated: OutOfWindow,
    windows: IncrementalWindows,
}

impl Explainer<'_> {
    /// Describes the world's strategies against an executor that starts everything early, and
    /// against one that starts everything late. Empty if the network is dynamically controllable.
    pub(super) fn adversary_strategies(&self, refused: &DecoupledEnvelope) -> Vec<String> {
        let Ok(network) = self.plan.uncertain_network(refused) else {
            return Vec::new();
        };
        if network.network.is_dynamically_controllable() {
            return Vec::new();
        }
        [Policy::Early, Policy::Late]
            .into_iter()
            .filter_map(|policy| {
                let play = self.play(&network, policy)?;
                Some(self.describe_play(&network, policy, &play))
            })
            .collect()
    }

    fn play(&self, network: &PlanNetwork, policy: Policy) -> Option<Play> {
        let zero = network_node(NodeId::ZERO);
        let adversary = Adversary::new(network.network.clone(), zero);
        let mut all = network.network.requirements().clone();
        for link in network.network.links() {
            let (from, to) = (link.activation, link.end);
            all.add(Constraint::at_least(from, to, link.lower.clone()));
            if let Some(upper) = &link.upper {
                all.add(Constraint::at_most(from, to, upper.clone()));
            }
        }
        let mut windows = IncrementalWindows::new(ConsistentNetwork::try_from(all).ok()?, zero);
        let mut times: Vec<Option<Rational>> = vec![None; self.plan.plan.nodes.len()];
        times[0] = Some(Rational::ZERO);
        let mut happened = Vec::new();
        let mut now = Rational::ZERO;
        for _ in 0..MAX_ROUNDS {
            let mut next: Option<(Rational, NodeId)> = None;
            let ending = adversary.ends_now(&now, &times);
            let mut moved: Vec<NodeId> = ending
                .iter()
                .map(|link| NodeId(network.network.link(*link).end.0))
                .collect();
            if moved.is_empty() {
                for (node, _) in self.plan.plan.nodes().skip(1) {
                    if times[node.index()].is_some()
                        || network.network.is_contingent(network_node(node))
                        || !is_ready(network, &times, node)
                    {
                        continue;
                    }
                    let window = windows.window(network_node(node));
                    let time = match policy {
                        Policy::Early => window.earliest.clone(),
                        Policy::Late => window.latest.clone(),
                    };
                    // An action without a latest time starts at its earliest time.
                    let time = time.or_else(|| window.earliest.clone()).unwrap_or_default();
                    if next.as_ref().is_none_or(|(earliest, _)| time < *earliest) {
                        next = Some((time, node));
                    }
                }
                if let Some((_, node)) = next.as_ref().filter(|(time, _)| *time <= now) {
                    moved.push(*node);
                }
            }
            for node in &moved {
                times[node.index()] = Some(now.clone());
                happened.push((now.clone(), *node));
                if let Err(broken) = windows.fix(network_node(*node), &now) {
                    return Some(Play {
                        happened,
                        violated: broken,
                        windows,
                    });
                }
            }
            if !moved.is_empty() {
                continue;
            }
            let look = adversary.next_query_time(&now, &times);
            let next = next.map(|(time, _)| time);
            let later = look.into_iter().chain(next).min()?;
            now = later;
        }
        None
    }

    fn describe_play(&self, network: &PlanNetwork, policy: Policy, play: &Play) -> String {
        let begun = |id: InstanceId| {
            let is_start = |(_, node): &&(Rational, NodeId)| {
                self.plan.plan.nodes[node.index()] == Node::Start(id)
            };
            play.happened
                .iter()
                .find(is_start)
                .map(|(time, _)| time.clone())
        };
        let mut events = Vec::new();
        for (time, node) in &play.happened {
            match self.plan.plan.nodes[node.index()] {
                Node::Start(id) | Node::Instant(id) => {
                    events.push(format!(
                        "{} at {}",
                        self.action_name(id),
                        time.to_decimal(3)
                    ));
                }
                Node::End(id) if network.network.is_contingent(network_node(*node)) => {
                    let took = begun(id).map(|begun| (time - begun).to_decimal(3));
                    events.push(format!(
                        "{} takes {}",
                        self.action_name(id),
                        took.unwrap_or_default()
                    ));
                }
                Node::End(_) | Node::Zero | Node::Timed(_) => {}
            }
        }
        let how = match policy {
            Policy::Early => "early",
            Policy::Late => "late",
        };
        let node = NodeId(play.violated.node.0);
        let at = play
            .happened
            .last()
            .map(|(time, _)| time.to_decimal(3))
            .unwrap_or_default();
        let limit = play.windows.grounds(play.violated.node, play.violated.end);
        let mut behind: Vec<String> = limit
            .iter()
            .flat_map(|grounds| &grounds.constraints)
            .filter_map(|id| network.constraint_of(*id))
            .map(|index| self.constraint(index))
            .collect();
        behind.dedup();
        let behind = match behind.as_slice() {
            [] => String::new(),
            _ => format!(" ({})", behind.join(", ")),
        };
        format!(
            "started {how}: {}; then {} at {at} comes too {}{behind}",
            events.join(", "),
            self.plan.plan.describe_node(self.task, node),
            match play.violated.end {
                elbowroom_stn::WindowEnd::Earliest => "early",
                elbowroom_stn::WindowEnd::Latest => "late",
            },
        )
    }
}

/// Returns `true` if all nodes have happened that a requirement orders before `node`.
fn is_ready(network: &PlanNetwork, times: &[Option<Rational>], node: NodeId) -> bool {
    let requirements = network.network.requirements();
    let mut leaving = requirements.leaving(network_node(node));
    leaving.all(|id| {
        let constraint = requirements.constraint(id);
        constraint.bound.is_positive() || times[constraint.to.index()].is_some()
    })
}
