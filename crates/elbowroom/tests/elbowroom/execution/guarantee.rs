//! No run fails within the guarantee.

use std::fmt::Write as _;
use std::sync::Arc;

use elbowroom::execute::{CachingPreparer, PlanPreparer};
use elbowroom::execution::NoRecord;
use elbowroom::execution::run::{TimeoutRule, Verdict};
use elbowroom::model::ground::{Action, Body, Change, Expression, FluentId};
use elbowroom::model::problem::Unknown;
use elbowroom::num::{Interval, Rational};
use elbowroom::plan::ParameterKind;
use elbowroom::sim::{SimWorld, WorldModel};

use crate::execution::scene::{Scene, read, runs};
use crate::shared;

/// In worlds with every parameter in its interval, `guarded` always reaches the goal and never
/// replans, and the validator accepts the execution. `ELBOWROOM_GUARANTEED_RUNS` sets the number of
/// runs.
#[test]
fn goal_is_reached_for_all_durations_inside_the_envelope() {
    let scenes = scenes();
    let share = runs("ELBOWROOM_GUARANTEED_RUNS", 10_000).div_ceil(scenes.len() as u64);
    for (name, scene) in &scenes {
        let model = world_of_the_envelope(scene);
        let mut preparer = CachingPreparer::new(PlanPreparer::new(scene.flow.clone()), 1);
        for seed in 0..share {
            let mut world = SimWorld::new(Arc::clone(&scene.task), &model, seed);
            let report = scene.run_in("guarded", &mut world, &mut preparer, &mut NoRecord);
            assert_eq!(
                report.verdict,
                Verdict::GoalReached,
                "{name}, seed {seed}: {report:#?}"
            );
            assert_eq!(
                report.replans, 0,
                "{name}, seed {seed}: {:?}",
                report.reasons
            );
            let verdict = scene.judged(&report);
            assert!(verdict.is_valid(), "{name}, seed {seed}: {verdict:?}");
        }
        println!("{name}: {share} runs");
    }
}

/// Returns scenes with deadlines, required concurrency, concurrent steps, conditions on numbers,
/// continuous changes and variable consumption, and the authors' robot deliveries, if available.
fn scenes() -> Vec<(String, Scene)> {
    let mut scenes: Vec<(String, Scene)> = ["delivery", "match", "battery", "tank"]
        .into_iter()
        .map(|name| (name.to_owned(), Scene::case(name)))
        .collect();
    for (early, late) in [
        ("420.389", "739.779"),
        ("480", "800"),
        ("553.197", "1005.395"),
    ] {
        let name = format!("two orders until {early} and {late}");
        scenes.push((name, Scene::two_orders(early, late)));
    }
    for (capacity, charge) in [("160", "151"), ("180", "171")] {
        let scene = one_order(capacity, charge);
        scenes.push((format!("two orders with a charge of {charge}"), scene));
    }
    scenes.extend(robot_deliveries());
    scenes
}

/// Returns the problem of table 2, with a plan for one of the orders.
pub(super) fn one_order(capacity: &str, charge: &str) -> Scene {
    let problem = read("experiments/table2/problem.pddl");
    let problem = problem
        .replace("{capacity}", capacity)
        .replace("{charge}", charge);
    let domain = read("experiments/table2/domain.pddl");
    let mut scene = Scene::new(&domain, &problem, Some(ONE_ORDER));
    scene.flow.vary = ["constant make-base-1 charge", "constant make-base-2 weight"]
        .map(|spec| spec.parse().expect("a correct test"))
        .to_vec();
    scene
}

