//! The search for a better plan after the loss of a guarantee, while the current plan is still
//! feasible.

use elbowroom::execution::Cause;
use elbowroom::execution::run::{PlanningTime, Report, RunSettings, Verdict};
use elbowroom::num::Rational;
use elbowroom::pipeline;

use crate::execution::background_planner::{
    RunResult, ScriptedBackgroundPlanner, ScriptedBackgroundPreparer, assert_has, run_recorded,
    settings,
};
use crate::execution::scene::Scene;

/// A large robot and a fast one. Either of them may walk to a place and inspect it before a deadline.
const DOMAIN: &str = "(define (domain robots)
    (:requirements :typing :durative-actions :fluents :timed-initial-literals) (:types robot)
    (:predicates (home ?r - robot) (there ?r - robot) (inspected) (day)) (:functions (pace ?r - robot))
    (:durative-action walk :parameters (?r - robot) :duration (= ?duration (* 2 (pace ?r)))
      :condition (and (at start (home ?r)) (over all (day)))
      :effect (and (at start (not (home ?r))) (at end (there ?r))))
    (:durative-action inspect :parameters (?r - robot) :duration (= ?duration (pace ?r))
      :condition (and (over all (there ?r)) (over all (day))) :effect (at end (inspected))))";

const PLAN: &str = "0: (walk large) [10]\n10.001: (inspect large) [5]";

fn scene(deadline: u32, fast_pace: u32) -> Scene {
    let problem = format!(
        "(define (problem p) (:domain robots) (:objects large fast - robot)
           (:init (home large) (home fast) (= (pace large) 5) (= (pace fast) {fast_pace}) (day)
             (at {deadline} (not (day))))
           (:goal (inspected)))"
    );
    let mut scene = Scene::new(DOMAIN, &problem, Some(PLAN));
    scene.flow = pipeline::Settings::default();
    scene
}

/// Runs with this duration of the large robot's walk. It is planned for 10, and the box guarantees
/// about 16.7.
fn run(deadline: u32, fast_pace: u32, walk: &str, planning_time: i64) -> Report {
    let mut scene = scene(deadline, fast_pace);
    scene.settings.planning_time = PlanningTime::Seconds(planning_time.into());
    let world = format!("[[duration]]\naction = \"(walk large)\"\nconstant = {walk}\n");
    scene.run("live", &scene.world(&world), 0)
}

#[test]
fn plan_with_more_slack_takes_over_while_the_present_one_is_still_feasible() {
    let report = run(25, 2, "21", 0);
    assert_eq!(report.verdict, Verdict::GoalReached, "{report:#?}");
    let causes = report.reasons.iter().map(|reason| reason.cause);
    assert_eq!(causes.collect::<Vec<_>>(), [Cause::MoreSlack]);
    let since = report.reasons[0].since.clone().expect("a time");
    assert!(since > Rational::from(16) && since < Rational::from(17));
    // After the last time at which the current plan is feasible, no other one is.
    let report = run(25, 2, "21", 1);
    assert_ne!(report.verdict, Verdict::GoalReached, "{report:#?}");
}

/// Runs with a planner in the background. The walk of the large robot takes 22.5 s.
fn run_with_background_planner(fast_pace: u32, seconds: i64, readying: &[Rational]) -> RunResult {
    let scene = scene(25, fast_pace);
    let planner = ScriptedBackgroundPlanner::with_planning_times(&[seconds.into()])
        .with_preparation_times(readying);
    let execution = scene.execution("live").with_settings(RunSettings {
        prepares_in_background: !readying.is_empty(),
        ..settings()
    });
    let execution = execution.with_preparer(ScriptedBackgroundPreparer(
        planner.clone(),
        scene.flow.clone(),
    ));
    run_recorded(
        execution,
        &scene.task,
        (100, Vec::new()),
        &planner,
        &[5, 0, 0],
    )
}

#[test]
fn present_plan_continues_while_a_better_one_is_made() {
    let readying: [&[i64]; 2] = [&[], &[1]];
    for times in readying {
        let times: Vec<Rational> = times.iter().map(|time| Rational::from(*time)).collect();
        let told = run_with_background_planner(2, 1, &times);
        assert_eq!(
            told.report.verdict,
            Verdict::GoalReached,
            "{:#?}",
            told.notes
        );
        let notes = ["16.7: plan", "17.7: the plan is there", "start (walk fast)"];
        assert_has(&told, &notes);
        // The other robot is too slow, or the planner is.
        for (fast_pace, seconds) in [(4, 1), (2, 50)] {
            let told = run_with_background_planner(fast_pace, seconds, &times);
            assert_ne!(
                told.report.verdict,
                Verdict::GoalReached,
                "{:#?}",
                told.notes
            );
            assert!(told.report.replans <= 3, "{:#?}", told.notes);
        }
    }
}

#[test]
fn current_plan_continues_if_no_other_has_more_slack() {
    for (deadline, fast_pace, walk) in [
        // The other robot is too slow.
        (25, 4, "18"),
        // The walk stays within the box, or there is time for everything.
        (25, 2, "16"),
        (1000, 2, "40"),
    ] {
        let report = run(deadline, fast_pace, walk, 0);
        assert_eq!(report.verdict, Verdict::GoalReached, "{report:#?}");
        assert_eq!(report.replans, 0, "{deadline}, {walk}: {report:#?}");
    }
}
