//! Situations in the middle of plans. Running actions are up to a half longer than planned.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use elbowroom::model::ground::{Body, Change, Condition, Effect, Expression};
use elbowroom::model::problem::UpdateOperator;
use elbowroom::model::{RunningAction, Situation, Task, TimeTriggeredPlan};
use elbowroom::num::{Interval, Rational};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::statistics::Sums;
use crate::{first_plan, task};

/// Domain and problem, relative to the folder.
const PROBLEMS: &[(&str, &str)] = &[
    ("delivery_battery/domain.pddl", "delivery_battery/p1.pddl"),
    ("delivery_battery/domain.pddl", "delivery_battery/p2.pddl"),
    ("delivery_battery/domain.pddl", "delivery_battery/p3.pddl"),
    (
        "envelopes/rcll_duration/domain_rcll_simple.pddl",
        "envelopes/rcll_duration/problems/problem_lp0.05_hp0.05.pddl",
    ),
    (
        "envelopes/rcll_resource/domain_rcll_simple_resource_2_param.pddl",
        "envelopes/rcll_resource/problems/problem_extra_fuel_rate_0.50.pddl",
    ),
];

const SITUATIONS: usize = 1000;

const LIMIT: Duration = Duration::from_secs(5);

/// Plans from a thousand situations.
pub(crate) fn plan_situations(folder: &Path) -> Result<(), String> {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let mut plans: Vec<(&str, Task, TimeTriggeredPlan)> = Vec::new();
    for (domain, problem) in PROBLEMS {
        let Some(task) = task(&folder.join(domain), &folder.join(problem)) else {
            return Err(format!("{problem} is not in the folder"));
        };
        let answer = first_plan(&task, &Situation::initial(&task), LIMIT);
        if let Some(found) = answer.found() {
            plans.push((problem, task, found.plan.clone()));
        }
    }
    let mut sums = Sums::default();
    let mut count = 0;
    while count < SITUATIONS && !plans.is_empty() {
        let (name, task, plan) = &plans[count % plans.len()];
        let cut = plan.makespan() * Rational::new(random.random_range(0..1000), 1000);
        let Some(situation) = situation_at(task, plan, &cut, &mut random) else {
            continue;
        };
        count += 1;
        let answer = first_plan(task, &situation, LIMIT);
        let name = format!("{name} at {}", situation.time);
        sums.count_answer(&name, task, &situation, &answer);
    }
    sums.print();
    Ok(())
}

/// Returns the situation at that time of the plan, or `None` if there is a happening at that time.
fn situation_at(
    task: &Task,
    plan: &TimeTriggeredPlan,
    now: &Rational,
    random: &mut ChaCha8Rng,
) -> Option<Situation> {
    let mut happened: Vec<(Rational, &[Effect])> = Vec::new();
    let mut running = Vec::new();
    for step in plan.steps.iter().filter(|step| step.start < *now) {
        match (&step.action.body, &step.duration) {
            (Body::Durative(body), Some(duration)) => {
                happened.push((step.start.clone(), &body.start.effects));
                if step.end() < *now {
                    happened.push((step.end(), &body.end.effects));
                } else {
                    let longest = duration * Rational::new(100 + random.random_range(0..50), 100);
                    running.push(RunningAction {
                        action: Arc::clone(&step.action),
                        start: step.start.clone(),
                        duration: Interval::closed(longest.clone(), longest),
                    });
                }
            }
            (Body::Instantaneous(snap), _) => happened.push((step.start.clone(), &snap.effects)),
            _ => {}
        }
    }
    let timed = task.timed().iter().filter(|timed| timed.time <= *now);
    let timed = timed.flat_map(|own| own.changes.iter().map(|change| (own.time.clone(), change)));
    let mut changes: Vec<(Rational, &Change)> = timed.collect();
    for (time, effects) in happened {
        if effects
            .iter()
            .any(|effect| effect.guard.now != Condition::TRUE)
        {
            return None;
        }
        changes.extend(effects.iter().map(|effect| (time.clone(), &effect.change)));
    }
    changes.sort_by_key(|(time, change)| (time.clone(), matches!(change, Change::Add(_))));
    let mut situation = Situation::initial(task);
    for (_, change) in changes {
        apply(change, &mut situation)?;
    }
    situation.time = now + Rational::new(1, 1000);
    situation.running = running;
    let mut timed = task.timed().iter();
    timed
        .all(|own| own.time <= *now || own.time > situation.time)
        .then_some(situation)
}

fn apply(change: &Change, situation: &mut Situation) -> Option<()> {
    match change {
        Change::Add(fact) => {
            situation.state.facts.insert(*fact);
        }
        Change::Delete(fact) => {
            situation.state.facts.remove(fact);
        }
        Change::Update {
            operator,
            fluent,
            value,
        } => {
            let values = &situation.state.values;
            let amount = value.evaluate(&mut |leaf| match leaf {
                Expression::Fluent(read) => values.get(read).cloned(),
                _ => None,
            })?;
            let old = values.get(fluent).cloned();
            let new = match operator {
                UpdateOperator::Assign => amount,
                UpdateOperator::Increase => old? + amount,
                UpdateOperator::Decrease => old? - amount,
                UpdateOperator::ScaleUp => old? * amount,
                UpdateOperator::ScaleDown => old?.checked_div(&amount)?,
            };
            situation.state.values.insert(*fluent, new);
        }
    }
    Some(())
}
