//! Small plans of kinds with frequent errors in guarantees. The tests cover the validator,
//! deordering, the box check and the nominal schedule for any order of the lines of the plan.

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::kinds::{Kind, kinds};
use elbowroom::envelope::{self, Guarantee, Oracle, StopReason, irr};
use elbowroom::model::{Task, TimeTriggeredPlan, Verdict, validate};
use elbowroom::num::Rational;
use elbowroom::plan::{
    BoxEnd, DecoupledEnvelope, NodeId, ParametrizedPlan, Schedule, Valuation, format, network_node,
};
use elbowroom::stn::ConsistentNetwork;
use elbowroom::{parse_box, pipeline};
use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn validate_plan(task: &Task, plan: &TimeTriggeredPlan) -> Verdict {
    validate(task, plan, &elbowroom::model::validate::Settings::default())
}

/// Returns the plan with all durations as parameters, and its nominal schedule.
fn opened(task: &Task, plan: &TimeTriggeredPlan) -> (Arc<ParametrizedPlan>, Schedule) {
    let freed = pipeline::free(task, plan).expect("a valid plan");
    let nominal = freed.nominal.clone();
    let open = pipeline::open(task, freed, &[]).expect("durations");
    (Arc::new(open), nominal)
}

fn is_inside(kind: &Kind, guarantee: Guarantee, text: &str) -> bool {
    let (task, plan) = kind.read();
    let (open, _) = opened(&task, &plan);
    let mut oracle = Oracle::new(&task, &open, guarantee).expect("within reach");
    let envelope = parse_box(text, &open).expect("a box of this plan");
    oracle.objection(&envelope).expect("few cases").is_none()
}

/// Returns some schedules for values in the box: at its corners and inside, each as early or as
/// late as possible, or with some random times.
fn schedules(
    open: &ParametrizedPlan,
    envelope: &DecoupledEnvelope,
    rng: &mut ChaCha8Rng,
) -> Vec<TimeTriggeredPlan> {
    let zero = network_node(NodeId::ZERO);
    let draw = |rng: &mut ChaCha8Rng| {
        let shares = [0, 0, 1, 3, 6, 6];
        let share = |rng: &mut ChaCha8Rng| Rational::new(shares[rng.random_range(0..6)], 6);
        let intervals = envelope.intervals().iter();
        let values: Valuation = intervals
            .map(|interval| {
                let lower = interval.lower.value().expect("a finite box");
                let upper = interval.upper.value().expect("a finite box");
                lower + (upper - lower) * share(rng)
            })
            .collect();
        let network = ConsistentNetwork::try_from(open.plan.network(&values));
        let mut network = network.expect("a schedule for all values in the box");
        let mut nodes: Vec<_> = open.plan.nodes().skip(1).map(|(node, _)| node).collect();
        nodes.shuffle(rng);
        for node in nodes.into_iter().map(network_node) {
            let earliest = -network.distance(node, zero).expect("not before zero");
            let latest = network.distance(zero, node);
            let latest = latest.unwrap_or_else(|| &earliest + Rational::from(7));
            let time = &earliest + (latest - &earliest) * share(rng);
            for constraint in [
                elbowroom::stn::Constraint::at_least(zero, node, time.clone()),
                elbowroom::stn::Constraint::at_most(zero, node, time),
            ] {
                network.add(constraint).expect("in its window");
            }
        }
        let schedule = network.earliest_schedule(zero).into();
        open.plan.at(&values).scheduled(&schedule)
    };
    (0..40).map(|_| draw(rng)).collect()
}

#[test]
fn the_plans_are_valid_and_so_is_their_nominal_schedule() {
    for kind in kinds() {
        let (task, plan) = kind.read();
        assert!(validate_plan(&task, &plan).is_valid(), "{}", kind.name);
        let freed = pipeline::free(&task, &plan).expect("a valid plan");
        let nominal = freed.nominal.clone();
        let closed = Arc::new(pipeline::without_parameters(&task, freed));
        let schedule = elbowroom::stn::Schedule::from(nominal);
        assert!(
            schedule.holds_in(&closed.plan.network(&Valuation::default())),
            "{}",
            kind.name
        );
        let mut oracle = Oracle::new(&task, &closed, Guarantee::Weak).expect("within reach");
        let objection = oracle.objection(&DecoupledEnvelope::point(&Valuation::default()));
        assert_eq!(objection, Ok(None), "{}", kind.name);
    }
}

