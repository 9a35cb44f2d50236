//! `PGen` against all orders tried one after the other.
#![allow(clippy::unwrap_used, reason = "a helper that panics fails the test")]

mod shared;
mod twin;

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_model::Task;
use elbowroom_model::ground::FactId;
use elbowroom_plan::{NodeId, PartialOrderPlan};
use elbowroom_probability::dispatch::patient;
use elbowroom_probability::likelihoods;
use elbowroom_probability::search::Found;
use elbowroom_probability::{
    Candidates, Circumstances, Likelihoods, Model, OrderSearch, PrunedNetwork, SearchSettings,
    Semantics, TotalOrderPlan,
};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use twin::random::{Case, Taste, case, failing_in_time, in_time, with_failing_ends};

struct Compared {
    /// The best order has more than one happening.
    is_long: bool,
    /// An order was found though the search was cut short at once.
    is_hasty: bool,
}

fn compare(case: &Case, semantics: Semantics, settings: SearchSettings) -> Compared {
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
        (Some(order), Some((best, shortest))) => {
            let p = order.probability;
            assert!(
                (p - best).abs() <= 1e-9 * best,
                "{p} is not {best}: {words}\n{order:?}"
            );
            assert_eq!(order.sequence.len(), shortest, "{words}\n{order:?}");
            // What is claimed of the order holds of it.
            let mut network = PrunedNetwork::new(search.model(), &case.circumstances).unwrap();
            for &node in &order.sequence {
                network.push(node).unwrap();
            }
            assert!((network.success_probability().unwrap() - p).abs() < 1e-15);
        }
        (found, best) => panic!("{found:?} is not {best:?}: {words}"),
    }
    // A sequence to begin with changes nothing, but where the search is cut short at once.
    let plain = OrderSearch::new(search.model().clone(), search.settings().clone());
    let nodes = 0..search.model().plan().nodes.len();
    let first: Vec<NodeId> = nodes.map(NodeId::from).collect();
    let mut begun = plain.beginning_with(first.clone());
    let hasty = begun.best_order(&case.circumstances, &mut |_| ControlFlow::Break(()));
    let hasty = hasty.unwrap().order;
    let patiently = begun.best_order(&case.circumstances, &mut patient).unwrap();
    let probability =
        |order: &Option<TotalOrderPlan>| order.as_ref().map_or(0.0, |o| o.probability);
    let (hasty, patiently) = (probability(&hasty), probability(&patiently.order));
    let best_known = probability(&found.order);
    assert!(
        (patiently - best_known).abs() <= 1e-9 * best_known,
        "{words}"
    );
    assert!(hasty <= best_known * (1.0 + 1e-9), "{words}");
    // Asked again, it knows.
    let again = search
        .best_order(&case.circumstances, &mut patient)
        .unwrap();
    assert_eq!((again.order, again.sequences), (found.order.clone(), 0));
    Compared {
        is_long: found.order.is_some_and(|order| order.sequence.len() > 1),
        is_hasty: hasty > 0.0,
    }
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
    let (mut long, mut hasty) = (0, 0);
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
        };
        let semantics = [Semantics::Paper, Semantics::World][round % 2];
        let mut compare = |case: &Case, settings| {
            let compared = compare(case, semantics, settings);
            long += usize::from(compared.is_long);
            hasty += usize::from(compared.is_hasty);
        };
        compare(&case, settings.clone());
        settings.candidates = Candidates::Working;
        // The twin knows what is nominal only of what is certain.
        let running = std::mem::take(&mut case.circumstances.running);
        case.circumstances = Circumstances::initial(&case.task);
        case.circumstances.running = running;
        compare(&case, settings);
    }
    assert!(long > 250, "{long} orders had more than one happening");
    assert!(hasty > 100, "{hasty} orders were there from the beginning");
}

#[test]
fn no_order_is_more_likely_to_succeed_where_facts_change_with_time() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut long = 0;
    for round in 0..300 {
        let taste = Taste {
            couples: round % 4 == 0,
            timed: round % 3 == 0,
            negations: round % 2 == 0,
            ..EASY
        };
        let case = case(&mut rng, taste);
        let case = in_time(&mut rng, case);
        let settings = SearchSettings {
            keeps_interference: rng.random_bool(0.5),
            candidates: Candidates::All,
        };
        let semantics = [Semantics::Paper, Semantics::World][round % 2];
        long += usize::from(compare(&case, semantics, settings).is_long);
    }
    assert!(long > 80, "{long} orders had more than one happening");
}

#[test]
fn no_order_is_more_likely_to_succeed_where_actions_fail_after_their_start() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let mut long = 0;
    for round in 0..400 {
        let taste = Taste {
            couples: round % 4 == 0,
            timed: round % 3 == 0,
            numbers: round % 5 == 0,
            ..EASY
        };
        let case = case(&mut rng, taste);
        let mut case = with_failing_ends(&mut rng, case);
        if round % 2 == 0 {
            case = failing_in_time(&mut rng, case);
        }
        for semantics in [Semantics::Paper, Semantics::World] {
            let compared = compare(&case, semantics, SearchSettings::default());
            long += usize::from(compared.is_long);
        }
    }
    assert!(
        long > 60,
        "{long} with a best order of two happenings or more"
    );
}

