//! Optimal policies in small worlds on a clock.

use elbowroom::execution::Ending;
use elbowroom::execution::run::{Report, Verdict};

use crate::execution::scene::{Scene, read};
use crate::shared::one_in;

/// Returns a task: a vase is to be fetched before it is knocked over. There are stairs, and a slide
/// on which the robot mostly slips.
fn house() -> Scene {
    Scene::new(&domain(), &file("problem.pddl"), Some(SLIDE)).with_likelihoods(&slippery())
}

const SLIDE: &str = "0: (slide) [10]\n10.001: (fetch) [2]";

fn file(name: &str) -> String {
    read(&format!("experiments/vase/{name}"))
}

fn domain() -> String {
    file("domain.pddl")
}

/// Returns the sections after the header of a file.
fn sections(name: &str) -> String {
    let text = file(name);
    let (_, sections) = text.split_once("version = 1").expect("a correct test");
    sections.to_owned()
}

fn slippery() -> String {
    sections("likelihoods.toml")
}

fn done(report: &Report) -> Vec<&str> {
    let names = report
        .executed
        .iter()
        .map(|it| it.step.action.name.as_str());
    names.map(|name| name.trim_matches(['(', ')'])).collect()
}

/// Returns `true` if the goal was reached with the first plan.
fn has_reached(report: &Report) -> bool {
    report.verdict == Verdict::GoalReached && report.replans == 0
}

fn reached(scene: &Scene, executor: &str, world: &str, count: u64) -> u64 {
    let world = scene.world(world);
    let reports = (0..count).map(|seed| scene.run(executor, &world, seed));
    let good = reports.filter(|report| {
        let is_reached = report.verdict == Verdict::GoalReached;
        assert!(!is_reached || scene.judged(report).is_valid());
        is_reached
    });
    good.count() as u64
}

#[test]
fn likelier_detour_outside_the_plan_is_taken() {
    let scene = house();
    let report = scene.run("lookahead", &scene.world(""), 0);
    assert_eq!(done(&report), ["climb", "fetch"]);
    assert!(has_reached(&report), "{report:#?}");
    let report = scene.run("adaptable", &scene.world(""), 0);
    assert_eq!(done(&report), ["slide", "fetch"]);
    let (world, count) = (sections("world.toml"), 200);
    let lookahead = reached(&scene, "lookahead", &world, count);
    let adaptable = reached(&scene, "adaptable", &world, count);
    println!("{lookahead} and {adaptable} of {count}");
    // The vase is still whole at 17 in 103 of 105 cases.
    assert!(lookahead * 100 > 93 * count, "{lookahead}");
    assert!(adaptable + count / 4 < lookahead, "{adaptable}");
}

/// Without likelihoods both ways are certain. The table has no durations, so it does not prefer
/// either.
#[test]
fn certain_world_makes_all_routes_equal() {
    let scene = Scene::new(&domain(), &file("problem.pddl"), Some(SLIDE));
    let report = scene.run("lookahead", &scene.world(""), 0);
    assert!(has_reached(&report), "{report:#?}");
    assert_eq!(report.starts, 2);
}

#[test]
fn unplanned_action_is_executed_when_needed_without_replanning() {
    let problem = "
        (define (problem late) (:domain house) (:init (whole) (upstairs)) (:goal (fetched)))";
    let scene =
        Scene::new(&domain(), problem, Some("0: (fetch) [2]")).with_likelihoods(&slippery());
    let world = "[[delay]]\naction = \"fetch\"\nvalues = [1]\n\
                 [[event]]\nfact = \"(upstairs)\"\nbecomes = false\nconstant = 0.5\n";
    let report = scene.run("lookahead", &scene.world(world), 0);
    assert!(has_reached(&report), "{report:#?}");
    assert_eq!(done(&report), ["climb", "fetch"]);
    let report = scene.run("adaptable", &scene.world(world), 0);
    assert_eq!(report.replans, 1, "{:?}", report.reasons);
}

/// Another agent has fetched the vase, and may put it back.
#[test]
fn running_action_is_cancelled_if_waiting_does_not_pay() {
    let fleeting = format!("{}\n[facts.fetched]\nbecomes_false = 0.1\n", slippery());
    let scene = house().with_likelihoods(&fleeting);
    let world = "[[event]]\nfact = \"(fetched)\"\nbecomes = true\nconstant = 5\n";
    let report = scene.run("lookahead", &scene.world(world), 0);
    assert!(has_reached(&report), "{report:#?}");
    assert_eq!(report.time, 5.into());
    let endings: Vec<_> = report.executed.iter().map(|it| it.ending.clone()).collect();
    assert_eq!(endings, [Some(Ending::Cancelled)]);
    // `adaptable` waits for the end of a running action.
    assert_eq!(
        scene.run("adaptable", &scene.world(world), 0).time,
        10.into()
    );
}

