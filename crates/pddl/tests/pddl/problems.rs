//! Problem files: objects, initial states, goals, metrics.

use crate::reading;
use crate::reading::{Printer, read_sections};
use elbowroom_model::problem::{ObjectId, TimedChange};
use elbowroom_pddl::{Feature, Source, read_problem};
use insta::assert_snapshot;

#[test]
fn facts_numbers_and_timed_initials_are_distinguished() {
    let (problem, _) = read_sections(
        "(:init (in b1 kitchen) (not (lit)) (= (size b1) 2.5) (= (level) (- 3))
               (at 10 (lit)) (at 12.5 (not (lit))) (at 20 (= (level) 7)))
         (:goal (and))",
    )
    .unwrap();
    assert_eq!(problem.initial_facts.len(), 1);
    let values: Vec<_> = problem
        .initial_values
        .iter()
        .map(|(_, _, value)| value.to_string())
        .collect();
    assert_eq!(values, ["5/2", "-3"]);
    let times: Vec<_> = problem.timed.iter().map(|t| t.time.to_string()).collect();
    assert_eq!(times, ["10", "25/2", "20"]);
    assert!(matches!(problem.timed[1].change, TimedChange::Delete(..)));
    assert!(matches!(problem.timed[2].change, TimedChange::Assign(..)));
}

#[test]
fn timed_initials_that_contradict_each_other_at_one_time_are_refused() {
    let is_read = |init: &str| read_sections(&format!("(:init {init}) (:goal (and))")).is_ok();
    assert!(!is_read("(at 10 (lit)) (at 10 (not (lit)))"));
    assert!(!is_read(
        "(at 10 (not (lit))) (at 20 (= (level) 1)) (at 10.0 (lit))"
    ));
    assert!(!is_read("(at 10 (= (level) 1)) (at 10 (= (level) 2))"));
    // Repetition is not a contradiction, nor is a change at another time.
    assert!(is_read(
        "(at 10 (lit)) (at 10 (lit)) (at 10.001 (not (lit)))"
    ));
    assert!(is_read("(at 10 (= (level) 1)) (at 10 (= (level) 1))"));
}

#[test]
fn timed_initial_at_zero_belongs_to_initial_state() {
    let (problem, warnings) =
        read_sections("(:init (lit) (at 0 (not (lit))) (at 0 (= (level) 1))) (:goal (and))")
            .unwrap();
    assert!(problem.initial_facts.is_empty());
    assert_eq!(problem.initial_values.len(), 1);
    assert_eq!(warnings.len(), 2);
}

#[test]
fn total_cost_is_initially_0() {
    let domain = "(define (domain d) (:functions (total-cost))
        (:action work :parameters () :effect (increase (total-cost) 1)))";
    let read = |init: &str| {
        let problem = format!("(define (problem p) (:domain d) (:init {init}) (:goal (and)))");
        let source = |name: &str, text: &str| Source::new(name, text);
        read_problem(&source("domain", domain), &source("problem", &problem)).unwrap()
    };
    let (problem, warnings) = read("");
    assert_eq!(problem.initial_values[0].2.to_string(), "0");
    assert_eq!(warnings.len(), 1);
    let (problem, warnings) = read("(= (total-cost) 5)");
    assert_eq!(problem.initial_values[0].2.to_string(), "5");
    assert!(warnings.is_empty());
}

#[test]
fn objects_keep_their_case_and_compare_without() {
    let (problem, _) = read_sections("(:init (in b2 KITCHEN)) (:goal (and))").unwrap();
    assert_eq!(problem.objects[3].name, "B2");
    assert_eq!(problem.initial_facts[0].1, [ObjectId(3), ObjectId(1)]);
}

#[test]
fn goals_may_be_any_condition() {
    let (problem, _) = read_sections(
        "(:init) (:goal (and (or (lit) (not (open hall)))
             (forall (?b - ball) (exists (?r - room) (in ?b ?r))) (= b1 b1) (< (level) 3)))",
    )
    .unwrap();
    assert_snapshot!(
        Printer(&problem).condition(&problem.goal),
        @"(and (or (lit) (not (open hall))) (forall (?b - ball) (exists (?r - room) (in ?0 ?1))) (= b1 b1) (< (level) 3))"
    );
}

#[test]
fn metrics_count_time_numbers_and_violations() {
    let metric = |text: &str| {
        let goal = "(and (preference p (lit)) (forall (?b - ball) (preference q (in ?b hall))))";
        let (problem, warnings) =
            read_sections(&format!("(:init) (:goal {goal}) (:metric {text})")).unwrap();
        assert!(warnings.is_empty());
        let metric = problem.metric.clone().unwrap();
        let expression = Printer(&problem).expression(&metric.expression);
        (metric.maximize, expression)
    };
    assert_eq!(
        metric("minimize (+ (total-time) (* 2 (level)))"),
        (false, "(+ (total-time) (* 2 (level)))".to_owned())
    );
    assert_eq!(
        metric("maximize (- 3 (is-violated Q))"),
        (true, "(- 3 (is-violated q))".to_owned())
    );
    let wrong = |metric: &str| {
        let text = format!("(:init) (:goal (preference p1 (lit))) (:metric minimize {metric})");
        reading::mistakes(read_sections(&text))
    };
    assert!(wrong("(is-violated p2)").contains("did you mean `p1`?"));
    assert!(wrong("(is-violated)").contains("takes the name of a preference"));
}

#[test]
fn sections_without_effect_on_validity_are_ignored_with_warning() {
    let (_, warnings) = read_sections(
        "(:requirements :strips :mystery) (:init) (:goal (and)) (:length (:serial 3)) (:wibble 1)",
    )
    .unwrap();
    let features: Vec<_> = warnings
        .iter()
        .map(|w| Feature::of(w).unwrap().name())
        .collect();
    assert_eq!(
        features,
        ["unknown requirements", "other sections", "other sections"]
    );
}

#[test]
fn a_problem_of_another_domain_is_read_with_a_warning() {
    let problem = elbowroom_pddl::Source::new(
        "problem.pddl",
        "(define (problem p) (:domain e) (:objects hall - room) (:init) (:goal (and)))",
    );
    let (problem, warnings) = elbowroom_pddl::read_problem(&reading::domain(""), &problem).unwrap();
    assert_eq!(problem.objects.len(), 1);
    let messages: Vec<_> = warnings.iter().map(|w| w.message.as_str()).collect();
    assert_eq!(
        messages,
        [
            "a problem of domain `e`, read with `d`",
            "`hall` is declared already"
        ]
    );
}
