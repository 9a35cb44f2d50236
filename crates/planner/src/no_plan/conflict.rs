//! Conjuncts of a goal that exclude each other.

use elbowroom_model::problem::Condition;
use elbowroom_model::{Situation, Task};

use super::{Effort, no_plan_certificate_within};

/// Limit on the number of conjuncts in a search for a conflict.
const MAX_CONJUNCTS: usize = 12;

/// Returns conjuncts of the goal that exclude each other, in words; empty unless a certificate
/// proves it.
///
/// Conjuncts are removed one after the other, as long as a certificate for the others exists
/// (deletion filter). So no proper subset of the result is known to be unreachable. Each of these
/// certificates has the same share of `work`. The result is empty if a single conjunct is
/// unreachable, or if `may_continue` returns `false`.
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
    let all = left.len();
    let share = work / (all as u64 + 1);
    let is_impossible = |task: &Task, may_continue: &mut dyn FnMut() -> bool| {
        no_plan_certificate_within(task, situation, &mut Effort::of(share, may_continue)).is_ok()
    };
    let mut place = all;
    while place > 0 {
        place -= 1;
        let mut fewer = left.clone();
        fewer.remove(place);
        let part = task.with_goal(Condition::And(fewer.clone()));
        if is_impossible(&part, may_continue) {
            left = fewer;
        }
        if !may_continue() {
            return Vec::new();
        }
    }
    let is_proved = left.len() < all || is_impossible(task, may_continue);
    if left.len() < 2 || !is_proved {
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
