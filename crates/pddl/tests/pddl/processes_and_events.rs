//! Processes and events: their reading and their validation.

use crate::reading::{mistakes, read_actions, task};
use elbowroom_model::Task;
use elbowroom_model::validate::{Settings, Verdict, validate};
use elbowroom_pddl::{Source, read_plan};
use insta::assert_snapshot;

/// Returns the task of a domain with these processes, events and actions, and a problem with these
/// sections.
fn plus(domain: &str, sections: &str) -> Task {
    let frame = "(define (domain d)
(:predicates (on) (off) (broken) (done) (p) (q))
(:functions (x) (y) (z))
(:action switch-on :effect (and (on) (not (off))))
(:action switch-off :effect (and (off) (not (on))))
(:action look :precondition (p) :effect (done))
(:durative-action watch :duration (>= ?duration 0) :condition (over all (not (broken))) :effect (at end (done)))
(:durative-action rise :duration (>= ?duration 0) :effect (increase (x) (* #t 1)))
";
    let problem = format!("(define (problem p) (:domain d) {sections})");
    task(
        &Source::new("domain.pddl", format!("{frame}{domain})")),
        &Source::new("problem.pddl", problem),
    )
}

/// Returns the verdict in words, with the final values for a valid plan.
fn verdict(task: &Task, plan: &str, settings: &Settings) -> String {
    let (plan, _) = read_plan(&Source::new("plan", plan), task).expect("a plan");
    match validate(task, &plan, settings) {
        Verdict::Valid(report) => {
            let values = report.state.values.iter();
            let values: Vec<_> = values
                .map(|(fluent, value)| format!("{} = {value}", task.fluent_name(*fluent)))
                .collect();
            format!("valid {}", values.join(", ")).trim_end().to_owned()
        }
        Verdict::Invalid(violation) => violation.to_string(),
        Verdict::Undecided(undecided) => format!("undecided: {undecided}"),
    }
}

fn verdict_on(domain: &str, sections: &str, plan: &str) -> String {
    verdict(&plus(domain, sections), plan, &Settings::default())
}

const FILLING: &str = "(:process filling :precondition (on) :effect (increase (x) (* #t 2)))";

#[test]
fn process_is_active_while_its_condition_holds() {
    let init = "(:init (= (x) 0)) (:goal (>= (x) 6))";
    assert_snapshot!(verdict_on(FILLING, init, "1: (switch-on)\n4: (switch-off)"), @"valid (x) = 6");
    assert_snapshot!(
        verdict_on(FILLING, init, "1: (switch-on)\n3.5: (switch-off)\n9: (switch-on)"),
        @"at 9.000: the goal (>= (x) 6) does not hold: (x) = 5, short by 1"
    );
    // From the very beginning until the evaluation of the goal.
    let init = "(:init (on) (= (x) 0)) (:goal (= (x) 4))";
    assert_snapshot!(verdict_on(FILLING, init, "2: (switch-off)"), @"valid (x) = 4");
}

#[test]
fn processes_and_actions_add_up() {
    let init = "(:init (on) (= (x) 0)) (:goal (and))";
    assert_snapshot!(verdict_on(FILLING, init, "1: (rise) [3]"), @"valid (x) = 11");
}

#[test]
fn process_stops_at_bound_and_next_process_starts() {
    let both = "(:process up :precondition (< (x) 3) :effect (increase (x) (* #t 2)))
        (:process on :precondition (>= (x) 3) :effect (increase (y) (* #t 1)))";
    let init = "(:init (= (x) 0) (= (y) 0)) (:goal (and))";
    assert_snapshot!(verdict_on(both, init, "5: (switch-on)"), @"valid (x) = 3, (y) = 7/2");
}

#[test]
fn an_event_happens_as_soon_as_its_condition_holds() {
    let overflow = format!(
        "{FILLING} (:event overflow :precondition (and (>= (x) 5) (not (broken))) :effect (broken))"
    );
    let init = "(:init (on) (= (x) 0)) (:goal (and))";
    assert_snapshot!(verdict_on(&overflow, init, "0.1: (watch) [2]"), @"valid (x) = 21/5");
    assert_snapshot!(
        verdict_on(&overflow, init, "0.1: (watch) [2.4]"),
        @"valid (x) = 5"
    );
    assert_snapshot!(
        verdict_on(&overflow, init, "0.1: (watch) [2.5]"),
        @"at 2.500: (watch) needs (not (broken)) over all: (broken) is true since the event (overflow) at 2.500"
    );
}

#[test]
fn an_event_on_a_strict_bound_happens_right_after_it() {
    let strict = "(:process run :precondition (on) :effect (increase (x) (* #t 1)))
        (:event e :precondition (and (> (x) 3) (on)) :effect (and (p) (not (on))))";
    let init = "(:init (on) (= (x) 0)) (:goal (and))";
    assert_snapshot!(verdict_on(strict, init, "5: (look)"), @"valid (x) = 3");
    // Exactly at the bound, it has not happened.
    assert_snapshot!(verdict_on(strict, init, "3: (look)"), @"at 3.000: (look) needs (p): (p) is false");
}

#[test]
fn events_cause_events_before_anything_else_happens() {
    let chain = "(:event a :precondition (on) :effect (and (not (on)) (q)))
        (:event b :precondition (and (q) (not (p))) :effect (p))";
    let init = "(:init) (:goal (done))";
    assert_snapshot!(verdict_on(chain, init, "1: (switch-on)\n1.001: (look)"), @"valid");
    assert_snapshot!(
        verdict_on(chain, init, "1: (switch-on)\n1.0005: (look)"),
        @"at 1.0005: (look) interferes: the event (b) at 1.000 and (look) at 1.0005 both concern (p) and must be at least 0.001 apart"
    );
}

#[test]
fn endlessly_repeating_event_is_reported_by_name() {
    let init = "(:init) (:goal (and))";
    assert_snapshot!(
        verdict_on("(:event again :precondition (on) :effect (p))", init, "2: (switch-on)"),
        @"at 2.000: the event (again) happens infinitely often: its effects do not make its precondition false"
    );
    let pair = "(:event there :precondition (on) :effect (and (not (on)) (off)))
        (:event back :precondition (and (off) (q)) :effect (and (not (off)) (on)))";
    assert_snapshot!(
        verdict_on(pair, "(:init (q)) (:goal (and))", "2: (switch-on)"),
        @"at 2.000: the event (there) happens infinitely often: other events make its precondition true again at the same time"
    );
}

#[test]
fn chattering_process_is_reported_by_name() {
    let drain = "(:process drain :precondition (>= (x) 0) :effect (decrease (x) (* #t 1)))";
    assert_snapshot!(
        verdict_on(drain, "(:init (= (x) 2)) (:goal (and))", "5: (switch-on)"),
        @"undecided: at 2.000: the process (drain) would start and stop infinitely often: it makes its condition false while active, and the condition is true while it is inactive"
    );
}

#[test]
fn two_events_at_once_must_not_interfere() {
    let two = "(:event a :precondition (on) :effect (and (not (on)) (p)))
        (:event b :precondition (on) :effect (and (not (on)) (q)))";
    assert_snapshot!(
        verdict_on(two, "(:init) (:goal (and))", "2: (switch-on)"),
        @"at 2.000: interferes: the event (a) at 2.000 and the event (b) at 2.000 both concern (on) and must not happen at the same time"
    );
}

/// A ball that falls with x = t² / 2.
const FALL: &str = "(:process fall :precondition (on)
      :effect (and (increase (x) (* #t (y))) (increase (y) (* #t 1))))";

#[test]
fn an_event_at_an_irrational_moment_changes_facts_exactly() {
    let fall = format!(
        "{FALL} (:event e :precondition (and (>= (x) 1) (not (p))) :effect (and (p) (increase (z) 1)))"
    );
    let init = "(:init (on) (= (x) 0) (= (y) 0) (= (z) 0)) (:goal (done))";
    // √2 is 1.41421356…
    assert_snapshot!(verdict_on(&fall, init, "1.4153: (look)"), @"valid (x) = 200307409/200000000, (y) = 14153/10000, (z) = 1");
    assert_snapshot!(verdict_on(&fall, init, "1.4142: (look)"), @"at 1.4142: (look) needs (p): (p) is false");
    assert_snapshot!(
        verdict_on(&fall, init, "1.41521: (look)"),
        @"at 1.41521: (look) interferes: the event (e) at about 1.414213 and (look) at 1.41521 both concern (p) and must be at least 0.001 apart"
    );
}

#[test]
fn process_stopped_at_bound_has_exact_value_at_irrational_time() {
    let stop = format!("{FALL} (:event e :precondition (and (>= (x) 1) (on)) :effect (not (on)))");
    let init = "(:init (on) (= (x) 0) (= (y) 0) (= (z) 0)) (:goal (= (x) 1))";
    assert_snapshot!(verdict_on(&stop, init, "3: (switch-off)"), @"valid (x) = 1, (z) = 0");
    // The speed at that moment is √2.
    let init = "(:init (on) (= (x) 0) (= (y) 0)) (:goal (> (y) 1))";
    assert_snapshot!(
        verdict_on(&stop, init, "3: (switch-off)"),
        @"undecided: at 3.000: (> (y) 1) reads (y), whose value is irrational: its rate of change changed at an irrational time"
    );
    let reset = format!(
        "{FALL} (:event e :precondition (and (>= (x) 1) (on)) :effect (and (not (on)) (assign (y) 0) (off)))"
    );
    assert_snapshot!(verdict_on(&reset, "(:init (on) (= (x) 0) (= (y) 0)) (:goal (= (y) 0))", "3: (switch-off)"), @"valid (x) = 1, (y) = 0");
}

#[test]
fn a_rate_that_depends_on_its_own_fluent_is_undecided() {
    let grow = "(:process grow :precondition (on) :effect (increase (x) (* #t (x))))";
    assert_snapshot!(
        verdict_on(grow, "(:init (on) (= (x) 1)) (:goal (> (x) 2))", "1: (switch-off)"),
        @"undecided: at 0.000: nonlinear change: the rate of (x) depends on (x) itself, so its value is not a polynomial in time"
    );
}

#[test]
fn zeno_behaviour_is_undecided() {
    let bounce =
        "(:process fall :precondition (on) :effect (and (increase (x) (* #t (y))) (decrease (y) (* #t 2))))
         (:event bounce :precondition (and (<= (x) 0) (< (y) 0)) :effect (and (assign (x) 0) (assign (y) (* -0.5 (y)))))";
    let init = "(:init (on) (= (x) 0) (= (y) 8)) (:goal (and))";
    assert_snapshot!(verdict_on(bounce, init, "14.5: (switch-off)"), @"valid (x) = 1/4, (y) = 0");
    // The bounces come closer and closer to 16.
    assert_snapshot!(verdict_on(bounce, init, "17: (switch-off)"), @"undecided: at about 16: events happen, or processes start and stop, more than 1000 times before the next happening of the plan");
}

#[test]
fn global_constraints_hold_in_each_state() {
    let limited = format!("{FILLING} (:constraint limit :parameters () :condition (<= (x) 5))");
    let init = "(:init (on) (= (x) 0)) (:goal (and))";
    assert_snapshot!(verdict_on(&limited, init, "2.5: (switch-off)"), @"valid (x) = 5");
    assert_snapshot!(
        verdict_on(&limited, init, "2.6: (switch-off)"),
        @"just after 2.500: the constraint (always (<= (x) 5)) is violated: (<= (x) 5) does not hold"
    );
    let event = format!(
        "{FILLING} (:event e :precondition (and (>= (x) 4) (on)) :effect (and (broken) (not (on))))
        (:constraint whole :condition (not (broken)))"
    );
    assert_snapshot!(
        verdict_on(&event, init, "2.6: (switch-off)"),
        @"at 2.000: the constraint (always (not (broken))) is violated: (not (broken)) does not hold"
    );
}

#[test]
fn errors_in_processes_and_events_suggest_a_fix() {
    let read = |text: &str| mistakes(read_actions(text));
    assert_snapshot!(read("(:process p :precondition (lit) :effect (lit))"), @"domain.pddl:6:41: error: `(lit)` is not a continuous change; effects of a process are `(increase (f) (* #t rate))`");
    assert_snapshot!(read("(:process p :effect (at start (lit)))"), @"domain.pddl:6:21: error: `(at …)` does not belong here; time specifier in an effect of a process");
    assert_snapshot!(read("(:process p :effect (when (lit) (increase (level) (* #t 1))))"), @"domain.pddl:6:21: error: a conditional effect of a process; write a separate process with the condition as its precondition");
    assert_snapshot!(read("(:process p :effect (increase (level) 1))"), @"domain.pddl:6:21: error: `(increase …)` is not a continuous change; effects of a process are `(increase (f) (* #t rate))`");
    assert_snapshot!(read("(:event e :effect (increase (level) (* #t 1)))"), @"domain.pddl:6:40: error: `#t` is not allowed here; it is defined only in effects of processes, and in continuous effects of durative actions outside of `at start` and `at end`");
    assert_snapshot!(read("(:event)"), @"domain.pddl:6:2: error: an event without a name; expected `(:event name …)`");
    assert_snapshot!(read("(:event e :condition (lit) :effect (not (lit)))"), @"domain.pddl:6:11: error: unknown keyword `:condition` in event `e`; did you mean `:precondition`?");
    assert_snapshot!(read("(:event e :effect (lit)) (:event e :effect (lit))"), @"domain.pddl:6:34: error: an event `e` is declared already; give each a unique name");
    assert_snapshot!(read("(:constraint c)"), @"domain.pddl:6:14: error: a constraint `c` without a condition; expected `:condition` and a condition on each state");
}

#[test]
fn process_or_event_in_plan_is_refused() {
    let task = plus(
        "(:process fill :effect (increase (x) (* #t 1))) (:event e :precondition (p) :effect (not (p)))",
        "(:init (= (x) 0)) (:goal (and))",
    );
    let read = |plan: &str| mistakes(read_plan(&Source::new("plan", plan), &task));
    assert_snapshot!(read("1: (e)"), @"plan:1:5: error: `e` is an event; events and processes happen by themselves and cannot be steps of plans");
    assert_snapshot!(read("1: (fill) [3]"), @"plan:1:5: error: `fill` is a process; events and processes happen by themselves and cannot be steps of plans");
}

/// `at` is a predicate of many domains.
#[test]
fn an_event_and_a_goal_have_no_start_and_no_end() {
    let domain = "(define (domain d) (:predicates (at ?x ?y) (done))
(:event e :precondition (at start (done)) :effect (not (done))))";
    let read = |domain: &str, goal: &str| {
        let problem =
            format!("(define (problem p) (:domain d) (:objects start b) (:init) (:goal {goal}))");
        mistakes(elbowroom_pddl::read_problem(
            &Source::new("domain.pddl", domain),
            &Source::new("problem.pddl", problem),
        ))
    };
    assert_snapshot!(read(domain, "(done)"), @"domain.pddl:2:25: error: `(at …)` does not belong here; time specifiers are allowed only in durative actions, and not inside each other");
    let domain = domain.replace("(at start (done))", "(done)");
    assert_snapshot!(read(&domain, "(at end (done))"), @"problem.pddl:1:67: error: `(at …)` does not belong here; time specifiers are allowed only in durative actions, and not inside each other");
    assert_snapshot!(read(&domain, "(at start b)"), @"none");
}
