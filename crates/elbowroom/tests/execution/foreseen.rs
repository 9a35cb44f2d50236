//! Expected situation after the next steps of the current plan, for planning in the background and
//! for planning in advance during a delay.

use elbowroom::execute::Execution;
use elbowroom::execution::{Command, Event, Passage, Request, World, WorldError};
use elbowroom::model::{RunningAction, Situation};
use elbowroom::num::Rational;

use crate::beside::{Beside, Telling, Told, assert_has, seconds, settings, telling, told_in};
use crate::lasting::scripted::{fact, pursue, task};
use crate::scene::{Scene, irr};

/// Returns the names and start times of the running actions.
fn under_way(situation: &Situation) -> Vec<(String, String)> {
    let words = |it: &RunningAction| (it.action.name.clone(), it.start.to_decimal(1));
    situation.running.iter().map(words).collect()
}

/// Makes a persistent run: `r` fetches all items, one after the other. The first plan is ready
/// after 12 seconds, and another one is requested when the goal is repeated.
fn errands(script: Vec<(i64, Event)>, quarters: &[i64]) -> (Told, Vec<Situation>) {
    let goal = "(and (have book) (have cup) (have key))";
    let task = task("", goal);
    let planner = Beside::taking(&[seconds(12)]);
    let script = script
        .into_iter()
        .map(|(time, event)| (seconds(time), event));
    let (mut world, is_to_end) = telling((200, script.collect()), &planner, quarters);
    let execution = Execution::of(&task)
        .with_envelopes(irr())
        .by("guarded".parse().expect("a registered one"))
        .with_settings(settings())
        .lasting(true);
    let told = told_in(execution, &task, &planner, &mut world, &is_to_end);
    let asked = planner.desk().asked.clone();
    (told, asked)
}

fn the_goal_once_more() -> Event {
    pursue("problem", "(and (have cup) (have book) (have key))")
}

/// After a pause all remaining actions are late. They are still executed one after the other.
#[test]
fn what_is_late_after_a_pause_is_expected_in_its_order() {
    let (told, asked) = errands(
        vec![
            (13, Event::Asked(Request::Pause)),
            (40, Event::Asked(Request::Resume)),
            (41, the_goal_once_more()),
        ],
        &[],
    );
    assert_has(
        &told,
        &["12: start", "40: start", "41: plan", "rest: goal-reached"],
    );
    assert_eq!(told.report.starts, 3, "{:#?}", told.notes);
    // The third job begins when the second is over.
    let third = under_way(&asked[1]);
    assert_eq!(third.len(), 1, "{third:?}");
    assert_eq!(third[0].1, "50", "{third:?}");
}

/// A late action is expected to take a quarter longer than its current age, and its successors
/// follow it.
#[test]
fn what_waits_for_something_late_is_expected_after_it() {
    let (told, asked) = errands(vec![(23, the_goal_once_more())], &[2, 0, 0]);
    assert_has(&told, &["12: start", "23: plan", "rest: goal-reached"]);
    assert_eq!(told.report.starts, 3, "{:#?}", told.notes);
    // It has taken 11 seconds.
    let second = under_way(&asked[1]);
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
    inner: Telling,
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

    fn wait(&mut self, until: &Rational) -> Result<Passage, WorldError> {
        self.inner.wait(until)
    }
}

/// Runs with an endless walk and a planning time of one second.
fn walking(
    durations: &[(&'static str, Rational)],
    script: Vec<(Rational, Event)>,
) -> (Told, Beside) {
    let scene = Scene::new(DOMAIN, PROBLEM, Some(PLAN));
    let planner = Beside::taking(&[seconds(1)]);
    let (inner, is_to_end) = telling((20, script), &planner, &[]);
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
    let told = told_in(execution, &scene.task, &planner, &mut world, &is_to_end);
    assert_has(&told, &["14: (walk) must end by 15.3", "15.3: plan"]);
    (told, planner)
}

/// Returns the start time of the lift.
#[track_caller]
fn lift(told: &Told) -> f64 {
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
fn what_ends_and_starts_as_planned_is_part_of_what_is_planned_ahead() {
    for milliseconds in [14_500, 14_503, 14_497, 14_550] {
        let wash = [("(wash)", Rational::new(milliseconds, 1000))];
        let (told, planner) = walking(&wash, Vec::new());
        let desk = planner.desk();
        assert_eq!(names(&desk.ahead[0]), ["(walk)", "(dry)"]);
        assert_eq!(desk.ahead.len(), 1, "{milliseconds}: {:#?}", told.notes);
        assert_eq!(desk.asked, desk.ahead, "{milliseconds}: {:#?}", told.notes);
        let lift = lift(&told);
        assert!(lift < 16.0, "{milliseconds}, {lift}: {:#?}", told.notes);
    }
}

/// If another action is late as well, or a fact changes unexpectedly, the planner receives the new
/// expected situation.
#[test]
fn what_comes_otherwise_than_foreseen_is_foreseen_anew() {
    let (told, planner) = walking(&[("(wash)", seconds(30))], Vec::new());
    let desk = planner.desk();
    assert_eq!(names(&desk.ahead[1]), ["(walk)", "(wash)"]);
    assert_eq!(desk.asked[0], desk.ahead[1], "{:#?}", told.notes);
    // The plan was begun a quarter of a second after the planned end of the washing.
    let began = lift(&told);
    assert!(began < 16.0, "{began}: {:#?}", told.notes);

    let task = Scene::new(DOMAIN, PROBLEM, Some(PLAN)).task;
    let gone = fact(&task, "(path)", true);
    let (told, planner) = walking(&[], vec![(Rational::new(142, 10), gone)]);
    let desk = planner.desk();
    assert_eq!(desk.ahead.len(), 2, "{:#?}", told.notes);
    assert_eq!(desk.asked[0], desk.ahead[1], "{:#?}", told.notes);
}
