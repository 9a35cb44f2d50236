//! Headings of planners, which separate the plans of a log.

use elbowroom_pddl::{Source, read_plan};

use crate::plan_lines::{errors, notes, plan};
use crate::reading::{domain, problem, task};

#[test]
fn action_next_to_heading_is_an_error_with_its_line() {
    let plan = ["0: (wait) [2]", "7: (snap b1)"];
    for heading in [
        "Solution found: wait",
        "Solution found. Wait",
        "Found plan: wait!",
        "Found plan 'snap'",
        "plan: TimeTriggeredPlan: wait",
        "TimeTriggeredPlan: WAIT",
        "Plan computed: walk",
        "Solution number 2: wait",
        "Solution found: jump hall kitchen",
        "Solution found - 3: (launch rocket) [3]",
        "Found plan: 3: launch rocket [3]",
        "ff: found legal plan as follows: wait",
        "All goal deadlines now no later than wait",
        "[t=0.003s, 10084 KB] Solution found: wait",
        "[wait] Solution found!",
    ] {
        for at in 0..=plan.len() {
            let mut lines = plan.to_vec();
            lines.insert(at, heading);
            let possible = "this line may contain an action, but cannot be read";
            assert_eq!(
                errors(&lines.join("\n")),
                format!("{}: {possible}", at + 1),
                "{heading}"
            );
        }
    }
}

#[test]
fn words_of_heading_are_not_actions() {
    let names = [
        "computed",
        "cost",
        "deadlines",
        "follows",
        "found",
        "goal",
        "later",
        "legal",
        "metric",
        "new",
        "now",
        "number",
        "plan",
        "solution",
        "step",
        "time",
        "with",
    ];
    let actions: Vec<_> = names
        .map(|it| format!("(:durative-action {it} :duration (= ?duration 1))"))
        .into();
    let task = task(
        &domain(&actions.join(" ")),
        &problem("(:init) (:goal (lit))"),
    );
    for heading in [
        "Plan found:",
        "Solution found.",
        "Solution found!",
        "[t=0.003s, 10084 KB] Solution found!",
        "; Plan found with metric 3",
        ";;;; Solution Found",
        "Plan found with metric 3",
        "Plan found with cost: 3",
        "Found plan:",
        "Found new plan:",
        "Solution number: 2",
        "Plan computed:",
        "Plan:",
        "plan: ",
        "**** Plan ****",
        "Rescheduled Plan:",
        "TimeTriggeredPlan:",
        "plan: TimeTriggeredPlan:",
        "ff: found legal plan as follows",
        " * All goal deadlines now no later than 3.000",
    ] {
        let text = format!("0: (found) [1]\n{heading}\n0: (plan) [1]\n1: (time) [1]\n");
        let read = read_plan(&Source::new("plan", text), &task);
        let (plan, notes) = read.unwrap_or_else(|found| panic!("{}", found.render(false)));
        assert_eq!(plan.steps.len(), 2, "{heading}");
        assert_eq!(notes[0].message, "the file has 2 plans", "{heading}");
    }
    // A line in the notation of Fast Downward.
    let text = "found\nplan\ntime (1)\n";
    let (plan, _) = read_plan(&Source::new("plan", text), &task).unwrap();
    assert_eq!(plan.steps.len(), 3);
}

#[test]
fn last_plan_of_a_log_is_read_with_a_note() {
    let log = "; Plan found with metric 9\n0: (wait) [9]\nnoise\n; Plan found with metric 4\n0: (wait) [4]\n";
    assert_eq!(plan(log), "0.000: (wait) [4.000]");
    assert_eq!(notes(log), "the file has 2 plans");
    assert_eq!(
        errors("Found plan: 0: (snap b1)\n1: (wait) [1]")
            .split(':')
            .next(),
        Some("1")
    );
}

#[test]
fn comment_between_steps_does_not_start_new_plan() {
    for comment in [
        "; new plan",
        ";; plan",
        "; found plan b",
        "; solution found",
    ] {
        let log = format!("0: (wait) [2]\n{comment}\n7: (snap b1)\n");
        assert_eq!(
            plan(&log),
            "0.000: (wait) [2.000]; 7.000: (snap b1)",
            "{comment}"
        );
        assert_eq!(notes(&log), "", "{comment}");
    }
}
