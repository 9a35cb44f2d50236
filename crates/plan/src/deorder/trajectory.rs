//! Orders and bounds for trajectory constraints.
//!
//! The facts that a constraint reads change at some happenings of the plan. These keep their order,
//! and simultaneous ones stay together. So the constraint's conditions have the same truth values
//! after each change, in every schedule. `always`, `sometime`, `at-most-once`, `sometime-after`,
//! `sometime-before` and `at end` depend on nothing else. The other constraints bound the time of a
//! change, or the time between two changes. The result may be too strict, but is never too weak.

use std::collections::BTreeSet;

use elbowroom_model::ground::{Body, Change, Condition, Effect, FactId};
use elbowroom_model::{Footprint, Modal, Task};
use elbowroom_num::Rational;

use super::DeorderError;
use crate::network::Schedule;
use crate::stn_plan::{Bound, Constraint, Node, NodeId, Reason, StnPlan};

/// Interval during which the conditions of a constraint do not change, from this happening on.
struct Phase {
    node: NodeId,
    time: Rational,
    /// Truth values of the conditions; the second is `false` if there is only one.
    holds: [bool; 2],
}

/// Returns constraints between happenings that imply the trajectory constraints of a valid plan.
///
/// `footprints` and `times` are by node.
pub(super) fn constraints(
    task: &Task,
    plan: &StnPlan,
    footprints: &[Footprint],
    times: &Schedule,
) -> Result<Vec<Constraint>, DeorderError> {
    let constraints = task.constraints();
    if constraints.hard.is_empty() {
        return Ok(Vec::new());
    }
    if constraints.depends_on_unknown_past() {
        return Err(unsupported("trajectory constraints during execution"));
    }
    let mut found = Vec::new();
    for modal in &constraints.hard {
        let groups = happenings_by_time(task, plan, modal, footprints, times)?;
        constrain_order(task, &groups, times, &mut found);
        let phases = phases(task, modal, footprints, &groups, times);
        bounds(modal, &phases, &mut found).ok_or_else(|| DeorderError::ConstraintViolated {
            constraint: task.describe_modal(modal),
        })?;
    }
    Ok(found)
}

fn unsupported(feature: &'static str) -> DeorderError {
    DeorderError::Unsupported { feature }
}

/// Returns the happenings that change facts of a constraint, grouped by time.
fn happenings_by_time(
    task: &Task,
    plan: &StnPlan,
    modal: &Modal<Condition>,
    footprints: &[Footprint],
    times: &Schedule,
) -> Result<Vec<Vec<NodeId>>, DeorderError> {
    let mut facts = BTreeSet::new();
    for condition in modal.conditions() {
        let footprint = Footprint::of_condition(task, condition);
        if !footprint.reads_fluents.is_empty() {
            return Err(unsupported("trajectory constraints on numbers"));
        }
        let mut is_derived = false;
        condition.visit_facts(&mut |fact| is_derived |= task.is_derived(fact));
        if is_derived {
            return Err(unsupported("trajectory constraints on derived facts"));
        }
        facts.extend(footprint.reads);
    }
    let mut nodes: Vec<NodeId> = (0..plan.nodes.len()).map(NodeId::from).collect();
    nodes.retain(|node| {
        let footprint = &footprints[node.index()];
        let mut written = footprint.adds.iter().chain(&footprint.deletes);
        written.any(|fact| facts.contains(fact))
    });
    for &node in &nodes {
        let concerns = |effect: &Effect| match &effect.change {
            Change::Add(fact) | Change::Delete(fact) => facts.contains(fact),
            Change::Update { .. } => false,
        };
        let is_guarded = |effect: &Effect| !effect.guard.is_trivial() && concerns(effect);
        if effects(plan, node).iter().any(is_guarded) {
            return Err(unsupported(
                "trajectory constraints on facts that conditional effects change",
            ));
        }
    }
    nodes.sort_by(|a, b| times[*a].cmp(&times[*b]));
    let groups = nodes.chunk_by(|a, b| times[*a] == times[*b]);
    Ok(groups.map(<[NodeId]>::to_vec).collect())
}

fn effects(plan: &StnPlan, node: NodeId) -> &[Effect] {
    let body = |id: crate::stn_plan::InstanceId| &plan.instances[id.index()].action.body;
    match plan.nodes[node.index()] {
        Node::Zero | Node::Timed(_) => &[],
        Node::Start(id) | Node::Instant(id) => match body(id) {
            Body::Instantaneous(snap) => &snap.effects,
            Body::Durative(body) => &body.start.effects,
        },
        Node::End(id) => match body(id) {
            Body::Instantaneous(_) => &[],
            Body::Durative(body) => &body.end.effects,
        },
    }
}

