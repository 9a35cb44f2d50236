//! Temporal constraints between a plan's happenings, independent of their order.

use elbowroom_model::Footprint;
use elbowroom_model::ground::Body;
use elbowroom_num::Rational;
use elbowroom_plan::{LinkKind, Node, NodeId};

use crate::model::Model;
use crate::search_state::Running;

/// Temporal constraints of a plan, computed once for all searches.
#[derive(Clone, Debug)]
pub(crate) struct Separations {
    pub(crate) epsilon: Rational,
    /// `true` if two nodes must be ε apart; symmetric.
    apart: Vec<Vec<bool>>,
    /// `true` if any node must be ε apart from the node.
    keeps_distance: Vec<bool>,
    /// For each node, the nodes that must not come after it.
    never_after: Vec<Vec<NodeId>>,
    /// For each node, the nodes that it must not come after.
    never_before: Vec<Vec<NodeId>>,
    /// Relevant timed initials, sorted by time.
    pub(crate) timed: Vec<(NodeId, Rational)>,
    /// Number of them in an order: those up to the last one that changes a fact or number of the
    /// goal. The goal counts after all timed initials.
    pub(crate) timed_until_goal: usize,
    /// Durations by instance.
    pub(crate) durations: Vec<(Rational, Option<Rational>)>,
    pub(crate) starts: Vec<NodeId>,
    pub(crate) ends: Vec<NodeId>,
}

impl Separations {
    pub(crate) fn of(model: &Model, keeps_interference: bool) -> Self {
        let (task, plan) = (model.task(), model.plan());
        let footprint = |node: Node| match node {
            Node::Zero => Footprint::default(),
            Node::Start(id) | Node::Instant(id) => {
                Footprint::of_start(task, &plan.instance(id).action)
            }
            Node::End(id) => {
                let mut footprint = Footprint::of_end(task, &plan.instance(id).action);
                // A failed end writes the facts of its outcome.
                let aftermaths = model.event(model.end(id)).failure_outcomes.iter();
                for &(fact, becomes) in aftermaths.flat_map(|aftermath| &aftermath.changes) {
                    footprint.include_fact(model.facts[fact], becomes);
                }
                footprint
            }
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
        let mut never_before = vec![Vec::new(); plan.nodes.len()];
        for link in plan.links.iter().filter(|_| keeps_interference) {
            if link.kind == LinkKind::Interference {
                apart[link.from.index()][link.to.index()] = true;
                apart[link.to.index()][link.from.index()] = true;
                never_after[link.to.index()].push(link.from);
                never_before[link.from.index()].push(link.to);
            }
        }
        let goal = Footprint::of_condition(task, task.goal());
        let mut read: Vec<Footprint> = vec![goal.clone()];
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
            read.iter().any(|reader| own.writes_reads_of(reader))
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
        let timed: Vec<(NodeId, Rational)> = timed.collect();
        let is_for_goal =
            |(node, _): &(NodeId, Rational)| footprints[node.index()].writes_reads_of(&goal);
        let keeps_distance = apart.iter().map(|row| row.contains(&true)).collect();
        let ids = || plan.instances().map(|(id, _)| id);
        Self {
            epsilon: task.epsilon().clone(),
            apart,
            never_after,
            never_before,
            keeps_distance,
            timed_until_goal: timed
                .iter()
                .rposition(is_for_goal)
                .map_or(0, |last| last + 1),
            timed,
            durations: ids().map(|id| plan.duration(id)).collect(),
            starts: ids().map(|id| model.start(id)).collect(),
            ends: ids().map(|id| model.end(id)).collect(),
        }
    }

    /// Returns `true` if two happenings must be `epsilon` apart.
    pub(crate) fn must_be_separated(&self, one: NodeId, other: NodeId) -> bool {
        self.apart[one.index()][other.index()]
    }

    /// Returns `true` if the plan's links allow `one` to come before `other`.
    pub(crate) fn may_precede(&self, one: NodeId, other: NodeId) -> bool {
        !self.never_after[one.index()].contains(&other)
    }

    pub(crate) fn node_count(&self) -> usize {
        self.apart.len()
    }

    /// Returns `true` if any node must be `epsilon` apart from a happening.
    pub(crate) fn keeps_distance(&self, node: NodeId) -> bool {
        self.keeps_distance[node.index()]
    }

    /// Returns the latest time of a happening that comes before the timed initials from
    /// `next_timed` on.
    pub(crate) fn latest_before_timed(&self, node: NodeId, next_timed: usize) -> Option<Rational> {
        let to_come = self.timed.iter().enumerate().skip(next_timed);
        let latest = to_come.filter_map(|(index, (timed, time))| {
            if self.must_be_separated(*timed, node) {
                Some(time - &self.epsilon)
            } else {
                (index == next_timed).then(|| time.clone())
            }
        });
        latest.min()
    }

    /// Returns the time of a timed initial if it is the next one. `None`: it has passed, or is not
    /// the next one, so there is no schedule.
    pub(crate) fn time_of_next(&self, node: NodeId, next_timed: usize) -> Option<&Rational> {
        let (next, time) = self.timed.get(next_timed)?;
        (*next == node).then_some(time)
    }

    /// Returns the earliest and the latest end of a running action. An overdue action has no latest
    /// end.
    pub(crate) fn end_of(&self, running: &Running, now: &Rational) -> (Rational, Option<Rational>) {
        let (least, greatest) = &self.durations[running.instance.index()];
        let earliest = (&running.start + least).max(now.clone());
        let latest = greatest.as_ref().map(|greatest| &running.start + greatest);
        (earliest, latest.filter(|latest| latest >= now))
    }

    /// Returns `true` if no timed initial after `now` changes a fact or number of the goal.
    pub(crate) fn is_goal_settled(&self, now: &Rational) -> bool {
        let last = self.timed_until_goal.checked_sub(1);
        last.is_none_or(|last| self.timed[last].1 <= *now)
    }

    /// Returns `true` if absolute times matter, not only time differences.
    pub(crate) fn has_deadlines(&self, now: &Rational) -> bool {
        self.timed.iter().any(|(_, time)| time > now)
    }

    /// Returns `true` if `node` may come after all placed nodes.
    pub(crate) fn may_follow(&self, node: NodeId, is_placed: &dyn Fn(NodeId) -> bool) -> bool {
        let before = &self.never_before[node.index()];
        !before.iter().any(|&other| is_placed(other))
    }
}
