//! Compares landmarks with their definition: without the operators that make a landmark true, even
//! the delete relaxation does not reach the goal.

use proptest::prelude::*;

use super::Landmarks;
use crate::embedded::apply::Stepper;
use crate::embedded::compile::{Compiled, Compressibility};
use crate::embedded::h2::tests::{Draft, drafts, numeric_drafts};
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
