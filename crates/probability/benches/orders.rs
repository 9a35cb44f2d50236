//! Benchmarks of the search for the best order, and of adding one happening to an order.
//!
//! `cargo bench -p elbowroom-probability`

#[path = "../tests/probability/shared/mod.rs"]
mod shared;

use std::fmt::Write;
use std::sync::Arc;

use elbowroom_plan::NodeId;
use elbowroom_probability::dispatch::never_interrupt;
use elbowroom_probability::likelihoods::read;
use elbowroom_probability::{
    Model, OrderSearch, PrunedNetwork, SearchSettings, SearchState, Semantics,
};

fn main() {
    divan::main();
}

/// Returns a plan that screws in `count` lamps, in any order and also simultaneously. Unless
/// `are_alike`, the lamps become loose with different probabilities.
fn lamps(count: usize, are_alike: bool) -> (Model, SearchState) {
    let domain =
        "(define (domain lamps) (:types lamp) (:predicates (whole ?l - lamp) (lit ?l - lamp))
        (:durative-action screw :parameters (?l - lamp) :duration (= ?duration 1)
          :condition (and (at start (whole ?l)) (over all (whole ?l)) (at end (whole ?l)))
          :effect (at end (lit ?l))))";
    let (mut objects, mut init, mut goal, mut plan, mut facts) = (
        String::new(),
        String::new(),
        String::new(),
        String::new(),
        String::new(),
    );
    for lamp in 0..count {
        let _ = write!(objects, " l{lamp}");
        let _ = write!(init, " (whole l{lamp})");
        let _ = write!(goal, " (lit l{lamp})");
        let _ = writeln!(plan, "0: (screw l{lamp}) [1]");
        if are_alike {
            continue;
        }
        // Different for each lamp and not monotonic, so that no simple rule gives the order.
        let breaks = 0.01 + 0.01 * f64::from(u32::try_from(lamp * 7 % count).unwrap_or(0));
        let dims = 0.01 + 0.005 * f64::from(u32::try_from(lamp * 3 % count).unwrap_or(0));
        let _ = writeln!(
            facts,
            "[facts.\"whole l{lamp}\"]\nbecomes_false = {breaks:?}"
        );
        let _ = writeln!(facts, "[facts.\"lit l{lamp}\"]\nbecomes_false = {dims:?}");
    }
    let problem = format!(
        "(define (problem p) (:domain lamps) (:objects{objects} - lamp) (:init{init})
           (:goal (and{goal})))"
    );
    let likelihoods = format!(
        "format = \"elbowroom-likelihoods\"\nversion = 1\n
         [defaults]\nbecomes_true = 0.01\nbecomes_false = 0.02\nstart = 0.8\neffect = 0.9\n{facts}"
    );
    model(domain, &problem, &plan, &likelihoods)
}

/// Returns a plan that cleans `count` rooms one after the other and moves between them.
fn rooms(count: usize) -> (Model, SearchState) {
    let domain = "(define (domain rooms) (:types room)
        (:predicates (in ?r - room) (open ?r - room) (clean ?r - room))
        (:durative-action sweep :parameters (?r - room) :duration (= ?duration 2)
          :condition (and (at start (and (in ?r) (open ?r))) (over all (in ?r)) (at end (open ?r)))
          :effect (at end (clean ?r)))
        (:durative-action go :parameters (?a ?b - room) :duration (= ?duration 1)
          :condition (at start (in ?a))
          :effect (and (at start (not (in ?a))) (at end (in ?b)))))";
    let (mut objects, mut init, mut goal, mut plan) = (
        String::new(),
        "(in r0)".to_owned(),
        String::new(),
        String::new(),
    );
    for room in 0..count {
        let _ = write!(objects, " r{room}");
        let _ = write!(init, " (open r{room})");
        let _ = write!(goal, " (clean r{room})");
        let at = room * 4;
        if room > 0 {
            let _ = writeln!(plan, "{}.5: (go r{} r{room}) [1]", at - 2, room - 1);
        }
        let _ = writeln!(plan, "{at}: (sweep r{room}) [2]");
    }
    let problem = format!(
        "(define (problem p) (:domain rooms) (:objects{objects} - room) (:init {init})
           (:goal (and{goal})))"
    );
    let likelihoods = "format = \"elbowroom-likelihoods\"\nversion = 1\n
         [defaults]\nbecomes_true = 0.01\nbecomes_false = 0.02\nstart = 0.8\neffect = 0.9\n[facts.open]\n";
    model(domain, &problem, &plan, likelihoods)
}

