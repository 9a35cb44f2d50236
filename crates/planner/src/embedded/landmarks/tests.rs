//! Compares landmarks with their definition: without the operators that make a landmark true, even
//! the delete relaxation does not reach the goal.

use elbowroom_model::Task;
use elbowroom_pddl::{Source, read_problem};
use proptest::prelude::*;

use super::Landmarks;
use crate::embedded::apply::Stepper;
use crate::embedded::compile::{Compiled, Compressibility};
use crate::embedded::formula::{Literal, is_set};
use crate::embedded::h2::tests::{Draft, drafts, numeric_drafts};
use crate::embedded::mutex::Mutexes;
use crate::embedded::relaxed::{Graph, Labels, Relaxed};
use crate::embedded::root::root;
use crate::embedded::search::is_goal;
use crate::embedded::state::State;
use crate::embedded::testing::{choices, compiled};

fn labels(relaxed: &mut Relaxed<'_>, state: &State) -> Option<Labels> {
    let mut labels = relaxed.labels(state)?;
    // In small increments, as a search does.
    while !relaxed.propagate(&mut labels, 1).1 {}
    Some(labels)
}

/// Returns the propositions that are reachable without one of them, by iterating over all operators
/// until nothing changes, and the operators that are then applicable.
fn reached_without(graph: &Graph, labels: &Labels, without: Option<u32>) -> (Vec<bool>, Vec<bool>) {
    let achievements = achievements(graph, labels);
    let mut reached: Vec<bool> = (0..)
        .take(graph.proposition_count)
        .map(|proposition| labels.held_initially(proposition) && Some(proposition) != without)
        .collect();
    let mut comes = vec![false; graph.operators.len()];
    loop {
        let mut changed = false;
        for &(operator, proposition) in &achievements {
            let needs = graph.operators[operator as usize].preconditions.clone();
            let mut needs = graph.preconditions[needs].iter();
            if needs.all(|&need| reached[need as usize]) {
                comes[operator as usize] = true;
                if Some(proposition) != without && !reached[proposition as usize] {
                    reached[proposition as usize] = true;
                    changed = true;
                }
            }
        }
        if !changed {
            return (reached, comes);
        }
    }
}

fn achievements(graph: &Graph, labels: &Labels) -> Vec<(u32, u32)> {
    let mut achievements = Vec::new();
    labels.visit_achievers(graph, &mut |operator, proposition| {
        achievements.push((operator, proposition));
    });
    achievements
}

/// Checks that each label contains exactly the propositions without which its proposition is
/// unreachable.
fn check_labels(graph: &Graph, labels: &Labels) {
    let (reached, _) = reached_without(graph, labels, None);
    for (proposition, &is_reached) in (0..).zip(&reached) {
        assert_eq!(
            labels.of(proposition).is_some(),
            is_reached,
            "{proposition}"
        );
    }
    let listed = (0..).take_while(|&proposition| graph.is_listed(proposition));
    for landmark in listed.filter(|&listed| !labels.held_initially(listed)) {
        let (reached, _) = reached_without(graph, labels, Some(landmark));
        for (proposition, &is_reached) in (0..).zip(&reached) {
            let Some(label) = labels.of(proposition) else {
                continue;
            };
            assert_eq!(
                label.contains(&landmark),
                !is_reached,
                "{landmark} for {proposition}"
            );
        }
    }
}

/// Checks that a landmark is needed just before another one exactly if every operator that can make
/// the other true for the first time needs it.
fn check_needs(graph: &Graph, labels: &Labels, landmarks: &Landmarks) {
    let achievements = achievements(graph, labels);
    for (number, landmark) in (0..).zip(&landmarks.list) {
        let (_, comes) = reached_without(graph, labels, Some(landmark.proposition));
        let first = achievements.iter().filter(|&&(operator, proposition)| {
            proposition == landmark.proposition && comes[operator as usize]
        });
        let needs: Vec<&[u32]> = first
            .map(|&(operator, _)| {
                let needs = graph.operators[operator as usize].preconditions.clone();
                &graph.preconditions[needs]
            })
            .collect();
        for other in &landmarks.list {
            let is_needed = !labels.held_initially(landmark.proposition)
                && needs.iter().all(|needs| needs.contains(&other.proposition));
            assert_eq!(
                other.needed_by.contains(&number),
                is_needed,
                "{other:?} {landmark:?}"
            );
        }
    }
}

/// Checks that new orders preserve the old ones, form no cycle, and are transitively closed.
fn check_orders(before: &Landmarks, landmarks: &Landmarks) {
    let orders = |landmarks: &Landmarks| {
        let name = |number: u32| landmarks.list[number as usize].proposition;
        let count = u32::try_from(landmarks.list.len()).expect("few");
        let mut orders = Vec::new();
        for later in 0..count {
            let after = &landmarks.list[later as usize].after;
            for earlier in (0..count).filter(|&earlier| is_set(after, earlier)) {
                assert!(earlier < later, "{landmarks:?}");
                orders.push((name(earlier), name(later)));
            }
        }
        orders
    };
    let own = orders(landmarks);
    assert!(orders(before).iter().all(|order| own.contains(order)));
    for &(first, middle) in &own {
        let mut others = own.iter().filter(|order| order.0 == middle);
        assert!(others.all(|&(_, last)| own.contains(&(first, last))));
    }
}

