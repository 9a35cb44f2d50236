//! Diagnostics for texts with mistakes.

use crate::reading::{domain, mistakes, problem, read_actions, read_sections};
use elbowroom_pddl::{Severity, Source, read_problem};
use insta::assert_snapshot;

fn rendered(actions: &str) -> String {
    let diagnostics = read_actions(actions).expect_err("a mistake");
    diagnostics.render(false)
}

#[test]
fn misspelt_name_is_reported_with_suggestion() {
    assert_snapshot!(rendered("(:action a :parameters (?r - roon) :effect (opne ?r))"), @r"
    error: unknown type `roon`
     --> domain.pddl:6:30
      |
    6 | (:action a :parameters (?r - roon) :effect (opne ?r)))
      |                              ^^^^
      |
      = help: did you mean `room`?

    error: unknown predicate `opne`
     --> domain.pddl:6:45
      |
    6 | (:action a :parameters (?r - roon) :effect (opne ?r)))
      |                                             ^^^^
      |
      = help: did you mean `open`?
    ");
}

#[test]
fn a_wrong_number_of_arguments_is_shown_with_the_declaration() {
    assert_snapshot!(rendered("(:action a :parameters (?r - room) :effect (in ?r))"), @r"
    error: `in` takes 2 arguments, not 1
     --> domain.pddl:6:44
      |
    6 | (:action a :parameters (?r - room) :effect (in ?r)))
      |                                            ^^^^^^^
      |
      = help: expected `(in ?b ?r)`
    ");
}

#[test]
fn missing_time_specifier_is_reported() {
    assert_snapshot!(
        rendered("(:durative-action a :duration (= ?duration 1) :condition (lit) :effect (at end (not (lit))))"),
        @r"
    error: `(lit)` has no time specifier
     --> domain.pddl:6:58
      |
    6 | (:durative-action a :duration (= ?duration 1) :condition (lit) :effect (at end (not (lit)))))
      |                                                          ^^^^^
      |
      = help: expected `(at start …)`, `(over all …)` or `(at end …)`
    "
    );
}

#[test]
fn every_mistake_of_an_action_is_reported() {
    let found = mistakes(read_actions(
        "(:durative-action a :parameters (?x) :duration (= ?dur 1)
           :condition (at start (blue ?x))
           :effect (and (at end (in ?x nowhere)) (lit) (at strat (lit))))
         (:action b :precondition (>= (level) ?z))",
    ));
    assert_snapshot!(found, @r"
    domain.pddl:6:48: error: `(= …)` does not bound the duration; expected `(= ?duration value)`, `(<= ?duration value)` or `(and …)` of such
    domain.pddl:7:34: error: unknown predicate `blue`; declare it under `:predicates`
    domain.pddl:8:40: error: unknown object `nowhere`; declare it under `:objects` or `:constants`
    domain.pddl:8:50: error: `(lit)` has no time specifier; expected `(at start …)` or `(at end …)`, or for continuous change `(increase (f) (* #t rate))`
    domain.pddl:8:56: error: `(at …)` has no time specifier; did you mean `at start`?
    domain.pddl:9:47: error: unknown number `?z`; declare open numbers under `:synth-parameters`
    ");
}

