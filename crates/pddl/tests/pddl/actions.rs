//! Actions, instantaneous and durative, as converted to the model.

use crate::reading;
use crate::reading::{mistakes, only_action, read_actions};
use insta::assert_snapshot;

/// Reads a durative action with this condition.
fn condition(text: &str) -> String {
    only_action(&format!(
        "(:durative-action a :parameters (?b - ball ?r - room) :duration () :condition {text})"
    ))
}

/// Reads a durative action with this effect.
fn effect(text: &str) -> String {
    only_action(&format!(
        "(:durative-action a :parameters (?b - ball ?r - room) :duration () :effect {text})"
    ))
}

/// Reads a durative action with this duration.
fn duration(text: &str) -> String {
    only_action(&format!(
        "(:durative-action a :parameters (?b - ball) :duration {text})"
    ))
}

#[test]
fn an_instantaneous_action_has_conditions_and_effects() {
    let action = only_action(
        "(:action throw :parameters (?b - ball ?from ?to - room)
           :precondition (and (in ?b ?from) (not (= ?from ?to)) (imply (lit) (open ?to)))
           :effect (and (in ?b ?to) (not (in ?b ?from)) (increase (level) (* 2 (size ?b)))))",
    );
    assert_snapshot!(action, @r"
    condition (and (in ?0 ?1) (not (= ?1 ?2)) (or (not (lit)) (open ?2)))
    effect (in ?0 ?2)
    effect (not (in ?0 ?1))
    effect (increase (level) (* 2 (size ?0)))
    ");
}

#[test]
fn conditions_and_effects_can_be_omitted() {
    assert_snapshot!(only_action("(:action a)"), @"");
    assert_snapshot!(only_action("(:action a :parameters () :precondition () :effect ())"), @"");
    assert_snapshot!(only_action("(:action a :precondition (and) :effect (and))"), @"");
}

#[test]
fn a_disjunction_keeps_a_part_that_always_holds() {
    assert_snapshot!(only_action("(:action a :precondition (or (and) (lit)))"), @"condition (or (and) (lit))");
    assert_snapshot!(only_action("(:action a :precondition (or))"), @"condition (or)");
}

#[test]
fn names_compare_without_case() {
    let action = only_action("(:ACTION A :Parameters (?B - BALL) :EFFECT (AND (In ?b HALL)))");
    assert_snapshot!(action, @"effect (in ?0 hall)");
}

#[test]
fn timed_conditions_are_sorted_by_time_through_and_and_forall() {
    let action = condition(
        "(and (at start (lit)) (over all (and (open ?r) (>= (level) 1)))
              (forall (?x - ball) (and (at start (in ?x ?r)) (at end (in ?x hall)))))",
    );
    assert_snapshot!(action, @r"
    at start (and (lit) (forall (?x - ball) (in ?2 ?1)))
    over all (and (open ?1) (>= (level) 1))
    at end (forall (?x - ball) (in ?2 hall))
    ");
}

#[test]
fn a_disjunction_of_conditions_at_one_time_is_a_condition_at_that_time() {
    assert_snapshot!(condition("(or (at end (lit)) (at end (open ?r)))"), @"at end (or (lit) (open ?1))");
    assert_snapshot!(condition("(not (over all (lit)))"), @"over all (not (lit))");
    assert_snapshot!(
        condition("(exists (?x - room) (at start (open ?x)))"),
        @"at start (exists (?x - room) (open ?2))"
    );
}

#[test]
fn at_can_also_be_a_predicate() {
    let domain = elbowroom_pddl::Source::new(
        "domain.pddl",
        "(define (domain d) (:predicates (at ?x ?y)) (:constants start robot)
           (:durative-action a :duration (= ?duration 1)
             :condition (and (at start (at robot start))) :effect (at end (not (at robot start)))))",
    );
    let problem = elbowroom_pddl::Source::new(
        "problem.pddl",
        "(define (problem p) (:domain d)
           (:init (at robot start) (at 10 (not (at robot start)))) (:goal (at robot start)))",
    );
    let task = reading::task(&domain, &problem);
    assert_eq!(task.initial().facts.len(), 1);
    assert_eq!(task.timed().len(), 1);
}

#[test]
fn durations_are_fixed_or_bounded_and_may_be_read_at_the_end() {
    assert_snapshot!(duration("(= ?duration (size ?b))"), @"duration = (size ?0)");
    assert_snapshot!(
        duration("(and (>= ?duration 1) (at end (<= ?duration (level))))"),
        @r"
    duration >= 1
    duration <= (level) at end
    "
    );
    assert_snapshot!(duration("(>= 3 ?duration)"), @"duration <= 3");
    assert_snapshot!(duration("()"), @"");
}

#[test]
fn effects_may_use_the_duration() {
    assert_snapshot!(
        effect("(and (at start (decrease (level) ?duration)) (at end (assign (speed) (/ 1 ?duration))))"),
        @r"
    start effect (decrease (level) ?duration)
    end effect (assign (speed) (/ 1 ?duration))
    "
    );
}

#[test]
fn a_guard_is_read_at_the_times_it_names() {
    assert_snapshot!(
        effect("(when (and (at start (lit)) (over all (open ?r)) (at end (dark ?r))) (at end (in ?b ?r)))"),
        @"end effect (in ?0 ?1) when at start (lit) when over all (open ?1) when now (dark ?1)"
    );
    assert_snapshot!(
        effect("(and (when (at start (lit)) (at start (open ?r))) (at end (when (lit) (open hall))))"),
        @r"
    start effect (open ?1) when now (lit)
    end effect (open hall) when now (lit)
    "
    );
}

