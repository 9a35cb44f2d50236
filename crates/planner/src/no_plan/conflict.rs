//! Conjuncts of a goal that exclude each other.

use elbowroom_model::problem::Condition;
use elbowroom_model::{Situation, Task};
use elbowroom_verify::no_plan::verify_no_plan_from;

use super::{Effort, no_plan_certificate_within};

/// Limit on the number of conjuncts in a search for a conflict.
const MAX_CONJUNCTS: usize = 12;

/// Returns conjuncts of the goal that exclude each other, in words; empty unless a certificate
/// proves it.
///
/// From the conjuncts of a certified goal, one after the other is removed as long as the same
/// certificate proves that the others are unreachable (deletion filter). A closed set of states
/// proves this only for the facts that its goal needs, so another one is searched for. No proper
/// subset of the result is known to be unreachable. The result is empty if a single conjunct is
/// unreachable, if the certificate takes more than its share of `work`, or if `may_continue`
/// returns `false`.
pub fn conflict(
    task: &Task,
    situation: &Situation,
    work: u64,
    may_continue: &mut dyn FnMut() -> bool,
) -> Vec<String> {
    let mut left = Vec::new();
    collect(&task.problem().goal, &mut left);
    if left.len() < 2 || left.len() > MAX_CONJUNCTS {
        return Vec::new();
    }
    let share = work / (left.len() as u64 + 1);
    let certified = |task: &Task, may_continue: &mut dyn FnMut() -> bool| {
        no_plan_certificate_within(task, situation, &mut Effort::of(share, may_continue)).ok()
    };
    let Some(mut certificate) = certified(task, may_continue) else {
        return Vec::new();
    };
    // The goals given last come last, and a conflict within one of them is the best reason.
    let mut place = 0;
    while place < left.len() {
        let mut fewer = left.clone();
        fewer.remove(place);
        let part = task.with_goal(Condition::And(fewer.clone()));
        let other = match verify_no_plan_from(&part, situation, &certificate) {
            Ok(()) => Some(certificate.clone()),
            Err(_) if certificate.closed.is_some() => certified(&part, may_continue),
            Err(_) => None,
        };
        match other {
            Some(other) => (certificate, left) = (other, fewer),
            None => place += 1,
        }
        if !may_continue() {
            return Vec::new();
        }
    }
    if left.len() < 2 {
        return Vec::new();
    }
    let in_words = |condition: Condition| {
        let ground = task.with_goal(condition).goal().clone();
        task.describe_condition(&ground)
    };
    left.into_iter().map(in_words).collect()
}

/// Adds the conjuncts of a condition.
fn collect(condition: &Condition, conjuncts: &mut Vec<Condition>) {
    match condition {
        Condition::And(parts) => parts.iter().for_each(|part| collect(part, conjuncts)),
        other => conjuncts.push(other.clone()),
    }
}
