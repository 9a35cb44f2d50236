//! The pruned network, compared with the enumeration of all worlds.

use crate::reference::Worlds;
use crate::reference::random::{
    Case, Taste, case, failing_in_time, in_time, order, with_failing_ends,
};
use elbowroom_probability::{Model, PrunedNetwork, Semantics};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const FACTORED: Taste = Taste {
    facts: 4,
    actions: 4,
    couples: false,
    negations: true,
    is_easy: true,
    timed: true,
    numbers: true,
};

/// Pushes random orders, pops some happenings in between, and compares at each step.
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
            // A push followed by a pop changes nothing.
            network.push(node).unwrap();
            network.success_probability().unwrap();
            network.pop();
            let pushed = network.push(node).unwrap();
            worlds.push(node);
            let actions = worlds.actions_probability();
            let story = || {
                let order = order[..=at].iter().map(|&node| model.describe_node(node));
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

/// Compares random cases from `make`, under both semantics. Returns the number of possible steps.
fn possible_steps(seed: u64, mut make: impl FnMut(&mut ChaCha8Rng, usize) -> Case) -> usize {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut possible = 0;
    for round in 0..1500 {
        let case = make(&mut rng, round);
        for semantics in [Semantics::Paper, Semantics::World] {
            possible += compare(&case, semantics, &mut rng);
        }
    }
    possible
}

/// Returns features where, in every second round, conditions couple facts.
fn coupled_now_and_then(round: usize) -> Taste {
    Taste {
        couples: round.is_multiple_of(2),
        actions: 3,
        ..FACTORED
    }
}

#[test]
fn independent_facts_have_exact_probabilities() {
    let possible = possible_steps(1, |rng, _| case(rng, FACTORED));
    assert!(possible > 20_000, "{possible} steps were possible at all");
}

#[test]
fn coupled_facts_have_exact_probabilities() {
    let taste = Taste {
        couples: true,
        actions: 3,
        ..FACTORED
    };
    let possible = possible_steps(2, |rng, _| case(rng, taste));
    assert!(possible > 15_000, "{possible} steps were possible at all");
}

#[test]
fn facts_that_change_with_time_have_exact_probabilities() {
    let possible = possible_steps(4, |rng, round| {
        let case = case(rng, coupled_now_and_then(round));
        in_time(rng, case)
    });
    assert!(possible > 15_000, "{possible} steps were possible at all");
}

#[test]
fn actions_that_fail_after_their_start_have_exact_probabilities() {
    let possible = possible_steps(5, |rng, round| {
        let case = case(rng, coupled_now_and_then(round));
        let case = with_failing_ends(rng, case);
        match round % 3 {
            0 => case,
            1 => failing_in_time(rng, case),
            _ => {
                let case = in_time(rng, case);
                failing_in_time(rng, case)
            }
        }
    });
    assert!(possible > 10_000, "{possible} steps were possible at all");
}
