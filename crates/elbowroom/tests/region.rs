//! The region has a point exactly if the box check accepts it.

#![allow(clippy::print_stdout, reason = "counts and times are worth seeing")]

mod shared;

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use elbowroom::AnyPlan;
use elbowroom::answers::region::{RegionFinding, region};
use elbowroom::answers::{EnvelopeRequest, RegionOutcome, Unwatched};
use elbowroom::envelope::{Guarantee, Oracle};
use elbowroom::model::Task;
use elbowroom::num::{Interval, Rational};
use elbowroom::pddl::{Source, read_plan, read_problem};
use elbowroom::plan::{DecoupledEnvelope, ParameterId, ParametrizedPlan, format};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use shared::case::Case;
use shared::draw;
use shared::instances::{figure_3, figure_4};

/// A case of this repository.
fn case(name: &str) -> (Arc<Task>, AnyPlan) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../cases")
        .join(name);
    let source = |file: &str| {
        let text = std::fs::read_to_string(folder.join(file)).expect("a file of the case");
        Source::new(file, text)
    };
    let read = read_problem(&source("domain.pddl"), &source("problem.pddl"));
    let task = Arc::new(Task::new(read.expect("a case without mistakes").0));
    let plan = read_plan(&source("plan.plan"), &task);
    (task, plan.expect("a plan without mistakes").0.into())
}

fn of(task: &Arc<Task>, plan: AnyPlan) -> RegionOutcome {
    region(&EnvelopeRequest::new(task, plan), &mut Unwatched).expect("within exact reasoning")
}

/// Values around the nominal ones, a share of each time on round numbers.
fn around(plan: &ParametrizedPlan) -> DecoupledEnvelope {
    let mut values = DecoupledEnvelope::ranges(plan);
    for (index, parameter) in plan.parameters.iter().enumerate() {
        let far = parameter.nominal.abs() * Rational::new(3, 2) + Rational::from(1);
        let mut lower = &parameter.nominal - &far;
        if let Some(least) = parameter.range.lower.value() {
            lower = lower.max(least.clone());
        }
        let interval = Interval::closed(lower, &parameter.nominal + far);
        values = values.with_interval(ParameterId::from(index), interval);
    }
    values
}

/// Compares with the box check at so many points: how many are in the region.
fn compare(name: &str, task: &Arc<Task>, outcome: &RegionOutcome, points: usize) -> usize {
    let plan = Arc::new(outcome.plan.clone().expect("a plan"));
    let found = outcome.region.as_ref().expect("a region");
    let mut oracle = Oracle::new(task, &plan, Guarantee::Weak).expect("within reach");
    let mut random = ChaCha8Rng::seed_from_u64(14);
    let wide = around(&plan);
    let nominal = plan.nominal();
    let mut inside = 0;
    for count in 0..points {
        let drawn = draw::valuation(&wide, &mut random);
        // A half of them near the nominal values, where more of the points are inside.
        let near = Rational::new(1, if count % 2 == 0 { 1 } else { 8 });
        let point = drawn.iter().zip(&nominal);
        let point = point
            .map(|(far, value)| value + (far - value) * &near)
            .collect();
        let theirs = oracle
            .objection(&DecoupledEnvelope::point(&point))
            .expect("within reach")
            .is_none();
        let value = |id: ParameterId| point[id].clone();
        let ours = found.contains(&value);
        assert_eq!(ours, theirs, "{name}: {point:?}\n{found:#?}");
        let pieces = found.pieces.iter();
        let pieces = pieces.filter(|piece| piece.rows.iter().all(|row| row.holds(&value)));
        assert_eq!(pieces.count(), usize::from(ours), "{name}: pieces overlap");
        inside += usize::from(ours);
    }
    inside
}

#[test]
fn the_region_of_each_case_has_the_points_that_the_box_check_accepts() {
    let mut inside = 0;
    for name in [
        "battery",
        "delivery",
        "hatchery",
        "lamp",
        "match",
        "paintshop",
        "tank",
    ] {
        let (task, plan) = case(name);
        let outcome = of(&task, plan);
        let RegionFinding::Region { pieces, .. } = &outcome.answer.finding else {
            panic!("{name}: {:?}", outcome.answer.finding);
        };
        let own = compare(name, &task, &outcome, 1000);
        let rows: usize = pieces.iter().map(|piece| piece.rows.len()).sum();
        println!(
            "{name}: {} pieces, {rows} rows, {own} of 1000 points inside",
            pieces.len()
        );
        inside += own;
    }
    assert!(inside > 1000 && inside < 6000, "{inside}");
}