#[test]
fn missing_parenthesis_is_located_at_next_section() {
    let actions = "(:action a :effect (and (lit) (open hall))\n(:action b :effect (lit))";
    assert_snapshot!(rendered(actions), @r"
    error: `(` without a matching `)`
     --> domain.pddl:6:1
      |
    6 | (:action a :effect (and (lit) (open hall))
      | ^ this list is still open …
      |
     ::: domain.pddl:7:1
      |
    7 | (:action b :effect (lit)))
      | - … where `(:action` begins
      |
      = help: close it before the next section
    ");
}

#[test]
fn files_in_the_wrong_order_are_recognized() {
    let read = read_problem(&problem("(:init) (:goal (and))"), &domain(""));
    assert_snapshot!(mistakes(read), @r"
    problem.pddl:1:9: error: this is a problem, not a domain; are the two files given in the wrong order?
    domain.pddl:1:9: error: this is a domain, not a problem; are the two files given in the wrong order?
    ");
}

#[test]
fn an_empty_file_is_no_domain() {
    let empty = Source::new("empty.pddl", "");
    let read = read_problem(&empty, &problem("(:init) (:goal (and))"));
    assert_snapshot!(mistakes(read), @"empty.pddl:1:1: error: this is not a PDDL domain; expected `(define (domain name) …)`");
}

#[test]
fn a_condition_of_a_durative_action_is_not_called_a_precondition() {
    let found = read_actions("(:durative-action a :duration () :precondition (at start (lit)))");
    let found = found.unwrap_err();
    let first = found.errors().next().unwrap();
    assert_eq!(first.advice.as_deref(), Some("did you mean `:condition`?"));
    assert_eq!((first.line(), first.column()), (6, 34));
}

#[test]
fn effect_that_depends_on_later_condition_is_refused() {
    let found = mistakes(read_actions(
        "(:durative-action a :duration () :effect (when (at end (lit)) (at start (open hall))))",
    ));
    assert_snapshot!(found, @"domain.pddl:6:48: error: the condition is read after its effect happens; only effects `at end` may depend on conditions `at end`");
}

#[test]
fn derived_predicates_cannot_be_set_nor_negate_themselves() {
    let found = mistakes(read_actions(
        "(:derived (lit) (exists (?r - room) (not (dark ?r))))
         (:derived (dark ?r - room) (not (lit)))
         (:action a :effect (lit))",
    ));
    assert_snapshot!(found, @r"
    domain.pddl:8:29: error: `lit` is a derived predicate and cannot be set; change the facts that its rules read
    domain.pddl:6:11: error: `lit` depends on its own negation; a derived predicate may not be negated in its own definition
    domain.pddl:7:20: error: `dark` depends on its own negation; a derived predicate may not be negated in its own definition
    ");
}

#[test]
fn negation_of_other_derived_predicate_is_allowed() {
    let read = read_actions(
        "(:derived (lit) (exists (?r - room) (open ?r)))
         (:derived (dark ?r - room) (and (not (lit)) (not (open ?r))))",
    );
    assert_eq!(read.unwrap().0.rules.len(), 2);
}

#[test]
fn a_type_cannot_be_its_own_supertype() {
    let domain = Source::new("d", "(define (domain d) (:types a - b b - c c - a d - a))");
    let problem = problem("(:init) (:goal (and))");
    assert!(mistakes(read_problem(&domain, &problem)).contains("is in a cycle of subtypes"));
}

#[test]
fn the_initial_state_is_facts_and_numbers() {
    let found = mistakes(read_sections(
        "(:init (in b1 kitchn) (= (size b1) (level)) (>= (level) 3) (at -3 (lit)) lit) (:goal (and))",
    ));
    assert_snapshot!(found, @r"
    problem.pddl:2:15: error: unknown object `kitchn`; did you mean `kitchen`?
    problem.pddl:2:36: error: `(level)` is not a constant; expected a number
    problem.pddl:2:45: error: unexpected `(>= …)`; expected `(predicate object …)`, `(= (function object …) number)`, or one of these in `(at time …)`
    problem.pddl:2:64: error: a time before 0; the plan begins at time 0
    problem.pddl:2:74: error: unexpected `lit`; expected `(predicate object …)`, `(= (function object …) number)`, or one of these in `(at time …)`
    ");
}

#[test]
fn an_argument_of_the_wrong_type_is_a_warning() {
    let (_, warnings) = read_sections("(:init (open b1)) (:goal (in b1 kitchen))").unwrap();
    assert_eq!(warnings.len(), 1);
    assert_eq!(warnings[0].severity, Severity::Warning);
    assert_snapshot!(
        warnings[0].message,
        @"`b1` is of type ball, but `open` asks for room"
    );
}

#[test]
fn bytes_that_are_not_text_are_reported_unless_commented_out() {
    let text = b"(define (problem p) ;\xff\n (:domain d) (:init \xff\xfe \0) (:goal (and)))";
    let read = read_problem(&domain(""), &Source::from_bytes("problem.pddl", text));
    assert_snapshot!(mistakes(read), @r"
    problem.pddl:2:21: error: this is not UTF-8 text; PDDL is plain text: parentheses, words, numbers and `;` comments
    problem.pddl:2:24: error: unexpected character U+0000; PDDL is plain text: parentheses, words, numbers and `;` comments
    ");
}

#[test]
fn colored_output_has_same_text() {
    let diagnostics = read_actions("(:action a :effect (opne hall))").unwrap_err();
    assert!(diagnostics.render(true).contains("\u{1b}["));
    assert!(!diagnostics.render(false).contains('\u{1b}'));
}

/// Two functions, a predicate, and an action that assigns one of the functions.
const ROOM: &str = "(define (domain room)
  (:requirements :durative-actions :fluents :timed-initial-literals)
  (:predicates (lit))
  (:functions (speed) (level))
  (:action measure :parameters () :effect (assign (level) 3)))";

/// Returns the diagnostics for a problem with these sections.
fn diagnostics_of(sections: &str) -> String {
    let problem = format!("(define (problem p) (:domain room) {sections})");
    let read = read_problem(
        &Source::new("room", ROOM),
        &Source::new("problem", problem.as_str()),
    );
    let found = match read {
        Ok((_, warnings)) => warnings,
        Err(wrong) => wrong.into(),
    };
    let lines: Vec<String> = found.iter().map(ToString::to_string).collect();
    lines.join("\n")
}

#[test]
fn a_timed_initial_without_parentheses_shows_its_form() {
    assert_snapshot!(diagnostics_of("(:init (at 120 not (lit))) (:goal (lit))"), @"problem:1:43: error: invalid timed initial; write `(at 120 (not (lit)))`");
    assert_snapshot!(diagnostics_of("(:init (at 120 lit)) (:goal (lit))"), @"problem:1:43: error: invalid timed initial; write `(at 120 (p …))`, `(at 120 (not (p …)))` or `(at 120 (= (f …) 5))`");
}

#[test]
fn decimal_comma_is_reported() {
    assert_snapshot!(diagnostics_of("(:init (= (speed) 1,5)) (:goal (lit))"), @"problem:1:54: error: unknown function `1,5`; write 1.5");
}

#[test]
fn goal_on_fluent_without_value_is_reported() {
    assert_snapshot!(diagnostics_of("(:init) (:goal (and (lit) (>= (speed) 2)))"), @"problem:1:45: warning: the goal reads `(speed)`, which never gets a value; write `(= (speed) …)` under `:init`");
    assert_eq!(diagnostics_of("(:init) (:goal (>= (level) 2))"), "");
    assert_eq!(
        diagnostics_of("(:init (= (speed) 1)) (:goal (>= (speed) 2))"),
        ""
    );
}

#[test]
fn a_plan_in_the_place_of_the_problem_is_recognized() {
    let read = read_problem(
        &Source::new("room", ROOM),
        &Source::new("a.plan", "0.000: (measure)\n1.000: (measure)"),
    );
    assert_snapshot!(read.unwrap_err().to_string(), @"a.plan:1:1: error: this is not a PDDL problem; it looks like a plan; the order is DOMAIN PROBLEM PLAN");
}
