//! The goal, which must hold after all actions and all timed initials.

use std::cell::OnceCell;

use elbowroom_model::Task;
use elbowroom_model::ground::Condition;

use super::dnf::WantedTruth;
use super::timeline::{Reading, Timeline};
use super::{BadCase, Refusal, Substitution};
use elbowroom_plan::NodeId;

/// Returns the ways to violate one conjunct of the goal.
///
/// All happenings are over by then. The last change of a fact or fluent is known, because changes
/// that do not commute interfere, and so keep their order
/// ([`Requirement::Separation`](super::Requirement::Separation)).
pub(super) fn goal_cases(
    task: &Task,
    timeline: &Timeline,
    substitution: &Substitution,
    condition: &Condition,
) -> Result<Vec<BadCase>, Refusal> {
    let reading = Reading {
        task,
        timeline,
        cut: None,
        // There are no drifts any more, so the moment of reading does not matter.
        moment: NodeId::ZERO,
        action: None,
        substitution,
        location: "goal",
        derived: OnceCell::new(),
    };
    let broken = reading.alternatives(condition, WantedTruth::NotTrue)?;
    let cases = broken.into_iter().map(|inequalities| BadCase {
        differences: Vec::new(),
        inequalities: [&timeline.assumptions[..], &inequalities].concat(),
    });
    Ok(cases.collect())
}
