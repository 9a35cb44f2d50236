//! Random tests of every box by the validator: random values in it, and random schedules for them.
//!
//! `ELBOWROOM_SAMPLES` sets the number of samples of each box; a few by default.
//! `ELBOWROOM_INSTANCES` selects the instances whose name contains it.

use crate::shared;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use crate::shared::draw;
use crate::shared::instances::{Instance, figure_3, figure_4};
use elbowroom::pipeline;
use elbowroom_envelope::{Guarantee, Oracle, Settings, irr};
use elbowroom_model::validate::{self, validate};
use elbowroom_model::{Task, Verdict};
use elbowroom_num::{Interval, Rational};
use elbowroom_pddl::read_plan;
use elbowroom_plan::{DecoupledEnvelope, ParametrizedPlan, Valuation, format};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

fn samples() -> usize {
    std::env::var("ELBOWROOM_SAMPLES")
        .ok()
        .and_then(|text| text.parse().ok())
        .unwrap_or(20)
}

/// Tests the selected instances, and prints the number of boxes.
#[allow(clippy::print_stdout, reason = "says how many boxes were attacked")]
fn attack_all(instances: &[Instance], least: usize) {
    let wanted = std::env::var("ELBOWROOM_INSTANCES").ok();
    let is_wanted = |instance: &&Instance| {
        let part = wanted.as_ref();
        part.is_none_or(|part| instance.name.contains(part.as_str()))
    };
    let mut attacked = 0;
    for instance in instances.iter().filter(is_wanted) {
        if attack(instance) {
            attacked += 1;
        }
    }
    println!("{attacked} boxes withstood {} samples each", samples());
    assert!(attacked >= least || wanted.is_some());
}

#[test]
fn samples_in_boxes_of_figure_3_are_valid() {
    let Some(data) = shared::data() else { return };
    attack_all(&figure_3(&data), 52);
}

#[test]
fn samples_in_boxes_of_figure_4_are_valid() {
    let Some(data) = shared::data() else { return };
    attack_all(&figure_4(&data), 25);
}

/// Tests the instance's box. Returns `false` if the plan is invalid at its nominal values.
fn attack(instance: &Instance) -> bool {
    let task = shared::task(&instance.domain, &instance.problem).expect("a readable problem");
    let bytes = std::fs::read(&instance.plan).expect("a plan file");
    let plan: ParametrizedPlan = format::read(&bytes, &task).expect("a readable plan");
    let (task, plan) = (Arc::new(task), Arc::new(plan));
    let Some(envelope) = envelope(&task, &plan) else {
        return false;
    };
    if let Some((valuation, verdict)) = refuted(&task, &plan, &envelope) {
        panic!("{}: {valuation:?} {verdict:?}", instance.name);
    }
    true
}

/// Returns the box found by the search, or `None` if the plan is invalid at its nominal values.
fn envelope(task: &Arc<Task>, plan: &Arc<ParametrizedPlan>) -> Option<DecoupledEnvelope> {
    let mut oracle = Oracle::new(task, plan, Guarantee::Weak).expect("within reach");
    let run = irr(&mut oracle, &Settings::default(), &mut |_| {
        ControlFlow::Continue(())
    })
    .expect("within reach");
    run.envelope.ok()
}

/// Returns values in a box for which the plan has no schedule (`None`), or one that the validator
/// rejects.
fn refuted(
    task: &Task,
    plan: &ParametrizedPlan,
    envelope: &DecoupledEnvelope,
) -> Option<(Valuation, Option<Verdict>)> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    (0..samples()).find_map(|_| {
        let valuation = draw::valuation(envelope, &mut rng);
        let Some(schedule) = draw::schedule(&plan.plan, &valuation, &mut rng) else {
            return Some((valuation, None));
        };
        let fixed = plan.plan.at(&valuation).scheduled(&schedule);
        let verdict = validate(task, &fixed, &validate::Settings::default());
        (!verdict.is_valid()).then_some((valuation, Some(verdict)))
    })
}

/// Tests the cases of the project like the instances of the papers. To show that the test can fail,
/// it also uses a box that is too large: some of its values break the plan.
#[test]
fn samples_in_boxes_of_cases_are_valid() {
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases");
    let (mut attacked, mut broken) = (0, 0);
    for entry in std::fs::read_dir(cases).expect("the cases") {
        let folder = entry.expect("an entry").path();
        if !folder.join("plan.plan").exists() {
            continue;
        }
        let task = shared::task(&folder.join("domain.pddl"), &folder.join("problem.pddl"));
        let task = Arc::new(task.expect("a readable problem"));
        let plan = shared::source(&folder.join("plan.plan"));
        let (plan, _) = read_plan(&plan, &task).expect("a readable plan");
        let freed = pipeline::free(&task, &plan).expect("a valid plan");
        let plan = Arc::new(pipeline::open(&task, freed, &[]).expect("all durations"));
        let envelope = envelope(&task, &plan).expect("the plan works as it is");
        if let Some((valuation, verdict)) = refuted(&task, &plan, &envelope) {
            panic!("{}: {valuation:?} {verdict:?}", folder.display());
        }
        attacked += 1;
        let most = Rational::from(1000);
        let everything = |_: &Interval| Interval::closed(Rational::ZERO, most.clone());
        let everything = envelope.intervals().iter().map(everything).collect();
        let everything = DecoupledEnvelope::new(&plan, everything).expect("an interval for each");
        if refuted(&task, &plan, &everything).is_some() {
            broken += 1;
        }
    }
    assert!(attacked >= 7, "only {attacked} boxes were attacked");
    assert!(
        broken >= 5,
        "only {broken} boxes that are too large were refuted"
    );
}
