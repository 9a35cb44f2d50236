//! Olisipo on a clock: orders, deadlines, retries.

use elbowroom::execution::Cause;
use elbowroom::execution::run::{Report, Verdict};
use elbowroom::num::Rational;

use crate::execution::scene::Scene;

/// The photo needs light, and the sample a rock that may roll away.
const DOMAIN: &str = "
    (define (domain field) (:requirements :durative-actions :timed-initial-literals)
      (:predicates (light) (rock) (photo) (sample) (report))
      (:durative-action take-photo :parameters () :duration (= ?duration 5)
        :condition (over all (light)) :effect (at end (photo)))
      (:durative-action take-sample :parameters () :duration (= ?duration 3)
        :condition (over all (rock)) :effect (at end (sample)))
      (:durative-action write :parameters () :duration (= ?duration 2)
        :condition (at start (photo)) :effect (at end (report))))";

const PLAN: &str = "0: (take-photo) [5]  0: (take-sample) [3]  5.001: (write) [2]";

const CHANCES: &str = "
    [defaults]
    becomes_true = 0.0
    becomes_false = 0.0
    start = 0.5
    effect = 1.0
    [facts.rock]
    becomes_false = 0.2
    [facts.light]
    becomes_false = 0.0";

fn field(dark: u32) -> Scene {
    let problem = format!(
        "(define (problem day) (:domain field)
           (:init (light) (rock) (at {dark} (not (light))))
           (:goal (and (photo) (sample) (report))))"
    );
    let plan = PLAN.replace("  ", "\n");
    Scene::new(DOMAIN, &problem, Some(&plan)).with_likelihoods(CHANCES)
}

fn done(report: &Report) -> Vec<&str> {
    let names = report
        .executed
        .iter()
        .map(|executed| &executed.step.action.name);
    names.map(|name| name.trim_matches(['(', ')'])).collect()
}

/// Returns `true` if the validator accepts the execution.
fn is_valid(scene: &Scene, report: &Report) -> bool {
    scene.judged(report).is_valid()
}

/// Returns the start and the end of an action.
fn times(report: &Report, name: &str) -> (Rational, Rational) {
    let steps = report.executed.iter().map(|executed| &executed.step);
    let mut found = steps.filter(|step| step.action.name.contains(name));
    let step = found.next().expect("it was done");
    (step.start.clone(), step.end())
}

#[test]
fn losable_facts_are_used_first_if_time_permits() {
    let scene = field(100);
    let report = scene.run("adaptable", &scene.world(""), 1);
    assert_eq!(report.verdict, Verdict::GoalReached);
    assert_eq!(done(&report), ["take-sample", "take-photo", "write"]);
    assert!(times(&report, "photo").0 >= times(&report, "sample").1);
    assert!(is_valid(&scene, &report));
}

#[test]
fn an_order_that_misses_its_deadline_is_not_chosen() {
    let scene = field(7);
    let report = scene.run("adaptable", &scene.world(""), 1);
    assert_eq!(report.verdict, Verdict::GoalReached);
    assert!(times(&report, "photo").1 < 7.into());
    assert!(times(&report, "photo").0 < times(&report, "sample").1);
    assert_eq!(report.replans, 0);
    assert!(is_valid(&scene, &report));
}

/// The next start is decided when the previous one is reported, which is immediately here.
#[test]
fn simultaneous_starts_are_dispatched_together() {
    let scene = field(7);
    let starts = |world: &str| {
        let report = scene.run("adaptable", &scene.world(world), 1);
        assert_eq!(report.verdict, Verdict::GoalReached);
        [times(&report, "photo").0, times(&report, "sample").0]
    };
    assert_eq!(starts(""), [Rational::ZERO, Rational::ZERO]);
    let late = "[[delay]]\naction = \"*\"\nconstant = 0.5\n";
    let mut late = starts(late);
    late.sort();
    assert_eq!(late, [Rational::new(1, 2), Rational::ONE]);
}

#[test]
fn action_with_achieved_effects_is_skipped() {
    let scene = field(100);
    let world = scene.world("[[event]]\nfact = \"(photo)\"\nbecomes = true\nconstant = 1");
    let report = scene.run("adaptable", &world, 1);
    assert_eq!(report.verdict, Verdict::GoalReached);
    assert_eq!(done(&report), ["take-sample", "write"]);
}

#[test]
fn failed_action_is_retried_while_likelihoods_explain_it() {
    let scene = field(100);
    let fails = |probability: &str| {
        let section = "[[failure]]\naction = \"*\"\nwhen = \"start\"\nprobability = ";
        scene.world(&format!("{section}{probability}"))
    };
    let mut failures = 0;
    for seed in 0..20 {
        let report = scene.run("adaptable", &fails("0.5"), seed);
        assert_eq!(report.verdict, Verdict::GoalReached, "{report:?}");
        assert_eq!(report.replans, 0, "{:?}", report.reasons);
        failures += report.starts - 3;
    }
    assert!(failures > 20, "{failures}");
    // Twenty failures in a row are not believable with probability 0.5.
    let report = scene.run("adaptable", &fails("1"), 1);
    assert_eq!(report.verdict, Verdict::ReplanLimit);
    assert!(
        report
            .reasons
            .iter()
            .all(|reason| reason.cause == Cause::Failed)
    );
    assert_eq!(report.starts, 20 * report.reasons.len());
    // Retries are also limited if a start hardly ever succeeds; a retry takes no time here.
    let hopeless = CHANCES.replace("start = 0.5", "start = 1e-9");
    let mut scene = field(100).with_likelihoods(&hopeless);
    scene.settings.max_replans = 1;
    for executor in ["adaptable", "lookahead"] {
        let report = scene.run(executor, &fails("1"), 1);
        assert_eq!(report.verdict, Verdict::ReplanLimit);
        assert_eq!(report.starts, 1000 * report.reasons.len(), "{executor}");
    }
}

