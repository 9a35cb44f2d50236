//! Whether there is time for an order: its simple temporal network, happening by happening.

use elbowroom_model::Footprint;
use elbowroom_model::ground::Body;
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, LinkKind, Node, NodeId};
use elbowroom_stn::{Checkpoint, ConsistentNetwork, Constraint};

use crate::circumstances::Circumstances;
use crate::model::Model;

/// What the temporal constraints of a plan are, once for all searches.
#[derive(Clone, Debug)]
pub(crate) struct Separations {
    epsilon: Rational,
    /// Whether two nodes must be `epsilon` apart; symmetric.
    apart: Vec<Vec<bool>>,
    /// For each node, those that may not come after it.
    never_after: Vec<Vec<NodeId>>,
    /// The timed initials that matter, in order of time.
    pub(crate) timed: Vec<(NodeId, Rational)>,
    /// By instance.
    durations: Vec<(Rational, Option<Rational>)>,
    pub(crate) starts: Vec<NodeId>,
    pub(crate) ends: Vec<NodeId>,
}

impl Separations {
    pub(crate) fn of(model: &Model, epsilon: &Rational, keeps_interference: bool) -> Self {
        let (task, plan) = (model.task(), model.plan());
        let footprint = |node: Node| match node {
            Node::Zero => Footprint::default(),
            Node::Start(id) | Node::Instant(id) => {
                Footprint::of_start(task, &plan.instance(id).action)
            }
            Node::End(id) => Footprint::of_end(task, &plan.instance(id).action),
            Node::Timed(index) => Footprint::of_timed(&task.timed()[index]),
        };
        let footprints: Vec<Footprint> = plan.nodes.iter().map(|&node| footprint(node)).collect();
        let mut apart: Vec<Vec<bool>> = footprints
            .iter()
            .map(|one| {
                footprints
                    .iter()
                    .map(|two| one.interferes_with(two))
                    .collect()
            })
            .collect();
        let mut never_after = vec![Vec::new(); plan.nodes.len()];
        for link in plan.links.iter().filter(|_| keeps_interference) {
            if link.kind == LinkKind::Interference {
                apart[link.from.index()][link.to.index()] = true;
                apart[link.to.index()][link.from.index()] = true;
                never_after[link.to.index()].push(link.from);
            }
        }
        let mut read: Vec<Footprint> = vec![Footprint::of_condition(task, task.goal())];
        for (_, instance) in plan.instances() {
            if let Body::Durative(body) = &instance.action.body {
                read.push(Footprint::of_condition(task, &body.over_all));
                for effect in &body.end.effects {
                    read.push(Footprint::of_condition(task, &effect.guard.over_all));
                }
            }
        }
        let is_action = |node: &Node| !matches!(node, Node::Timed(_) | Node::Zero);
        let matters = |at: usize| {
            let own = &footprints[at];
            let actions = plan.nodes.iter().zip(&footprints);
            read.iter().any(|reader| own.writes_what_is_read_by(reader))
                || actions
                    .filter(|(node, _)| is_action(node))
                    .any(|(_, other)| own.interferes_with(other))
        };
        let timed = plan
            .nodes
            .iter()
            .enumerate()
            .filter_map(|(at, node)| match node {
                Node::Timed(index) if matters(at) => {
                    Some((NodeId::from(at), task.timed()[*index].time.clone()))
                }
                _ => None,
            });
        let ids = || plan.instances().map(|(id, _)| id);
        Self {
            epsilon: epsilon.clone(),
            apart,
            never_after,
            timed: timed.collect(),
            durations: ids().map(|id| plan.duration(id)).collect(),
            starts: ids().map(|id| model.start(id)).collect(),
            ends: ids().map(|id| model.end(id)).collect(),
        }
    }

    /// Whether the clock matters, and not only time differences.
    pub(crate) fn has_deadlines(&self, now: &Rational) -> bool {
        self.timed.iter().any(|(_, time)| time > now)
    }

