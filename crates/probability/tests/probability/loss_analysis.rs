//! Analysis of success probabilities, and the lattice of orders, compared with the enumeration of
//! all worlds and all orders.

use crate::reference;
use crate::shared;
use std::collections::BTreeMap;

use crate::reference::Worlds;
use crate::reference::random::{Case, Taste, case, failing_in_time, order, with_failing_ends};
use elbowroom_plan::{Node, NodeId};
use elbowroom_probability::likelihoods::{FailureModel, PartialChange, Success};
use elbowroom_probability::loss_analysis::LossAnalysis;
use elbowroom_probability::search::{LatticeLimits, TooLarge};
use elbowroom_probability::{
    Likelihoods, LossCause, Model, OrderSearch, Reading, SearchSettings, Semantics,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const BOTH: [Semantics; 2] = [Semantics::Paper, Semantics::World];

const TASTE: Taste = Taste {
    facts: 4,
    actions: 4,
    couples: true,
    negations: true,
    is_easy: true,
    timed: true,
    numbers: true,
};

/// Generates a random case; in half of them actions also fail after their start.
fn mixed(rng: &mut ChaCha8Rng, round: usize) -> Case {
    let plain = case(rng, TASTE);
    match round % 4 {
        0 | 1 => plain,
        2 => with_failing_ends(rng, plain),
        _ => {
            let case = with_failing_ends(rng, plain);
            failing_in_time(rng, case)
        }
    }
}

fn model(case: &Case, semantics: Semantics) -> Model {
    let (task, plan) = (case.task.clone(), case.plan.clone());
    Model::new(task, plan, &case.likelihoods, semantics).unwrap()
}

fn worlds<'a>(case: &'a Case, likelihoods: &'a Likelihoods, semantics: Semantics) -> Worlds<'a> {
    let (task, plan) = (&case.task, &case.plan);
    Worlds::new(task, plan, likelihoods, semantics, &case.circumstances)
}

fn success(case: &Case, likelihoods: &Likelihoods, semantics: Semantics, order: &[NodeId]) -> f64 {
    let mut worlds = worlds(case, likelihoods, semantics);
    for &node in order {
        worlds.push(node);
    }
    worlds.success_probability()
}

fn assert_close(found: f64, expected: f64, what: &str) {
    assert!(
        (found - expected).abs() < 1e-11,
        "{found} is not {expected}: {what}"
    );
}

#[test]
fn losses_and_success_sum_to_one() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut lossy = 0;
    for round in 0..400 {
        let case = mixed(&mut rng, round);
        for semantics in BOTH {
            let order = order(&mut rng, &case);
            let model = model(&case, semantics);
            let account = LossAnalysis::of(&model, &case.circumstances, &order).unwrap();
            let lost: f64 = account.losses.iter().map(|loss| loss.mass).sum();
            assert_close(lost + account.probability, 1.0, &case.text);
            // The loss at each position is the decrease of the worlds' total probability.
            let mut worlds = worlds(&case, &case.likelihoods, semantics);
            let at = |position, is_goal| {
                let is_there = account.losses.iter().filter(move |loss| {
                    loss.position == position && (loss.reading == Reading::Goal) == is_goal
                });
                is_there.map(|loss| loss.mass).sum::<f64>()
            };
            let mut before = worlds.actions_probability();
            assert_close(at(None, false), 1.0 - before, &case.text);
            for (position, &node) in order.iter().enumerate() {
                worlds.push(node);
                let after = worlds.actions_probability();
                assert_close(at(Some(position), false), before - after, &case.text);
                before = after;
            }
            let end = order.len().checked_sub(1);
            assert_close(
                at(end, true),
                before - worlds.success_probability(),
                &case.text,
            );
            assert_close(account.actions_probability, before, &case.text);
            lossy += account.losses.len();
        }
    }
    assert!(lossy > 2000, "{lossy} losses");
}

#[test]
fn gain_of_certainty_equals_certain_world() {
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let (mut actions, mut facts) = (0, 0);
    for round in 0..400 {
        let case = mixed(&mut rng, round);
        for semantics in BOTH {
            let order = order(&mut rng, &case);
            let model = model(&case, semantics);
            let account = LossAnalysis::of(&model, &case.circumstances, &order).unwrap();
            for share in &account.actions {
                let own = &case.plan.instance(share.instance).action;
                let same = case
                    .plan
                    .instances()
                    .filter(|(_, it)| it.action.name == own.name);
                if same.count() > 1 {
                    continue;
                }
                let all = (0..case.task.problem().predicates.len())
                    .map(|index| (index.into(), 1.0))
                    .collect::<BTreeMap<_, _>>();
                let certain = Success {
                    start: Some(1.0),
                    effects: all.clone(),
                    deletions: all,
                    failing: FailureModel {
                        end: Some(1.0),
                        during_per_second: Some(0.0),
                        ..FailureModel::default()
                    },
                };
                let mut likelihoods = case.likelihoods.clone();
                let key = (own.schema, own.arguments.clone());
                likelihoods.actions.insert(key, certain);
                let expected = success(&case, &likelihoods, semantics, &order);
                assert_close(share.if_certain, expected, &case.text);
                actions += 1;
            }
            for fact in model.facts() {
                let mut likelihoods = case.likelihoods.clone();
                let never = PartialChange {
                    becomes_true: Some(0.0),
                    becomes_false: Some(0.0),
                    becomes_true_per_second: Some(0.0),
                    becomes_false_per_second: Some(0.0),
                };
                likelihoods.facts.insert(case.task.atom(fact), never);
                let expected = success(&case, &likelihoods, semantics, &order);
                match account.facts.iter().find(|share| share.fact == fact) {
                    Some(share) => {
                        assert_close(share.if_steady, expected, &case.text);
                        facts += 1;
                    }
                    None => assert!(expected <= account.probability + 1e-11, "{}", case.text),
                }
            }
        }
    }
    assert!(
        actions > 1000 && facts > 200,
        "{actions} actions, {facts} facts"
    );
}

