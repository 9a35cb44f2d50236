//! Explanations for boxes that no executor can guarantee, although there is a schedule for all
//! values.

use elbowroom_plan::{DecoupledEnvelope, Node, NodeId, ParameterId, ParameterKind, Reason};

use super::Explainer;
use crate::{ControlConflict, ControlGround};

impl Explainer<'_> {
    /// Describes the values that an executor would have to know in advance, and the constraints
    /// that require it.
    pub(super) fn uncontrollable(&self, conflict: &ControlConflict) -> String {
        let mut unknown: Vec<ParameterId> = Vec::new();
        let mut between: Vec<String> = Vec::new();
        for ground in &conflict.grounds {
            match *ground {
                ControlGround::Early(id) | ControlGround::Late(id) => {
                    if !unknown.contains(&id) {
                        unknown.push(id);
                    }
                }
                ControlGround::Constraint(index) => {
                    let words = self.constraint(index);
                    if !between.contains(&words) {
                        between.push(words);
                    }
                }
            }
        }
        unknown.sort_unstable();
        let unknown: Vec<String> = unknown
            .into_iter()
            .map(|id| self.describe_duration(id))
            .collect();
        let mut reason = match unknown.as_slice() {
            [] => "no executor can guarantee this in advance".to_owned(),
            _ => format!(
                "the executor would have to know in advance {}",
                join_list(&unknown)
            ),
        };
        if !between.is_empty() {
            reason.push_str(": ");
            reason.push_str(&between.join(", "));
        }
        reason
    }

    /// Does the same, with the intervals of the parameters.
    pub(super) fn uncontrollable_in(
        &self,
        conflict: &ControlConflict,
        refused: &DecoupledEnvelope,
    ) -> String {
        let mut ids: Vec<ParameterId> = conflict.ends().iter().map(|end| end.parameter).collect();
        ids.dedup();
        let range = |id: ParameterId| {
            let interval = refused.interval(id);
            format!("{} in {interval}", self.plan.parameter(id).name)
        };
        let ranges: Vec<String> = ids.into_iter().map(range).collect();
        let reason = self.uncontrollable(conflict);
        match ranges.as_slice() {
            [] => reason,
            _ => format!("{reason} ({})", ranges.join(", ")),
        }
    }

    fn describe_duration(&self, id: ParameterId) -> String {
        match self.plan.parameter(id).kind {
            ParameterKind::Duration(instance) => {
                format!("how long {} takes", self.action_name(instance))
            }
            _ => self.quantity(id),
        }
    }

    /// Describes a constraint of the plan.
    pub fn constraint(&self, index: usize) -> String {
        let plan = &self.plan.plan;
        let constraint = &plan.constraints[index];
        let node = |id: NodeId| plan.describe_node(self.task, id);
        if let Reason::Timed(timed) = constraint.reason {
            return format!(
                "{}{}",
                self.timed_change(constraint.from, timed),
                self.at_time(timed)
            );
        }
        let own = |id: NodeId| match plan.nodes[id.index()] {
            Node::Start(instance) | Node::End(instance) => Some(instance),
            _ => None,
        };
        match (own(constraint.from), own(constraint.to)) {
            (Some(start), Some(end)) if start == end => {
                format!("the duration of {}", self.action_name(start))
            }
            _ => format!("{} before {}", node(constraint.from), node(constraint.to)),
        }
    }
}

fn join_list(items: &[String]) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}
