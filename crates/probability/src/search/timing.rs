//! Time windows of the happenings of an order, by its simple temporal network.

use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, Node, NodeId};
use elbowroom_stn::{ConsistentNetwork, Constraint};

use super::separations::Separations;
use crate::model::Model;
use crate::search_state::SearchState;

/// The whole network of an order, happening by happening.
///
/// The search itself needs less, and uses a faster method ([`super::time_slack::TimeSlacks`]).
#[derive(Clone, Debug)]
pub(super) struct Timing<'s> {
    separations: &'s Separations,
    network: ConsistentNetwork,
    zero: elbowroom_stn::NodeId,
    /// The last happening, or the present time.
    last: elbowroom_stn::NodeId,
    placed: Vec<(NodeId, elbowroom_stn::NodeId)>,
    /// Number of these in the past.
    past: usize,
    /// Ends of the running actions.
    pending: Vec<(InstanceId, elbowroom_stn::NodeId)>,
}

impl<'s> Timing<'s> {
    /// Creates the network without happenings; `None` if the running actions leave no schedule.
    pub(super) fn new(separations: &'s Separations, circumstances: &SearchState) -> Option<Self> {
        let mut network = ConsistentNetwork::new();
        let zero = network.add_node();
        let now = network.add_node();
        let mut timing = Self {
            separations,
            network,
            zero,
            last: now,
            placed: Vec::new(),
            past: circumstances.recent.len(),
            pending: Vec::new(),
        };
        timing.fix(now, &circumstances.now)?;
        for (node, time) in &circumstances.recent {
            let own = timing.network.add_node();
            timing.fix(own, time)?;
            timing.placed.push((*node, own));
        }
        for running in &circumstances.running {
            let end = timing.network.add_node();
            let (earliest, latest) = separations.end_of(running, &circumstances.now);
            timing.demand(Constraint::at_least(zero, end, earliest))?;
            if let Some(latest) = latest {
                timing.demand(Constraint::at_most(zero, end, latest))?;
            }
            timing.pending.push((running.instance, end));
        }
        Some(timing)
    }

    fn demand(&mut self, constraint: Constraint) -> Option<()> {
        self.network.add(constraint).ok().map(|_| ())
    }

    fn fix(&mut self, node: elbowroom_stn::NodeId, time: &Rational) -> Option<()> {
        self.demand(Constraint::at_least(self.zero, node, time.clone()))?;
        self.demand(Constraint::at_most(self.zero, node, time.clone()))
    }

    /// Adds a happening. `next_timed` is the number of timed initials before it. Returns `None` if
    /// there is no schedule. With `is_joined`, it comes at the same moment as the last one, or now.
    pub(super) fn push(
        &mut self,
        model: &Model,
        (node, is_joined): (NodeId, bool),
        next_timed: usize,
    ) -> Option<()> {
        let what = model.plan().nodes[node.index()];
        let own = match what {
            Node::End(id) => {
                let place = self
                    .pending
                    .iter()
                    .position(|(pending, _)| *pending == id)?;
                self.pending.remove(place).1
            }
            _ => self.network.add_node(),
        };
        self.demand(Constraint::at_least(self.last, own, Rational::ZERO))?;
        if is_joined {
            self.demand(Constraint::at_most(self.last, own, Rational::ZERO))?;
        }
        let separations = self.separations;
        // Happenings before the last one that must be apart are earlier, so they need no
        // constraint.
        let mut placed = self.placed.iter().rev();
        let last_apart = placed.find(|(other, _)| separations.must_be_separated(*other, node));
        if let Some(&(_, before)) = last_apart {
            let epsilon = separations.epsilon.clone();
            self.demand(Constraint::at_least(before, own, epsilon))?;
        }
        if matches!(what, Node::Timed(_)) {
            let time = separations.time_of_next(node, next_timed)?;
            self.fix(own, time)?;
        } else if let Some(latest) = separations.latest_before_timed(node, next_timed) {
            self.demand(Constraint::at_most(self.zero, own, latest))?;
        }
        if let Node::Start(id) = what {
            let end = self.network.add_node();
            let (least, greatest) = &separations.durations[id.index()];
            self.demand(Constraint::at_least(own, end, least.clone()))?;
            if let Some(greatest) = greatest {
                self.demand(Constraint::at_most(own, end, greatest.clone()))?;
            }
            self.pending.push((id, end));
        }
        for place in 0..self.pending.len() {
            let end = self.pending[place].1;
            self.demand(Constraint::at_least(own, end, Rational::ZERO))?;
        }
        self.placed.push((node, own));
        self.last = own;
        Some(())
    }

    /// Returns the time window of each happening of the order.
    pub(super) fn windows(&self) -> Vec<(NodeId, Rational, Option<Rational>)> {
        let windows = self.network.windows(self.zero);
        let window = |(node, own): &(NodeId, elbowroom_stn::NodeId)| {
            let window = &windows[*own];
            let earliest = window.earliest.clone().unwrap_or_default();
            (*node, earliest, window.latest.clone())
        };
        self.placed[self.past..].iter().map(window).collect()
    }
}
