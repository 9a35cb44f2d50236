//! Descriptions of timed initials, such as deadlines.

use elbowroom_model::Footprint;
use elbowroom_model::ground::{Change, Condition, FactId};
use elbowroom_num::Rational;
use elbowroom_plan::{Node, NodeId, Parameter, ParameterKind};

use super::Explainer;

impl Explainer<'_> {
    /// Describes why the node must come before the timed initials: `deadline of (open w) at
    /// 320.118`.
    pub(super) fn deadline(&self, node: NodeId, timed: usize) -> String {
        let time = self.at_time(timed);
        match self.deleted_condition(node, timed) {
            Some(fact) => format!("deadline of {}{time}", self.task.fact_name(fact)),
            None => format!(
                "{} must come before {}{time}",
                self.plan.plan.describe_node(self.task, node),
                self.timed_change(node, timed),
            ),
        }
    }

    /// Describes a plan's bound on a node's absolute time by the deadline behind it, if there is
    /// one: the first timed initial at or after the bound that deletes a condition of the node. If
    /// the bound is more than ε before the deadline, the description names both.
    pub(super) fn deadline_of_bound(&self, node: NodeId, bound: &Rational) -> Option<String> {
        let (index, timed) = self
            .task
            .timed()
            .iter()
            .enumerate()
            .filter(|(_, timed)| timed.time >= *bound)
            .find(|(index, _)| self.deleted_condition(node, *index).is_some())?;
        let deadline = self.deadline(node, index);
        if &timed.time - bound <= *self.task.epsilon() {
            return Some(deadline);
        }
        let node = self.plan.plan.describe_node(self.task, node);
        let bound = bound.to_decimal(6);
        Some(format!("{deadline} ({node} at {bound} or before)"))
    }

    /// Describes the change by the timed initials that concerns the node: `(open w) becomes false`.
    pub(super) fn timed_change(&self, node: NodeId, timed: usize) -> String {
        let changes = &self.task.timed()[timed].changes;
        let footprint = self.plan.plan.footprint(self.task, node);
        let concerns = |change: &&Change| match change {
            Change::Add(fact) | Change::Delete(fact) => {
                footprint.reads.contains(fact)
                    || footprint.adds.contains(fact)
                    || footprint.deletes.contains(fact)
            }
            Change::Update { fluent, .. } => {
                footprint.reads_fluents.contains(fluent)
                    || footprint.shifts.contains(fluent)
                    || footprint.assigns.contains(fluent)
            }
        };
        let change = changes.iter().find(concerns).or(changes.first());
        match change {
            Some(Change::Add(fact)) => format!("{} becomes true", self.task.fact_name(*fact)),
            Some(Change::Delete(fact)) => format!("{} becomes false", self.task.fact_name(*fact)),
            Some(Change::Update { fluent, .. }) => {
                format!("{} changes", self.task.fluent_name(*fluent))
            }
            None => "a timed initial".to_owned(),
        }
    }

    /// Returns ` at 60`; empty if the time is open.
    pub(super) fn at_time(&self, timed: usize) -> String {
        let is_open = |p: &Parameter| p.kind == ParameterKind::Timed(timed);
        if self.plan.parameters.iter().any(is_open) {
            return String::new();
        }
        format!(" at {}", self.task.timed()[timed].time.to_decimal(6))
    }

    /// Describes the time of the timed initials as a quantity.
    pub(super) fn timed_quantity(&self, timed: usize) -> String {
        match self.task.timed()[timed].changes.as_slice() {
            [Change::Delete(fact)] => format!("deadline of {}", self.task.fact_name(*fact)),
            [Change::Add(fact)] => format!("when {} becomes true", self.task.fact_name(*fact)),
            [Change::Update { fluent, .. }] => {
                format!("when {} changes", self.task.fluent_name(*fluent))
            }
            _ => format!(
                "time of the timed initials at {}",
                self.task.timed()[timed].time.to_decimal(6)
            ),
        }
    }

    /// Returns a fact that the timed initials delete, and that is a condition of the node or of the
    /// action that it ends.
    fn deleted_condition(&self, node: NodeId, timed: usize) -> Option<FactId> {
        let mut needed = self.plan.plan.footprint(self.task, node).reads;
        if let Node::End(id) = self.plan.plan.nodes[node.index()]
            && let Some(body) = self.plan.plan.instance(id).action.durative()
        {
            needed.extend(self.reads(&body.over_all));
        }
        let deleted = self.task.timed()[timed].changes.iter();
        deleted
            .filter_map(|change| match change {
                Change::Delete(fact) => Some(*fact),
                _ => None,
            })
            .find(|fact| needed.contains(fact))
    }

    fn reads(&self, condition: &Condition) -> impl Iterator<Item = FactId> + use<> {
        Footprint::of_condition(self.task, condition)
            .reads
            .into_iter()
    }
}