#[test]
fn waiting_costs_where_facts_change_with_time_so_actions_stay_parallel() {
    let (task, plan) = lamps(3);
    let text = "format = \"elbowroom-likelihoods\"\nversion = 1
        [defaults]\nbecomes_true = 0.0\nbecomes_false = 0.0\nstart = 1.0\neffect = 1.0
        [facts.whole]\nbecomes_false_per_second = 0.1\n";
    let likelihoods = likelihoods::read(text.as_bytes(), &task).unwrap();
    let found = search((task, plan), &likelihoods).order.unwrap();
    // All three at once, a second each: who begins one after the other waits six seconds in all.
    assert!(
        (found.probability - (-0.3_f64).exp()).abs() < 1e-12,
        "{found:?}"
    );
}

/// Lamps of one kind to be screwed in, in any order and also at once.
fn lamps(count: usize) -> (Task, PartialOrderPlan) {
    let domain = "(define (domain lamps) (:types lamp)
        (:predicates (whole ?l - lamp) (lit ?l - lamp) (power))
        (:durative-action screw :parameters (?l - lamp) :duration (= ?duration 1)
          :condition (and (at start (whole ?l)) (over all (power)) (at end (whole ?l)))
          :effect (at end (lit ?l))))";
    let each = |form: &str| -> String {
        let numbers = (0..count).map(|number| number.to_string());
        numbers.map(|number| form.replace('#', &number)).collect()
    };
    let problem = format!(
        "(define (problem p) (:domain lamps) (:objects{} - lamp) (:init (power){})
           (:goal (and{})))",
        each(" l#"),
        each(" (whole l#)"),
        each(" (lit l#)"),
    );
    shared::read_task(domain, &problem, &each("0: (screw l#) [1]\n"))
}

/// Everything about lamps is uncertain.
fn frail(task: &Task) -> Likelihoods {
    let text = "format = \"elbowroom-likelihoods\"\nversion = 1
        [defaults]\nbecomes_true = 0.02\nbecomes_false = 0.03\nstart = 0.8\neffect = 0.9\n";
    likelihoods::read(text.as_bytes(), task).unwrap()
}

/// The best order of all, and how many sequences were looked at.
fn search((task, plan): (Task, PartialOrderPlan), likelihoods: &Likelihoods) -> Found {
    let initial = Circumstances::initial(&task);
    let model = Model::new(Arc::new(task), plan, likelihoods, Semantics::Paper).unwrap();
    let mut search = OrderSearch::new(model, SearchSettings::default());
    search.best_order(&initial, &mut patient).unwrap()
}

/// Where nothing is uncertain, every order is as likely and as long as the first.
#[test]
fn a_world_where_nothing_is_uncertain_is_not_searched() {
    let found = search(lamps(12), &Likelihoods::certain());
    let order = found.order.unwrap();
    assert_eq!((order.probability, order.sequence.len()), (1.0, 24));
    assert!(found.sequences <= 25, "{} sequences", found.sequences);
}

/// Ten lamps of one kind have ten factorial orders that are equally likely.
#[test]
fn many_instances_of_one_kind_are_searched_to_the_end() {
    let ten = lamps(10);
    let likelihoods = frail(&ten.0);
    let found = search(ten, &likelihoods);
    assert_eq!(found.order.unwrap().sequence.len(), 20);
    assert!(found.sequences < 2_000, "{} sequences", found.sequences);
}

/// Of orders that differ by which lamp is which only one is tried, and it is as good as all. So
/// too when one of the three may be broken.
#[test]
fn of_instances_that_can_stand_for_each_other_one_is_tried() {
    for candidates in [Candidates::Working, Candidates::All] {
        for broken in [None, Some("(whole l1)")] {
            // The twin knows what is nominal only of what is certain.
            if broken.is_some() && candidates == Candidates::Working {
                continue;
            }
            let (task, plan) = lamps(3);
            let mut circumstances = Circumstances::initial(&task);
            if let Some(broken) = broken {
                let count = u32::try_from(task.fact_count()).unwrap();
                let mut facts = (0..count).map(FactId);
                let fact = facts.find(|fact| task.fact_name(*fact) == broken);
                circumstances.belief.set(fact.unwrap(), 0.7);
            }
            let case = Case {
                text: format!("{candidates:?} {broken:?}"),
                likelihoods: frail(&task),
                task: Arc::new(task),
                plan,
                circumstances,
            };
            let settings = SearchSettings {
                candidates,
                ..SearchSettings::default()
            };
            for semantics in [Semantics::Paper, Semantics::World] {
                assert!(compare(&case, semantics, settings.clone()).is_long);
            }
        }
    }
}
