//! Compares estimates that stop early with complete ones, and with costs computed by iterating over
//! all operators until nothing changes.

use std::cell::Cell;

use elbowroom_model::problem::Comparison;
use elbowroom_num::Rational;
use proptest::prelude::*;
use proptest::test_runner::{RngAlgorithm, TestRng, TestRunner};

use super::graph::{Gain, Kind};
use super::{Estimate, MOST, Relaxed, Subgoal, UNREACHED};
use crate::embedded::apply::Stepper;
use crate::embedded::compile::{Compiled, Compressibility, NONE};
use crate::embedded::h2::tests::{Draft, drafts, numeric_drafts};
use crate::embedded::root::root;
use crate::embedded::state::State;
use crate::embedded::testing::{self, compiled};

/// Returns the estimate without an early stop.
fn whole(relaxed: &mut Relaxed<'_>, state: &State) -> Option<Estimate> {
    relaxed.serves_repairs = false;
    let is_in_time = relaxed.prepare(state, None);
    if is_in_time {
        relaxed.propagate_costs(state, false, None);
    }
    relaxed.buckets.iter_mut().for_each(Vec::clear);
    relaxed.serves_repairs = true;
    let graph = &relaxed.graph;
    let mut ends = state
        .open
        .iter()
        .map(|open| graph.end_of[open.action as usize]);
    let can_end = ends.all(|end| relaxed.missing[end as usize] == 0);
    let mut goals = graph.goal.iter();
    let reaches = goals.all(|&goal| relaxed.cost[goal as usize] != UNREACHED);
    if !is_in_time || !can_end || !reaches {
        return None;
    }
    let mut estimate = Estimate::default();
    let wanted = relaxed.graph.goal.clone();
    relaxed.extract(state, wanted, &mut estimate);
    if state.timed < relaxed.compiled.timed_until_goal {
        relaxed.await_timed(state, &mut estimate);
    }
    relaxed.list_applicable(state, &mut estimate);
    Some(estimate)
}

/// Returns the cost of each proposition: the minimum, over its achievers, of the sum over their
/// preconditions.
fn plain_costs(relaxed: &mut Relaxed<'_>, state: &State) -> Option<Vec<u32>> {
    if !relaxed.prepare(state, None) {
        relaxed.buckets.iter_mut().for_each(Vec::clear);
        return None;
    }
    relaxed.buckets.iter_mut().for_each(Vec::clear);
    let graph = &relaxed.graph;
    let mut costs = relaxed.cost.clone();
    loop {
        let before = costs.clone();
        for (number, operator) in graph.operators.iter().enumerate() {
            let is_past = matches!(operator.kind, Kind::Timed(timed) if timed < state.timed);
            // It waits for something other than its conditions, which never becomes true.
            let is_kept_out = relaxed.missing[number] > graph.precondition_counts[number];
            let needs = &graph.preconditions[operator.preconditions.clone()];
            let is_unreached = needs.iter().any(|&need| costs[need as usize] == UNREACHED);
            if is_past || is_kept_out || is_unreached {
                continue;
            }
            let sum = |sum: u32, &need: &u32| sum.saturating_add(costs[need as usize]).min(MOST);
            let own = relaxed.own_cost[number];
            let cost = needs.iter().fold(own, sum);
            for &effect in &graph.effects[operator.effects.clone()] {
                costs[effect as usize] = costs[effect as usize].min(cost);
            }
            for &(test, gain) in &graph.gains[operator.gains.clone()] {
                let place = graph.test(test) as usize;
                if let Some(times) = plain_times(relaxed.compiled, state, test, gain) {
                    let all = cost.saturating_add((times - 1).saturating_mul(own));
                    costs[place] = costs[place].min(all.min(MOST));
                }
            }
        }
        if costs == before {
            return Some(costs);
        }
    }
}

/// Returns the exact number of repetitions until a failing test passes, or its gap is closed, by
/// counting.
fn plain_times(compiled: &Compiled, state: &State, test: u32, gain: Gain) -> Option<u32> {
    let test = &compiled.tests[test as usize];
    let gain = match gain {
        Gain::Sets(_) => return None,
        Gain::Reaches(more) => return Some(1 + more),
        Gain::Adds(gain) => gain,
    };
    #[allow(clippy::cast_possible_truncation, reason = "small whole numbers here")]
    let step = Rational::from(gain as i64);
    assert!((step.to_f64() - gain).abs() < 1e-12, "{gain} is whole");
    let mut value = test.difference.value(&state.values, None)?;
    let is_below = value.is_negative();
    (1..=200).find(|_| {
        value += &step;
        match test.comparison {
            Comparison::Equal => value.is_zero() || value.is_negative() != is_below,
            comparison => comparison.holds(&value, &Rational::ZERO),
        }
    })
}

fn is_among<T: PartialEq>(few: &[T], many: &[T]) -> bool {
    few.iter().all(|one| many.contains(one))
}