/// The parcel of `cases/delivery`, whose picks fail at their end three times in ten.
#[test]
fn undone_pick_is_retried() {
    // The sections after the header.
    let sections = |name: &str| {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../cases/delivery/");
        let text = std::fs::read_to_string(format!("{folder}{name}")).expect("it is there");
        let (_, sections) = text.split_once("version = 1").expect("it has a header");
        sections.to_owned()
    };
    let (told, world) = (sections("likelihoods.toml"), sections("slips.toml"));
    let world = world.as_str();
    let scene = |likelihoods: &str| Scene::case("delivery").with_likelihoods(likelihoods);
    for executor in ["adaptable", "lookahead"] {
        let (mut again, mut more) = (0, 0);
        for seed in 0..40 {
            let scene = scene(&told);
            let report = scene.run(executor, &scene.world(world), seed);
            assert_eq!(report.verdict, Verdict::GoalReached, "{executor} {seed}");
            // A retry needs no new plan.
            assert_eq!(report.replans, 0, "{executor} {seed}");
            let picks = done(&report)
                .iter()
                .filter(|name| name.starts_with("pick"))
                .count();
            again += usize::from(picks == 2);
            more += usize::from(picks > 2);
        }
        assert!(
            again >= 4 && more >= 1,
            "{executor}: {again} twice, {more} more often"
        );
    }
    // With a likelihood of 1 for picks, a failure makes the executor abandon the plan.
    let certain = told.replace("end = 0.7", "end = 1.0");
    let scene = scene(&certain);
    let given_up = (0..40).filter(|seed| {
        let report = scene.run("adaptable", &scene.world(world), *seed);
        report.verdict != Verdict::GoalReached || report.replans > 0
    });
    assert!(given_up.count() >= 4);
}

#[test]
fn failure_explained_by_observation_is_not_counted() {
    let domain = DOMAIN.replace("(over all (rock))", "(at start (rock))");
    let problem = "(define (problem day) (:domain field) (:init (light) (rock) (photo) (report))
        (:goal (sample)))";
    let chances = CHANCES.replace("start = 0.5", "start = 1.0");
    let plan = Some("0: (take-sample) [3]");
    let event = |becomes: bool, time: &str| {
        format!("[[event]]\nfact = \"(rock)\"\nbecomes = {becomes}\nconstant = {time}\n")
    };
    let late = "[[delay]]\naction = \"*\"\nconstant = 1\n";
    let (gone, back) = (event(false, "0.25"), event(true, "0.5"));
    let run = |world: &str| {
        let scene = Scene::new(&domain, problem, plan).with_likelihoods(&chances);
        scene.run("adaptable", &scene.world(world), 1)
    };
    // The rock is back before the action would start.
    let report = run(&format!("{late}{gone}{back}"));
    assert_eq!((report.starts, report.replans), (1, 0), "{report:#?}");
    // The rock is not back. Then there is no order, which is the only reason.
    let report = run(&format!("{late}{gone}"));
    assert_eq!(report.verdict, Verdict::Unsolvable);
    assert_eq!(report.reasons[0].cause, Cause::NoOrder, "{report:#?}");
}

#[test]
fn initial_belief_determines_the_first_action() {
    let domain = "
        (define (domain house) (:requirements :durative-actions)
          (:predicates (open-front) (open-back) (inside))
          (:durative-action enter-front :parameters () :duration (= ?duration 1)
            :condition (at start (open-front)) :effect (at end (inside)))
          (:durative-action enter-back :parameters () :duration (= ?duration 1)
            :condition (at start (open-back)) :effect (at end (inside))))";
    let problem = "
        (define (problem home) (:domain house) (:init (open-front) (open-back)) (:goal (inside)))";
    let plan = "0: (enter-front) [1]\n2: (enter-back) [1]";
    let first = |beliefs: &str| {
        let chances = format!(
            "defaults = {{ becomes_true = 0.0, becomes_false = 0.0, start = 1.0, effect = 1.0 }}\n{beliefs}"
        );
        let scene = Scene::new(domain, problem, Some(plan)).with_likelihoods(&chances);
        let firsts = ["adaptable", "lookahead"].map(|executor| {
            let report = scene.run(executor, &scene.world(""), 1);
            assert_eq!(report.verdict, Verdict::GoalReached);
            done(&report)[0].to_owned()
        });
        assert_eq!(firsts[0], firsts[1]);
        firsts[0].clone()
    };
    assert_eq!(first(""), "enter-front");
    assert_eq!(
        first("[beliefs]\nopen-front = 0.6\nopen-back = 0.9"),
        "enter-back"
    );
    assert_eq!(
        first("[beliefs]\nopen-front = 0.9\nopen-back = 0.6"),
        "enter-front"
    );
}
