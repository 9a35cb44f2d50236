//! Compares macro-operators with the steps that they consist of.

use std::cell::Cell;

use proptest::prelude::*;
use proptest::test_runner::{RngAlgorithm, TestRng, TestRunner};

use super::super::{Graph, Kind};
use crate::embedded::apply::{Step, Stepper};
use crate::embedded::compile::{Action, Compiled, Compressibility, Macro, NONE};
use crate::embedded::formula::{Literal, set};
use crate::embedded::h2::tests::{Draft, drafts};
use crate::embedded::root::root;
use crate::embedded::state::State;
use crate::embedded::testing::{choices, compiled};

/// Applies the three steps one by one.
fn one_by_one(compiled: &Compiled, state: &State, data: Macro) -> Option<State> {
    let mut stepper = Stepper::new(compiled);
    let state = stepper.apply(state, Step::Start(data.envelope))?;
    let state = stepper.apply(&state, Step::Compressed(data.content))?;
    let mut open = state.open.iter();
    let place = open.rposition(|open| open.action == data.envelope)?;
    stepper.apply(&state, Step::End(u32::try_from(place).expect("few")))
}

/// Compares the operators of macro-operators with the facts and fluents that the steps read and
/// change. Returns the number of macro-operators that are applicable in the state.
fn compare_operators(compiled: &Compiled, graph: &Graph, state: &State) -> usize {
    let mut possible = 0;
    for operator in &graph.operators {
        let Kind::Macro(number) = operator.kind else {
            continue;
        };
        let whole = Stepper::new(compiled).apply(state, Step::Macro(number));
        let parts = one_by_one(compiled, state, compiled.macros[number as usize]);
        let (Some(whole), Some(parts)) = (&whole, &parts) else {
            assert!(whole.is_none() && parts.is_none());
            continue;
        };
        assert!(whole.is_discretely(parts));
        assert_eq!(whole.annotations, parts.annotations);
        let needs = &graph.preconditions[operator.preconditions.clone()];
        let literals = needs.iter().filter(|&&need| need < graph.first_test);
        for &need in literals {
            assert!(Literal(need).holds(&state.facts), "{need} in {state:?}");
        }
        let mut facts = state.facts.clone();
        for &effect in &graph.effects[operator.effects.clone()] {
            let literal = Literal(effect);
            set(&mut facts, literal.fact(), literal.truth());
        }
        assert_eq!(facts, whole.facts);
        possible += 1;
    }
    possible
}

/// Searches for actions that are applicable only while an envelope runs, by trying all pairs.
/// Returns their number.
fn find_contents(compiled: &Compiled, state: &State) -> usize {
    let is_plain = |action: &Action| {
        let mut snaps = [action.start, action.end].into_iter();
        action.start != NONE
            && action.end != NONE
            && snaps.all(|snap| compiled.snap(snap).conditional.is_empty())
    };
    let candidates = |is_envelope: bool| {
        let actions = (0..).zip(&compiled.actions);
        let matching = actions.filter(move |(_, action)| {
            (action.compressibility == Compressibility::Envelope) == is_envelope && is_plain(action)
        });
        matching.map(|(number, _)| number).collect::<Vec<u32>>()
    };
    let mut found = 0;
    for &content in &candidates(false) {
        let action = compiled.action(content);
        let start = &compiled.snap(action.start).condition;
        let needs = || start.literals.iter().chain(&action.over_all.literals);
        for &envelope in &candidates(true) {
            let data = Macro { envelope, content };
            let before = compiled.snap(compiled.action(envelope).start);
            let after = compiled.snap(compiled.action(envelope).end);
            let is_offered = needs().any(|need| {
                let (made, unmade) = if need.truth() {
                    (&before.adds, &after.deletes)
                } else {
                    (&before.deletes, &after.adds)
                };
                let is_own = compiled.snap(action.start).adds.contains(&need.fact());
                !is_own && made.contains(&need.fact()) && unmade.contains(&need.fact())
            });
            let is_possible = one_by_one(compiled, state, data).is_some();
            let ends_alone = [envelope, content].iter().all(|&number| {
                let action = compiled.action(number);
                let end = &compiled.snap(action.end).condition.literals;
                end.iter().all(|l| action.over_all.literals.contains(l))
            });
            if is_offered && is_possible && ends_alone {
                assert!(compiled.macros.contains(&data), "{data:?}");
                found += 1;
            }
        }
    }
    found
}

/// Returns how many macro-operators were compared on a random path, and how many contents were found.
fn walk(draft: &Draft, path: &[prop::sample::Index]) -> (usize, usize) {
    let compiled = &compiled(&draft.task());
    let compresses = Some(Compressibility::HoldsResource);
    let graph = Graph::of(compiled, compresses, &compiled.macros);
    let mut state = root(compiled);
    let (mut compared, mut found) = (0, 0);
    for choice in path {
        compared += compare_operators(compiled, &graph, &state);
        found += find_contents(compiled, &state);
        let steps = choices(compiled, &state);
        let nexts = steps.filter_map(|step| Stepper::new(compiled).apply(&state, step));
        let nexts: Vec<State> = nexts.collect();
        if nexts.is_empty() {
            break;
        }
        state = choice.get(&nexts).clone();
    }
    (compared, found)
}

#[test]
fn macro_operator_equals_sequence_of_its_steps() {
    let config = ProptestConfig {
        cases: 2_000,
        failure_persistence: None,
        ..ProptestConfig::default()
    };
    let total = Cell::new((0, 0));
    let path = prop::collection::vec(any::<prop::sample::Index>(), 6);
    TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha))
        .run(&(drafts(), path), |(draft, path)| {
            let (compared, found) = walk(&draft, &path);
            let (before, found_before) = total.get();
            total.set((before + compared, found_before + found));
            Ok(())
        })
        .expect("both are the same");
    let (compared, found) = total.get();
    assert!(compared > 50 && found > 50, "{compared}, {found}");
}
