//! Trajectory constraints of a plan hold in every schedule of its network. The validator checks
//! random schedules.

#![allow(clippy::unwrap_used, reason = "the helpers of a test are part of it")]

use crate::shared;
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom::pipeline;
use elbowroom_envelope::{Guarantee, Oracle, irr};
use elbowroom_model::validate::Settings;
use elbowroom_model::{Task, Verdict, validate};
use elbowroom_num::Rational;
use elbowroom_pddl::{Source, read_plan, read_problem};
use elbowroom_plan::deorder::{DeorderError, deorder};
use elbowroom_plan::{NodeId, Reason, Schedule, StnPlan, Valuation, network_node};
use elbowroom_stn::{ConsistentNetwork, Constraint};
use rand::seq::{IndexedRandom, SliceRandom};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// All forms of constraints, on conditions over three facts.
const FORMS: [&str; 12] = [
    "(at end (or (p) (q)))",
    "(always (or (p) (not (q)) (r)))",
    "(sometime (and (p) (q)))",
    "(sometime (and (p) (q) (not (r))))",
    "(within {t} (and (p) (r)))",
    "(at-most-once (and (p) (q)))",
    "(sometime-after (p) (and (q) (r)))",
    "(sometime-before (and (p) (q)) (r))",
    "(always-within {t} (p) (or (q) (r)))",
    "(always-within {t} (and (p) (q)) (r))",
    "(hold-during {t} {u} (or (p) (q)))",
    "(hold-after {t} (or (p) (not (r))))",
];

/// Returns a problem with one constraint and actions that each change some facts at their start and
/// end, and a plan for it. The executor chooses durations, or the domain fixes them to those of the
/// plan, so that the world chooses them.
fn case(form: &str, is_fixed: bool, rng: &mut ChaCha8Rng) -> (Task, String) {
    let mut domain = "(define (domain d) (:predicates (p) (q) (r))\n".to_owned();
    let mut plan = String::new();
    for action in 0..4 {
        let mut effect = String::new();
        for when in ["start", "end"] {
            for fact in ["(p)", "(q)", "(r)"] {
                match rng.random_range(0..7) {
                    0 => write!(effect, "(at {when} {fact}) ").unwrap(),
                    1 => write!(effect, "(at {when} (not {fact})) ").unwrap(),
                    _ => {}
                }
            }
        }
        let (start, duration) = (rng.random_range(1..13), rng.random_range(1..8));
        let durations = if is_fixed {
            format!("(= ?duration {duration})")
        } else {
            "(and (>= ?duration 1) (<= ?duration 9))".to_owned()
        };
        writeln!(
            domain,
            "(:durative-action a{action} :parameters () :condition (and) :effect (and {effect})
               :duration {durations})"
        )
        .unwrap();
        writeln!(plan, "{start}.{action}: (a{action}) [{duration}]").unwrap();
    }
    let begin = rng.random_range(0..12);
    let form = form
        .replace("{t}", &begin.to_string())
        .replace("{u}", &(begin + rng.random_range(1..6)).to_string());
    let timed = rng.random_range(1..20);
    let initial = ["", "(p)", "(q) (r)", "(p) (r)"].choose(rng).unwrap();
    let problem = format!(
        "(define (problem p) (:domain d) (:init {initial} (at {timed}.5 (r))) (:goal (and))
           (:constraints {form}))"
    );
    let (domain, problem) = (
        Source::new("domain", domain + ")"),
        Source::new("problem", problem),
    );
    (Task::new(read_problem(&domain, &problem).unwrap().0), plan)
}

/// Draws a schedule: in random order, each node gets an end of its window or a time within.
fn draw(plan: &StnPlan, rng: &mut ChaCha8Rng) -> Schedule {
    let zero = network_node(NodeId::ZERO);
    let network = ConsistentNetwork::try_from(plan.network(&Valuation::default()));
    let mut network = network.expect("the plan has schedules");
    let mut nodes: Vec<NodeId> = plan.nodes().map(|(node, _)| node).skip(1).collect();
    nodes.shuffle(rng);
    for node in nodes {
        let node = network_node(node);
        let earliest = -network.distance(node, zero).unwrap();
        let latest = network.distance(zero, node);
        let latest = latest.unwrap_or_else(|| &earliest + Rational::from(30));
        let share = Rational::new(*[0, 0, 3, 7, 10, 10].choose(rng).unwrap(), 10);
        let time = &earliest + (latest - &earliest) * share;
        network
            .add(Constraint::at_least(zero, node, time.clone()))
            .unwrap();
        network.add(Constraint::at_most(zero, node, time)).unwrap();
    }
    network.earliest_schedule(zero).into()
}