/// Plan for table 2 with concurrent steps of the base.
const ONE_ORDER: &str = "
      0.000: (collect rover store simple) [60]
     60.001: (go rover store press) [20]
     80.002: (make-base-1 rover press simple) [170]
     80.003: (make-base-2 rover press simple) [160]
     80.004: (make-base-3 rover press simple) [150]
     80.005: (make-base-4 rover press simple) [140]
     80.006: (make-base-5 rover press simple) [130]
     80.007: (make-base-6 rover press simple) [120]
    250.003: (go rover press mounting) [20]
    270.004: (mount-rings rover mounting simple) [120]
    390.005: (go rover mounting front) [20]
    410.006: (deliver rover front simple) [1]";

/// Returns the authors' problems with plans of the embedded planner. The durations of the authors'
/// plans do not match their domain.
fn robot_deliveries() -> Vec<(String, Scene)> {
    let Some(data) = shared::data() else {
        return Vec::new();
    };
    let folder = data.join("envelopes/robot_delivery");
    let domain = text(&folder.join("domain_robot_delivery.pddl"));
    let mut scenes = Vec::new();
    for name in ["g02_w04", "g03_w05", "g05_w04", "g07_w05", "g10_w10"] {
        let file = |kind: &str| {
            let path = format!("scalability/{kind}problem_{name}_ROSPlan.pddl");
            text(&folder.join(path))
        };
        let mut scene = Scene::within(20_000, &domain, &file("problems_deadline/"), None);
        // Values of unbounded intervals are drawn beyond every time-out.
        scene.settings.timeout = TimeoutRule::Off;
        scene.flow.timeout = TimeoutRule::Off;
        scenes.push((format!("robot delivery {name}"), scene));
    }
    scenes
}

fn text(path: &std::path::Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Returns a world with a uniform distribution of every parameter in its interval of the first
/// plan's envelope.
fn world_of_the_envelope(scene: &Scene) -> WorldModel {
    let prepared = scene.prepared("guarded");
    let envelope = prepared.envelope.as_ref().expect("a correct test");
    let mut sections = String::new();
    for (index, parameter) in prepared.plan.parameters.iter().enumerate() {
        let (from, to) = ends(&envelope.intervals()[index], &parameter.nominal);
        let uniform = format!("uniform = {{ from = {from}, to = {to} }}");
        let action = |id| &prepared.plan.plan.instance(id).action;
        match parameter.kind {
            ParameterKind::Duration(instance) => {
                let name = &action(instance).name;
                let _ = writeln!(sections, "[[duration]]\naction = \"{name}\"\n{uniform}");
            }
            ParameterKind::Constant(instance) => {
                let name = &action(instance).name;
                let fluent = scene.task.fluent_name(changed(action(instance), index));
                let _ = writeln!(
                    sections,
                    "[[amount]]\naction = \"{name}\"\nfluent = \"{fluent}\"\n{uniform}"
                );
            }
            other => panic!("{other:?} is not left open here"),
        }
    }
    scene.world(&sections)
}

/// Returns the ends of an interval in thousandths, rounded inwards. An infinite end is replaced by
/// three times the nominal value.
fn ends(interval: &Interval, nominal: &Rational) -> (f64, f64) {
    let thousand = Rational::from(1000);
    let lower = interval.lower.value().expect("a correct test");
    let farthest = nominal * Rational::from(3);
    let upper = interval.upper.value().unwrap_or(&farthest);
    let from = (lower * &thousand).ceil() / &thousand;
    let to = (upper * &thousand).floor() / &thousand;
    (from.to_f64(), to.to_f64())
}

/// Returns the fluent that an action changes by the parameter.
fn changed(action: &Action, parameter: usize) -> FluentId {
    let Body::Durative(body) = &action.body else {
        panic!("a correct test");
    };
    let mut effects = body.start.effects.iter().chain(&body.end.effects);
    let found = effects.find_map(|effect| match &effect.change {
        Change::Update { fluent, value, .. } => {
            let open = Expression::Unknown(Unknown::Parameter(
                u32::try_from(parameter).expect("a correct test"),
            ));
            (*value == open).then_some(*fluent)
        }
        _ => None,
    });
    found.expect("a correct test")
}
