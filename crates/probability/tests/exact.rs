//! The pruned network against worlds spelt out one by one.
#![allow(clippy::unwrap_used, reason = "a helper that panics fails the test")]

mod shared;
mod twin;

use elbowroom_probability::{Model, PrunedNetwork, Semantics};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use twin::Worlds;
use twin::random::{Case, Taste, case, failing_in_time, in_time, order, with_failing_ends};

const FACTORED: Taste = Taste {
    facts: 4,
    actions: 4,
    couples: false,
    negations: true,
    is_easy: true,
    timed: true,
    numbers: true,
};

/// Pushes random orders, taking back some happenings on the way, and compares at each step.
fn compare(case: &Case, semantics: Semantics, rng: &mut ChaCha8Rng) -> usize {
    let model = Model::new(
        case.task.clone(),
        case.plan.clone(),
        &case.likelihoods,
        semantics,
    );
    let model = model.unwrap();
    let mut network = PrunedNetwork::new(&model, &case.circumstances).unwrap();
    let mut possible = 0;
    for _ in 0..4 {
        let order = order(rng, case);
        let mut worlds = Worlds::new(
            &case.task,
            &case.plan,
            &case.likelihoods,
            semantics,
            &case.circumstances,
        );
        for (at, &node) in order.iter().enumerate() {
            // There and back again.
            network.push(node).unwrap();
            network.success_probability().unwrap();
            network.pop();
            let pushed = network.push(node).unwrap();
            worlds.push(node);
            let actions = worlds.actions_probability();
            let story = || {
                let order = order[..=at].iter().map(|&node| model.node_words(node));
                format!("{}\n{:?}", case.text, order.collect::<Vec<_>>())
            };
            assert!(
                (pushed - actions).abs() < 1e-12,
                "{pushed} {actions} {}",
                story()
            );
            let success = network.success_probability().unwrap();
            let expected = worlds.success_probability();
            assert!(
                (success - expected).abs() < 1e-12,
                "{success} {expected} {}",
                story()
            );
            possible += usize::from(actions > 0.0);
        }
        while !network.sequence().is_empty() {
            network.pop();
        }
        let initial = PrunedNetwork::new(&model, &case.circumstances).unwrap();
        let (now, before) = (network.actions_probability(), initial.actions_probability());
        assert!((now - before).abs() < 1e-15);
    }
    possible
}

#[test]
fn independent_facts_have_exact_probabilities() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut possible = 0;
    for _ in 0..1500 {
        let case = case(&mut rng, FACTORED);
        for semantics in [Semantics::Paper, Semantics::World] {
            possible += compare(&case, semantics, &mut rng);
        }
    }
    assert!(possible > 20_000, "{possible} steps were possible at all");
}

#[test]
fn coupled_facts_have_exact_probabilities() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mut possible = 0;
    let taste = Taste {
        couples: true,
        actions: 3,
        ..FACTORED
    };
    for _ in 0..1500 {
        let case = case(&mut rng, taste);
        for semantics in [Semantics::Paper, Semantics::World] {
            possible += compare(&case, semantics, &mut rng);
        }
    }
    assert!(possible > 15_000, "{possible} steps were possible at all");
}

#[test]
fn facts_that_change_with_time_have_exact_probabilities() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut possible = 0;
    for round in 0..1500 {
        let taste = Taste {
            couples: round % 2 == 0,
            actions: 3,
            ..FACTORED
        };
        let case = case(&mut rng, taste);
        let case = in_time(&mut rng, case);
        for semantics in [Semantics::Paper, Semantics::World] {
            possible += compare(&case, semantics, &mut rng);
        }
    }
    assert!(possible > 15_000, "{possible} steps were possible at all");
}

#[test]
fn actions_that_fail_after_their_start_have_exact_probabilities() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut possible = 0;
    for round in 0..1500 {
        let taste = Taste {
            couples: round % 2 == 0,
            actions: 3,
            ..FACTORED
        };
        let case = case(&mut rng, taste);
        let case = with_failing_ends(&mut rng, case);
        let case = match round % 3 {
            0 => case,
            1 => failing_in_time(&mut rng, case),
            _ => {
                let case = in_time(&mut rng, case);
                failing_in_time(&mut rng, case)
            }
        };
        for semantics in [Semantics::Paper, Semantics::World] {
            possible += compare(&case, semantics, &mut rng);
        }
    }
    assert!(possible > 10_000, "{possible} steps were possible at all");
}