#[test]
fn box_checks_match_hand_computation() {
    for kind in kinds() {
        for (boxes, expected) in [(kind.inside, true), (kind.outside, false)] {
            for text in boxes {
                let found = is_inside(&kind, Guarantee::Weak, text);
                assert_eq!(found, expected, "{}: {text}", kind.name);
            }
        }
    }
}

#[test]
fn controllability_matches_hand_computation() {
    for kind in kinds() {
        for (boxes, expected) in [(kind.dynamic, true), (kind.not_dynamic, false)] {
            for text in boxes {
                assert!(is_inside(&kind, Guarantee::Weak, text), "{}", kind.name);
                let found = is_inside(&kind, Guarantee::Dynamic, text);
                assert_eq!(found, expected, "{}: {text}", kind.name);
            }
        }
    }
}

#[test]
fn validator_accepts_schedules_of_boxes_inside() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    for kind in kinds() {
        let (task, plan) = kind.read();
        let (open, _) = opened(&task, &plan);
        for text in kind.inside.iter().chain(kind.dynamic) {
            let envelope = parse_box(text, &open).expect("a box of this plan");
            for schedule in schedules(&open, &envelope, &mut rng) {
                let verdict = validate_plan(&task, &schedule);
                let violation = verdict.violation().map(ToString::to_string);
                assert_eq!(violation, None, "{}: {text}: {schedule:?}", kind.name);
            }
        }
    }
}

#[test]
fn envelope_of_each_kind_is_valid_and_contains_the_plan() {
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    for kind in kinds() {
        let (task, plan) = kind.read();
        let (open, nominal) = opened(&task, &plan);
        let at_nominal = open.plan.network(&open.nominal());
        assert!(elbowroom::stn::Schedule::from(nominal).holds_in(&at_nominal));
        let mut oracle = Oracle::new(&task, &open, Guarantee::Weak).expect("within reach");
        let go_on = &mut |_: Option<&envelope::Widening<'_>>| ControlFlow::Continue(());
        let run = irr(&mut oracle, &envelope::Settings::default(), go_on).expect("few cases");
        assert_eq!(run.stop, StopReason::Converged, "{}", kind.name);
        let mut found = run.envelope.expect("it works as planned");
        for (index, interval) in found.clone().intervals().iter().enumerate() {
            let far = &interval.lower.value().cloned().unwrap_or_default() + Rational::from(60);
            let near = interval.intersection(&elbowroom::num::Interval::at_most(far));
            found = found.with_interval(index.into(), near);
        }
        for schedule in schedules(&open, &found, &mut rng) {
            assert!(
                validate_plan(&task, &schedule).is_valid(),
                "{}: {schedule:?}",
                kind.name
            );
        }
    }
}

/// Widens one end after the other. An oracle with a cache agrees with one without knowledge of
/// earlier boxes.
#[test]
fn caching_oracle_agrees_with_uncached_oracle() {
    let mut rng = ChaCha8Rng::seed_from_u64(13);
    let mut counts = [0; 2];
    for (kind, guarantee) in kinds()
        .into_iter()
        .flat_map(|kind| Guarantee::ALL.map(|guarantee| (kind, guarantee)))
    {
        let (task, plan) = kind.read();
        let (open, _) = opened(&task, &plan);
        let new = || Oracle::new(&task, &open, guarantee).expect("within reach");
        for _ in 0..4 {
            let mut oracle = new();
            let point = DecoupledEnvelope::point(&open.nominal());
            if oracle.start(&point).expect("few cases").is_some() {
                continue;
            }
            for _ in 0..15 {
                let accepted = oracle.accepted().expect("it started").clone();
                let ends: Vec<BoxEnd> = BoxEnd::all(open.parameters.len()).collect();
                let end = ends[rng.random_range(0..ends.len())];
                let Some(reach) = end.reach(&accepted) else {
                    continue;
                };
                let step =
                    Rational::new(rng.random_range(1..40), [1, 3, 8][rng.random_range(0..3)]);
                let reach = rng.random_bool(0.9).then(|| reach + step);
                let wider = end.with_reach(&accepted, reach.clone());
                let expected = new().objection(&wider).expect("few cases").is_none();
                let found = oracle.try_reach(end, reach).expect("few cases");
                assert_eq!(found, expected, "{}, {guarantee}: {wider:?}", kind.name);
                counts[usize::from(found)] += 1;
            }
        }
    }
    assert!(counts.iter().all(|&count| count > 200), "{counts:?}");
}

