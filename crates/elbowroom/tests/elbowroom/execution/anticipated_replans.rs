//! Expected situation after the next steps of the current plan, for planning in the background and
//! for planning in advance during a delay.

use elbowroom::execute::Execution;
use elbowroom::execution::{Command, Event, Request, TimeAdvance, World, WorldError};
use elbowroom::model::{RunningAction, Situation};
use elbowroom::num::Rational;

use crate::execution::background_planner::{
    AnnouncingWorld, RunResult, ScriptedBackgroundPlanner, announcing_world, assert_has,
    run_recorded_in, seconds, settings,
};
use crate::execution::persistent::scripted::{fact, pursue, task};
use crate::execution::scene::{Scene, irr};

/// Returns the names and start times of the running actions.
fn running_actions(situation: &Situation) -> Vec<(String, String)> {
    let words = |it: &RunningAction| (it.action.name.clone(), it.start.to_decimal(1));
    situation.running.iter().map(words).collect()
}

/// Makes a persistent run: `r` fetches all items, one after the other. The first plan is ready
/// after 12 seconds, and another one is requested when the goal is repeated.
fn errands(script: Vec<(i64, Event)>, quarters: &[i64]) -> (RunResult, Vec<Situation>) {
    let goal = "(and (have book) (have cup) (have key))";
    let task = task("", goal);
    let planner = ScriptedBackgroundPlanner::with_planning_times(&[seconds(12)]);
    let script = script
        .into_iter()
        .map(|(time, event)| (seconds(time), event));
    let (mut world, must_end) = announcing_world((200, script.collect()), &planner, quarters);
    let execution = Execution::of(&task)
        .with_envelopes(irr())
        .by("guarded".parse().expect("a registered one"))
        .with_settings(settings())
        .persistent(true);
    let told = run_recorded_in(execution, &task, &planner, &mut world, &must_end);
    let asked = planner.state().requested.clone();
    (told, asked)
}

fn repeated_goal() -> Event {
    pursue("problem", "(and (have cup) (have book) (have key))")
}

/// After a pause all remaining actions are late. They are still executed one after the other.
#[test]
fn late_actions_after_pause_are_predicted_in_plan_order() {
    let (told, asked) = errands(
        vec![
            (13, Event::Requested(Request::Pause)),
            (40, Event::Requested(Request::Resume)),
            (41, repeated_goal()),
        ],
        &[],
    );
    assert_has(
        &told,
        &["12: start", "40: start", "41: plan", "rest: goal-reached"],
    );
    assert_eq!(told.report.starts, 3, "{:#?}", told.notes);
    // The third job begins when the second is over.
    let third = running_actions(&asked[1]);
    assert_eq!(third.len(), 1, "{third:?}");
    assert_eq!(third[0].1, "50", "{third:?}");
}

/// A late action is expected to take a quarter longer than its current age, and its successors
/// follow it.
#[test]
fn successor_of_late_action_is_predicted_after_it() {
    let (told, asked) = errands(vec![(23, repeated_goal())], &[2, 0, 0]);
    assert_has(&told, &["12: start", "23: plan", "rest: goal-reached"]);
    assert_eq!(told.report.starts, 3, "{:#?}", told.notes);
    // It has taken 11 seconds.
    let second = running_actions(&asked[1]);
    assert_eq!(second.len(), 1, "{second:?}");
    assert_eq!(second[0].1, "25.8", "{second:?}");
}

/// One robot walks and climbs until 26; there is a lift as an alternative. Meanwhile another one
/// dries the washing.
const DOMAIN: &str = "(define (domain late)
  (:requirements :durative-actions :timed-initial-literals)
  (:predicates (path) (half) (there) (open) (wet) (clean) (dry) (lamp))
  (:durative-action walk :parameters () :duration (= ?duration 10)
    :condition (and (at start (path)) (over all (open)))
    :effect (and (at start (not (path))) (at end (half))))
  (:durative-action climb :parameters () :duration (= ?duration 10)
    :condition (and (at start (half)) (over all (open))) :effect (at end (there)))
  (:durative-action lift :parameters () :duration (= ?duration 3)
    :condition (at start (lamp)) :effect (at end (there)))
  (:durative-action wash :parameters () :duration (= ?duration 14.5)
    :condition (at start (wet)) :effect (and (at start (not (wet))) (at end (clean))))
  (:durative-action dry :parameters () :duration (= ?duration 6)
    :condition (at start (clean)) :effect (and (at start (not (clean))) (at end (dry)))))";

