//! Plan text, read and written.

use crate::reading;
use crate::reading::{domain, problem, task};
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_pddl::{Diagnostic, Diagnostics, Source, read_plan, write_plan};
use insta::assert_snapshot;

/// Returns a task with two rooms and two balls. The domain gives the duration of `walk`, the plan
/// that of `wait`; `snap` is instantaneous.
fn house() -> Task {
    let domain = domain(
        "(:durative-action walk :parameters (?from ?to - room) :duration (= ?duration (* 2 (speed))))
         (:durative-action carry :parameters (?b - ball) :duration (= ?duration (level)))
         (:durative-action wait :duration (>= ?duration 1) :effect (at end (increase (level) 1)))
         (:action snap :parameters (?b - ball))",
    );
    task(
        &domain,
        &problem("(:init (= (speed) 2) (= (level) 3)) (:goal (and))"),
    )
}

fn read(text: &str) -> Result<(TimeTriggeredPlan, Vec<Diagnostic>), Diagnostics> {
    read_plan(&Source::new("plan", text), &house())
}

/// Returns the plan in a text, written again.
fn rewritten(text: &str) -> String {
    let task = house();
    match read_plan(&Source::new("plan", text), &task) {
        Ok((plan, _)) => write_plan(&task, &plan),
        Err(diagnostics) => panic!("{}", diagnostics.render(false)),
    }
}

fn mistakes(text: &str) -> String {
    reading::mistakes(read(text))
}

