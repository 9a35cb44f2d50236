//! Compares random networks with random demands: times for the few happenings exist exactly if the
//! linear program of all happenings has a solution, and then they are part of one.

use elbowroom_model::Task;
use elbowroom_model::problem::Comparison;
use elbowroom_num::{Delta, Rational};
use elbowroom_pddl::{Source, read_problem};
use proptest::prelude::*;

use super::super::program::{Constraints, Limit, all_times, program};
use super::times;
use crate::embedded::bound::MetricBound;
use crate::embedded::compile::Compiled;
use crate::embedded::expressions::{Form, Symbolic};
use crate::embedded::network::{Network, NodeId};
use crate::embedded::testing::compiled;
use crate::embedded::time::{NEVER, Ticks};

/// A happening: its earliest time, optionally its latest one, its predecessors, and happenings with
/// maximum distances.
#[derive(Clone, Debug)]
struct DraftNode {
    earliest: Ticks,
    width: Option<Ticks>,
    after: Vec<(usize, Ticks)>,
    before: Option<(usize, Ticks)>,
    /// The demand added with this happening: coefficients of happenings, a constant, and a
    /// comparison.
    demand: Option<DraftDemand>,
}

type DraftDemand = (Vec<(usize, i64)>, Ticks, Comparison);

fn drafts() -> impl Strategy<Value = Vec<DraftNode>> {
    let comparison = prop::sample::select(vec![
        Comparison::AtLeast,
        Comparison::AtLeast,
        Comparison::Greater,
        Comparison::AtMost,
        Comparison::Less,
        Comparison::Equal,
    ]);
    let demand = (
        prop::collection::vec((0..12_usize, -2..3_i64), 1..4),
        -30..30_i64,
        comparison,
    );
    let node = (
        0..6_i64,
        prop::option::weighted(0.3, 10..60_i64),
        prop::collection::vec((0..12_usize, 0..9_i64), 0..3),
        prop::option::weighted(0.5, (0..12_usize, 0..20_i64)),
        prop::option::weighted(0.6, demand),
    )
        .prop_map(|(earliest, room, after, before, demand)| DraftNode {
            earliest,
            width: room,
            after,
            before,
            demand,
        });
    prop::collection::vec(node, 2..10)
}

fn trivial_problem() -> Compiled {
    let domain = "(define (domain d) (:requirements :durative-actions) (:predicates (f))
        (:durative-action a :parameters () :duration (= ?duration 5)
          :condition (and) :effect (at end (f))))";
    let problem = "(define (problem p) (:domain d) (:init) (:goal (f)))";
    let sources = (
        Source::new("domain.pddl", domain.to_owned()),
        Source::new("problem.pddl", problem.to_owned()),
    );
    let (problem, _) = read_problem(&sources.0, &sources.1).expect("a domain and its problem");
    compiled(&Task::new(problem))
}

fn node(number: usize) -> NodeId {
    NodeId::try_from(number).expect("few")
}

/// Adds a happening. Returns `None` if the network then has no solution.
fn add(network: &mut Network, draft: &DraftNode) -> Option<()> {
    let count = network.node_count();
    let old = |number: usize| (count > 0).then(|| node(number % count.max(1)));
    let mut after: Vec<(NodeId, Ticks)> = Vec::new();
    for &(number, distance) in &draft.after {
        after.extend(old(number).map(|old| (old, distance)));
    }
    let latest = draft.width.map_or(NEVER, |room| draft.earliest + room);
    let new = network.add_node(draft.earliest, latest, &after).ok()?;
    if let Some((number, most)) = draft.before
        && let Some(old) = old(number)
    {
        network.add_edge(new, old, -most).ok()?;
    }
    Some(())
}

fn form(compiled: &Compiled, count: usize, terms: &[(usize, i64)], constant: Ticks) -> Form {
    let constant = Form::constant(compiled.scale.units(constant));
    terms.iter().fold(constant, |sum, &(number, coefficient)| {
        sum.plus(
            &Rational::from(coefficient),
            &Form::node(node(number % count)),
        )
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, ..ProptestConfig::default() })]

    #[test]
    fn projected_times_exist_exactly_if_full_times_exist(
        drafts in drafts(),
        weights in prop::collection::vec((0..12_usize, -1..2_i64), 0..3),
        (time, most, may_equal) in (0..2_i64, -20..120_i64, any::<bool>()),
        is_limited in any::<bool>(),
    ) {
        let compiled = trivial_problem();
        let mut network = Network::default();
        let mut symbolic = Symbolic::default();
        let bound = MetricBound { value: compiled.scale.units(most), may_equal };
        for draft in &drafts {
            if add(&mut network, draft).is_none() {
                return Ok(());
            }
            let count = network.node_count();
            if let Some((terms, constant, comparison)) = &draft.demand {
                let form = form(&compiled, count, terms, *constant);
                if form.as_constant().is_none() {
                    symbolic.demand(form, *comparison);
                }
            }
            let spent = form(&compiled, count, &weights, 0);
            let limit = Limit { spent, time: Rational::from(time), bound: &bound };
            let limit = is_limited.then_some(&limit);
            let constraints = Constraints::new(&symbolic, &compiled, limit);
            let found = times(&network, &[], &constraints);
            let expected = all_times(&network, &symbolic.demands, &compiled, limit);
            prop_assert_eq!(found.is_some(), expected.is_some());
            let Some(found) = found else { return Ok(()) };
            // With these times, the other happenings still have feasible times.
            let (mut whole, variables, _) = program(&network, &symbolic.demands, &compiled, None);
            for (node, time) in &found {
                let variable = variables[usize::from(*node)];
                whole.assert_lower(variable, Delta::from(time.clone()), 0);
                whole.assert_upper(variable, Delta::from(time.clone()), 0);
            }
            prop_assert!(whole.check().is_ok());
            symbolic.times = found;
        }
    }
}
