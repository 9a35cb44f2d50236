//! Claims in the middle of a valid plan.

use std::sync::Arc;

use elbowroom::model::ground::{Body, Change, Effect};
use elbowroom::model::validate::{Settings, validate_from};
use elbowroom::model::{RunningAction, Situation, Step, Task, TimeTriggeredPlan};
use elbowroom::no_plan::{no_plan_certificate_from, with_any_ends};
use elbowroom::num::{Interval, Rational};

use crate::game::Random;
use crate::no_plan_claims::draft::Solved;

/// Checks that no certificate contradicts the remaining plan at a time in the middle of it.
pub(crate) fn check(solved: &Solved, random: &mut Random) {
    let cut = &solved.plan.makespan() * &Rational::new(random.whole(1, 99), 100);
    let Some((situation, rest)) = middle(&solved.task, &solved.plan, &cut) else {
        return;
    };
    let verdict = validate_from(&solved.task, &situation, &rest, &Settings::default());
    if !verdict.is_valid() {
        return;
    }
    for from in [with_any_ends(&situation), situation] {
        let mut left = 2_000;
        let found = no_plan_certificate_from(&solved.task, &from, &mut || {
            left -= 1;
            left > 0
        });
        if let Ok(certificate) = found {
            let kind = certificate.kind();
            panic!("{kind:?} denies the rest from {cut}:\n{}", solved.text);
        }
    }
}

/// Returns the situation at a time and the remaining plan, or `None` if the plan depends on more
/// than unconditional changes of facts.
fn middle(
    task: &Task,
    plan: &TimeTriggeredPlan,
    now: &Rational,
) -> Option<(Situation, TimeTriggeredPlan)> {
    let mut happened: Vec<(Rational, Vec<Change>)> = Vec::new();
    let (mut running, mut continued, mut rest): (Vec<RunningAction>, Vec<Step>, Vec<Step>) =
        Default::default();
    for step in &plan.steps {
        if step.start >= *now {
            rest.push(step.clone());
            continue;
        }
        match (&step.action.body, &step.duration) {
            (Body::Durative(body), Some(duration)) => {
                if !body.continuous.is_empty() {
                    return None;
                }
                happened.push((step.start.clone(), plain(&body.start.effects)?));
                if step.end() < *now {
                    happened.push((step.end(), plain(&body.end.effects)?));
                } else {
                    continued.push(step.clone());
                    running.push(RunningAction {
                        action: Arc::clone(&step.action),
                        start: step.start.clone(),
                        duration: Interval::closed(duration.clone(), duration.clone()),
                    });
                }
            }
            (Body::Instantaneous(snap), _) => {
                happened.push((step.start.clone(), plain(&snap.effects)?));
            }
            _ => return None,
        }
    }
    for timed in task.timed().iter().filter(|timed| timed.time <= *now) {
        happened.push((timed.time.clone(), timed.changes.clone()));
    }
    happened.sort_by(|one, other| one.0.cmp(&other.0));
    let mut situation = Situation::initial(task);
    for (time, _) in &happened {
        for is_added in [false, true] {
            for change in happened
                .iter()
                .filter(|own| own.0 == *time)
                .flat_map(|own| &own.1)
            {
                match change {
                    Change::Add(fact) if is_added => drop(situation.state.facts.insert(*fact)),
                    Change::Delete(fact) if !is_added => {
                        situation.state.facts.remove(fact);
                    }
                    Change::Update { .. } => return None,
                    _ => {}
                }
            }
        }
    }
    situation.time = now.clone();
    situation.running = running;
    let steps = continued.into_iter().chain(rest).collect();
    Some((situation, TimeTriggeredPlan { steps }))
}

/// Returns the changes, if all of them are unconditional.
fn plain(effects: &[Effect]) -> Option<Vec<Change>> {
    let is_plain = effects.iter().all(|effect| effect.guard.is_trivial());
    is_plain.then(|| effects.iter().map(|own| own.change.clone()).collect())
}