/// Checks that the estimate of a subgoal has the costs of a full exploration. Returns the cost of
/// the cheapest candidate.
fn compare_subgoal(
    relaxed: &mut Relaxed<'_>,
    state: &State,
    kept: &[u32],
    candidates: &[u32],
    costs: &[u32],
) -> u32 {
    let (late_operators, _) = relaxed.lateness(state, false);
    let subgoal = Subgoal {
        kept: kept.into(),
        candidates: candidates.into(),
        late_operators,
        costs: Box::default(),
    };
    relaxed.serves_repairs = false;
    let estimate = relaxed.evaluate_subgoal(state, &subgoal);
    assert!(estimate.is_some(), "{subgoal:?}");
    for &goal in kept {
        assert_eq!(relaxed.cost[goal as usize], costs[goal as usize]);
    }
    let own = candidates.iter().map(|&goal| relaxed.cost[goal as usize]);
    let own = own.min().expect("a candidate");
    let known = candidates.iter().map(|&goal| costs[goal as usize]);
    assert_eq!(Some(own), known.min(), "{subgoal:?}");
    own
}

/// Compares the estimates of a state.
fn compare(
    compiled: &Compiled,
    compresses: Option<Compressibility>,
    prices: &[u32],
    state: &State,
) {
    let relaxed = || {
        let mut relaxed = Relaxed::new(compiled, compresses);
        relaxed.serves_repairs = true;
        relaxed.lists_actions = true;
        relaxed.set_costs(
            (0..)
                .zip(prices.iter().copied())
                .take(compiled.actions.len()),
        );
        relaxed
    };
    let (mut early, mut late) = (relaxed(), relaxed());
    let costs = plain_costs(&mut relaxed(), state);
    let (stopped, full) = (early.evaluate(state), whole(&mut late, state));
    let Some(stopped) = stopped else {
        assert!(full.is_none(), "{full:?}");
        return;
    };
    let full = full.expect("one that stops has all of the goal");
    let costs = costs.expect("what is under way can end");
    for &goal in &early.graph.goal {
        assert_eq!(early.cost[goal as usize], costs[goal as usize]);
        assert_eq!(late.cost[goal as usize], costs[goal as usize]);
    }
    // Running actions may also end too late, which a subgoal does not account for.
    if state.open.is_empty() {
        for goal in late.graph.goal.clone() {
            let only = compare_subgoal(&mut relaxed(), state, &[], &[goal], &costs);
            let cheapest = late.graph.goal.iter().map(|&goal| costs[goal as usize]);
            let any = compare_subgoal(&mut relaxed(), state, &[], &late.graph.goal, &costs);
            assert!(any <= only && Some(any) == cheapest.min(), "{any}, {only}");
            compare_subgoal(&mut relaxed(), state, &late.graph.goal, &[goal], &costs);
        }
    }
    assert!(
        is_among(&stopped.actions, &full.actions),
        "{stopped:?}, {full:?}"
    );
    assert!(
        is_among(&stopped.applicable, &full.applicable),
        "{stopped:?}, {full:?}"
    );
    assert!(stopped.steps <= full.steps, "{stopped:?}, {full:?}");
    if stopped.steps != full.steps {
        // The separate end of an action that is not compressed may be missing.
        let graph = &late.graph;
        let has_end = |&action: &u32| {
            let (start, end) = graph.operators_of(action);
            let start = graph.operators.get(start as usize);
            end != NONE && start.is_some_and(|start| start.kind == Kind::Start(action))
        };
        assert!(full.actions.iter().any(has_end), "{stopped:?}, {full:?}");
    }
}

/// Compares the estimates of the states along a path through a problem. Returns the number of
/// numeric tests that failed.
fn walk(draft: &Draft, prices: &[u32], choices: &[prop::sample::Index]) -> usize {
    let task = draft.task();
    let compiled = compiled(&task);
    let mut state = root(&compiled);
    let mut failed = 0;
    for choice in choices {
        for compresses in [None, Some(Compressibility::HoldsResource)] {
            compare(&compiled, compresses, prices, &state);
        }
        let tests = 0..u32::try_from(compiled.tests.len()).expect("few");
        failed += tests
            .filter(|&test| !state.test_holds(&compiled, test, None))
            .count();
        let steps = testing::choices(&compiled, &state);
        let nexts = steps.filter_map(|step| Stepper::new(&compiled).apply(&state, step));
        let nexts: Vec<State> = nexts.collect();
        if nexts.is_empty() {
            break;
        }
        state = choice.get(&nexts).clone();
    }
    failed
}

fn prices() -> impl Strategy<Value = Vec<u32>> {
    prop::collection::vec(1..9_u32, 5)
}

fn choices() -> impl Strategy<Value = Vec<prop::sample::Index>> {
    prop::collection::vec(any::<prop::sample::Index>(), 8)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn early_stop_keeps_estimate_of_full_exploration(
        draft in drafts(),
        prices in prices(),
        choices in choices(),
    ) {
        walk(&draft, &prices, &choices);
    }
}

/// As above, for problems in which numbers are compared and changed. The test counts how often they
/// matter.
#[test]
fn early_stop_keeps_estimate_of_full_exploration_with_numbers() {
    let config = ProptestConfig {
        cases: 192,
        failure_persistence: None,
        ..ProptestConfig::default()
    };
    let failed = Cell::new(0);
    let way = (numeric_drafts(), prices(), choices());
    // The number of failing tests depends on the random problems, which are the same in each run.
    TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha))
        .run(&way, |(draft, prices, choices)| {
            failed.set(failed.get() + walk(&draft, &prices, &choices));
            Ok(())
        })
        .expect("the estimates agree");
    assert!(failed.get() > 100, "{}", failed.get());
}
