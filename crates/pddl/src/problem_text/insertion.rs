//! Insertion of initial facts into the text of a problem file.

use crate::report::Report;
use crate::source::FileId;
use crate::syntax::{Node, parse};
use elbowroom_text::Source;

/// Returns the text of a problem file with further elements at the end of its `:init`, such as
/// timed initials. `lines` has one element or comment a line. The rest of the text, including
/// comments, is unchanged. A text that is not a problem file is returned unchanged.
///
/// ```
/// let problem = "(define (problem p) (:domain d)\n  (:init (lit))\n  (:goal (cold)))";
/// assert_eq!(
///     elbowroom_pddl::with_initials(problem, "(at 5 (not (lit)))\n"),
///     "(define (problem p) (:domain d)\n  (:init (lit)\n    (at 5 (not (lit))))\n  (:goal (cold)))"
/// );
/// ```
pub fn with_initials(problem: &str, lines: &str) -> String {
    let source = Source::from(problem);
    let mut report = Report::new(&source, &source);
    let nodes = parse(FileId::Problem, problem, &mut report);
    let is_init = |node: &&Node<'_>| node.form().is_some_and(|(head, _)| head == ":init");
    let define = nodes
        .iter()
        .find(|node| node.form().is_some_and(|(head, _)| head == "define"));
    let Some(define) = define else {
        return problem.to_owned();
    };
    let init = define.list().into_iter().flatten().find(is_init);
    let (section, opening, closing) = match init {
        Some(init) => (init, "", ""),
        None => (define, "\n  (:init", ")"),
    };
    // Position of the closing parenthesis.
    let at = section.span.end.saturating_sub(1);
    let (Some(before), Some(after)) = (problem.get(..at), problem.get(at..)) else {
        return problem.to_owned();
    };
    let mut text = format!("{}{opening}", before.trim_end());
    for line in lines.lines() {
        text.push_str("\n    ");
        text.push_str(line);
    }
    // A comment would hide the parenthesis.
    if ends_in_comment(&text) {
        text.push_str("\n  ");
    }
    text.push_str(closing);
    text.push_str(after);
    text
}

/// Returns `true` if the last line of the text has a comment.
fn ends_in_comment(text: &str) -> bool {
    text.lines()
        .next_back()
        .is_some_and(|line| line.contains(';'))
}

#[cfg(test)]
mod tests {
    use super::with_initials;

    #[test]
    fn comments_do_not_hide_the_end_of_the_section() {
        let problem = "(define (problem p) (:domain d) (:INIT (lit) ; now\n) (:goal (lit)))";
        assert_eq!(
            with_initials(problem, "(at 5 (dark)) ; later"),
            "(define (problem p) (:domain d) (:INIT (lit) ; now\n    (at 5 (dark)) ; later\n  ) \
             (:goal (lit)))"
        );
    }

    #[test]
    fn problem_without_initial_facts_gets_a_section() {
        let problem = "(define (problem p) (:domain d) (:goal (lit)))";
        let expected = "(define (problem p) (:domain d) (:goal (lit))\n  (:init\n    (lit)))";
        assert_eq!(with_initials(problem, "(lit)"), expected);
        assert_eq!(with_initials("nothing", "(lit)"), "nothing");
    }
}
