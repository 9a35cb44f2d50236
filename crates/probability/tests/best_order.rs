//! `PGen` against all orders tried one after the other.
#![allow(clippy::unwrap_used, reason = "a helper that panics fails the test")]

mod shared;
mod twin;

use elbowroom_probability::dispatch::patient;
use elbowroom_probability::{
    Candidates, Circumstances, Model, OrderSearch, PrunedNetwork, SearchSettings, Semantics,
};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use twin::random::{Case, Taste, case};

fn compare(case: &Case, semantics: Semantics, settings: SearchSettings) -> bool {
    let model = Model::new(
        case.task.clone(),
        case.plan.clone(),
        &case.likelihoods,
        semantics,
    );
    let mut search = OrderSearch::new(model.unwrap(), settings);
    let found = search
        .best_order(&case.circumstances, &mut patient)
        .unwrap();
    let best = twin::orders::best(case, semantics, &search);
    let words = format!(
        "{}\n{:?}\n{:?} {semantics:?}",
        case.text,
        case.circumstances,
        search.settings()
    );
    match (&found.order, best) {
        (None, None) => {}
        (Some(order), Some(best)) => {
            let p = order.probability;
            assert!(
                (p - best).abs() <= 1e-9 * best,
                "{p} is not {best}: {words}\n{order:?}"
            );
            // What is claimed of the order holds of it.
            let mut network = PrunedNetwork::new(search.model(), &case.circumstances).unwrap();
            for &node in &order.sequence {
                network.push(node).unwrap();
            }
            assert!((network.success_probability().unwrap() - p).abs() < 1e-15);
        }
        (found, best) => panic!("{found:?} is not {best:?}: {words}"),
    }
    // Asked again, it knows.
    let again = search
        .best_order(&case.circumstances, &mut patient)
        .unwrap();
    assert_eq!((again.order, again.sequences), (found.order.clone(), 0));
    found.order.is_some_and(|order| order.sequence.len() > 1)
}

const EASY: Taste = Taste {
    facts: 4,
    actions: 3,
    couples: false,
    negations: true,
    is_easy: true,
    timed: true,
    numbers: true,
};

#[test]
fn no_order_is_more_likely_to_succeed_than_the_one_found() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut long = 0;
    for round in 0..700 {
        let taste = Taste {
            couples: round % 4 == 0,
            timed: round % 3 == 0,
            numbers: round % 5 == 0,
            negations: round % 2 == 0,
            ..EASY
        };
        let mut case = case(&mut rng, taste);
        let keeps_interference = rng.random_bool(0.5);
        let mut settings = SearchSettings {
            keeps_interference,
            candidates: Candidates::All,
            ..SearchSettings::default()
        };
        let semantics = [Semantics::Paper, Semantics::World][round % 2];
        long += usize::from(compare(&case, semantics, settings.clone()));
        settings.candidates = Candidates::Working;
        // The twin knows what is nominal only of what is certain.
        let running = std::mem::take(&mut case.circumstances.running);
        case.circumstances = Circumstances::initial(&case.task);
        case.circumstances.running = running;
        long += usize::from(compare(&case, semantics, settings));
    }
    assert!(long > 250, "{long} orders had more than one happening");
}