#[test]
fn dead_end_triggers_replanning_without_result() {
    let scene = house();
    let world = scene.world("[[event]]\nfact = \"(whole)\"\nbecomes = false\nconstant = 5\n");
    let report = scene.run("lookahead", &world, 0);
    assert_eq!(report.verdict, Verdict::Unsolvable, "{report:#?}");
}

/// Returns a problem of paper 2's experiments with one of its likelihood files.
fn machines(name: &str, case: &str) -> Scene {
    let file = |name: &str| read(&format!("experiments/olisipo/{name}"));
    let likelihoods = file(&format!("{name}-{case}.toml"));
    let parts = likelihoods.split_once("version = 1");
    let sections = parts.expect("a correct test").1;
    let (domain, problem) = (
        file(&format!("{name}-domain.pddl")),
        file(&format!("{name}-problem.pddl")),
    );
    Scene::new(&domain, &problem, None).with_likelihoods(sections)
}

/// The machines of paper 2, with starts that fail. By the likelihoods of AF3 p4 a machine may
/// become maintained spontaneously, which never happens here. An executor that waits for it would
/// never end.
#[test]
fn machines_of_paper_2_are_maintained_in_timed_world() {
    let failing = "[[failure]]\naction = \"*\"\nwhen = \"start\"\nprobability = 0.25\n";
    let all = &["lookahead", "adaptable", "esterel"][..];
    for (name, case, executors, seeds) in [
        ("sf3", "p1", all, 9 / one_in::<u64>(3)),
        ("af3", "p4", &["lookahead"][..], 3 / one_in::<u64>(3)),
    ] {
        let scene = machines(name, case);
        for executor in executors {
            for seed in 0..seeds {
                let report = scene.run(executor, &scene.world(failing), seed);
                let words = format!(
                    "{name}, {executor}: {:?}, {:?}",
                    report.verdict, report.reasons
                );
                assert!(has_reached(&report), "{words}");
                assert!(scene.judged(&report).is_valid(), "{words}");
                assert!(report.time < 30.into(), "{words}");
            }
        }
    }
}

/// By the likelihoods the goal may come about spontaneously, which never happens. The world has no
/// table, because one of its actions may have duration 0.
#[test]
fn chance_change_that_never_happens_is_not_awaited() {
    let idle = |name: &str, effect: &str| {
        format!(
            "(:durative-action {name} :parameters () :duration (and (>= ?duration 0) (<= ?duration 2))
               :condition (at start (free))
               :effect (and (at start (not (free))) (at end (free)) (at end {effect})))"
        )
    };
    for (goal, chance) in [
        ("(done)", "becomes_true"),
        ("(not (undone))", "becomes_false"),
    ] {
        let effect = goal;
        let domain = format!(
            "(define (domain d) (:requirements :durative-actions :duration-inequalities :negative-preconditions)
               (:predicates (free) (done) (undone) (seen)) {}
               (:durative-action work :parameters () :duration (= ?duration 5) :condition (at start (free))
                 :effect (and (at start (not (free))) (at end (free)) (at end {effect}))))",
            idle("idle", "(seen)")
        );
        let problem = format!(
            "(define (problem p) (:domain d) (:init (free) (undone)) (:goal (and {goal})))"
        );
        let fact = goal.trim_start_matches("(not ").trim_matches(['(', ')']);
        let unsteady = |when: &str| {
            format!(
                "[defaults]\nbecomes_true = 0.0\nbecomes_false = 0.0\nstart = 1.0\neffect = 1.0\n\
                 [facts.{fact}]\n{chance}{when} = 0.3\n[actions.work]\nstart = 0.9\n\
                 [actions.work.effects]\n{fact} = 0.5\n"
            )
        };
        for when in ["", "_per_second"] {
            let mut scene = Scene::new(&domain, &problem, Some("0: (idle) [1]\n1.001: (work) [5]"))
                .with_likelihoods(&unsteady(when));
            scene.settings.time_limit = 1000.into();
            for executor in ["lookahead", "adaptable"] {
                let report = scene.run(executor, &scene.world(""), 0);
                assert!(
                    has_reached(&report),
                    "{goal} {when} {executor}: {report:#?}"
                );
                assert!(
                    report.time < 30.into(),
                    "{goal} {when} {executor}: {report:#?}"
                );
            }
        }
    }
}
