//! A plan's constraints in words.

use elbowroom_model::Task;
use elbowroom_model::ground::Change;
use elbowroom_num::{End, Interval, Rational};
use elbowroom_plan::{InstanceId, NodeId, StnPlan, network_node};
use elbowroom_stn::WindowEnd;

use super::{Bounds, Dispatch};
use crate::horizon::Behind;

/// How many constraints of a long chain are named.
const MOST_NAMED: usize = 4;

/// A constraint of a plan in words.
pub(super) fn words(task: &Task, plan: &StnPlan, index: usize) -> String {
    let constraint = &plan.constraints[index];
    if let elbowroom_plan::Reason::Timed(timed) = constraint.reason {
        return timed_words(task, timed);
    }
    if let Some(id) = plan.duration_of(constraint) {
        return format!("the duration of {}", plan.instance(id).action.name);
    }
    let node = |id: NodeId| plan.node_words(task, id);
    format!("{} before {}", node(constraint.from), node(constraint.to))
}

/// What timed initials do, and when, on the task's clock.
fn timed_words(task: &Task, index: usize) -> String {
    let timed = &task.timed()[index];
    let changes: Vec<String> = timed
        .changes
        .iter()
        .map(|change| match change {
            Change::Add(fact) => format!("{} becomes true", task.fact_name(*fact)),
            Change::Delete(fact) => format!("{} becomes false", task.fact_name(*fact)),
            Change::Update { fluent, .. } => format!("{} changes", task.fluent_name(*fluent)),
        })
        .collect();
    changes.join(", ")
}

impl Dispatch {
    /// The plan's constraints behind one end of a node's window, in words. Of a long chain only
    /// the ends are named: the deadline, or whatever it begins with, and what is next to the node.
    pub(super) fn behind(&self, node: NodeId, end: WindowEnd) -> Vec<String> {
        self.in_words(&self.horizon.grounds(network_node(node), end))
    }

    /// The plan's constraints behind something, in words.
    fn in_words(&self, behind: &[Behind]) -> Vec<String> {
        let named = |behind: &Behind| {
            let index = self.sources.of(*behind)?;
            let timed = match self.plan.constraints[index].reason {
                elbowroom_plan::Reason::Timed(timed) => Some(timed),
                _ => None,
            };
            let words = words(&self.task, &self.plan, index);
            Some(match timed {
                Some(timed) => {
                    let time = self.world(&self.task.timed()[timed].time);
                    format!("{words} at {}", time.to_decimal(3))
                }
                None => words,
            })
        };
        let mut chain: Vec<String> = behind.iter().filter_map(named).collect();
        chain.dedup();
        if chain.len() > MOST_NAMED {
            let last = chain.split_off(chain.len() - MOST_NAMED / 2);
            chain.truncate(MOST_NAMED / 2);
            chain.push("…".to_owned());
            chain.extend(last);
        }
        chain
    }

    /// Whether what limits an end is the duration of its own action.
    pub(super) fn is_limited_by_duration(&self, id: InstanceId, end: WindowEnd) -> bool {
        let node = network_node(self.ends[id.index()][1]);
        let behind = self.horizon.grounds(node, end);
        let index = behind.last().and_then(|behind| self.sources.of(*behind));
        index.is_some_and(|index| self.plan.duration_of(&self.plan.constraints[index]) == Some(id))
    }
}

/// Bounds as an interval.
pub(super) fn interval(bounds: &Bounds) -> Interval {
    let end = |bound: &Option<Rational>| bound.clone().map_or(End::Infinite, End::Closed);
    Interval {
        lower: end(&bounds.0),
        upper: end(&bounds.1),
    }
}
