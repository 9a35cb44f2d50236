//! `PGen`, compared with the enumeration of all orders.

use crate::reference;
use crate::shared;
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::sync::Arc;

use crate::reference::random::{Case, Taste, case, failing_in_time, in_time, with_failing_ends};
use elbowroom_model::Task;
use elbowroom_model::ground::FactId;
use elbowroom_plan::{InstanceId, Node, NodeId, PartialOrderPlan};
use elbowroom_probability::dispatch::never_interrupt;
use elbowroom_probability::likelihoods;
use elbowroom_probability::search::SearchResult;
use elbowroom_probability::{
    Candidates, Likelihoods, Model, OrderSearch, PrunedNetwork, SearchSettings, SearchState,
    Semantics, TotalOrderPlan,
};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

struct Compared {
    /// The best order contains happenings that need each other at one moment.
    is_joined: bool,
    /// The best order has more than one happening.
    is_long: bool,
    /// An order was found although the search was interrupted at once.
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
        .best_order(&case.circumstances, &mut never_interrupt)
        .unwrap();
    let orders = reference::orders::all(case, semantics, &search);
    let best = reference::orders::best(&orders, true);
    // Spontaneous changes, or failures of effects, may help happenings that come at one moment
    // although they do not need each other.
    let apart = reference::orders::best(&orders, false).map_or(0.0, |(best, _)| best);
    let is_certain = case.likelihoods.defaults.effect == Some(1.0);
    let is_steady = is_certain
        && case.likelihoods.predicates.values().all(|flip| {
            let changes = [
                flip.becomes_true,
                flip.becomes_false,
                flip.becomes_true_per_second,
                flip.becomes_false_per_second,
            ];
            changes.into_iter().flatten().all(|p| p == 0.0)
        });
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
            let is_best = (p - best).abs() <= 1e-9 * best;
            let is_between = p <= best && p >= apart * (1.0 - 1e-9);
            assert!(
                is_best || !is_steady && is_between,
                "{p} is not {best}: {words}\n{order:?}"
            );
            if is_best {
                assert_eq!(order.sequence.len(), shortest, "{words}\n{order:?}");
            }
            // The properties of the returned order are correct.
            let mut network = PrunedNetwork::new(search.model(), &case.circumstances).unwrap();
            network.push_all(order.into()).unwrap();
            assert!((network.success_probability().unwrap() - p).abs() < 1e-15);
            let joined = &order.joined;
            let mut spelt_out = reference::Worlds::new(
                &case.task,
                &case.plan,
                &case.likelihoods,
                semantics,
                &case.circumstances,
            );
            for (at, &node) in order.sequence.iter().enumerate() {
                let is_open = joined.get(at + 1) == Some(&true);
                spelt_out.push_as(node, (joined[at], is_open));
            }
            assert!(
                (spelt_out.success_probability() - p).abs() < 1e-9,
                "{words}"
            );
        }
        (found, best) => panic!("{found:?} is not {best:?}: {words}"),
    }
    // A given first sequence changes nothing, unless the search is interrupted at once.
    let plain = OrderSearch::new(search.model().clone(), search.settings().clone());
    let nodes = 0..search.model().plan().nodes.len();
    let first: Vec<NodeId> = nodes.map(NodeId::from).collect();
    let mut begun = plain.beginning_with(first.clone());
    let hasty = begun.best_order(&case.circumstances, &mut |_| ControlFlow::Break(()));
    let hasty = hasty.unwrap().order;
    let patiently = begun
        .best_order(&case.circumstances, &mut never_interrupt)
        .unwrap();
    let probability =
        |order: &Option<TotalOrderPlan>| order.as_ref().map_or(0.0, |o| o.probability);
    let (hasty, patiently) = (probability(&hasty), probability(&patiently.order));
    let best_known = probability(&found.order);
    assert!(
        (patiently - best_known).abs() <= 1e-9 * best_known,
        "{words}"
    );
    assert!(hasty <= best_known * (1.0 + 1e-9), "{words}");
    // The second query is answered from the cache.
    let again = search
        .best_order(&case.circumstances, &mut never_interrupt)
        .unwrap();
    assert_eq!((again.order, again.sequences), (found.order.clone(), 0));
    Compared {
        is_joined: found.order.as_ref().is_some_and(TotalOrderPlan::has_joined),
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
fn found_order_is_optimal() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let (mut long, mut hasty) = (0, 0);
    let rounds = 700 / shared::one_in::<usize>(2);
    for round in 0..rounds {
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
        // The reference implementation determines nominal states from certain facts only.
        let running = std::mem::take(&mut case.circumstances.running);
        case.circumstances = SearchState::initial(&case.task);
        case.circumstances.running = running;
        compare(&case, settings);
    }
    assert!(
        3 * long > rounds,
        "{long} orders had more than one happening"
    );
    assert!(
        7 * hasty > rounds,
        "{hasty} orders were there from the beginning"
    );
}