#[test]
fn a_plan_is_times_actions_and_durations() {
    let plan =
        rewritten("0: (walk hall kitchen) [4]\n4.001: (snap B2)\n 0.0005 : ( WAIT ) [ 1.5 ]");
    assert_snapshot!(plan, @r"
    0.000: (walk hall kitchen) [4.000]
    0.0005: (wait) [1.500]
    4.001: (snap B2)
    ");
}

#[test]
fn planner_output_around_plan_is_skipped() {
    let log = "Number of literals: 4
b (10.000 | 0.100)b (8.000 | 0.200)(G)
; Plan found with metric 12.0
; States evaluated so far: 3
; Time 0.01
0.000: (wait)  [12.000]

* All goal deadlines now no later than 12.000

; Plan found with metric 4.0
; Time 0.02
0.000: (walk hall kitchen)  [4.000] ; there
; and on
4.001: (walk kitchen hall)  [4.000]

;;;; Solution Found
";
    assert_snapshot!(rewritten(log), @r"
    0.000: (walk hall kitchen) [4.000]
    4.001: (walk kitchen hall) [4.000]
    ");
    let (_, warnings) = read(log).unwrap();
    assert_eq!(warnings[0].message, "the file has 2 plans");
    assert_eq!(warnings[0].line(), 12);
}

#[test]
fn lpg_writes_durations_and_costs_in_one_bracket() {
    let log = "Plan computed:
   Time: (ACTION) [action Duration; action Cost]
 0.0003:   (WALK HALL KITCHEN) [D:4.0000; C:0.1000]

Solution number: 1
Total time:      0.01";
    assert_snapshot!(rewritten(log), @"0.0003: (walk hall kitchen) [4.000]");
}

#[test]
fn actions_without_times_happen_one_after_the_other() {
    assert_snapshot!(rewritten("(snap b1)\n(snap b2)\n(walk hall kitchen)"), @r"
    0.000: (snap b1)
    1.000: (snap B2)
    2.000: (walk hall kitchen) [4.000]
    ");
}

#[test]
fn missing_time_of_some_actions_is_an_error() {
    assert_snapshot!(
        mistakes("0: (snap b1)\n(snap b2)"),
        @"plan:2:2: error: an action without a time; expected `time: (action argument …) [duration]`"
    );
}

#[test]
fn a_missing_duration_is_taken_from_the_domain_only_where_it_is_fixed() {
    assert_snapshot!(rewritten("0: (walk hall kitchen)"), @"0.000: (walk hall kitchen) [4.000]");
    let found = read("0: (carry b1)\n1: (wait)").unwrap_err();
    assert_snapshot!(found.render(false), @r"
    error: `carry` has no duration here
     --> plan:1:5
      |
    1 | 0: (carry b1)
      |     ^^^^^ it depends on `level`, which changes
      |
      = help: write it after the action: `[10.000]`

    error: `wait` has no duration here
     --> plan:2:5
      |
    2 | 1: (wait)
      |     ^^^^ the domain allows more than one duration
      |
      = help: write it after the action: `[10.000]`
    ");
}

#[test]
fn a_wrong_action_is_shown_with_what_is_expected() {
    let found =
        read("0: (wlak hall kitchen) [4]\n1: (snap b3)\n2: (snap hall)\n3: (snap)").unwrap_err();
    assert_snapshot!(found.render(false), @r"
    error: unknown action `wlak`
     --> plan:1:5
      |
    1 | 0: (wlak hall kitchen) [4]
      |     ^^^^
      |
      = help: did you mean `walk`?

    error: unknown object `b3`
     --> plan:2:10
      |
    2 | 1: (snap b3)
      |          ^^
      |
      = help: did you mean `b1`?

    error: `hall` cannot be bound to ?b of `snap`: it is not of type ball
     --> plan:3:5
      |
    3 | 2: (snap hall)
      |     ^^^^^^^^^
      |
      = help: expected `(snap ?b - ball)`

    error: `snap` takes 1 arguments, not 0
     --> plan:4:5
      |
    4 | 3: (snap)
      |     ^^^^
      |
      = help: expected `(snap ?b - ball)`
    ");
}

#[test]
fn malformed_line_is_an_error() {
    assert_snapshot!(
        mistakes("0.0: (snap b1\n1: (snap b1) twice\n2: (wait) [3\n-1: (snap b1)\n4: (wait) [x]\n1e999: (snap b1)"),
        @r"
    plan:1:14: error: this is not an action of a plan; expected `time: (action argument …) [duration]`
    plan:2:14: error: this is not an action of a plan; expected `time: (action argument …) [duration]`
    plan:3:13: error: this is not an action of a plan; expected `time: (action argument …) [duration]`
    plan:4:1: error: a negative time; times and durations are at least 0
    plan:5:12: error: `x` is not a number: write a decimal such as 12.5 or a fraction such as 25/2
    plan:6:1: error: `1e999` is not a number: write a decimal such as 12.5 or a fraction such as 25/2
    "
    );
}

#[test]
fn malformed_line_of_discarded_plan_is_ignored() {
    assert_eq!(mistakes("0: (snap\nPlan found\n0: (snap b1)"), "none");
}

#[test]
fn an_action_that_takes_no_time_needs_no_duration() {
    assert!(read("0: (snap b1) [0.001]").unwrap().1.is_empty());
    assert_eq!(read("0: (snap b1) [3]").unwrap().1.len(), 1);
}

#[test]
fn a_text_without_actions_is_an_empty_plan_with_a_warning() {
    let (plan, warnings) = read("; nothing to do\n").unwrap();
    assert!(plan.steps.is_empty());
    assert_eq!(warnings.len(), 1);
}

#[test]
fn numbers_survive_writing_and_reading() {
    let text = "1/3: (wait) [22/7]\n0.1: (wait) [1.000000000000000000000000000001]\n";
    let task = house();
    let (plan, _) = read_plan(&Source::new("plan", text), &task).unwrap();
    let written = write_plan(&task, &plan);
    let (again, _) = read_plan(&Source::new("plan", written), &task).unwrap();
    assert_eq!(again, plan);
}

/// Returns the warnings for a plan that is read successfully.
fn remarks(text: &str) -> String {
    let (_, warnings) = read(text).unwrap_or_else(|wrong| panic!("{wrong}"));
    let lines: Vec<String> = warnings.iter().map(ToString::to_string).collect();
    lines.join("\n")
}

#[test]
fn lenient_reading_is_reported_as_note() {
    // A unit of time.
    assert_snapshot!(remarks("0: (wait) [9 min]"), @"plan:1:14: warning: `min` is ignored; a duration is a number in brackets, in the domain's unit: `[10.000]`");
    // No brackets.
    assert_snapshot!(remarks("0: (walk hall kitchen) 4"), @"plan:1:5: warning: read as a plan from the terminal of PlanSys2: time, action, duration; the usual format is `0.000: (action argument …) [10.000]`");
    // No duration at all, reported once.
    assert_snapshot!(remarks("0: (walk hall kitchen)\n9: (walk kitchen hall)"), @"plan:1:5: warning: `walk` has no duration here: 4 is used, from the domain; write it after the action, as in `[10.000]`; reported only once");
    // No times.
    assert_snapshot!(remarks("(snap b1)\n(snap b2)"), @"plan:1:2: warning: no action has a time: each starts when the one before it has ended, and 1 later if that takes no time; write the time before the action: `0.000: (action argument …) [10.000]`");
    assert_eq!(
        remarks("0: (wait) [9]\n1: (snap b1)\n2: (wait) [D:2.0; C:0.1]"),
        ""
    );
}
