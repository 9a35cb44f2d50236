//! An estimate that stops early, beside one that does not, and beside costs made plainly: by going over all
//! operators until nothing changes.

use elbowroom_model::Situation;
use elbowroom_model::reachability::{self, Answer};
use proptest::prelude::*;

use super::graph::Kind;
use super::{Estimate, MOST, Relaxed, UNREACHED};
use crate::embedded::apply::{Step, Stepper};
use crate::embedded::compile::{Compiled, Compressibility, Wanted, compile};
use crate::embedded::pairs::tests::drafts;
use crate::embedded::root::root;
use crate::embedded::state::State;

/// The estimate that goes over everything that can be reached.
fn whole(relaxed: &mut Relaxed<'_>, state: &State) -> Option<Estimate> {
    relaxed.serves_repairs = false;
    let is_in_time = relaxed.prepare(state);
    if is_in_time {
        relaxed.spread(state);
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
    relaxed.extract(state, &mut estimate);
    if state.timed < relaxed.compiled.timed_until_goal {
        relaxed.await_timed(state, &mut estimate);
    }
    relaxed.list_applicable(state, &mut estimate);
    Some(estimate)
}

/// What each proposition costs: the least, over its achievers, of the sum over what they need.
fn plain_costs(relaxed: &mut Relaxed<'_>, state: &State) -> Option<Vec<u32>> {
    if !relaxed.prepare(state) {
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
            // What it waits for beside its conditions never comes.
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
        }
        if costs == before {
            return Some(costs);
        }
    }
}

fn is_among<T: PartialEq>(few: &[T], many: &[T]) -> bool {
    few.iter().all(|one| many.contains(one))
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
    assert!(
        is_among(&stopped.actions, &full.actions),
        "{stopped:?}, {full:?}"
    );
    assert!(
        is_among(&stopped.applicable, &full.applicable),
        "{stopped:?}, {full:?}"
    );
    assert!(stopped.steps <= full.steps, "{stopped:?}, {full:?}");
    if compresses.is_some() && stopped.steps != full.steps {
        let is_open =
            |&action: &u32| compiled.action(action).compressibility == Compressibility::Envelope;
        assert!(full.actions.iter().any(is_open), "{stopped:?}, {full:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn an_estimate_that_stops_early_is_that_of_all_that_can_be_reached(
        draft in drafts(),
        prices in prop::collection::vec(1..9_u32, 5),
        choices in prop::collection::vec(any::<prop::sample::Index>(), 8),
    ) {
        let task = draft.task();
        let situation = Situation::initial(&task);
        let limits = reachability::Settings::default();
        let Answer::Complete(grounding) = reachability::ground(&task, &limits) else {
            panic!("a small task");
        };
        let tuning = crate::embedded::Tuning::default();
        let wanted = Wanted { situation: &situation, metric: false, tuning: &tuning };
        let compiled = compile(&task, &grounding, wanted, &mut || true).expect("plain");
        let mut state = root(&compiled);
        for choice in choices {
            for compresses in [None, Some(Compressibility::HoldsResource)] {
                compare(&compiled, compresses, &prices, &state);
            }
            let actions = u32::try_from(compiled.actions.len()).expect("few");
            let open = u32::try_from(state.open.len()).expect("few");
            let starts = (0..actions).map(Step::Start);
            let steps = starts.chain((0..open).map(Step::End)).chain([Step::Timed]);
            let nexts = steps.filter_map(|step| Stepper::new(&compiled).apply(&state, step));
            let nexts: Vec<State> = nexts.collect();
            if nexts.is_empty() {
                break;
            }
            state = choice.get(&nexts).clone();
        }
    }
}
