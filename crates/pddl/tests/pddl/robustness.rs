//! No bytes make the readers panic, hang or overflow the stack.

use crate::reading;
use elbowroom_model::Task;
use elbowroom_pddl::{Source, read_plan, read_problem};
use proptest::prelude::*;
use proptest::sample::Index;

const DOMAIN: &str = "(define (domain d)
(:requirements :typing :fluents) (:types room - place ball - (either thing toy))
(:constants hall - room) (:predicates (in ?b - ball ?r - room) (lit) (dark))
(:functions (size ?b - ball) (level) - number)
(:synth-parameters ?u)
(:derived (dark) (not (lit)))
(:action throw :parameters (?b - ball ?r - room) :precondition (and (in ?b ?r) (or (lit) (dark)))
  :effect (and (not (in ?b ?r)) (forall (?x - ball) (when (in ?x hall) (increase (level) (size ?x))))))
(:durative-action roll :parameters (?b - ball) :duration (and (>= ?duration ?u) (<= ?duration (/ (size ?b) 2)))
  :condition (and (at start (exists (?r - room) (in ?b ?r))) (over all (> (level) -1.5)))
  :effect (and (at start (not (lit))) (at end (assign (level) (- ?duration)))
    (when (at start (dark)) (at end (lit))) (decrease (level) (* #t (+ 1 (size ?b)))))))";

const PROBLEM: &str = "(define (problem p) (:domain d) (:objects b1 b2 - ball)
(:init (in b1 hall) (= (size b1) 4) (= (level) 1e2) (at 5 (lit)) (at 6.5 (not (lit))) (at 7 (= (level) 3)))
(:goal (and (preference q (lit)) (imply (dark) (< (level) 7)) (forall (?b - ball) (in ?b hall))))
(:constraints (and (forall (?b - ball) (preference r (sometime-before (lit) (in ?b hall))))
  (always-within 2.5 (lit) (dark)) (hold-during 1 7 (not (lit))) (at end (lit)) (at-most-once (lit))))
(:metric minimize (+ (total-time) (+ (* 2 (level)) (is-violated r)))))";

const PLAN: &str = "; Plan found with metric 3\n0.000: (throw b1 hall) [0.001]\n0.001: (ROLL b1) [D:2.0; C:1]\n2.1: (roll b2)";

/// Reads these texts in all ways.
fn read_all(domain: &[u8], problem: &[u8], plan: &[u8]) {
    let domain = Source::from_bytes("domain", domain);
    let problem = Source::from_bytes("problem", problem);
    match read_problem(&domain, &problem) {
        Ok((problem, warnings)) => {
            for warning in warnings {
                warning.render(true);
            }
            let task = Task::new(problem);
            if let Err(diagnostics) = read_plan(&Source::from_bytes("plan", plan), &task) {
                diagnostics.render(false);
            }
        }
        Err(diagnostics) => {
            assert!(diagnostics.errors().count() > 0);
            diagnostics.render(false);
            let _ = diagnostics.to_string();
        }
    }
}

/// Reads with one of the three texts replaced.
fn read_changed(which: usize, text: &[u8]) {
    let mut texts = [DOMAIN.as_bytes(), PROBLEM.as_bytes(), PLAN.as_bytes()];
    texts[which] = text;
    let [domain, problem, plan] = texts;
    read_all(domain, problem, plan);
}

#[test]
fn unchanged_texts_are_read_without_errors() {
    let read = read_problem(&Source::new("d", DOMAIN), &Source::new("p", PROBLEM));
    assert_eq!(reading::mistakes(read), "none");
}

#[test]
fn truncated_text_does_not_panic() {
    for (which, text) in [DOMAIN, PROBLEM, PLAN].iter().enumerate() {
        for end in 0..text.len() {
            read_changed(which, &text.as_bytes()[..end]);
        }
    }
}

#[test]
fn deleted_byte_does_not_panic() {
    for (which, text) in [DOMAIN, PROBLEM, PLAN].iter().enumerate() {
        for at in 0..text.len() {
            let mut bytes = text.as_bytes().to_vec();
            bytes.remove(at);
            read_changed(which, &bytes);
        }
    }
}

#[test]
fn nul_byte_does_not_panic() {
    for (which, text) in [DOMAIN, PROBLEM, PLAN].iter().enumerate() {
        for at in 0..text.len() {
            let mut bytes = text.as_bytes().to_vec();
            bytes[at] = 0;
            read_changed(which, &bytes);
        }
    }
}

#[test]
fn a_million_levels_of_nesting_are_refused() {
    let million = 1_000_000;
    for deep in [
        "(".repeat(million),
        "(and ".repeat(million),
        "(not ".repeat(million) + &")".repeat(million),
        "(+ 1 ".repeat(million),
    ] {
        read_changed(0, DOMAIN.replace("(lit)", &deep).as_bytes());
        read_changed(1, PROBLEM.replace("(lit)", &deep).as_bytes());
        read_changed(2, deep.as_bytes());
    }
}

#[test]
fn the_deepest_nesting_that_is_read_does_not_overflow_the_stack() {
    for form in [
        "(not ",
        "(and ",
        "(forall (?x) ",
        "(imply (lit) ",
        "(or (dark) ",
    ] {
        let deep = form.repeat(190) + "(lit)" + &")".repeat(190);
        read_changed(
            1,
            PROBLEM
                .replace("(imply (dark)", &format!("(imply {deep}"))
                .as_bytes(),
        );
    }
}

#[test]
fn long_chains_of_types_and_rules_are_read_quickly() {
    let types = repeated(0..5000, |i| format!("t{i} - t{} ", i + 1));
    read_changed(
        0,
        format!("(define (domain d) (:types {types}))").as_bytes(),
    );
    let ladder = repeated(0..60, |i| {
        format!("a{i} b{i} - (either a{} b{}) ", i + 1, i + 1)
    });
    read_changed(
        0,
        format!("(define (domain d) (:types {ladder}))").as_bytes(),
    );
    let predicates = repeated(0..5000, |i| format!("(p{i}) "));
    let rules = repeated(0..4999, |i| format!("(:derived (p{i}) (p{})) ", i + 1));
    read_changed(
        0,
        format!("(define (domain d) (:predicates {predicates}) {rules})").as_bytes(),
    );
}

#[test]
fn large_texts_full_of_mistakes_are_read_quickly() {
    let facts = repeated(0..20_000, |i| format!("(inn bb{i} hall) "));
    read_changed(
        1,
        format!("(define (problem p) (:domain d) (:init {facts}) (:goal (and)))").as_bytes(),
    );
    let steps = repeated(0..20_000, |i| format!("{i}: (rol bb{i})\n"));
    read_changed(2, steps.as_bytes());
    read_changed(2, steps.replace('\n', " ").as_bytes());
}

/// Returns a text for each number, concatenated.
fn repeated(numbers: std::ops::Range<u32>, text: impl Fn(u32) -> String) -> String {
    numbers.map(text).collect::<Vec<_>>().concat()
}

/// Generates a text with some bytes replaced, and parts of it copied to other positions.
fn mutated(text: &'static str) -> impl Strategy<Value = Vec<u8>> {
    let replaced = prop::collection::vec((any::<Index>(), any::<u8>()), 0..4);
    let copied = prop::collection::vec((any::<Index>(), any::<Index>(), 0..80_usize), 0..4);
    (replaced, copied).prop_map(move |(replaced, copied)| {
        let mut bytes = text.as_bytes().to_vec();
        for (at, byte) in replaced {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        for (from, to, length) in copied {
            let from = from.index(bytes.len());
            let stretch = bytes[from..(from + length).min(bytes.len())].to_vec();
            let to = to.index(bytes.len());
            bytes.splice(to..to, stretch);
        }
        bytes
    })
}

proptest! {
    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..300), which in 0..3_usize) {
        read_changed(which, &bytes);
    }

    #[test]
    fn any_words_are_read_or_refused(
        words in prop::collection::vec(prop::sample::select(vec![
            "(", "(", "(", ")", ")", ")", "define", "domain", "d", "problem", ":init", ":action", ":types",
            ":predicates", ":functions", ":derived", ":durative-action", ":parameters", ":duration",
            ":condition", ":effect", "=", "-", "?x", "?duration", "#t", "at", "start", "end", "over",
            "all", "and", "or", "not", "when", "forall", "exists", "either", "object", "3", "-1.5",
            "increase", "lit", "in", "hall", "level", "*", "/", "preference", "imply", ":constraints",
            "always", "within", "hold-during", "sometime-after", "is-violated", ":metric",
        ]), 0..120),
        which in 0..3_usize,
    ) {
        read_changed(which, words.join(" ").as_bytes());
        let inside = format!("(define (domain d) (:predicates (lit) (in ?x)) {}", words.join(" "));
        read_changed(0, inside.as_bytes());
    }

    #[test]
    fn a_mutated_domain_is_read_or_refused(domain in mutated(DOMAIN)) {
        read_changed(0, &domain);
    }

    #[test]
    fn a_mutated_problem_is_read_or_refused(problem in mutated(PROBLEM)) {
        read_changed(1, &problem);
    }

    #[test]
    fn a_mutated_plan_is_read_or_refused(plan in mutated(PLAN)) {
        read_changed(2, &plan);
    }
}