fn model(domain: &str, problem: &str, plan: &str, likelihoods: &str) -> (Model, SearchState) {
    let (task, plan) = shared::read_task(domain, problem, plan);
    let likelihoods = read(likelihoods.as_bytes(), &task).expect("well-formed");
    let initial = SearchState::initial(&task);
    let model = Model::new(Arc::new(task), plan, &likelihoods, Semantics::Paper);
    (model.expect("complete"), initial)
}

fn first_order(bencher: divan::Bencher<'_, '_>, model: &Model, initial: &SearchState) {
    bencher
        .with_inputs(|| OrderSearch::new(model.clone(), SearchSettings::default()))
        .bench_local_refs(|search| search.best_order(initial, &mut never_interrupt));
}

#[divan::bench(args = [1, 3, 6, 8, 9])]
fn sf3(bencher: divan::Bencher<'_, '_>, number: usize) {
    let Some(world) = shared::sf3().into_iter().nth(number - 1) else {
        return;
    };
    let initial = SearchState::initial(&world.task);
    first_order(bencher, &world.model(Semantics::Paper), &initial);
}

#[divan::bench(args = [1, 5])]
fn af3(bencher: divan::Bencher<'_, '_>, number: usize) {
    let Some(world) = shared::af3().into_iter().nth(number - 1) else {
        return;
    };
    let initial = SearchState::initial(&world.task);
    first_order(bencher, &world.model(Semantics::Paper), &initial);
}

#[divan::bench(args = [3, 5, 7, 8, 10])]
fn lamps_in_any_order(bencher: divan::Bencher<'_, '_>, count: usize) {
    let (model, initial) = lamps(count, false);
    first_order(bencher, &model, &initial);
}

#[divan::bench(args = [3, 5, 10])]
fn lamps_of_one_kind(bencher: divan::Bencher<'_, '_>, count: usize) {
    let (model, initial) = lamps(count, true);
    first_order(bencher, &model, &initial);
}

#[divan::bench(args = [3, 5, 10])]
fn rooms_in_a_row(bencher: divan::Bencher<'_, '_>, count: usize) {
    let (model, initial) = rooms(count);
    first_order(bencher, &model, &initial);
}

/// Pushes the last of twenty happenings, computes the success probability, and pops the happening.
#[divan::bench]
fn one_step(bencher: divan::Bencher<'_, '_>) {
    let (model, initial) = lamps(10, false);
    let mut network = PrunedNetwork::new(&model, &initial).expect("not coupled");
    for node in 1..20 {
        network.push(NodeId(node)).expect("not coupled");
    }
    bencher.bench_local(|| {
        network.push(NodeId(20)).expect("not coupled");
        let probability = network.success_probability();
        network.pop();
        probability
    });
}

/// Pushes and pops without the goal: the cost of one node of the search.
#[divan::bench]
fn one_push_and_pop(bencher: divan::Bencher<'_, '_>) {
    let (model, initial) = lamps(10, false);
    let mut network = PrunedNetwork::new(&model, &initial).expect("not coupled");
    for node in 1..20 {
        network.push(NodeId(node)).expect("not coupled");
    }
    bencher.bench_local(|| {
        let probability = network.push(NodeId(20));
        network.pop();
        probability
    });
}
