//! Encoding of violations.

use elbowroom_model::Footprint;
use elbowroom_model::ground::{Condition, Expression};
use elbowroom_plan::{Bound, InstanceId, Node, NodeId};

use super::text::{and, not, number};
use super::{At, Encoder, NotEncoded};

impl Encoder<'_> {
    pub(super) fn conditions(&mut self) -> Result<(), NotEncoded> {
        for node in self.nodes() {
            let Some(snap) = self.snap(node) else {
                continue;
            };
            for k in self.places.of(node) {
                let holds =
                    self.condition(&snap.condition, &At::Arrival(k), self.instance(node))?;
                self.violations.push(and(&[self.at(node, k), not(&holds)]));
            }
        }
        Ok(())
    }

    pub(super) fn separation(&mut self) {
        let epsilon = number(self.epsilon);
        for node in self.nodes() {
            for other in 1..node {
                let (left, right) = (self.footprint(node), self.footprint(other));
                if !left.interferes_with(&right) {
                    continue;
                }
                let is_timed = |node: usize| matches!(self.node(node), Node::Timed(_));
                let are_timed = is_timed(node) && is_timed(other);
                if are_timed && !self.is_open(node) && !self.is_open(other) {
                    continue;
                }
                let is_far = |first, second| {
                    let gap = self.places.least_gap(first, second);
                    gap.is_some_and(|gap| gap >= *self.epsilon)
                };
                if is_far(node, other) || is_far(other, node) {
                    continue;
                }
                self.violations.push(format!(
                    "(and (< (- t{node} t{other}) {epsilon}) (< (- t{other} t{node}) {epsilon}))"
                ));
            }
        }
    }

    fn is_open(&self, node: usize) -> bool {
        self.plan.plan.constraints.iter().any(|constraint| {
            constraint.to.index() == node
                && constraint.from == NodeId::ZERO
                && matches!(constraint.upper, Bound::Parameter(_))
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

    pub(super) fn durations(&mut self) -> Result<(), NotEncoded> {
        for (id, body) in self.durative() {
            let (start, end) = (self.start(id), self.end(id));
            self.violations.push(format!("(< t{end} t{start})"));
            for limit in &body.duration {
                let node = if limit.at_end { end } else { start };
                let condition =
                    Condition::Compare(limit.comparison, Expression::Duration, limit.bound.clone());
                for k in self.places.of(node) {
                    let holds = self.condition(&condition, &At::Arrival(k), Some(id))?;
                    self.violations.push(and(&[self.at(node, k), not(&holds)]));
                }
            }
        }
        Ok(())
    }

    /// Requires over-all conditions at one moment for each action, after each position.
    pub(super) fn over_all(&mut self) -> Result<(), NotEncoded> {
        for (id, body) in self.durative() {
            if body.over_all.is_trivial() {
                continue;
            }
            let moment = format!("s{}", id.0);
            self.line(&format!("(declare-const {moment} Real)"));
            let inside = format!(
                "(and (< t{} {moment}) (< {moment} t{}))",
                self.start(id),
                self.end(id)
            );
            for k in 1..self.count() {
                let is_under_way = and(&[
                    self.before(self.start(id), k + 1),
                    not(&self.before(self.end(id), k + 1)),
                ]);
                if is_under_way == "false" {
                    continue;
                }
                let at = At::Moment(k, moment.clone());
                let holds = self.condition(&body.over_all, &at, Some(id))?;
                self.violations.push(format!(
                    "(and {inside} (<= tau{k} {moment}) (< {moment} tau{}) (not {holds}))",
                    k + 1
                ));
            }
        }
        Ok(())
    }

    /// Requires the goal, which is read after the last position.
    pub(super) fn goal(&mut self) -> Result<(), NotEncoded> {
        let holds = self.condition(&self.plan.goal, &At::After(self.count()), None)?;
        self.violations.push(not(&holds));
        Ok(())
    }
}