/// Returns all orders of the lines of a plan.
fn orders(lines: &[&str]) -> Vec<String> {
    if lines.is_empty() {
        return vec![String::new()];
    }
    let mut all = Vec::new();
    for index in 0..lines.len() {
        let mut rest = lines.to_vec();
        let first = rest.remove(index);
        all.extend(
            orders(&rest)
                .into_iter()
                .map(|rest| format!("{first}\n{rest}")),
        );
    }
    all
}

/// Returns the names of the actions, in the order of their numbers after deordering. (Facts are
/// numbered in the order of their first use.)
fn names(plan: &ParametrizedPlan) -> Vec<&str> {
    let instances = plan.plan.instances.iter();
    instances
        .map(|instance| instance.action.name.as_str())
        .collect()
}

#[test]
fn the_order_of_the_lines_of_a_plan_does_not_matter() {
    for kind in kinds() {
        let (task, plan) = kind.read();
        let (open, nominal) = opened(&task, &plan);
        let envelope = pipeline::robust_plan(&task, &plan, &pipeline::Settings::default());
        let envelope = envelope.expect("within reach").envelope;
        let lines: Vec<&str> = kind.plan.lines().collect();
        for text in orders(&lines) {
            let (task, plan) = kind.read_with(&text);
            assert!(
                validate_plan(&task, &plan).is_valid(),
                "{}:\n{text}",
                kind.name
            );
            let (found, times) = opened(&task, &plan);
            let here = format!("{}:\n{text}", kind.name);
            assert_eq!(found.plan.constraints, open.plan.constraints, "{here}");
            assert_eq!(found.parameters, open.parameters, "{here}");
            assert_eq!((names(&found), &times), (names(&open), &nominal), "{here}");
            let found = pipeline::robust_plan(&task, &plan, &pipeline::Settings::default());
            let found = found.expect("within reach").envelope;
            assert_eq!(found, envelope, "{}:\n{text}", kind.name);
        }
    }
}

#[test]
fn independent_ends_are_not_coupled() {
    for kind in kinds() {
        let (task, plan) = kind.read();
        let (open, _) = opened(&task, &plan);
        // Without the nominal durations, no two ends coincide in all schedules.
        let mut network = elbowroom::stn::Network::with_nodes(open.plan.nodes.len());
        for constraint in &open.plan.constraints {
            let (from, to) = (network_node(constraint.from), network_node(constraint.to));
            if let elbowroom::plan::Bound::Finite(lower) = &constraint.lower {
                network.add(elbowroom::stn::Constraint::at_least(
                    from,
                    to,
                    lower.clone(),
                ));
            }
            if let elbowroom::plan::Bound::Finite(upper) = &constraint.upper {
                network.add(elbowroom::stn::Constraint::at_most(from, to, upper.clone()));
            }
        }
        let network = ConsistentNetwork::try_from(network).expect("a schedule");
        let ends: Vec<NodeId> = open
            .plan
            .nodes()
            .filter(|(_, what)| matches!(what, elbowroom::plan::Node::End(_)))
            .map(|(node, _)| node)
            .collect();
        for &first in &ends {
            for &second in &ends {
                let there = network.distance(network_node(first), network_node(second));
                let back = network.distance(network_node(second), network_node(first));
                let is_tied = first != second && there.zip(back).is_some_and(|(a, b)| a == -b);
                assert!(!is_tied, "{}", kind.name);
            }
        }
    }
}