#[test]
fn gain_of_retries_equals_sum_over_attempts() {
    let mut rng = ChaCha8Rng::seed_from_u64(13);
    let mut gains = 0;
    for _ in 0..40 {
        let case = case(&mut rng, TASTE);
        for semantics in BOTH {
            let order = order(&mut rng, &case);
            let model = model(&case, semantics);
            let account = LossAnalysis::of(&model, &case.circumstances, &order).unwrap();
            let starts = order.iter().enumerate().filter(|(_, node)| {
                matches!(
                    case.plan.nodes[node.index()],
                    Node::Start(_) | Node::Instant(_)
                )
            });
            for ((position, &node), share) in starts.zip(&account.actions) {
                let mut failed = worlds(&case, &case.likelihoods, semantics);
                for &before in &order[..position] {
                    failed.push(before);
                }
                let mut expected = 0.0;
                while failed.actions_probability() > 1e-14 {
                    let mut rest = failed.clone();
                    for &after in &order[position..] {
                        rest.push(after);
                    }
                    expected += rest.success_probability();
                    failed.fail(node);
                }
                let found = share.if_retried.unwrap();
                assert_close(found, expected, &case.text);
                gains += usize::from(found > account.probability + 1e-6);
            }
        }
    }
    assert!(gains > 30, "{gains} gains");
}

#[test]
fn gain_of_restarts_equals_sum_over_failed_ends() {
    let mut rng = ChaCha8Rng::seed_from_u64(15);
    let (mut gains, mut shares) = (0, 0);
    for round in 0..200 {
        let plain = case(&mut rng, TASTE);
        let mut case = with_failing_ends(&mut rng, plain);
        if round % 2 == 0 {
            case = failing_in_time(&mut rng, case);
        }
        for semantics in BOTH {
            let order = order(&mut rng, &case);
            let model = model(&case, semantics);
            let account = LossAnalysis::of(&model, &case.circumstances, &order).unwrap();
            for share in &account.actions {
                let place = |node| order.iter().position(|other| *other == node).unwrap();
                let start = place(model.start(share.instance));
                let end = place(model.end(share.instance));
                let schema = case.plan.instance(share.instance).action.schema;
                let success = case.likelihoods.schemas[&schema].failing.end.unwrap();
                let is_durative = start != end;
                assert_eq!(share.if_restarted.is_some(), is_durative && success < 1.0);
                let Some(found) = share.if_restarted else {
                    continue;
                };
                shares += 1;
                let mut failed = worlds(&case, &case.likelihoods, semantics);
                for &before in &order[..end] {
                    failed.push(before);
                }
                let mut expected = 0.0;
                for _ in 0..2000 {
                    let mut rest = failed.clone();
                    for &after in &order[end..] {
                        rest.push(after);
                    }
                    expected += rest.success_probability();
                    failed.fail(order[end]);
                    failed.push(order[start]);
                    if failed.actions_probability() < 1e-14 {
                        break;
                    }
                }
                assert_close(found, expected, &case.text);
                gains += usize::from(found > account.probability + 1e-6);
            }
        }
    }
    assert!(gains > 30 && shares > 200, "{gains} gains, {shares} shares");
}