    /// Whether `node` may come after all of these.
    pub(crate) fn may_follow(&self, node: NodeId, is_placed: &dyn Fn(NodeId) -> bool) -> bool {
        // `never_after[placed]` holds `node`; the lists are short.
        !self
            .never_after
            .iter()
            .enumerate()
            .any(|(at, before)| before.contains(&node) && is_placed(NodeId::from(at)))
    }
}

/// The network of the order so far.
#[derive(Clone, Debug)]
pub(crate) struct Timing<'s> {
    separations: &'s Separations,
    network: ConsistentNetwork,
    zero: elbowroom_stn::NodeId,
    /// The last happening, or now.
    last: elbowroom_stn::NodeId,
    placed: Vec<(NodeId, elbowroom_stn::NodeId)>,
    /// How many of these were before now.
    past: usize,
    /// The ends of the actions under way.
    pending: Vec<(InstanceId, elbowroom_stn::NodeId)>,
    marks: Vec<Mark>,
}

#[derive(Clone, Debug)]
struct Mark {
    checkpoint: Checkpoint,
    last: elbowroom_stn::NodeId,
    placed: usize,
    pending: Vec<(InstanceId, elbowroom_stn::NodeId)>,
}

impl<'s> Timing<'s> {
    /// The network without happenings; `None` if what is under way leaves no schedule.
    pub(crate) fn new(separations: &'s Separations, circumstances: &Circumstances) -> Option<Self> {
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
            marks: Vec::new(),
        };
        timing.fix(now, &circumstances.now)?;
        for (node, time) in &circumstances.recent {
            let own = timing.network.add_node();
            timing.fix(own, time)?;
            timing.placed.push((*node, own));
        }
        for running in &circumstances.running {
            let end = timing.network.add_node();
            let (least, greatest) = &separations.durations[running.instance.index()];
            let earliest = (&running.start + least).max(circumstances.now.clone());
            timing.demand(Constraint::at_least(zero, end, earliest))?;
            // An action that is overdue has no latest end that could still be kept.
            let latest = greatest.as_ref().map(|greatest| &running.start + greatest);
            if let Some(latest) = latest.filter(|latest| *latest >= circumstances.now) {
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

    /// Adds a happening, unless there is no time for it.
    pub(crate) fn push(&mut self, model: &Model, node: NodeId, next_timed: usize) -> bool {
        let mark = Mark {
            checkpoint: self.network.checkpoint(),
            last: self.last,
            placed: self.placed.len(),
            pending: self.pending.clone(),
        };
        if self.try_push(model, node, next_timed).is_none() {
            self.go_back_to(mark);
            return false;
        }
        self.marks.push(mark);
        true
    }

    /// Takes the last happening back.
    pub(crate) fn pop(&mut self) {
        if let Some(mark) = self.marks.pop() {
            self.go_back_to(mark);
        }
    }

    fn go_back_to(&mut self, mark: Mark) {
        self.network.undo_to(mark.checkpoint);
        self.last = mark.last;
        self.placed.truncate(mark.placed);
        self.pending = mark.pending;
    }

    fn try_push(&mut self, model: &Model, node: NodeId, next_timed: usize) -> Option<()> {
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
        let separations = self.separations;
        let is_apart = |other: NodeId| separations.apart[other.index()][node.index()];
        // Whatever is before the last of those that must be apart is before it in time, too.
        let last_apart = self.placed.iter().rev().find(|(other, _)| is_apart(*other));
        if let Some(&(_, before)) = last_apart {
            let epsilon = separations.epsilon.clone();
            self.demand(Constraint::at_least(before, own, epsilon))?;
        }
        match what {
            Node::Timed(_) => {
                // One that has happened, or is not next, leaves no time.
                let (next, time) = separations.timed.get(next_timed)?;
                if *next != node {
                    return None;
                }
                self.fix(own, time)?;
            }
            _ => self.keep_before(own, node, next_timed)?,
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

    /// Before the timed initials that have not had their turn.
    fn keep_before(
        &mut self,
        own: elbowroom_stn::NodeId,
        node: NodeId,
        next_timed: usize,
    ) -> Option<()> {
        let separations = self.separations;
        for (index, (timed, time)) in separations.timed.iter().enumerate().skip(next_timed) {
            if separations.apart[timed.index()][node.index()] {
                let latest = time - &separations.epsilon;
                self.demand(Constraint::at_most(self.zero, own, latest))?;
            } else if index == next_timed {
                self.demand(Constraint::at_most(self.zero, own, time.clone()))?;
            }
        }
        Some(())
    }

    /// What of the past can still matter to the timing of what follows: distances between zero,
    /// the last happening, and ends under way. `None` if nothing can.
    pub(crate) fn room(&self, has_deadlines: bool) -> Option<Room> {
        if self.pending.is_empty() && !has_deadlines {
            return None;
        }
        let mut points = vec![(Point::Last, self.last)];
        if has_deadlines {
            points.push((Point::Zero, self.zero));
        }
        let mut pending: Vec<_> = self.pending.clone();
        pending.sort_unstable_by_key(|(id, _)| *id);
        points.extend(pending.iter().map(|(id, end)| (Point::End(*id), *end)));
        let from_last = self.network.shortest_paths_from(self.last);
        let is_close = |node: elbowroom_stn::NodeId| {
            let latest = from_last.distance(node);
            latest.is_none_or(|latest| *latest > -self.separations.epsilon.clone())
        };
        let matters = |node: NodeId| self.separations.apart[node.index()].contains(&true);
        let recent = self.placed.iter().rev();
        let recent = recent.take_while(|(_, own)| is_close(*own));
        let mut recent: Vec<_> = recent.filter(|(node, _)| matters(*node)).collect();
        recent.sort_unstable_by_key(|(node, _)| *node);
        points.extend(
            recent
                .iter()
                .map(|(node, own)| (Point::Recent(*node), *own)),
        );
        let distances = points
            .iter()
            .map(|(_, from)| {
                let paths = self.network.shortest_paths_from(*from);
                let row = points.iter().map(|(_, to)| paths.distance(*to).cloned());
                row.collect()
            })
            .collect();
        Some(Room {
            points: points.into_iter().map(|(point, _)| point).collect(),
            distances,
        })
    }

    /// When each happening of the order, and each end under way, may and can be.
    pub(crate) fn windows(&self) -> Vec<(NodeId, Rational, Option<Rational>)> {
        let windows = self.network.windows(self.zero);
        let window = |(node, own): &(NodeId, elbowroom_stn::NodeId)| {
            let window = &windows[*own];
            let earliest = window.earliest.clone().unwrap_or_default();
            (*node, earliest, window.latest.clone())
        };
        self.placed[self.past..].iter().map(window).collect()
    }
}

/// A time point that what follows can refer to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Point {
    Zero,
    Last,
    End(InstanceId),
    /// A happening less than ε ago, from which something must be ε apart.
    Recent(NodeId),
}

/// The projection of an order's network on the points that matter to what follows.
#[derive(Clone, Debug)]
pub(crate) struct Room {
    points: Vec<Point>,
    /// The greatest difference from point to point; `None` if there is none.
    distances: Vec<Vec<Option<Rational>>>,
}

impl Room {
    /// Whether every way to go on that has time here has time in `self`, too.
    pub(crate) fn contains(&self, other: &Self) -> bool {
        if self.points.len() > other.points.len() {
            return false;
        }
        let place = |point: &Point| other.points.iter().position(|own| own == point);
        let places: Option<Vec<usize>> = self.points.iter().map(place).collect();
        let Some(places) = places else {
            return false;
        };
        (0..places.len()).all(|from| {
            (0..places.len()).all(|to| {
                let own = &self.distances[from][to];
                let its = &other.distances[places[from]][places[to]];
                match (own, its) {
                    (None, _) => true,
                    (Some(_), None) => false,
                    (Some(own), Some(its)) => own >= its,
                }
            })
        })
    }
}
