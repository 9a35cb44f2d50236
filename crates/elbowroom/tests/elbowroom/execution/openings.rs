//! Windows of timed initials, and several parameters.

use elbowroom::execution::run::Verdict;
use elbowroom::num::Rational;
use elbowroom::sim::WorldModel;

use crate::execution::scene::{EXECUTORS, Scene};

const SHIPPING: &str = "(define (domain shipping)
    (:requirements :durative-actions :timed-initial-literals)
    (:predicates (packed) (van) (shipped) (ordered))
    (:durative-action pack :parameters () :duration (= ?duration 4)
      :condition (at start (ordered)) :effect (at end (packed)))
    (:durative-action ship :parameters () :duration (= ?duration 6)
      :condition (and (at start (packed)) (over all (van))) :effect (at end (shipped))))";

/// `fixed:X` once shipped at 4.001, although the van comes at 20.
#[test]
fn shipping_waits_for_the_van() {
    let problem = "(define (problem p) (:domain shipping)
        (:init (ordered) (at 20 (van))) (:goal (shipped)))";
    let plan = "0: (pack) [4]\n20.001: (ship) [6]";
    let scene = Scene::new(SHIPPING, problem, Some(plan));
    for executor in EXECUTORS.iter().chain(&["fixed:0", "fixed:60"]) {
        let report = scene.run(executor, &WorldModel::without_deviations(), 0);
        assert_eq!(
            report.verdict,
            Verdict::GoalReached,
            "{executor}: {report:#?}"
        );
        let ship = &report.executed.last().expect("two steps").step;
        assert!(ship.start >= Rational::from(20), "{executor}: {report:#?}");
        assert_eq!(report.replans, 0, "{executor}: {:?}", report.reasons);
    }
}

#[test]
fn a_run_ends_after_the_last_timed_initial_that_the_goal_depends_on() {
    let problem = "(define (problem p) (:domain shipping)
        (:init (ordered) (at 20 (van)) (at 50 (shipped))) (:goal (and (packed) (van))))";
    let scene = Scene::new(SHIPPING, problem, Some("0: (pack) [4]"));
    for executor in EXECUTORS.iter() {
        let report = scene.run(executor, &WorldModel::without_deviations(), 0);
        assert_eq!(
            report.verdict,
            Verdict::GoalReached,
            "{executor}: {report:#?}"
        );
        let moment = Rational::from(20)..Rational::from(21);
        assert!(moment.contains(&report.time), "{executor}: {report:#?}");
        assert_eq!(report.replans, 0, "{executor}: {:?}", report.reasons);
    }
}

/// At 20 earlier packages are thrown away.
///
/// The published baselines start at once, pack in 1 instead of 4, and have used up their replans
/// before 20. They fail, but they must not count the package that will be thrown away as a success.
#[test]
fn effect_deleted_by_timed_initial_is_achieved_again() {
    let problem = "(define (problem p) (:domain shipping)
        (:init (ordered) (at 20 (not (packed)))) (:goal (packed)))";
    let scene = Scene::new(SHIPPING, problem, Some("17: (pack) [4]"));
    let quick = scene.world("[[duration]]\naction = \"pack\"\nvalues = [1]\n");
    let mut successes = 0;
    for executor in EXECUTORS.iter() {
        let report = scene.run(executor, &quick, 0);
        let is_baseline = executor.starts_with("fixed") || *executor == "esterel";
        if is_baseline && report.verdict == Verdict::ReplanLimit {
            continue;
        }
        assert_eq!(
            report.verdict,
            Verdict::GoalReached,
            "{executor}: {report:#?}"
        );
        let last = &report.executed.last().expect("it was packed").step;
        assert!(last.end() > Rational::from(20), "{executor}: {report:#?}");
        assert!(report.time >= last.end(), "{executor}: {report:#?}");
        successes += 1;
    }
    assert!(successes >= 3, "{successes}");
}

#[test]
fn fixed_detects_missing_van_at_start_of_shipping() {
    let problem = "(define (problem p) (:domain shipping)
        (:init (ordered) (van) (at 15 (not (van))) (at 40 (van))) (:goal (shipped)))";
    let plan = "0: (pack) [4]\n4.001: (ship) [6]";
    let scene = Scene::new(SHIPPING, problem, Some(plan));
    let late = scene.world("[[duration]]\naction = \"pack\"\nconstant = 12\n");
    let report = scene.run("fixed:300", &late, 0);
    assert_eq!(report.verdict, Verdict::GoalReached, "{report:#?}");
    let ships = report.executed.iter();
    let ships: Vec<_> = ships.filter(|it| it.step.action.name == "(ship)").collect();
    let last = ships.last().expect("it was shipped");
    assert!(last.step.start >= Rational::from(40), "{report:#?}");
}

const SPEED: &str = "(define (domain hauling)
    (:requirements :durative-actions :fluents :duration-inequalities)
    (:synth-parameters ?s) (:predicates (done)) (:functions (left))
    (:durative-action haul :parameters () :duration (= ?duration 5)
      :condition (at start (>= (left) 0))
      :effect (and (at end (done)) (at start (decrease (left) ?s)))))";

#[test]
fn durations_and_a_domains_open_number_are_varied_together() {
    let problem = "(define (problem p) (:domain hauling)
        (:init (= (left) 10)) (:goal (and (done) (>= (left) 0))))";
    let plan = "0: (haul) [5]";
    for specs in [
        &["?s=3"][..],
        &["durations", "?s=3"],
        &["?s=3", "durations"],
    ] {
        let mut scene = Scene::new(SPEED, problem, None.or(Some(plan)));
        scene.flow.vary = specs
            .iter()
            .map(|spec| spec.parse().expect("a correct test"))
            .collect();
        elbowroom::execute::check_vary(&scene.task, &scene.flow.vary).expect("all are there");
        let names = scene.prepared("guarded").plan.parameters;
        let mut names: Vec<_> = names.into_iter().map(|parameter| parameter.name).collect();
        names.sort();
        assert_eq!(names.len(), 2, "{specs:?}: {names:?}");
        let report = scene.run("guarded", &WorldModel::without_deviations(), 0);
        assert_eq!(
            report.verdict,
            Verdict::GoalReached,
            "{specs:?}: {report:#?}"
        );
    }
    let scene = Scene::new(SPEED, problem, Some(plan));
    let wrong = ["?t=3".parse().expect("a correct test")];
    elbowroom::execute::check_vary(&scene.task, &wrong).expect_err("there is no ?t");
}
