//! The goal holds after the last happening of the plan's actions.

use std::cell::OnceCell;
use std::collections::BTreeSet;

use elbowroom_model::Task;
use elbowroom_model::ground::Condition;

use super::dnf::Wanted;
use super::timeline::{Reading, Timeline};
use super::{BadCase, Difference, Refusal, Substitution};
use crate::stn_plan::{Node, NodeId, StnPlan};

/// How one conjunct of the goal can be violated.
///
/// All actions have happened by then; of the timed initials that touch the conjunct, those up to
/// the last action have. They fall at fixed times in a fixed order, so the cases are: the last
/// action comes between one of them and the next.
pub(super) fn goal_cases(
    task: &Task,
    plan: &StnPlan,
    timeline: &Timeline,
    substitution: &Substitution,
    condition: &Condition,
) -> Result<Vec<BadCase>, Refusal> {
    let mut touched = BTreeSet::new();
    task.visit_facts_of(condition, &mut |fact| {
        touched.extend(timeline.fact_nodes(fact));
    });
    task.visit_fluents_of(condition, &mut |fluent| {
        touched.extend(timeline.fluent_nodes(fluent));
    });
    let timed: Vec<NodeId> = plan
        .nodes()
        .filter(|(id, node)| matches!(node, Node::Timed(_)) && touched.contains(id))
        .map(|(id, _)| id)
        .collect();
    let lasts = lasts(plan);
    let mut cases = Vec::new();
    for happened in 0..=timed.len() {
        let (before, after) = timed.split_at(happened);
        let reading = Reading {
            task,
            timeline,
            cut: &|node| !after.contains(&node),
            // Nothing drifts any more, so the moment of reading does not matter.
            moment: NodeId::ZERO,
            action: None,
            substitution,
            place: "goal",
            derived: OnceCell::new(),
        };
        let mut common = Vec::new();
        if let Some(&next) = after.first() {
            common.extend(lasts.iter().map(|&last| Difference::before(last, next)));
        }
        let windows: Vec<Vec<Difference>> = match before.last() {
            None => vec![common],
            Some(&previous) => lasts
                .iter()
                .map(|&last| {
                    let mut window = common.clone();
                    window.push(Difference::not_after(previous, last));
                    window
                })
                .collect(),
        };
        for inequalities in reading.alternatives(condition, Wanted::NotTrue)? {
            for differences in &windows {
                let inequalities = [&timeline.assumptions[..], &inequalities].concat();
                cases.push(BadCase {
                    differences: differences.clone(),
                    inequalities,
                });
            }
        }
    }
    Ok(cases)
}

/// The nodes that can be the last of the plan's actions: their ends and instants. Starts of
/// durative actions are never last, their ends follow.
pub(super) fn lasts(plan: &StnPlan) -> Vec<NodeId> {
    plan.nodes()
        .filter(|(_, node)| matches!(node, Node::End(_) | Node::Instant(_)))
        .map(|(id, _)| id)
        .collect()
}