const PROBLEM: &str = "(define (problem late) (:domain late)
  (:init (path) (open) (wet) (lamp) (at 26 (not (open)))) (:goal (and (there) (dry))))";

const PLAN: &str = "0.000: (walk) [10.000]\n0.000: (wash) [14.500]\n10.001: (climb) [10.000]\n14.501: (dry) [6.000]\n";

/// World with the given durations.
struct Deviating<'w> {
    inner: AnnouncingWorld,
    durations: &'w [(&'static str, Rational)],
}

impl World for Deviating<'_> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        let mut command = command.clone();
        if let Command::Start {
            action, duration, ..
        } = &mut command
            && let Some((_, other)) = self.durations.iter().find(|(it, _)| action.name == *it)
        {
            *duration = Some(other.clone());
        }
        self.inner.command(now, &command)
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        self.inner.wait(until)
    }
}

/// Runs with an endless walk and a planning time of one second.
fn run_with_endless_walk(
    durations: &[(&'static str, Rational)],
    script: Vec<(Rational, Event)>,
) -> (RunResult, ScriptedBackgroundPlanner) {
    let scene = Scene::new(DOMAIN, PROBLEM, Some(PLAN));
    let planner = ScriptedBackgroundPlanner::with_planning_times(&[seconds(1)]);
    let (inner, must_end) = announcing_world((20, script), &planner, &[]);
    let walk = [("(walk)", seconds(50))];
    let durations = [&walk, durations].concat();
    let mut world = Deviating {
        inner,
        durations: &durations,
    };
    let execution = Execution::of(&scene.task)
        .with_envelopes(irr())
        .by("guarded".parse().expect("a registered one"))
        .beginning_with(scene.plan.clone())
        .with_settings(settings());
    let told = run_recorded_in(execution, &scene.task, &planner, &mut world, &must_end);
    assert_has(&told, &["14: (walk) must end by 15.3", "15.3: plan"]);
    (told, planner)
}

/// Returns the start time of the lift.
#[track_caller]
fn lift(told: &RunResult) -> f64 {
    let starts = told.notes.iter();
    let lift = starts.filter_map(|it| it.strip_suffix(": start (lift)"));
    let lift: Vec<f64> = lift.filter_map(|it| it.parse().ok()).collect();
    assert_eq!(lift.len(), 1, "{:#?}", told.notes);
    lift[0]
}

fn names(situation: &Situation) -> Vec<String> {
    let names = situation.running.iter();
    names.map(|it| it.action.name.clone()).collect()
}

/// The washing ends and the drying begins during the wait for the walk, as planned or slightly
/// earlier or later. The plan that was begun at the warning is ready when it is needed.
#[test]
fn predicted_events_are_part_of_the_anticipated_situation() {
    for milliseconds in [14_500, 14_503, 14_497, 14_550] {
        let wash = [("(wash)", Rational::new(milliseconds, 1000))];
        let (told, planner) = run_with_endless_walk(&wash, Vec::new());
        let desk = planner.state();
        assert_eq!(names(&desk.anticipated[0]), ["(walk)", "(dry)"]);
        assert_eq!(
            desk.anticipated.len(),
            1,
            "{milliseconds}: {:#?}",
            told.notes
        );
        assert_eq!(
            desk.requested, desk.anticipated,
            "{milliseconds}: {:#?}",
            told.notes
        );
        let lift = lift(&told);
        assert!(lift < 16.0, "{milliseconds}, {lift}: {:#?}", told.notes);
    }
}

/// If another action is late as well, or a fact changes unexpectedly, the planner receives the new
/// expected situation.
#[test]
fn deviation_from_prediction_triggers_new_prediction() {
    let (told, planner) = run_with_endless_walk(&[("(wash)", seconds(30))], Vec::new());
    let desk = planner.state();
    assert_eq!(names(&desk.anticipated[1]), ["(walk)", "(wash)"]);
    assert_eq!(desk.requested[0], desk.anticipated[1], "{:#?}", told.notes);
    // The plan was begun a quarter of a second after the planned end of the washing.
    let began = lift(&told);
    assert!(began < 16.0, "{began}: {:#?}", told.notes);

    let task = Scene::new(DOMAIN, PROBLEM, Some(PLAN)).task;
    let gone = fact(&task, "(path)", true);
    let (told, planner) = run_with_endless_walk(&[], vec![(Rational::new(142, 10), gone)]);
    let desk = planner.state();
    assert_eq!(desk.anticipated.len(), 2, "{:#?}", told.notes);
    assert_eq!(desk.requested[0], desk.anticipated[1], "{:#?}", told.notes);
}
