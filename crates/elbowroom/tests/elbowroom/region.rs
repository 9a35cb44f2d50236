//! The region contains a point exactly if the box check accepts it.

#![allow(clippy::print_stdout, reason = "counts and times are worth seeing")]

use crate::shared;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use crate::shared::case::Case;
use crate::shared::draw;
use crate::shared::instances::{figure_3, figure_4};
use crate::shared::own::case;
use elbowroom::AnyPlan;
use elbowroom::answers::region::{
    Others, PictureError, Plane, RegionFinding, RegionSettings, picture, region,
};
use elbowroom::answers::{EnvelopeRequest, NoObserver, Observer, RegionOutcome, StopRequest};
use elbowroom::envelope::{Guarantee, Oracle};
use elbowroom::model::Task;
use elbowroom::num::{Interval, Rational};
use elbowroom::pddl::{Source, read_problem};
use elbowroom::plan::{DecoupledEnvelope, ParameterId, ParametrizedPlan, format};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn of(task: &Arc<Task>, plan: AnyPlan) -> RegionOutcome {
    region(
        &EnvelopeRequest::new(task, plan),
        &RegionSettings::default(),
        &mut NoObserver,
    )
    .expect("within exact reasoning")
}

/// Draws values around the nominal ones, some of them round numbers.
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

