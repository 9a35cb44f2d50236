//! Interval ends whose limits lie beyond the farthest value that IRR tries.

use std::fs;

use crate::command::elbowroom;

const DOMAIN: &str = "
(define (domain lease)
  (:requirements :typing :durative-actions :timed-initial-literals)
  (:predicates (rented) (done))
  (:durative-action work :parameters () :duration (= ?duration 5)
    :condition (over all (rented)) :effect (at end (done))))";

/// Returns the answer of `envelope --sharpen` for an action of 5 s before a deadline.
fn sharpened(deadline: &str, guarantee: &str) -> String {
    let name = format!(
        "elbowroom-{}-far-{deadline}-{guarantee}",
        std::process::id()
    );
    let folder = std::env::temp_dir().join(name);
    fs::create_dir_all(&folder).expect("a temporary folder can be made");
    let problem = format!(
        "(define (problem once) (:domain lease) (:init (rented) (at {deadline} (not (rented)))) \
         (:goal (done)))"
    );
    let texts = [DOMAIN, &problem, "0.000: (work) [5.000]\n"];
    let [domain, problem, plan] = ["domain.pddl", "problem.pddl", "plan.plan"].map(|file| {
        let path = folder.join(file);
        path.display().to_string()
    });
    for (path, text) in [&domain, &problem, &plan].into_iter().zip(texts) {
        fs::write(path, text).expect("a temporary file can be written");
    }
    let output = elbowroom(&[
        "envelope",
        &domain,
        &problem,
        &plan,
        "--sharpen",
        "--guarantee",
        guarantee,
    ]);
    let _ = fs::remove_dir_all(&folder);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let text = String::from_utf8(output.stdout).expect("text");
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn only_ends_with_a_reason_are_at_their_limits() {
    for guarantee in ["strong", "dynamic", "weak"] {
        let near = sharpened("3000000000.5", guarantee);
        assert!(near.contains("upper bound of dur_0"), "{near}");
        assert!(near.contains("Each bound is at its limit."), "{near}");
        let far = sharpened("1000000000000", guarantee);
        assert!(!far.contains("Each bound is at its limit"), "{far}");
        assert!(
            far.contains("Each bound with a reason is at its limit."),
            "{far}"
        );
        assert!(
            far.contains("Bounds without a reason could move further."),
            "{far}"
        );
    }
}
