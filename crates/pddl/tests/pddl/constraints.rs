//! Trajectory constraints, and the validator's verdicts on them.

#![allow(
    clippy::format_push_string,
    reason = "the tests put texts together, and know what is in them"
)]

use crate::reading::{mistakes, problem, read_actions, read_sections, task};
use elbowroom_model::Situation;
use elbowroom_model::validate::{Settings, Verdict, validate};
use elbowroom_pddl::{ProblemText, Source, read_plan, write_problem};
use insta::assert_snapshot;

const DOMAIN: &str = "(define (domain d)
(:types room ball - object)
(:constants hall - room)
(:predicates (in ?b - ball ?r - room) (lit) (open ?r - room))
(:functions (level))
(:constraints (forall (?r - room) (at-most-once (open ?r))))
(:durative-action carry :parameters (?b - ball ?from ?to - room) :duration (= ?duration 3)
  :condition (and (at start (in ?b ?from)) (preference light (over all (lit))))
  :effect (and (at start (not (in ?b ?from))) (at end (in ?b ?to))))
(:action light :precondition () :effect (lit))
(:action open :parameters (?r - room) :precondition () :effect (open ?r)))
";

/// Returns the validator's verdict on a plan for a problem with these sections.
fn verdict_on(sections: &str, plan: &str) -> String {
    let problem = problem(&format!("(:init (in b1 kitchen) (in B2 hall)) {sections}"));
    let task = task(&Source::new("domain.pddl", DOMAIN), &problem);
    let (plan, _) = read_plan(&Source::new("plan", plan), &task).expect("a plan");
    match validate(&task, &plan, &Settings::default()) {
        Verdict::Valid(report) => {
            let violated = &report.preferences.violated;
            let mut text = match report.metric(&task) {
                Some(metric) => format!("valid, {metric}"),
                None => "valid".to_owned(),
            };
            for one in violated {
                let name = &task.problem().preferences[one.preference.index()];
                text += &format!("\n{name} at {}: {}", one.time.to_decimal(3), one.why);
            }
            text
        }
        Verdict::Invalid(violation) => violation.to_string(),
        Verdict::Undecided(undecided) => format!("undecided: {undecided}"),
    }
}

const PLAN: &str = "1: (carry b1 kitchen hall) [3]
2: (light)
5: (open kitchen)
6: (carry b2 hall kitchen) [3]";

#[test]
fn violated_constraint_is_reported_with_time_and_reason() {
    let constraints =
        |text: &str| verdict_on(&format!("(:goal (and)) (:constraints {text})"), PLAN);
    assert_snapshot!(
        constraints("(within 3 (in b1 hall))"),
        @"at 3.000: the constraint (within 3 (in b1 hall)) is violated: (in b1 hall) does not hold until 3"
    );
    assert_snapshot!(constraints("(within 4 (in b1 hall))"), @r"
    valid
    light at 1: (lit) does not hold over all
    ");
    assert_snapshot!(
        constraints("(forall (?b - ball) (always (exists (?r - room) (in ?b ?r))))"),
        @"at 1.000: the constraint (always (or (in b1 hall) (in b1 kitchen))) is violated: (or (in b1 hall) (in b1 kitchen)) does not hold: (in b1 hall) is false; (in b1 kitchen) is false since the start of (carry b1 kitchen hall) at 1.000"
    );
    assert_snapshot!(
        constraints("(and (sometime (open hall)) (sometime-before (in b1 hall) (open kitchen)))"),
        @"at 4.000: the constraint (sometime-before (in b1 hall) (open kitchen)) is violated: (in b1 hall) holds, but (open kitchen) never held before"
    );
}

#[test]
fn violated_preferences_are_counted_in_the_metric() {
    let sections = "(:goal (and (in b1 hall) (preference shut (not (open kitchen)))
                        (forall (?r - room) (preference opened (open ?r)))))
         (:constraints (and (preference soon (within 3 (in b1 hall)))
                            (preference late (hold-after 9 (in b2 kitchen)))))
         (:metric minimize (+ (total-time) (+ (* 10 (is-violated light))
            (+ (* 100 (is-violated opened)) (* 1000 (is-violated soon))))))";
    assert_snapshot!(verdict_on(sections, PLAN), @r"
    valid, 1119
    light at 1: (lit) does not hold over all
    shut at 9: (at end (not (open kitchen))): (not (open kitchen)) does not hold at the end
    opened at 9: (at end (open hall)): (open hall) does not hold at the end
    soon at 3: (within 3 (in b1 hall)): (in b1 hall) does not hold until 3
    ");
}

