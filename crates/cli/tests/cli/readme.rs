//! Checks that the command prints the output shown in README.md.

use std::fs;

use crate::command::{elbowroom, root};

/// Returns the first answer in a document, in the characters of a terminal without Unicode.
fn first_answer(document: &str) -> String {
    let text = fs::read_to_string(root().join(document)).expect("the document is there");
    let begin = text.find("Elbow room of").expect("it shows an answer");
    let (answer, _) = text[begin..].split_once("```").expect("the answer ends");
    let plain = answer.replace("  ±", " +-").replace('▶', ">");
    plain
        .replace(['├', '┤'], "|")
        .replace('─', "-")
        .replace('●', "o")
}

/// Removes the duration of the search.
fn without_time(answer: &str) -> String {
    let (all, last) = answer
        .trim_end()
        .rsplit_once("widenings, ")
        .expect("it counts them");
    assert!(last.ends_with(" ms."), "{last}");
    all.to_owned()
}

#[test]
fn readme_answers_match_the_command() {
    let output = elbowroom(&[
        "envelope",
        "cases/delivery/domain.pddl",
        "cases/delivery/problem.pddl",
        "cases/delivery/plan.plan",
    ]);
    let answer = String::from_utf8(output.stdout).expect("text");
    for document in [
        "README.md",
        "crates/elbowroom/docs/tutorial/01-from-a-plan-to-an-envelope.md",
    ] {
        assert_eq!(
            without_time(&first_answer(document)),
            without_time(&answer),
            "{document}"
        );
    }
}