#[test]
fn quantified_effects_carry_their_variables() {
    assert_snapshot!(
        effect("(forall (?x - ball) (forall (?y - room) (when (at start (in ?x ?y)) (at end (not (in ?x ?y))))))"),
        @"end effect (not (in ?2 ?3)) for all ?x - ball ?y - room when at start (in ?2 ?3)"
    );
}

#[test]
fn inner_forall_variables_are_renumbered_after_guard_variables() {
    assert_snapshot!(
        effect("(at end (when (exists (?z - ball) (in ?z ?r)) (forall (?y - ball) (in ?y ?r))))"),
        @"end effect (in ?2 ?1) for all ?y - ball when now (exists (?z - ball) (in ?3 ?1))"
    );
}

#[test]
fn continuous_change_is_any_form_that_is_linear_in_time() {
    let rate = |value: &str| effect(&format!("(increase (level) {value})"));
    assert_snapshot!(rate("#t"), @"rate of (level): 1");
    assert_snapshot!(rate("(* #t 2)"), @"rate of (level): 2");
    assert_snapshot!(rate("(* (speed) #t)"), @"rate of (level): (speed)");
    assert_snapshot!(rate("(* (* #t (speed)) 3)"), @"rate of (level): (* (speed) 3)");
    assert_snapshot!(rate("(/ #t (speed))"), @"rate of (level): (/ 1 (speed))");
    assert_snapshot!(rate("(+ (* #t 2) (* #t (speed)))"), @"rate of (level): (+ 2 (speed))");
    assert_snapshot!(rate("(- (* #t 2) #t)"), @"rate of (level): (+ 2 (- 1))");
    assert_snapshot!(rate("(* #T ?duration)"), @"rate of (level): ?duration");
    assert_snapshot!(effect("(decrease (level) (* #t 2))"), @"rate of (level): (- 2)");
    assert_snapshot!(effect("(decrease (level) (* #t (speed)))"), @"rate of (level): (- (speed))");
    assert_snapshot!(
        effect("(when (at start (lit)) (increase (level) (* #t 1)))"),
        @"rate of (level): 1 when at start (lit)"
    );
}

#[test]
fn sums_products_and_differences_take_any_number_of_operands() {
    let action = only_action(
        "(:action a :precondition (>= (+ 1 (level) (speed) (* 2 3 (level))) (- (level) 1 2))
                    :effect (scale-up (level) (- (speed))))",
    );
    assert_snapshot!(action, @r"
    condition (>= (+ 1 (level) (speed) (* 2 3 (level))) (- (level) (+ 1 2)))
    effect (scale-up (level) (- (speed)))
    ");
}

#[test]
fn open_numbers_belong_to_the_domain_or_to_the_action() {
    let action = only_action(
        "(:synth-parameters ?a ?b)
         (:durative-action a :parameters (?r - room) :synth-parameters (?c)
           :duration (and (>= ?duration ?b) (<= ?duration ?c)))",
    );
    assert_snapshot!(action, @r"
    duration >= unknown 1
    duration <= own unknown 0
    ");
}

#[test]
fn a_function_without_arguments_needs_no_parentheses() {
    assert_snapshot!(only_action("(:action a :effect (increase level 1))"), @"effect (increase (level) 1)");
}

#[test]
fn predicates_of_one_name_may_differ_in_their_number_of_arguments() {
    let domain = elbowroom_pddl::Source::new(
        "domain.pddl",
        "(define (domain d) (:predicates (p) (p ?x)) (:action a :parameters (?y) :effect (and (p) (p ?y))))",
    );
    let problem = elbowroom_pddl::Source::new(
        "problem.pddl",
        "(define (problem p) (:domain d) (:init (p)) (:goal (p)))",
    );
    assert_eq!(
        reading::task(&domain, &problem).problem().predicates.len(),
        2
    );
}

#[test]
fn either_ranges_over_all_its_types() {
    let action =
        only_action("(:action a :precondition (forall (?x - (either room ball)) (in ?x hall)))");
    assert_snapshot!(action, @"condition (forall (?x - room|ball) (in ?0 hall))");
}

#[test]
fn action_preferences_are_separate_from_conditions() {
    let (problem, warnings) = read_actions(
        "(:action a :precondition (and (lit) (preference p (open hall))))
         (:durative-action b :parameters (?r - room) :duration (= ?duration 1)
           :condition (and (at start (lit)) (forall (?b - ball)
             (preference q (and (at start (in ?b ?r)) (over all (open ?r)))))))",
    )
    .unwrap();
    assert!(warnings.is_empty());
    let printer = reading::Printer(&problem);
    assert_snapshot!(printer.schema(&problem.schemas[0]), @"condition (and (lit))");
    let said: Vec<_> = problem
        .action_preferences
        .iter()
        .map(|own| {
            let parts = [&own.at_start, &own.over_all, &own.at_end];
            let parts = parts.map(|part| printer.condition(part)).join(" ");
            format!(
                "{} {} {}: {parts}",
                problem.schemas[own.schema.index()].name,
                problem.preferences[own.preference.index()],
                own.variables.len()
            )
        })
        .collect();
    assert_eq!(
        said,
        [
            "a p 0: (open hall) (and) (and)",
            "b q 1: (in ?1 ?0) (open ?0) (and)"
        ]
    );
    for wrong in [
        "(not (preference (lit)))",
        "(preference p (preference q (lit)))",
    ] {
        let read = read_actions(&format!("(:action a :precondition {wrong})"));
        assert!(mistakes(read).contains("a preference is not allowed here"));
    }
}