/// Compares with the box check at `points` points. Returns the number of those in the region.
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
        // Half of them are near the nominal values, where more points are inside.
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
fn regions_of_cases_match_the_box_check() {
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

/// The signal must be given before the gate opens, which waits for two crews. It is in time if it
/// takes less time than one of them.
#[test]
fn disjunction_gives_two_pieces() {
    let (task, plan) = gate();
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

const GATE: &str = "(define (domain gate)
           (:requirements :durative-actions)
           (:predicates (given) (opened))
           (:durative-action signal :parameters () :duration (>= ?duration 0)
             :condition (and) :effect (at end (given)))
           (:durative-action work :parameters () :duration (>= ?duration 0)
             :condition (and) :effect (and))
           (:durative-action open :parameters () :duration (= ?duration 1)
             :condition (at start (given)) :effect (at end (opened))))";

const GATE_PLAN: &str = "parameter s default 1; parameter c default 2; parameter d default 3;
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

/// Returns the plan of a gate, whose region has two pieces.
fn gate() -> (Arc<Task>, ParametrizedPlan) {
    let domain = Source::new("gate.pddl", GATE);
    let problem = Source::new(
        "problem.pddl",
        "(define (problem morning) (:domain gate) (:init) (:goal (opened)))",
    );
    let task = Task::new(read_problem(&domain, &problem).expect("no mistakes").0);
    let plan = format::read(GATE_PLAN.as_bytes(), &task).expect("no mistakes");
    (Arc::new(task), plan)
}

#[test]
fn volumes_and_shares_match_random_sampling() {
    let mut exact = 0;
    for name in [
        "battery",
        "delivery",
        "hatchery",
        "lamp",
        "match",
        "paintshop",
    ] {
        let (task, plan) = case(name);
        exact += measured(name, &task, plan);
    }
    let (task, plan) = gate();
    exact += measured("gate", &task, plan.into());
    assert!(exact >= 5, "{exact}");
}

/// Returns 1 if the volume is exact, and 0 otherwise.
fn measured(name: &str, task: &Arc<Task>, plan: AnyPlan) -> usize {
    let settings = RegionSettings {
        with_boxes: true,
        with_volume: true,
        seed: 3,
    };
    let request = EnvelopeRequest::new(task, plan);
    let outcome = region(&request, &settings, &mut NoObserver).expect("within exact reasoning");
    let RegionFinding::Region { boxes, measure, .. } = &outcome.answer.finding else {
        panic!("{name}: {:?}", outcome.answer.finding);
    };
    let plan = outcome.plan.as_ref().expect("a plan");
    let found = outcome.region.as_ref().expect("a region");
    let measure = measure
        .as_ref()
        .unwrap_or_else(|| panic!("{name} has a volume"));
    let mut frame = DecoupledEnvelope::ranges(plan);
    let mut whole = 0.0;
    for (index, [lower, upper]) in measure.frame.values().enumerate() {
        let interval = Interval::closed(lower.0.clone(), upper.0.clone());
        whole += interval.width().expect("bounded").to_f64().log10();
        frame = frame.with_interval(ParameterId::from(index), interval);
    }
    let mut random = ChaCha8Rng::seed_from_u64(15);
    let drawn = 4000;
    let mut inside = 0;
    for _ in 0..drawn {
        let uniform: Vec<Rational> = measure
            .frame
            .values()
            .map(|[lower, upper]| {
                let share = Rational::new(random.random_range(0..1_000_000), 1_000_000);
                &lower.0 + (&upper.0 - &lower.0) * share
            })
            .collect();
        inside += usize::from(found.contains(&|id| uniform[id.index()].clone()));
    }
    let share = 10_f64.powf(measure.log10 - whole);
    let expected = share * f64::from(drawn);
    let spread = 4.0 * (expected * (1.0 - share).max(0.0)).sqrt() + 2.0;
    let counted = f64::from(u32::try_from(inside).expect("few"));
    assert!(
        (counted - expected).abs() < spread,
        "{name}: {counted} of {drawn} points, and a share of {share}"
    );
    assert_eq!(boxes.len(), 3, "{name}");
    for own in boxes {
        let share = own.share.as_ref().expect("a share");
        let is_flat = own.intervals.values().any(|it| it.lower == it.upper);
        assert!(
            (share.decimal > 0.0 || is_flat) && share.decimal <= 1.0,
            "{name}: {own:?}"
        );
        let mut small = frame.clone();
        for (index, interval) in own.intervals.values().enumerate() {
            let id = ParameterId::from(index);
            let ends = Interval {
                lower: interval.lower.clone(),
                upper: interval.upper.clone(),
            };
            small = small.with_interval(id, ends.intersection(frame.interval(id)));
        }
        for _ in 0..100 {
            let point = draw::valuation(&small, &mut random);
            let value = |id: ParameterId| point[id].clone();
            assert!(found.contains(&value), "{name}: {} has {point:?}", own.name);
        }
    }
    println!("{name}: {measure:?}");
    usize::from(measure.volume.is_some())
}

/// Watcher that ends a search after this number of polls.
struct PollLimit(usize);

impl Observer for PollLimit {
    fn flow(&mut self) -> ControlFlow<StopRequest> {
        match self.0.checked_sub(1) {
            Some(left) => {
                self.0 = left;
                ControlFlow::Continue(())
            }
            None => ControlFlow::Break(StopRequest::TimeLimit),
        }
    }
}

#[test]
fn interrupted_computation_returns_part_of_the_region() {
    let (task, plan) = gate();
    let request = EnvelopeRequest::new(&task, plan);
    let settings = RegionSettings::default();
    let whole = region(&request, &settings, &mut NoObserver).expect("within exact reasoning");
    let whole = whole.region.expect("a region");
    let (mut nothing, mut parts) = (0, 0);
    for patience in 0.. {
        let outcome = region(&request, &settings, &mut PollLimit(patience));
        let outcome = outcome.expect("within exact reasoning");
        match &outcome.answer.finding {
            RegionFinding::None { .. } => nothing += 1,
            RegionFinding::Region {
                pieces,
                missing: Some(_),
                ..
            } => {
                assert!(!pieces.is_empty());
                let part = outcome.region.expect("a region");
                assert!(part.pieces.iter().all(|piece| whole.pieces.contains(piece)));
                assert!(part.pieces.len() < whole.pieces.len() || part.missing.is_some());
                parts += 1;
            }
            RegionFinding::Region { missing: None, .. } => break,
            finding => panic!("{finding:?}"),
        }
        assert!(patience < 10_000);
    }
    assert!(nothing > 0 && parts > 0, "{nothing} {parts}");
}

#[test]
fn picture_contains_region_boxes_and_nominal_point() {
    let (task, plan) = case("match");
    let settings = RegionSettings {
        with_boxes: true,
        ..RegionSettings::default()
    };
    let request = EnvelopeRequest::new(&task, plan);
    let outcome = region(&request, &settings, &mut NoObserver).expect("within exact reasoning");
    let mut flow = || ControlFlow::Continue(());
    for others in [Others::Nominal, Others::Any] {
        let plane = Plane {
            axes: ["dur_1".to_owned(), "(inspect keel)".to_owned()],
            others,
        };
        let picture = picture(&outcome, &plane, &mut flow).expect("two parameters");
        assert_eq!(picture.boxes.len(), 3);
        assert_eq!(picture.areas.len(), 1);
        // The nominal point is inside both polygons.
        let point = picture.point.as_ref().expect("a point").1;
        assert!((point[0] - 8.0).abs() < 1e-9 && (point[1] - 10.0).abs() < 1e-9);
        let is_left = |corners: &Vec<[f64; 2]>| {
            (0..corners.len()).all(|at| {
                let ([ax, ay], [bx, by]) = (corners[at], corners[(at + 1) % corners.len()]);
                (bx - ax) * (point[1] - ay) - (by - ay) * (point[0] - ax) >= 0.0
            })
        };
        assert!(is_left(&picture.areas[0]), "{:?}", picture.areas);
    }
    let same = Plane {
        axes: ["dur_1".to_owned(), "dur_1".to_owned()],
        others: Others::Nominal,
    };
    assert!(matches!(
        picture(&outcome, &same, &mut flow),
        Err(PictureError::Same(_))
    ));
}

#[test]
#[allow(
    clippy::disallowed_methods,
    reason = "how long a region takes is worth seeing"
)]
fn regions_of_published_plans_match_the_box_check() {
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
