//! Every box is attacked with the judge: random values in it, random schedules for them.
//!
//! `ELBOWROOM_SAMPLES` says how many per box; a few by default. `ELBOWROOM_INSTANCES` restricts
//! the attack to instances whose name contains it.

mod shared;

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_envelope::{Guarantee, Oracle, Settings, irr};
use elbowroom_model::validate::{self, validate};
use elbowroom_plan::{ParametrizedPlan, format};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use shared::draw;
use shared::instances::{Instance, figure_3, figure_4};

fn samples() -> usize {
    std::env::var("ELBOWROOM_SAMPLES")
        .ok()
        .and_then(|text| text.parse().ok())
        .unwrap_or(20)
}

/// Attacks these instances, less those that are not wanted, and says how many withstood.
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
fn values_and_schedules_in_the_boxes_of_figure_3_pass_the_judge() {
    let Some(data) = shared::data() else { return };
    attack_all(&figure_3(&data), 52);
}

#[test]
fn values_and_schedules_in_the_boxes_of_figure_4_pass_the_judge() {
    let Some(data) = shared::data() else { return };
    attack_all(&figure_4(&data), 25);
}

/// Samples the instance's box; false if the plan does not work at its nominal values.
fn attack(instance: &Instance) -> bool {
    let task = shared::task(&instance.domain, &instance.problem).expect("a readable problem");
    let bytes = std::fs::read(&instance.plan).expect("a plan file");
    let plan: ParametrizedPlan = format::read(&bytes, &task).expect("a readable plan");
    let (task, plan) = (Arc::new(task), Arc::new(plan));
    let mut oracle = Oracle::new(&task, &plan, Guarantee::Weak).expect("within reach");
    let run = irr(&mut oracle, &Settings::default(), &mut |_| {
        ControlFlow::Continue(())
    })
    .expect("within reach");
    let Ok(envelope) = run.envelope else {
        return false;
    };
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for _ in 0..samples() {
        let valuation = draw::valuation(&envelope, &mut rng);
        let schedule = draw::schedule(&plan.plan, &valuation, &mut rng)
            .unwrap_or_else(|| panic!("{}: no schedule at {valuation:?}", instance.name));
        let fixed = plan.plan.at(&valuation).scheduled(&schedule);
        let verdict = validate(&task, &fixed, &validate::Settings::default());
        assert!(
            verdict.is_valid(),
            "{}: {valuation:?} {verdict:?}",
            instance.name
        );
    }
    true
}
