//! The goal holds after the last happening of the plan's actions.

use std::cell::OnceCell;
use std::collections::BTreeSet;

use elbowroom_model::Task;
use elbowroom_model::ground::Condition;

use super::dnf::Wanted;
use super::separation::is_fixed;
use super::timeline::{Reading, Timeline};
use super::{BadCase, Difference, Refusal, Substitution};
use elbowroom_plan::{Node, NodeId, StnPlan};

/// How many timed initials at open times one conjunct of the goal may depend on.
const MOST_OPEN: usize = 10;

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
    let (open, fixed): (Vec<_>, Vec<_>) = timed.into_iter().partition(|&id| !is_fixed(plan, id));
    if open.len() > MOST_OPEN {
        return Err(Refusal::TooManyCases {
            place: "timed initials that the goal depends on".to_owned(),
            limit: 1 << MOST_OPEN,
        });
    }
    let lasts = lasts(plan);
    let mut cases = Vec::new();
    let choices =
        (0..=fixed.len()).flat_map(|count| (0..1_usize << open.len()).map(move |w| (count, w)));
    for (happened, which) in choices {
        let (mut before, mut after) = (Vec::new(), Vec::new());
        for (index, &node) in open.iter().enumerate() {
            let side = if which >> index & 1 == 1 {
                &mut before
            } else {
                &mut after
            };
            side.push(node);
        }
        let has_happened =
            |node: NodeId| !after.contains(&node) && !fixed[happened..].contains(&node);
        let reading = Reading {
            task,
            timeline,
            cut: &has_happened,
            // Nothing drifts any more, so the moment of reading does not matter.
            moment: NodeId::ZERO,
            action: None,
            substitution,
            place: "goal",
            derived: OnceCell::new(),
        };
        // Of the fixed ones the next to happen and the latest that has are enough.
        let latest = happened.checked_sub(1).map(|index| fixed[index]);
        let not_yet: Vec<_> = after.iter().chain(fixed.get(happened)).collect();
        let already: Vec<_> = before.iter().chain(&latest).collect();
        let common: Vec<_> = lasts
            .iter()
            .flat_map(|&last| {
                not_yet
                    .iter()
                    .map(move |&&next| Difference::before(last, next))
            })
            .collect();
        let windows: Vec<Vec<Difference>> = if already.is_empty() {
            vec![common]
        } else {
            lasts
                .iter()
                .map(|&last| {
                    let window = already.iter();
                    let window = window.map(|&&node| Difference::not_after(node, last));
                    window.chain(common.iter().cloned()).collect()
                })
                .collect()
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