/// Keeps the changes in their order, and simultaneous ones together.
fn constrain_order(
    task: &Task,
    groups: &[Vec<NodeId>],
    times: &Schedule,
    found: &mut Vec<Constraint>,
) {
    for group in groups {
        for pair in group.windows(2) {
            found.push(between(
                pair[0],
                pair[1],
                Some(Rational::ZERO),
                Some(Rational::ZERO),
            ));
        }
    }
    for pair in groups.windows(2) {
        let (from, to) = (pair[0][0], pair[1][0]);
        // Happenings that do not interfere may be closer to each other than ε.
        let gap = &times[to] - &times[from];
        let least = gap.min(task.epsilon().clone());
        found.push(between(from, to, Some(least), None));
    }
}

fn between(
    from: NodeId,
    to: NodeId,
    lower: Option<Rational>,
    upper: Option<Rational>,
) -> Constraint {
    let bound = |value: Option<Rational>| value.map_or(Bound::Infinite, Bound::Finite);
    Constraint {
        from,
        to,
        lower: bound(lower),
        upper: bound(upper),
        reason: Reason::TrajectoryConstraint,
    }
}

/// Returns the phases of a constraint; the first begins with the initial state.
fn phases(
    task: &Task,
    modal: &Modal<Condition>,
    footprints: &[Footprint],
    groups: &[Vec<NodeId>],
    times: &Schedule,
) -> Vec<Phase> {
    let mut facts: BTreeSet<FactId> = task.initial().facts.iter().copied().collect();
    let truth = |facts: &BTreeSet<FactId>| {
        let mut holds = [false; 2];
        for (condition, holds) in modal.conditions().into_iter().zip(&mut holds) {
            *holds = is_true(condition, facts);
        }
        holds
    };
    let mut phases = vec![Phase {
        node: NodeId::ZERO,
        time: Rational::ZERO,
        holds: truth(&facts),
    }];
    for group in groups {
        for node in group {
            for fact in &footprints[node.index()].deletes {
                facts.remove(fact);
            }
        }
        for node in group {
            facts.extend(&footprints[node.index()].adds);
        }
        let holds = truth(&facts);
        if phases.last().is_none_or(|last| last.holds != holds) {
            phases.push(Phase {
                node: group[0],
                time: times[group[0]].clone(),
                holds,
            });
        }
    }
    phases
}

/// Returns the truth value of a condition that compares no numbers.
fn is_true(condition: &Condition, facts: &BTreeSet<FactId>) -> bool {
    match condition {
        Condition::Fact(fact) => facts.contains(fact),
        Condition::Compare(..) => false,
        Condition::Not(part) => !is_true(part, facts),
        Condition::And(parts) => parts.iter().all(|part| is_true(part, facts)),
        Condition::Or(parts) => parts.iter().any(|part| is_true(part, facts)),
    }
}

/// Bounds the times of the changes. Returns `None` if the plan violates the constraint.
fn bounds(modal: &Modal<Condition>, phases: &[Phase], found: &mut Vec<Constraint>) -> Option<()> {
    let zero = NodeId::ZERO;
    match modal {
        Modal::Within(time, _) => {
            let first = phases.iter().find(|phase| phase.holds[0])?;
            if first.time > *time {
                return None;
            }
            if first.node != zero {
                found.push(between(zero, first.node, None, Some(time.clone())));
            }
        }
        Modal::AlwaysWithin(time, ..) => {
            for (position, phase) in phases.iter().enumerate() {
                if !phase.holds[0] || phase.holds[1] {
                    continue;
                }
                let answer = phases[position..].iter().find(|phase| phase.holds[1])?;
                if &answer.time - &phase.time > *time {
                    return None;
                }
                found.push(between(phase.node, answer.node, None, Some(time.clone())));
            }
        }
        Modal::HoldDuring(from, until, _) => throughout(phases, from, Some(until), found)?,
        Modal::HoldAfter(from, _) => throughout(phases, from, None, found)?,
        // Only the order of the changes matters.
        Modal::AtEnd(_)
        | Modal::Always(_)
        | Modal::Sometime(_)
        | Modal::AtMostOnce(_)
        | Modal::SometimeAfter(..)
        | Modal::SometimeBefore(..) => {}
    }
    Some(())
}

/// Keeps the phases where the first condition is false out of a window, on the side of the window
/// where they are in the plan.
fn throughout(
    phases: &[Phase],
    from: &Rational,
    until: Option<&Rational>,
    found: &mut Vec<Constraint>,
) -> Option<()> {
    for (position, phase) in phases.iter().enumerate() {
        if phase.holds[0] {
            continue;
        }
        match (phases.get(position + 1), until) {
            (Some(next), _) if next.time <= *from => {
                found.push(between(NodeId::ZERO, next.node, None, Some(from.clone())));
            }
            (_, Some(until)) if phase.time >= *until => {
                found.push(between(NodeId::ZERO, phase.node, Some(until.clone()), None));
            }
            _ => return None,
        }
    }
    Some(())
}