#[test]
fn a_domains_constraints_bind_its_problems() {
    let domain = "(define (domain d) (:predicates (lit))
        (:constraints (at-most-once (lit)))
        (:action on :effect (lit)) (:action off :effect (not (lit))))";
    let problem = "(define (problem p) (:domain d) (:init) (:goal (and)))";
    let task = task(
        &Source::new("domain.pddl", domain),
        &Source::new("problem.pddl", problem),
    );
    let plan = Source::new("plan", "1: (on)\n2: (off)\n3: (on)");
    let (plan, _) = read_plan(&plan, &task).expect("a plan");
    let verdict = validate(&task, &plan, &Settings::default());
    let violation = verdict.violation().expect("it is on twice");
    assert_snapshot!(
        violation,
        @"at 3.000: the constraint (at-most-once (lit)) is violated: (lit) holds again"
    );
}

#[test]
fn a_written_problem_has_the_same_constraints() {
    let sections = "(:init (in b1 kitchen)) (:goal (and (lit) (preference end (open hall))))
         (:constraints (and (always-within 2.5 (lit) (open hall)) (hold-during 1 7/2 (lit))
            (forall (?b - ball) (preference p (and (sometime-after (lit) (in ?b hall))
                                                   (at end (lit)))))))
         (:metric minimize (+ (is-violated p) (is-violated end)))";
    let domain = Source::new("domain.pddl", DOMAIN);
    let first = task(&domain, &problem(sections));
    let text = write_problem(&first, &Situation::initial(&first), &ProblemText::default());
    let text = text.expect("nothing has happened");
    let again = task(&domain, &Source::new("again.pddl", text));
    assert_eq!(again.problem(), first.problem());
    assert_eq!(again.constraints(), first.constraints());

    let later = Situation {
        time: 1.into(),
        ..Situation::initial(&first)
    };
    let error = write_problem(&first, &later, &ProblemText::default()).unwrap_err();
    assert!(error.to_string().contains("the states so far"));
}

#[test]
fn goal_read_alone_ignores_preferences() {
    let (problem, _) = read_sections("(:init) (:goal (and))").expect("a problem");
    let read = |goal: &str| elbowroom_pddl::read_goal(&Source::new("goal", goal), &problem);
    assert!(read("(lit)").is_ok());
    assert!(mistakes(read("(preference p (lit))")).contains("a preference is not allowed here"));
}

#[test]
fn meaningless_constraints_are_errors() {
    let wrong = |text: &str| {
        mistakes(read_sections(&format!(
            "(:init) (:goal (and)) (:constraints {text})"
        )))
    };
    assert!(wrong("(lit)").contains("is not a trajectory constraint"));
    assert!(wrong("(not (always (lit)))").contains("is not a trajectory constraint"));
    assert!(wrong("(always (sometime (lit)))").contains("not inside each other"));
    assert!(wrong("(within (lit))").contains("expected `(within time condition)`"));
    assert!(wrong("(within soon (lit))").contains("unknown function `soon`"));
    assert!(wrong("(hold-during 3 2 (lit))").contains("must be later"));
    assert!(wrong("(within -1 (lit))").contains("a time below 0"));
    assert!(wrong("(allways (lit))").contains("is not a trajectory constraint"));
    let nested = wrong("(preference p (preference q (always (lit))))");
    assert!(nested.contains("a preference is not allowed here"));
}

#[test]
fn misplaced_forms_are_reported_with_their_proper_place() {
    let sections = "(:init) (:goal (and)) (:constraints (sometime (always (lit))))";
    assert_snapshot!(mistakes(read_sections(sections)), @"problem.pddl:2:48: error: `(always …)` does not belong here; trajectory constraints are allowed only under `:constraints`, and not inside each other");
    assert_snapshot!(mistakes(read_actions("(:action a :precondition (within 3 (lit)))")), @"domain.pddl:6:27: error: `(within …)` does not belong here; trajectory constraints are allowed only under `:constraints`, and not inside each other");
    assert_snapshot!(mistakes(read_actions("(:action a :effect (preference p (lit)))")), @"domain.pddl:6:21: error: `(preference …)` does not belong here; preferences are allowed in conditions, in goals and under `:constraints`");
}