/// Generates actions that make each other's conditions true, most of them at their start.
fn coupled(rng: &mut ChaCha8Rng, has_numbers: bool, is_certain: bool) -> Case {
    let mut domain =
        "(define (domain d) (:predicates (f0) (f1) (f2) (d0) (d1) (d2)) (:functions (n))"
            .to_owned();
    let mut plan = String::new();
    for action in 0..3 {
        let duration = rng.random_range(0..3);
        let mut fact = || rng.random_range(0..3);
        let (needs, other, gives, takes) = (fact(), fact(), fact(), fact());
        let over_all = match rng.random_range(0..6) {
            0 => String::new(),
            1 => format!("(over all (or (f{needs}) (f{other})))"),
            2 if has_numbers => "(over all (= (n) 1))".to_owned(),
            _ => format!("(over all (f{needs}))"),
        };
        let mut effects = String::new();
        for (when, share) in [("start", 0.8), ("end", 0.3)] {
            if rng.random_bool(share) {
                let _ = write!(effects, "(at {when} (f{gives}))");
            }
        }
        if rng.random_bool(0.5) {
            let _ = write!(effects, "(at end (not (f{takes})))");
        }
        if has_numbers {
            let change = ["increase", "decrease"][rng.random_range(0..2)];
            let when = ["start", "end"][rng.random_range(0..2)];
            let _ = write!(effects, "(at {when} ({change} (n) 1))");
        }
        let _ = write!(
            domain,
            "(:durative-action a{action} :parameters () :duration (= ?duration {duration})
               :condition (and {over_all}) :effect (and {effects} (at end (d{action}))))"
        );
        let _ = writeln!(plan, "0: (a{action}) [{duration}]");
    }
    domain.push(')');
    let timed = if rng.random_bool(0.2) {
        "(at 1 (f0))"
    } else {
        ""
    };
    let problem = format!(
        "(define (problem p) (:domain d) (:init (= (n) 1) {timed}) (:goal (and (d0) (d1))))"
    );
    let (task, plan) = shared::read_task(&domain, &problem, &plan);
    let effect = if is_certain { "1.0" } else { "0.9" };
    let text = format!(
        "format = \"elbowroom-likelihoods\"\nversion = 1\n[defaults]\nbecomes_true = 0.0\nbecomes_false = 0.0\n\
         start = 0.8\neffect = {effect}\n[actions.a0]\nend = 0.7\n"
    );
    Case {
        text: format!("{domain}\n{problem}"),
        likelihoods: likelihoods::read(text.as_bytes(), &task).unwrap(),
        circumstances: SearchState::initial(&task),
        task: Arc::new(task),
        plan,
    }
}

