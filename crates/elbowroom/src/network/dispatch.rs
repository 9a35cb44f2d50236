//! One execution of a network whose links take so long.

use std::sync::Arc;

use elbowroom_num::Rational;
use elbowroom_stn::uncertain::{Dispatchable, Dispatcher, LinkId, UncertainNetwork};
use elbowroom_stn::{Minimal, NodeId, Schedule};

/// The dispatcher of the controllable time points.
pub(super) enum Executor {
    /// By the dispatchable network, as early as it allows.
    Dispatchable(Arc<Dispatchable<Rational>>),
    /// As early as the windows allow, as if the ends of links could be chosen. It promises nothing.
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

/// The time of each event; `None` if the executor waits for ever.
pub(super) fn run(
    network: &UncertainNetwork<Rational>,
    executor: &Executor,
    durations: &[Rational],
) -> Option<Schedule<Rational>> {
    let decider = match executor {
        Executor::Dispatchable(form) => {
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
        // What falls together is observed before it is decided upon.
        let (node, time) = match (world, chosen) {
            (Some(world), Some(chosen)) if world.1 <= chosen.1 => world,
            (_, Some(chosen)) => chosen,
            (Some(world), None) => world,
            (None, None) => return None,
        };
        run.happen(node, time);
    }
    let times: Option<Vec<Rational>> = run.happened.into_iter().collect();
    times.map(Schedule::new)
}

impl Run<'_> {
    fn happen(&mut self, node: NodeId, time: Rational) {
        if let Decider::Dispatcher(dispatcher) = &mut self.decider {
            // A duration outside the bounds of its link may miss a window; the requirements are
            // looked at in the end.
            let _ = dispatcher.happen(node, &time);
        }
        self.now.clone_from(&time);
        self.happened[node.index()] = Some(time);
    }

    /// The end of a link that comes next.
    fn next_end(&self) -> Option<(NodeId, Rational)> {
        let ends = self.network.link_ids().filter_map(|id: LinkId| {
            let link = self.network.link(id);
            let begun = self.happened[link.activation.index()].as_ref()?;
            let is_running = self.happened[link.end.index()].is_none();
            is_running.then(|| (link.end, begun + &self.durations[id.index()]))
        });
        ends.min_by(|(_, one), (_, other)| one.cmp(other))
    }

    /// The point that the executor chooses next, if nothing happens before.
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

    /// Whether the executor chooses a point that has not happened, and all that must come before it
    /// have.
    fn is_enabled(&self, minimal: &Minimal<Rational>, node: NodeId) -> bool {
        if self.network.is_contingent(node) || self.happened[node.index()].is_some() {
            return false;
        }
        self.network.requirements().nodes().all(|other| {
            let must_follow = minimal
                .distance(node, other)
                .is_some_and(|most| !most.is_positive());
            // Points that fall together wait for none of each other, but all for the world.
            let is_mutual = minimal
                .distance(other, node)
                .is_some_and(|most| !most.is_positive());
            other == node
                || !must_follow
                || (is_mutual && !self.network.is_contingent(other))
                || self.happened[other.index()].is_some()
        })
    }

    /// The time at which a point's window opens, as far as what has happened says.
    fn opens(&self, minimal: &Minimal<Rational>, node: NodeId) -> Option<Rational> {
        let happened = self.network.requirements().nodes().filter_map(|other| {
            let time = self.happened[other.index()].as_ref()?;
            Some(time - minimal.distance(node, other)?)
        });
        happened.max()
    }
}

/// The earliest of them; those without a time may happen now.
fn first(
    times: impl Iterator<Item = (NodeId, Option<Rational>)>,
    now: &Rational,
) -> Option<(NodeId, Rational)> {
    let times = times.map(|(node, time)| (node, time.unwrap_or_else(|| now.clone())));
    times.min_by(|(one, a), (other, b)| a.cmp(b).then(one.cmp(other)))
}
