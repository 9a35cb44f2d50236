//! Functions whose values are objects, as predicates with one more argument.

use crate::reading::{mistakes, task};
use elbowroom_model::validate::{Settings, Verdict, validate};
use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_pddl::{ProblemText, Source, read_plan, read_problem, write_problem};
use insta::assert_snapshot;

const DOMAIN: &str = "(define (domain d) (:types place robot - object) (:constants home - place)
(:predicates (near ?a ?b - place) (seen ?p - place))
(:functions (position ?r - robot) - place (post) - place (fuel ?r - robot) - number (depth ?p - place))
(:action jump :parameters (?r - robot ?p - place)
  :precondition (and (near (position ?r) ?p) (> (fuel ?r) (depth (position ?r))))
  :effect (and (assign (position ?r) ?p) (decrease (fuel ?r) 1)))
(:action look :parameters (?r - robot) :precondition (= (position ?r) (post)) :effect (seen home))
(:action vanish :parameters (?r - robot) :effect (assign (position ?r) undefined))
(:durative-action drive :parameters (?r - robot ?p - place) :duration (= ?duration 2)
  :condition (at start (not (= (position ?r) ?p))) :effect (change (position ?r) ?p)))";

fn problem(sections: &str) -> Source {
    let text = format!(
        "(define (problem p) (:domain d) (:objects a b - place r - robot)
           (:init (= (position r) home) (= (post) b) (near home a) (near a b) (= (fuel r) 9)
                  (= (depth home) 1) (= (depth a) 1) (= (depth b) 20) (at 10 (= (position r) a)))
           {sections})"
    );
    Source::new("problem.pddl", text)
}

fn verdict_on(goal: &str, plan: &str) -> String {
    let task = task(
        &Source::new("domain.pddl", DOMAIN),
        &problem(&format!("(:goal {goal})")),
    );
    let plan = if plan.is_empty() {
        TimeTriggeredPlan::default()
    } else {
        read_plan(&Source::new("plan", plan), &task)
            .expect("a plan")
            .0
    };
    match validate(&task, &plan, &Settings::default()) {
        Verdict::Valid(report) => {
            let facts = report.state.facts.iter().map(|fact| task.fact_name(*fact));
            let values: Vec<_> = facts.filter(|fact| fact.starts_with("(= (pos")).collect();
            format!("valid {}", values.join(" "))
        }
        other => other
            .violation()
            .map_or_else(|| "undecided".to_owned(), ToString::to_string),
    }
}

#[test]
fn an_assignment_replaces_the_value() {
    assert_snapshot!(verdict_on("(= (position r) b)", "1: (jump r a)\n2: (jump r b)\n11: (jump r b)"), @"valid (= (post) b) (= (position r) b)");
    assert_snapshot!(verdict_on("(= (position r) home)", "1: (jump r a)"), @"at 10.000: the goal (= (position r) home) does not hold: (= (position r) home) is false since (jump r a) at 1.000");
}

#[test]
fn values_are_arguments_in_conditions() {
    assert_snapshot!(verdict_on("(seen home)", "1: (jump r a)\n2: (jump r b)\n3: (look r)"), @"valid (= (post) b) (= (position r) a)");
    let missing = verdict_on("(seen home)", "1: (jump r b)");
    assert!(
        missing.starts_with("at 1.000: (jump r b) needs (or "),
        "{missing}"
    );
}

#[test]
fn durative_assignment_leaves_value_undefined_meanwhile() {
    assert_snapshot!(verdict_on("(seen home)", "1: (drive r b) [2]\n4: (look r)"), @"valid (= (post) b) (= (position r) a)");
    let meanwhile = verdict_on("(seen home)", "1: (drive r b) [2]\n2: (look r)");
    assert!(
        meanwhile.starts_with("at 2.000: (look r) needs"),
        "{meanwhile}"
    );
}

#[test]
fn a_function_may_be_undefined() {
    assert_snapshot!(verdict_on("(= (position r) undefined)", "11: (vanish r)"), @"valid (= (post) b)");
    let defined = verdict_on("(= (position r) undefined)", "");
    assert!(
        defined.starts_with("at 10.000: the goal (not (or "),
        "{defined}"
    );
}

#[test]
fn a_written_problem_has_the_same_values() {
    let domain = Source::new("domain.pddl", DOMAIN);
    let goal = "(:goal (and (= (position r) (post)) (not (near (post) a))))";
    let task: Task = task(&domain, &problem(goal));
    let text = write_problem(&task, &Situation::initial(&task), &ProblemText::default());
    let text = text.expect("nothing is running");
    assert!(
        text.contains("(= (position r) home)") && text.contains("(at 10 (= (position r) a))"),
        "{text}"
    );
    let (again, _) = read_problem(&domain, &Source::new("written.pddl", text)).expect("right");
    assert_eq!(again.goal, task.problem().goal);
    assert_eq!(again.timed, task.problem().timed);
    assert_eq!(
        again.initial_facts.len(),
        task.problem().initial_facts.len()
    );
}

#[test]
fn error_messages_suggest_a_fix() {
    let read = |goal: &str| {
        let domain = Source::new("domain.pddl", DOMAIN);
        mistakes(read_problem(&domain, &problem(&format!("(:goal {goal})"))))
    };
    assert_snapshot!(read("(position r)"), @"problem.pddl:4:20: error: `position` is a function, not a predicate; compare its value with an object, as in `(= (f) object)`");
    assert_snapshot!(read("(> (position r) 3)"), @"problem.pddl:4:23: error: the values of `position` are objects, not numbers; compare it with an object, as in `(= (f) object)`");
    assert_snapshot!(read("(= (position r) 3)"), @"problem.pddl:4:35: error: `3` is a number, not an object; expected the name of an object, or a `?variable`");
    assert_snapshot!(read("(= (position r home) home)"), @"problem.pddl:4:22: error: `position` takes 1 argument, not 2; expected `(position ?r)`");
    assert_snapshot!(read("(= (positon r) home)"), @r#"
problem.pddl:4:23: error: unknown function `positon`; declare it under `:functions`
problem.pddl:4:34: error: unknown function `home`; declare it under `:functions`
"#);
}

#[test]
fn value_of_wrong_type_is_reported() {
    let warnings = |domain: &str, goal: &str| {
        let problem = problem(&format!("(:goal {goal})"));
        let read = read_problem(&Source::new("domain.pddl", domain), &problem);
        let (_, warnings) = read.expect("no mistake");
        let lines: Vec<_> = warnings.iter().map(ToString::to_string).collect();
        lines.join("\n")
    };
    assert_snapshot!(warnings(DOMAIN, "(= (position r) r)"), @"problem.pddl:4:35: warning: `r` is of type robot, but `position` asks for place");
    let domain = DOMAIN.replace("(position ?r) undefined", "(position ?r) ?r");
    assert_ne!(domain, DOMAIN);
    assert_snapshot!(warnings(&domain, "(seen home)"), @"domain.pddl:8:72: warning: `?r` is of type robot, but `position` asks for place");
    assert_snapshot!(warnings(DOMAIN, "(= (position r) home)"), @"");
}