/// Happenings of one moment that need each other, in worlds where facts do not change by themselves.
#[test]
fn found_order_is_optimal_with_coupled_happenings() {
    let mut rng = ChaCha8Rng::seed_from_u64(21);
    let mut joined = 0;
    for round in 0..600 {
        let case = coupled(&mut rng, round % 3 == 0, round % 4 > 0);
        let settings = SearchSettings {
            keeps_interference: round % 2 == 0,
            candidates: Candidates::Working,
        };
        let semantics = [Semantics::Paper, Semantics::World][round / 2 % 2];
        joined += usize::from(compare(&case, semantics, settings).is_joined);
    }
    assert!(joined > 10, "{joined} orders with happenings at one moment");
}

#[test]
fn found_order_is_optimal_with_timed_changes() {
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
fn found_order_is_optimal_with_failing_actions() {
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
fn timed_changes_keep_actions_parallel() {
    let (task, plan) = lamps(3);
    let text = "format = \"elbowroom-likelihoods\"\nversion = 1
        [defaults]\nbecomes_true = 0.0\nbecomes_false = 0.0\nstart = 1.0\neffect = 1.0
        [facts.whole]\nbecomes_false_per_second = 0.1\n";
    let likelihoods = likelihoods::read(text.as_bytes(), &task).unwrap();
    let found = search((task, plan), &likelihoods).order.unwrap();
    // All three at once take one second each. One after the other, the waiting times add up to six
    // seconds.
    assert!(
        (found.probability - (-0.3_f64).exp()).abs() < 1e-12,
        "{found:?}"
    );
}

/// Lamps of one kind that can be screwed in in any order, also simultaneously.
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

/// Likelihoods that make all properties of lamps uncertain.
fn frail(task: &Task) -> Likelihoods {
    let text = "format = \"elbowroom-likelihoods\"\nversion = 1
        [defaults]\nbecomes_true = 0.02\nbecomes_false = 0.03\nstart = 0.8\neffect = 0.9\n";
    likelihoods::read(text.as_bytes(), task).unwrap()
}

/// Returns the best order, and the number of examined sequences.
fn search((task, plan): (Task, PartialOrderPlan), likelihoods: &Likelihoods) -> SearchResult {
    let initial = SearchState::initial(&task);
    let model = Model::new(Arc::new(task), plan, likelihoods, Semantics::Paper).unwrap();
    let mut search = OrderSearch::new(model, SearchSettings::default());
    search.best_order(&initial, &mut never_interrupt).unwrap()
}

/// Without uncertainty, every order is as likely and as long as the first one.
#[test]
fn certain_world_is_not_searched() {
    let found = search(lamps(12), &Likelihoods::certain());
    let order = found.order.unwrap();
    assert_eq!((order.probability, order.sequence.len()), (1.0, 24));
    assert!(found.sequences <= 25, "{} sequences", found.sequences);
}

/// Ten lamps of one kind have 10! equally likely orders.
#[test]
fn many_instances_of_one_kind_are_searched_to_the_end() {
    let ten = lamps(10);
    let likelihoods = frail(&ten.0);
    let found = search(ten, &likelihoods);
    assert_eq!(found.order.unwrap().sequence.len(), 20);
    assert!(found.sequences < 2_000, "{} sequences", found.sequences);
}

/// Of orders that differ only in the choice of lamps, one is tried, and it is as good as the
/// others. The same holds if one of the three lamps may be broken.
#[test]
fn one_of_interchangeable_instances_is_tried() {
    for candidates in [Candidates::Working, Candidates::All] {
        for broken in [None, Some("(whole l1)")] {
            // The reference implementation determines nominal states from certain facts only.
            if broken.is_some() && candidates == Candidates::Working {
                continue;
            }
            let (task, plan) = lamps(3);
            let mut circumstances = SearchState::initial(&task);
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

/// With other numbers, the end would delete the goal's fact, and the start would make an over-all
/// condition false.
#[test]
fn effects_that_numbers_prevent_do_not_exclude_an_order() {
    for (effect, over_all) in [
        ("(when (at end (<= (n) 0)) (at end (not (p))))", "(p)"),
        ("(when (at start (<= (n) 0)) (at end (not (p))))", "(p)"),
        ("(when (at start (<= (n) 0)) (at start (not (q))))", "(q)"),
        ("(when (at start (<= (n) 0)) (at start (r)))", "(not (r))"),
    ] {
        let domain = format!(
            "(define (domain d) (:requirements :adl :durative-actions :numeric-fluents)
               (:predicates (p) (q) (r)) (:functions (n))
               (:durative-action act :parameters () :duration (= ?duration 2)
                 :condition (over all {over_all}) :effect (and (at start (p)) {effect})))"
        );
        let problem =
            "(define (problem x) (:domain d) (:init (q) (= (n) 5)) (:goal (and (p) (q))))";
        let found = search(
            shared::read_task(&domain, problem, "0: (act) [2]"),
            &Likelihoods::certain(),
        );
        let order = found
            .order
            .unwrap_or_else(|| panic!("no order with {effect}"));
        assert!((order.probability - 1.0).abs() < 1e-12, "{effect}");
    }
}

#[test]
fn comparison_of_undefined_fluent_does_not_hold() {
    let orders = |condition: &str| {
        let domain = format!(
            "(define (domain d) (:requirements :adl :durative-actions :numeric-fluents)
               (:predicates (p) (q)) (:functions (n) (u))
               (:durative-action act :parameters () :duration (= ?duration 2)
                 :condition (at start {condition}) :effect (and (at end (q)) (increase (n) (* #t 1))))
               (:durative-action next :parameters () :duration (= ?duration 1)
                 :condition (at end {condition}) :effect (at end (p))))"
        );
        let problem = "(define (problem x) (:domain d) (:init (= (n) 5)) (:goal (and (p) (q))))";
        let found = search(
            shared::read_task(&domain, problem, "0: (act) [2]\n1: (next) [1]"),
            &Likelihoods::certain(),
        );
        found.order.is_some()
    };
    for condition in [
        "(> (u) 3)",
        "(not (> (u) 3))",
        "(> (n) (u))",
        "(or (> (u) 3) (< (n) 2))",
        "(and (> (n) 1) (not (and (> (n) 3) (> (u) 3))))",
        "(> (/ 1 (- (n) (n))) 0)",
    ] {
        assert!(!orders(condition), "{condition}");
    }
    for condition in [
        "(or (> (u) 3) (> (n) 2))",
        "(not (and (> (u) 3) (< (n) 3)))",
    ] {
        assert!(orders(condition), "{condition}");
    }
}

#[test]
fn duration_bounds_decide_on_orders() {
    // The duration of the drive is the remaining time: three seconds, after the stop that takes two
    // of five.
    let domain = "(define (domain d) (:requirements :adl :durative-actions :numeric-fluents)
         (:predicates (p) (q)) (:functions (left))
         (:durative-action stop :parameters () :duration (= ?duration 1)
           :effect (and (at end (p)) (at end (decrease (left) 2))))
         (:durative-action drive :parameters () :duration (= ?duration (left)) :effect (at end (q))))";
    let problem = "(define (problem x) (:domain d) (:init (= (left) 5)) (:goal (and (p) (q))))";
    let best = |plan: &str| {
        let (task, plan) = shared::read_task(domain, problem, plan);
        let nodes = plan.nodes.clone();
        let found = search((task, plan), &Likelihoods::certain());
        let sequence = found.order.expect("an order").sequence;
        let nodes = sequence.iter().map(|node| nodes[node.index()]);
        nodes.collect::<Vec<_>>()
    };
    let [first, second] = [0, 1].map(InstanceId);
    let one_by_one = [
        Node::Start(first),
        Node::End(first),
        Node::Start(second),
        Node::End(second),
    ];
    assert_eq!(best("0: (stop) [1]\n2: (drive) [3]"), one_by_one);
    let order = best("0: (drive) [5]\n6: (stop) [1]");
    let place = |node: Node| order.iter().position(|own| *own == node);
    assert!(place(Node::Start(first)) < place(Node::End(second)));
}
