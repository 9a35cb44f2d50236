//! Two equal actions at one time.

use elbowroom_pddl::Source;

use crate::val_program::program::{PlanVerdict, Val, ours, task};

const CONDITIONS: [&str; 6] = [
    "(p)",
    "(r)",
    "(not (q))",
    "(>= (n) 0)",
    "(<= (m) 5)",
    "(>= (n) (m))",
];
const EFFECTS: [&str; 10] = [
    "(q)",
    "(p)",
    "(not (p))",
    "(not (q))",
    "(not (r))",
    "(increase (n) 1)",
    "(increase (n) (m))",
    "(decrease (m) 1)",
    "(assign (m) 2)",
    "(scale-up (n) 2)",
];

fn domain(action: &str) -> String {
    format!(
        "(define (domain d)
 (:requirements :typing :durative-actions :fluents :negative-preconditions)
 (:predicates (p) (q) (r)) (:functions (n) (m))
 {action})"
    )
}

#[test]
fn identical_simultaneous_actions_get_same_verdict_as_val() {
    let Some(val) = Val::find("equal") else {
        return;
    };
    let problem = "(define (problem x) (:domain d)
 (:init (= (n) 0) (= (m) 1) (p) (r)) (:goal (>= (m) -9)))";
    let mut differ = Vec::new();
    let mut counts = [0; 2];
    for condition in CONDITIONS {
        for effect in EFFECTS {
            let instant = format!(
                "(:action a :parameters () :precondition (and {condition}) :effect (and {effect}))"
            );
            let lasting = |specifier: &str, at: &str| {
                format!(
                    "(:durative-action a :parameters () :duration (>= ?duration 1)
  :condition (and ({specifier} {condition})) :effect (and (at {at} {effect})))"
                )
            };
            for (action, plan) in [
                (instant, "1: (a)\n1: (a)\n"),
                (lasting("at start", "start"), "1: (a) [2]\n1: (a) [2]\n"),
                (lasting("over all", "end"), "1: (a) [2]\n1: (a) [2]\n"),
                (lasting("at end", "start"), "1: (a) [2]\n1: (a) [3]\n"),
                (lasting("at start", "end"), "1: (a) [2]\n3: (a) [2]\n"),
            ] {
                let domain = domain(&action);
                let theirs = val.verdict(&domain, problem, plan);
                let read = task(
                    &Source::new("d", domain.as_str()),
                    &Source::new("p", problem),
                );
                let (own, why) = ours(&read.expect("a problem"), &Source::new("plan", plan));
                if !own.agrees_with(&theirs) {
                    differ.push(format!(
                        "VAL {theirs:?}, we {own:?} {why}\n{action}\n{plan}"
                    ));
                }
                counts[usize::from(own == PlanVerdict::Invalid)] += 1;
            }
        }
    }
    assert!(
        differ.is_empty(),
        "{} differ\n{}",
        differ.len(),
        differ.join("\n")
    );
    assert!(
        counts.iter().all(|count| *count > 50),
        "valid and invalid: {counts:?}"
    );
}