/// Follows all choices within the budget, and checks that no landmark remains where a plan ends.
fn check_progress(
    compiled: &Compiled,
    landmarks: &Landmarks,
    (state, before): (&State, Option<&[u64]>),
    left: usize,
    budget: &mut u32,
) {
    let (accepted, lacking) = landmarks.progress(compiled, before, state);
    if state.timed >= compiled.timed_until_goal && is_goal(compiled, state) {
        assert_eq!(lacking, 0, "{landmarks:?} {state:?}");
    }
    *budget = budget.saturating_sub(1);
    if left == 0 || *budget == 0 {
        return;
    }
    for step in choices(compiled, state) {
        if let Some(next) = Stepper::new(compiled).apply(state, step) {
            check_progress(
                compiled,
                landmarks,
                (&next, Some(&accepted)),
                left - 1,
                budget,
            );
        }
    }
}

fn check(draft: &Draft) {
    let compiled = &compiled(&draft.task());
    let root = root(compiled);
    for compresses in [Some(Compressibility::HoldsResource), None] {
        let mut relaxed = Relaxed::new(compiled, compresses);
        let Some(labels) = labels(&mut relaxed, &root) else {
            continue;
        };
        let graph = relaxed.graph();
        check_labels(graph, &labels);
        let Some(landmarks) = Landmarks::of(graph, &labels, &root.open) else {
            continue;
        };
        check_needs(graph, &labels, &landmarks);
        if compresses.is_none() {
            check_progress(compiled, &landmarks, (&root, None), 6, &mut 2_000);
        }
        let mut ordered = landmarks.clone();
        let mutexes = Mutexes::of(compiled, &root, u64::MAX);
        ordered.order_reasonably(graph, &labels, &mutexes);
        check_orders(&landmarks, &ordered);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 128, ..ProptestConfig::default() })]

    #[test]
    fn landmarks_are_necessary_for_goal(draft in drafts()) {
        check(&draft);
    }

    #[test]
    fn numeric_landmarks_are_necessary_for_goal(draft in numeric_drafts()) {
        check(&draft);
    }
}

const BLOCKS: &str = "(define (domain blocks) (:requirements :typing :durative-actions)
    (:types block)
    (:predicates (on ?x ?y - block) (clear ?x - block) (table ?x - block) (held ?x - block) (free))
    (:durative-action take :parameters (?x - block) :duration (= ?duration 1)
      :condition (and (at start (clear ?x)) (at start (table ?x)) (at start (free)))
      :effect (and (at start (not (clear ?x))) (at start (not (table ?x))) (at start (not (free)))
                   (at end (held ?x))))
    (:durative-action stack :parameters (?x ?y - block) :duration (= ?duration 1)
      :condition (and (at start (held ?x)) (at start (clear ?y)))
      :effect (and (at start (not (held ?x))) (at start (not (clear ?y)))
                   (at end (clear ?x)) (at end (free)) (at end (on ?x ?y)))))";

/// A block can be taken only when it is clear, so a block placed on it too early would have to be
/// removed again.
#[test]
fn landmark_order_builds_tower_bottom_up() {
    let problem = "(define (problem p) (:domain blocks) (:objects a b c - block)
        (:init (clear a) (clear b) (clear c) (table a) (table b) (table c) (free))
        (:goal (and (on a b) (on b c))))";
    let sources = [("domain", BLOCKS), ("problem", problem)]
        .map(|(name, text)| Source::new(name, text.to_owned()));
    let Ok((problem, _)) = read_problem(&sources[0], &sources[1]) else {
        panic!("a problem that can be read");
    };
    let task = Task::new(problem);
    let compiled = &compiled(&task);
    let name = |literal: Literal| task.fact_name(compiled.facts[literal.fact() as usize]);
    let root = root(compiled);
    let mutexes = Mutexes::of(compiled, &root, u64::MAX);
    let facts = |group: &Vec<u32>| {
        let facts = group
            .iter()
            .filter_map(|&atom| compiled.facts.get(atom as usize));
        let mut facts: Vec<String> = facts.map(|&fact| task.fact_name(fact)).collect();
        facts.sort();
        facts
    };
    let groups: Vec<Vec<String>> = mutexes.groups.iter().map(facts).collect();
    let around_b = ["(clear b)", "(held b)", "(on a b)"];
    assert!(groups.iter().any(|group| *group == around_b), "{groups:?}");
    let mut relaxed = Relaxed::new(compiled, Some(Compressibility::HoldsResource));
    let labels = labels(&mut relaxed, &root).expect("in time");
    let graph = relaxed.graph();
    let mut landmarks = Landmarks::of(graph, &labels, &root.open).expect("reachable");
    let position = |landmarks: &Landmarks, wanted: &str| {
        let mut all = landmarks.list.iter();
        all.position(|landmark| name(Literal(landmark.proposition)) == wanted)
    };
    landmarks.order_reasonably(graph, &labels, &mutexes);
    let low = position(&landmarks, "(on b c)").expect("a goal");
    let high = position(&landmarks, "(on a b)").expect("a goal");
    let after = &landmarks.list[high].after;
    assert!(
        is_set(after, u32::try_from(low).expect("few")),
        "{landmarks:?}"
    );
}
