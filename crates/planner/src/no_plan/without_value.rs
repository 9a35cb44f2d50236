//! Fluents without any value, which make actions and goals impossible.

use elbowroom_model::{Situation, Task};
use elbowroom_verify::no_plan::Instances;

use super::{Effort, add_reachable};

/// Work limit for each of two lists of reachable facts: some tenths of a second.
const WORK: u64 = 3_000_000;

/// Returns the names of fluents that never have a value, because they have none initially and
/// nothing assigns one, and whose values can decide whether a plan exists: the goal reads them, or
/// an action that contributes to the goal does. No plan contains such an action. The result is
/// empty if the goal would also be unreachable with values, or if the work limit is reached.
pub fn fluents_without_value(task: &Task, situation: &Situation) -> Vec<String> {
    names(task, situation).unwrap_or_default()
}

fn names(task: &Task, situation: &Situation) -> Option<Vec<String>> {
    let mut always = || true;
    let mut stated = Instances::from(task, situation).ok()?;
    let stated = add_reachable(&mut stated, &mut Effort::of(WORK, &mut always)).ok()?;
    let mut assuming = Instances::with_assumed_values(task, situation).ok()?;
    let all = add_reachable(&mut assuming, &mut Effort::of(WORK, &mut always)).ok()?;
    Some(assuming.fluents_without_value(&all, &stated))
}