/// The signal has to be given before the gate opens, which waits for two crews: it is in time if it
/// takes less long than one of them.
#[test]
fn where_one_of_two_things_has_to_be_so_there_are_two_pieces() {
    let domain = Source::new(
        "gate.pddl",
        "(define (domain gate)
           (:requirements :durative-actions)
           (:predicates (given) (opened))
           (:durative-action signal :parameters () :duration (>= ?duration 0)
             :condition (and) :effect (at end (given)))
           (:durative-action work :parameters () :duration (>= ?duration 0)
             :condition (and) :effect (and))
           (:durative-action open :parameters () :duration (= ?duration 1)
             :condition (at start (given)) :effect (at end (opened))))",
    );
    let problem = Source::new(
        "problem.pddl",
        "(define (problem morning) (:domain gate) (:init) (:goal (opened)))",
    );
    let task = Task::new(read_problem(&domain, &problem).expect("no mistakes").0);
    let plan = "parameter s default 1; parameter c default 2; parameter d default 3;
        durative-action instance n0 : (signal);
        durative-action instance n1 : (work);
        durative-action instance n2 : (work);
        durative-action instance n3 : (open);
        c: n0.end - n0.start in [s, s];
        c: n1.end - n1.start in [c, c];
        c: n2.end - n2.start in [d, d];
        c: n3.end - n3.start in [1, 1];
        c: n0.start - .zero in [0, 0];
        c: n1.start - .zero in [0, 0];
        c: n2.start - .zero in [0, 0];
        c: n3.start - n1.end in [0, inf];
        c: n3.start - n2.end in [0, inf];";
    let plan = format::read(plan.as_bytes(), &task).expect("no mistakes");
    let task = Arc::new(task);
    let outcome = of(&task, plan.into());
    let RegionFinding::Region { pieces, .. } = &outcome.answer.finding else {
        panic!("{:?}", outcome.answer.finding);
    };
    let texts = pieces.iter().map(|piece| {
        let rows = piece.rows.iter().map(|row| row.text.as_str());
        rows.collect::<Vec<_>>().join(", ")
    });
    let texts: Vec<String> = texts.collect();
    assert_eq!(texts.len(), 2, "{texts:#?}");
    assert!(
        texts.iter().any(|text| text.contains("s <= c - 1/1000")),
        "{texts:#?}"
    );
    let inside = compare("gate", &task, &outcome, 1000);
    assert!(inside > 100 && inside < 1000, "{inside}");
}

#[test]
#[allow(
    clippy::disallowed_methods,
    reason = "how long a region takes is worth seeing"
)]
fn regions_of_published_plans_have_the_points_that_the_box_check_accepts() {
    let Some(data) = shared::data() else { return };
    let points = std::env::var("ELBOWROOM_POINTS");
    let points = points.map_or(50, |count| count.parse().expect("a number"));
    let deliveries = figure_4(&data).into_iter().step_by(12).collect();
    for (family, instances) in [
        ("AAAI-19", figure_3(&data)),
        ("robot deliveries, each twelfth", deliveries),
    ] {
        let (mut whole, mut inside, mut most) = (0, 0, 0);
        let mut longest: f64 = 0.0;
        let mut open = Vec::new();
        for instance in &instances {
            let case = Case::read(&instance.domain, &instance.problem, &instance.plan);
            let begun = Instant::now();
            let outcome = of(&case.task, ParametrizedPlan::clone(&case.plan).into());
            let seconds = begun.elapsed().as_secs_f64();
            match &outcome.answer.finding {
                RegionFinding::Region { pieces, .. } => {
                    longest = longest.max(seconds);
                    whole += 1;
                    most = most.max(pieces.len());
                    inside += compare(&instance.name, &case.task, &outcome, points);
                }
                finding => open.push(format!("{}: {finding:?}", instance.name)),
            }
        }
        println!(
            "{family}: {whole} regions of {}, at most {most} pieces, the longest in {longest:.3} s; \
             {inside} of {} points inside; without: {open:#?}",
            instances.len(),
            whole * points
        );
        assert!(whole > 3 && inside > 50);
    }
}