/// Returns a plan with two parallel chains of actions. Corresponding actions have the same
/// parameter as their duration, so both chains end together. To prove that, a box must be split at
/// every duration.
fn twin_chains(count: usize) -> String {
    let mut lines = Vec::new();
    for index in 0..count {
        lines.push(format!("parameter p{index} default 10 lb 5 ub 20;"));
        for chain in ["a", "b"] {
            lines.push(format!("durative-action instance {chain}{index} : (tick);"));
        }
    }
    for chain in ["a", "b"] {
        lines.push(format!("c: {chain}0.start - .zero in [0, 0];"));
        for index in 0..count {
            let own = format!("{chain}{index}");
            lines.push(format!(
                "c: {own}.end - {own}.start in [p{index}, p{index}];"
            ));
            if index > 0 {
                let before = format!("{chain}{}", index - 1);
                lines.push(format!("c: {own}.start - {before}.end in [0, 0];"));
            }
        }
    }
    let last = count - 1;
    lines.push(format!("c: b{last}.end - a{last}.end in [-1, 1];"));
    lines.join("\n")
}

#[test]
fn partial_result_is_kept_after_too_many_cases() {
    const DOMAIN: &str = "(define (domain clocks)
  (:requirements :durative-actions)
  (:predicates (ticked))
  (:durative-action tick :parameters () :duration (>= ?duration 0)
    :condition () :effect (at end (ticked))))";
    const PROBLEM: &str = "(define (problem two) (:domain clocks) (:init) (:goal (ticked)))";
    let source = |text: &str| elbowroom::pddl::Source::new("clocks", text);
    let (problem, _) =
        elbowroom::pddl::read_problem(&source(DOMAIN), &source(PROBLEM)).expect("a problem");
    let task = Task::new(problem);
    let plan = format::read(twin_chains(20).as_bytes(), &task).expect("a plan");
    let (task, plan) = (Arc::new(task), Arc::new(plan));
    let mut oracle = Oracle::new(&task, &plan, Guarantee::Weak).expect("within reach");
    let go_on = &mut |_: Option<&envelope::Widening<'_>>| ControlFlow::Continue(());
    let run = irr(&mut oracle, &envelope::Settings::default(), go_on).expect("an answer");
    assert_eq!(run.stop, StopReason::Undecided);
    assert!(run.widenings > 5, "{}", run.widenings);
    let found = run.envelope.expect("it works as planned");
    assert_eq!(
        oracle.objection(&found),
        Ok(None),
        "what was kept is inside"
    );
}

#[test]
fn rate_of_continuous_decrease_can_be_left_open() {
    let all = kinds();
    let jobs = all.iter().find(|kind| kind.domain.contains("workshop"));
    let (task, plan) = jobs.expect("the jobs with a battery").read();
    let opened = |spec: &str| {
        let freed = pipeline::free(&task, &plan).expect("a valid plan");
        let spec = spec.parse().expect("a specification");
        pipeline::open(&task, freed, &[spec])
    };
    let open = Arc::new(opened("constant work charge shared").expect("a number"));
    assert_eq!(open.nominal(), Valuation::new(vec![Rational::ONE]));
    assert!(opened("constant work charge 1 shared").is_ok());
    assert!(opened("constant work charge -1 shared").is_err());
    // Three jobs of 10 each, and a budget of 39.
    let mut oracle = Oracle::new(&task, &open, Guarantee::Weak).expect("within reach");
    for (text, expected) in [("[0,13/10]", true), ("[1/2,1301/1000]", false)] {
        let name = &open.parameters[0].name;
        let envelope = parse_box(&format!("{name}={text}"), &open).expect("a box");
        let objection = oracle.objection(&envelope).expect("few cases");
        assert_eq!(objection.is_none(), expected, "{text}");
    }
}
