//! Execution of a network with given durations of its links.

use std::sync::Arc;

use elbowroom_num::Rational;
use elbowroom_stn::uncertain::{Dispatchable, Dispatcher, LinkId, UncertainNetwork};
use elbowroom_stn::{Minimal, NodeId, Schedule};

/// The dispatcher of the controllable time points.
pub(super) enum Executor {
    /// Follows the dispatchable network, as early as it allows.
    Dispatchable(Arc<Dispatchable<Rational>>),
    /// Follows the dispatchable network for the durations of a box, as early as it allows, also
    /// when a duration lies outside the box.
    BestBox(Arc<Dispatchable<Rational>>),
    /// Follows the windows, as early as they allow, as if the executor could choose the ends of
    /// links. It has no guarantee.
    EarlyFirst(Minimal<Rational>),
}

/// The state of a dispatcher during one simulated execution.
enum Decider<'a> {
    Dispatcher(Box<Dispatcher<Rational>>),
    Windows(&'a Minimal<Rational>),
}

/// A run.
struct Run<'a> {
    network: &'a UncertainNetwork<Rational>,
    decider: Decider<'a>,
    durations: &'a [Rational],
    happened: Vec<Option<Rational>>,
    now: Rational,
}

/// Returns the time of each event; `None` if the executor waits for ever.
pub(super) fn run(
    network: &UncertainNetwork<Rational>,
    executor: &Executor,
    durations: &[Rational],
) -> Option<Schedule<Rational>> {
    let decider = match executor {
        Executor::Dispatchable(form) | Executor::BestBox(form) => {
            Decider::Dispatcher(Box::new(Dispatcher::new(Arc::clone(form))))
        }
        Executor::EarlyFirst(minimal) => Decider::Windows(minimal),
    };
    let mut run = Run {
        network,
        decider,
        durations,
        happened: vec![None; network.requirements().node_count()],
        now: Rational::ZERO,
    };
    while run.happened.contains(&None) {
        let world = run.next_end();
        let chosen = run.next_chosen();
        // At equal times, observations come before decisions.
        let (node, time) = match (world, chosen) {
            (Some(world), Some(chosen)) if world.1 <= chosen.1 => world,
            (_, Some(chosen)) => chosen,
            (Some(world), None) => world,
            (None, None) => return None,
        };
        run.record_happening(node, time);
    }
    let times: Option<Vec<Rational>> = run.happened.into_iter().collect();
    times.map(Schedule::new)
}

impl Run<'_> {
    fn record_happening(&mut self, node: NodeId, time: Rational) {
        if let Decider::Dispatcher(dispatcher) = &mut self.decider {
            // A duration outside the bounds of its link may miss a window; the requirements are
            // checked at the end.
            let _ = dispatcher.record(node, &time);
        }
        self.now.clone_from(&time);
        self.happened[node.index()] = Some(time);
    }

    /// Returns the next end of a link.
    fn next_end(&self) -> Option<(NodeId, Rational)> {
        let ends = self.network.link_ids().filter_map(|id: LinkId| {
            let link = self.network.link(id);
            let begun = self.happened[link.activation.index()].as_ref()?;
            let is_running = self.happened[link.end.index()].is_none();
            is_running.then(|| (link.end, begun + &self.durations[id.index()]))
        });
        ends.min_by(|(_, one), (_, other)| one.cmp(other))
    }

    /// Returns the point that the executor chooses next, if nothing happens before.
    fn next_chosen(&self) -> Option<(NodeId, Rational)> {
        let next = match &self.decider {
            Decider::Dispatcher(dispatcher) => {
                let times = dispatcher.ready().filter_map(|node| {
                    let earliest = dispatcher.earliest(node).ok()?;
                    Some((node, earliest.cloned()))
                });
                first(times, &self.now)
            }
            Decider::Windows(minimal) => {
                let requirements = self.network.requirements();
                let times = requirements
                    .nodes()
                    .filter(|&node| self.is_enabled(minimal, node))
                    .map(|node| (node, self.opens(minimal, node)));
                first(times, &self.now)
            }
        };
        next.map(|(node, time)| (node, time.max(self.now.clone())))
    }

    /// Returns `true` if the executor chooses this point, it has not happened, and all points
    /// before it have.
    fn is_enabled(&self, minimal: &Minimal<Rational>, node: NodeId) -> bool {
        if self.network.is_contingent(node) || self.happened[node.index()].is_some() {
            return false;
        }
        self.network.requirements().nodes().all(|other| {
            let must_follow = minimal
                .distance(node, other)
                .is_some_and(|most| !most.is_positive());
            // Simultaneous points do not wait for each other, except for points that the world
            // chooses.
            let is_mutual = minimal
                .distance(other, node)
                .is_some_and(|most| !most.is_positive());
            other == node
                || !must_follow
                || (is_mutual && !self.network.is_contingent(other))
                || self.happened[other.index()].is_some()
        })
    }

    /// Returns the opening time of a point's window, given the points that have happened.
    fn opens(&self, minimal: &Minimal<Rational>, node: NodeId) -> Option<Rational> {
        let happened = self.network.requirements().nodes().filter_map(|other| {
            let time = self.happened[other.index()].as_ref()?;
            Some(time - minimal.distance(node, other)?)
        });
        happened.max()
    }
}

/// Returns the earliest of them; those without a time may happen now.
fn first(
    times: impl Iterator<Item = (NodeId, Option<Rational>)>,
    now: &Rational,
) -> Option<(NodeId, Rational)> {
    let times = times.map(|(node, time)| (node, time.unwrap_or_else(|| now.clone())));
    times.min_by(|(one, a), (other, b)| a.cmp(b).then(one.cmp(other)))
}
