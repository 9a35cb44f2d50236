//! Compares stored states with the original ones, on random paths through random problems.

use proptest::prelude::*;

use super::{MAX_RECENT, States, is_settled};
use crate::embedded::apply::Stepper;
use crate::embedded::compile::Compressibility;
use crate::embedded::h2::tests::{Draft, drafts, numeric_drafts};
use crate::embedded::relaxed::Relaxed;
use crate::embedded::root::root;
use crate::embedded::state::State;
use crate::embedded::testing::{choices, compiled};

/// Stores states of a problem and reads them back in any order. A state's parent is any state
/// before it, mostly the last one, so that paths are long.
fn keep_and_read(draft: &Draft, picks: &[(prop::sample::Index, prop::sample::Index)]) {
    let task = draft.task();
    let compiled = compiled(&task);
    let mut stepper = Stepper::new(&compiled);
    let mut plain: Vec<State> = vec![root(&compiled)];
    let mut states = States::default();
    states.push(None, plain[0].clone());
    for (number, (parent, choice)) in picks.iter().enumerate() {
        let parent = if number % 4 == 0 {
            parent.index(plain.len())
        } else {
            plain.len() - 1
        };
        let steps = choices(&compiled, &plain[parent]);
        let nexts = steps.filter_map(|step| stepper.apply(&plain[parent], step));
        let nexts: Vec<State> = nexts.collect();
        if nexts.is_empty() {
            continue;
        }
        let next = choice.get(&nexts).clone();
        states.push(u32::try_from(parent).ok(), next.clone());
        plain.push(next);
    }
    let mut made = State::default();
    let mut facts = Vec::new();
    for step in [1, MAX_RECENT + 1] {
        for place in (0..plain.len()).step_by(step) {
            let number = u32::try_from(place).expect("few");
            let expected = format!("{:?}", plain[place]);
            states.restore(number, &mut made);
            assert_eq!(format!("{made:?}"), expected);
            assert_eq!(format!("{:?}", states.get(number)), expected);
            assert_eq!(states.is_unsettled(number), !is_settled(&plain[place]));
            for other in &plain {
                let is_same =
                    other.facts == plain[place].facts && other.timed == plain[place].timed;
                assert_eq!(states.has_facts_of(number, other, &mut facts), is_same);
            }
        }
    }
    list(draft, &plain);
}

/// Compares the applicable steps of estimates and of lists.
fn list(draft: &Draft, plain: &[State]) {
    let task = draft.task();
    let compiled = compiled(&task);
    for compresses in [None, Some(Compressibility::HoldsResource)] {
        let mut relaxed = Relaxed::new(&compiled, compresses);
        for state in plain {
            let Some(estimate) = relaxed.evaluate(state) else {
                continue;
            };
            let listed = relaxed.list(state).expect("what is under way can end");
            assert_eq!(listed.applicable, estimate.applicable);
        }
    }
}

fn picks() -> impl Strategy<Value = Vec<(prop::sample::Index, prop::sample::Index)>> {
    prop::collection::vec(any::<(prop::sample::Index, prop::sample::Index)>(), 60)
}

proptest! {
    #[test]
    fn stored_state_is_restored_unchanged(draft in drafts(), picks in picks()) {
        keep_and_read(&draft, &picks);
    }

    #[test]
    fn stored_numeric_state_is_restored_unchanged(draft in numeric_drafts(), picks in picks()) {
        keep_and_read(&draft, &picks);
    }
}