#[test]
fn trajectory_constraint_holds_in_every_schedule() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut needed = 0;
    for form in FORMS {
        let mut valid = 0;
        for _ in 0..400 {
            let (task, text) = case(form, false, &mut rng);
            let (plan, _) = read_plan(&Source::new("plan", text.clone()), &task).unwrap();
            let judge = |plan: &_| validate(&task, plan, &Settings::default());
            if valid == 25 || !judge(&plan).is_valid() {
                continue;
            }
            valid += 1;
            let deordered = deorder(&task, &plan).unwrap();
            assert!(judge(&deordered.plan.scheduled(&deordered.nominal)).is_valid());
            let mut free = deordered.plan.clone();
            free.constraints
                .retain(|constraint| constraint.reason != Reason::TrajectoryConstraint);
            for _ in 0..4 {
                let schedule = draw(&deordered.plan, &mut rng);
                if let Verdict::Invalid(why) = judge(&deordered.plan.scheduled(&schedule)) {
                    panic!("{form}\n{text}{why}");
                }
                // It would be invalid without the constraints between happenings.
                let schedule = draw(&free, &mut rng);
                needed += usize::from(!judge(&free.scheduled(&schedule)).is_valid());
            }
        }
        assert!(valid > 5, "{form}: {valid} valid plans");
    }
    assert!(needed > 100, "{needed}");
}

/// The constraint holds for all durations in the box, and for all their schedules.
#[test]
fn trajectory_constraint_holds_throughout_the_box() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut broken = 0;
    for form in FORMS {
        let (mut boxes, mut is_wide) = (0, false);
        for _ in 0..200 {
            let (task, text) = case(form, true, &mut rng);
            let (plan, _) = read_plan(&Source::new("plan", text.clone()), &task).unwrap();
            if boxes == 6 || !validate(&task, &plan, &Settings::default()).is_valid() {
                continue;
            }
            let freed = pipeline::free(&task, &plan).unwrap();
            let plan = Arc::new(pipeline::open(&task, freed, &[]).unwrap());
            let task = Arc::new(task);
            let mut oracle = Oracle::new(&task, &plan, Guarantee::Weak).unwrap();
            let settings = elbowroom_envelope::Settings::default();
            let run = irr(&mut oracle, &settings, &mut |_| ControlFlow::Continue(()));
            let envelope = run.unwrap().envelope.unwrap();
            boxes += 1;
            is_wide |= envelope
                .intervals()
                .iter()
                .any(|one| one.width() != Some(Rational::ZERO));
            for _ in 0..12 {
                let valuation = shared::draw::valuation(&envelope, &mut rng);
                let fixed = plan.plan.at(&valuation);
                let schedule = shared::draw::schedule(&plan.plan, &valuation, &mut rng);
                let schedule = schedule.unwrap_or_else(|| panic!("{form}\n{text}"));
                let verdict = validate(&task, &fixed.scheduled(&schedule), &Settings::default());
                assert!(verdict.is_valid(), "{form}\n{text}{verdict:?}");
                // Some would be invalid without the constraints between happenings.
                let mut loose = fixed.clone();
                loose
                    .constraints
                    .retain(|one| one.reason != Reason::TrajectoryConstraint);
                if let Some(schedule) = shared::draw::schedule(&loose, &valuation, &mut rng) {
                    let verdict =
                        validate(&task, &loose.scheduled(&schedule), &Settings::default());
                    broken += usize::from(!verdict.is_valid());
                }
            }
        }
        assert!(boxes > 3 && is_wide, "{form}: {boxes} boxes");
    }
    assert!(broken > 100, "{broken}");
}

#[test]
fn inexpressible_trajectory_constraint_is_rejected_with_its_name() {
    let refused = |functions: &str, effect: &str, constraint: &str| {
        let domain = format!(
            "(define (domain d) (:predicates (p) (q)) {functions}
               (:derived (both) (and (p) (q)))
               (:action a :parameters () :precondition (and) :effect {effect}))"
        )
        .replace("(q))", "(q) (both))");
        let problem = format!(
            "(define (problem p) (:domain d) (:init (q)) (:goal (and)) (:constraints {constraint}))"
        );
        let (domain, problem) = (
            Source::new("domain", domain),
            Source::new("problem", problem),
        );
        let task = Task::new(read_problem(&domain, &problem).unwrap().0);
        let (plan, _) = read_plan(&Source::new("plan", "1: (a)"), &task).unwrap();
        match deorder(&task, &plan) {
            Err(DeorderError::Unsupported { feature }) => feature,
            other => panic!("{other:?}"),
        }
    };
    let functions = "(:functions (x))";
    assert!(refused(functions, "(p)", "(at-most-once (> (x) 1))").contains("on numbers"));
    assert!(refused("", "(p)", "(sometime (both))").contains("derived facts"));
    assert!(refused("", "(when (q) (p))", "(sometime (p))").contains("conditional effects"));
}
