//! Plans without steps that nothing needs (*action elimination*, Nakhost & Müller, ICAPS 2010).

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::ground::FactId;
use elbowroom_model::validate::{self, Report, Verdict};
use elbowroom_model::{Footprint, Situation, Step, Task, TimeTriggeredPlan, validate_from};

/// The plan without the steps that it works without. A search can come to a goal by way of an action
/// that makes true what another one, perhaps under way before, makes true anyway.
///
/// Only steps are tried that add no fact which no other step adds, and change no number: there are few
/// of them, and whether the plan works without one is for the judge to say. `goes_on` is asked before
/// each trial; once it says no, the other steps stay.
pub(super) fn without_needless(
    task: &Task,
    situation: &Situation,
    plan: TimeTriggeredPlan,
    report: Report,
    goes_on: &mut dyn FnMut() -> bool,
) -> (TimeTriggeredPlan, Report) {
    let mut added: Vec<Added> = plan
        .steps
        .iter()
        .map(|step| Added::by(task, step))
        .collect();
    let mut adders: BTreeMap<FactId, usize> = BTreeMap::new();
    for fact in added.iter().flat_map(|added| &added.facts) {
        *adders.entry(*fact).or_default() += 1;
    }
    let mut left = (plan, report);
    // What is under way comes first, and stays. Later steps may need earlier ones.
    for index in (situation.running.len()..added.len()).rev() {
        let may_be_needless =
            !added[index].changes_numbers && added[index].facts.iter().all(|fact| adders[fact] > 1);
        if !may_be_needless {
            continue;
        }
        if !goes_on() {
            break;
        }
        let mut fewer = left.0.clone();
        fewer.steps.remove(index);
        let verdict = validate_from(task, situation, &fewer, &validate::Settings::default());
        if let Verdict::Valid(report) = verdict {
            left = (fewer, report);
            for fact in added.remove(index).facts {
                *adders.entry(fact).or_default() -= 1;
            }
        }
    }
    left
}

/// The effects of a step.
struct Added {
    /// The facts that it makes true.
    facts: BTreeSet<FactId>,
    changes_numbers: bool,
}

impl Added {
    fn by(task: &Task, step: &Step) -> Self {
        let (start, end) = (
            Footprint::of_start(task, &step.action),
            Footprint::of_end(task, &step.action),
        );
        let changes = |one: &Footprint| !one.shifts.is_empty() || !one.assigns.is_empty();
        Self {
            changes_numbers: changes(&start) || changes(&end),
            facts: start.adds.into_iter().chain(end.adds).collect(),
        }
    }
}