#[test]
fn lattice_contains_all_orders() {
    let mut rng = ChaCha8Rng::seed_from_u64(14);
    let mut many = 0;
    for _ in 0..150 {
        let case = case(
            &mut rng,
            Taste {
                timed: false,
                couples: false,
                actions: 3,
                ..TASTE
            },
        );
        let semantics = Semantics::Paper;
        let search = OrderSearch::new(model(&case, semantics), SearchSettings::default());
        let lattice = search
            .lattice(&case.circumstances, LatticeLimits::default())
            .unwrap();
        let orders = reference::orders::all(&case, semantics, &search);
        // The lattice contains coupled happenings of one moment in one order only.
        if orders.iter().any(|order| order.has_joined) {
            continue;
        }
        assert_eq!(lattice.orders, orders.len(), "{}", case.text);
        let mut sets: BTreeMap<Vec<NodeId>, f64> = BTreeMap::new();
        let mut ends: BTreeMap<Vec<NodeId>, f64> = BTreeMap::new();
        let mut edges: BTreeMap<(Vec<NodeId>, NodeId), f64> = BTreeMap::new();
        let raise = |known: &mut f64, p: f64| *known = known.max(p);
        for order in &orders {
            let (order, p) = (&order.sequence, &order.probability);
            let set = |length: usize| {
                let mut set = order[..length].to_vec();
                set.sort_unstable();
                set
            };
            for length in 0..=order.len() {
                raise(sets.entry(set(length)).or_default(), *p);
                if let Some(&next) = order.get(length) {
                    raise(edges.entry((set(length), next)).or_default(), *p);
                }
            }
            raise(ends.entry(set(order.len())).or_default(), *p);
        }
        assert_eq!(lattice.nodes.len(), sets.len(), "{}", case.text);
        for node in &lattice.nodes {
            assert_close(node.best, sets[&node.done], &case.text);
            assert_eq!(node.ends.is_some(), ends.contains_key(&node.done));
            if let Some(own) = node.ends {
                assert_close(own, ends[&node.done], &case.text);
            }
        }
        assert_eq!(lattice.edges.len(), edges.len(), "{}", case.text);
        for edge in &lattice.edges {
            let from = lattice.nodes[edge.from].done.clone();
            assert_close(edge.best, edges[&(from, edge.node)], &case.text);
        }
        many += usize::from(orders.len() > 3);
    }
    assert!(many > 20, "{many} cases with many orders");
}

#[test]
fn a_lattice_beyond_its_limits_is_refused() {
    let domain = "(define (domain d) (:types lamp) (:predicates (lit ?l - lamp))
        (:durative-action light :parameters (?l - lamp) :duration (= ?duration 1)
          :effect (at end (lit ?l))))";
    let problem = "(define (problem p) (:domain d) (:objects a b c - lamp) (:init)
        (:goal (and (lit a) (lit b) (lit c))))";
    let plan = "0: (light a) [1]\n0: (light b) [1]\n0: (light c) [1]";
    let (task, plan) = shared::read_task(domain, problem, plan);
    let initial = elbowroom_probability::SearchState::initial(&task);
    let model = Model::new(task, plan, &Likelihoods::certain(), Semantics::Paper).unwrap();
    let search = OrderSearch::new(model, SearchSettings::default());
    let lattice = search.lattice(&initial, LatticeLimits::default()).unwrap();
    // Each lamp is off, being lit, or lit. Of the 6! / 2^3 orders, six have no schedule: with equal
    // durations, an action cannot start after one of two that started together has ended, and end
    // before the other.
    assert_eq!((lattice.nodes.len(), lattice.orders), (27, 84));
    let limits = LatticeLimits {
        nodes: 20,
        ..LatticeLimits::default()
    };
    assert_eq!(search.lattice(&initial, limits), Err(TooLarge::Nodes(20)));
    let limits = LatticeLimits {
        sequences: 50,
        ..LatticeLimits::default()
    };
    assert_eq!(
        search.lattice(&initial, limits),
        Err(TooLarge::Sequences(50))
    );
}

#[test]
fn loss_names_violated_condition() {
    let domain = "(define (domain d) (:predicates (whole) (lit))
        (:durative-action screw :parameters () :duration (= ?duration 5)
          :condition (over all (whole)) :effect (at end (lit))))";
    let problem = "(define (problem p) (:domain d) (:init (whole)) (:goal (lit)))";
    let (task, plan) = shared::read_task(domain, problem, "0: (screw) [5]");
    let mut likelihoods = Likelihoods::certain();
    likelihoods.defaults.start = Some(0.5);
    likelihoods.defaults.effect = Some(0.9);
    likelihoods.defaults.becomes_false = Some(0.25);
    let initial = elbowroom_probability::SearchState::initial(&task);
    let fact = |name| task.fact_named(name).unwrap();
    let (whole, lit) = (fact("(whole)"), fact("(lit)"));
    let model = Model::new(task, plan, &likelihoods, Semantics::Paper).unwrap();
    let order = [NodeId::from(1), NodeId::from(2)];
    let account = LossAnalysis::of(&model, &initial, order.as_slice()).unwrap();
    let instance = account.actions[0].instance;
    let fact = |fact, truth| LossCause::Fact { fact, truth };
    let found = account.losses.into_iter();
    let found: Vec<_> = found
        .map(|it| (it.position, it.reading, it.cause, it.mass))
        .collect();
    assert_eq!(
        found,
        [
            (Some(0), Reading::OnArrival, LossCause::Start, 0.5),
            (
                Some(0),
                Reading::Throughout(instance),
                fact(whole, true),
                0.125
            ),
            (
                Some(1),
                Reading::Goal,
                fact(lit, true),
                0.037_499_999_999_999_98
            ),
        ]
    );
}
