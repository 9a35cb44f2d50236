//! Requirements of a group of happenings.

use std::collections::BTreeMap;

use elbowroom_model::Footprint;
use elbowroom_model::ground::{Condition, Expression};
use elbowroom_plan::{Bound, InstanceId, Node, NodeId};

use super::search::{Context, Search, Step, World};
use crate::second_oracle::polynomial::{Polynomial, Symbol};
use crate::second_oracle::system::Relation;

impl Search<'_> {
    /// Checks the conditions of a group, and its distance from others.
    pub(super) fn arrive(&mut self, world: &World, group: &[usize]) -> Step {
        for &node in group {
            let context = self.context(world, node);
            let what = format!("{:?}", self.node(node));
            match self.node(node) {
                Node::Zero | Node::Timed(_) => {}
                Node::Instant(id) => {
                    let snap = self.snap(id);
                    self.require(&snap.condition, &context, &what)?;
                }
                Node::Start(id) => {
                    self.require_duration(id, false, &context)?;
                    self.require(&self.durative(id).start.condition, &context, &what)?;
                }
                Node::End(id) => {
                    let start = NodeId::index(self.plan.plan.start(id));
                    if !group.contains(&start) && !world.placed.contains(&start) {
                        self.report(format!("{} ends before it starts", id.0));
                        return Ok(());
                    }
                    self.require_duration(id, true, &context)?;
                    self.require(&self.durative(id).end.condition, &context, &what)?;
                }
            }
            if self.found.is_some() {
                return Ok(());
            }
        }
        self.separate(world, group)?;
        if self.found.is_some() {
            return Ok(());
        }
        let mut guards = Vec::new();
        for &node in group {
            guards.extend(self.guards(world, node)?);
        }
        self.decide(world, group, &guards, &mut BTreeMap::new())
    }

    fn require_duration(&mut self, id: InstanceId, at_end: bool, context: &Context) -> Step {
        for limit in &self.durative(id).duration {
            if limit.at_end == at_end {
                let condition =
                    Condition::Compare(limit.comparison, Expression::Duration, limit.bound.clone());
                self.require(&condition, context, &format!("duration of {}", id.0))?;
            }
        }
        Ok(())
    }

    /// Checks that interfering happenings are at least epsilon apart. For two timed initials, that
    /// is only required if the time of one is open.
    fn separate(&mut self, world: &World, group: &[usize]) -> Step {
        for (position, &node) in group.iter().enumerate() {
            for &other in world.placed.iter().chain(&group[..position]) {
                let footprint = |node: usize| self.footprint(node);
                if !footprint(node).interferes_with(&footprint(other)) {
                    continue;
                }
                let is_timed = |node: usize| matches!(self.node(node), Node::Timed(_));
                let are_timed = is_timed(node) && is_timed(other);
                if are_timed && !self.is_open(node) && !self.is_open(other) {
                    continue;
                }
                let gap = Polynomial::difference(Symbol::Time(other), Symbol::Time(node));
                let missing = gap.minus(&Polynomial::constant(self.epsilon));
                self.system.push();
                self.assert(&missing, Relation::Below)?;
                if self.system.is_feasible() {
                    let (first, second) = (self.node(other), self.node(node));
                    self.report(format!("{first:?} and {second:?} too near"));
                    if let Some(found) = self.found.as_mut().filter(|_| are_timed) {
                        found.is_only_timed = true;
                    }
                }
                self.system.pop();
                if self.found.is_some() {
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// Returns `true` if the time of a timed initial depends on a parameter: no constraint fixes
    /// it.
    fn is_open(&self, node: usize) -> bool {
        !self.plan.plan.constraints.iter().any(|constraint| {
            constraint.to.index() == node
                && constraint.from == NodeId::ZERO
                && constraint.lower == constraint.upper
                && matches!(constraint.upper, Bound::Finite(_))
        })
    }

    fn footprint(&self, node: usize) -> Footprint {
        let action = |id: InstanceId| &self.plan.plan.instances[id.index()].action;
        match self.node(node) {
            Node::Zero => Footprint::default(),
            Node::Start(id) | Node::Instant(id) => Footprint::of_start(self.task, action(id)),
            Node::End(id) => Footprint::of_end(self.task, action(id)),
            Node::Timed(group) => Footprint::of_timed(&self.task.timed()[group]),
        }
    }
}
