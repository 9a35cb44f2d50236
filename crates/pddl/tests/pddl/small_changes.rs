//! Small changes of a domain with processes, events, control parameters and object fluents. Each
//! changed text is either read or refused; texts that are read are validated and written.

use elbowroom_model::validate::{Settings, Verdict, validate};
use elbowroom_model::{Situation, Task};
use elbowroom_pddl::{ProblemText, Source, read_plan, read_problem, write_problem};

const DOMAIN: &str = "(define (domain flat) (:types robot room thing)
(:constants hall bath - room kettle - thing)
(:predicates (open) (wet ?r - room) (has ?r - robot ?t - thing))
(:functions (level) - number (place ?r - robot) - room)
(:process fills :parameters (?r - room) :precondition (and (open) (not (wet ?r)))
  :effect (increase (level) (* #t 1)))
(:event spills :parameters () :precondition (and (open) (>= (level) 5))
  :effect (and (wet bath) (not (open)) (assign (level) 0)))
(:durative-action pour :parameters (?t - thing) :control (?amount - number)
  :duration (= ?duration (* 2 ?amount)) :condition (and (at start (<= ?amount 5)) (over all (open)))
  :effect (at end (decrease (level) ?amount)))
(:action carry :parameters (?r - robot ?t - thing ?to - room)
  :precondition (not (= (place ?r) ?to)) :effect (and (assign (place ?r) ?to) (has ?r ?t))))";

const PROBLEM: &str = "(define (problem evening) (:domain flat) (:objects r1 - robot)
(:init (open) (= (level) 0) (= (place r1) hall) (at 3 (= (place r1) bath)))
(:goal (and (has r1 kettle) (= (place r1) hall))))";

const PLAN: &str = "0.1: (pour kettle 0.5) [1]\n4: (carry r1 kettle hall)\n";

/// Returns the verdict, if the texts are understood.
fn verdict_of(domain: &str, problem: &str, plan: &str) -> Option<Verdict> {
    let domain = Source::new("domain.pddl", domain);
    let problem = match read_problem(&domain, &Source::new("problem.pddl", problem)) {
        Ok((problem, _)) => problem,
        Err(diagnostics) => {
            assert!(diagnostics.errors().count() > 0);
            diagnostics.render(false);
            return None;
        }
    };
    let task = Task::new(problem);
    let written = write_problem(&task, &Situation::initial(&task), &ProblemText::default())
        .expect("nothing has happened");
    if let Err(diagnostics) = read_problem(&domain, &Source::new("written.pddl", &written)) {
        panic!(
            "{}\n{written}\n{}",
            domain.text(),
            diagnostics.render(false)
        );
    }
    let (plan, _) = read_plan(&Source::new("plan", plan), &task).ok()?;
    Some(validate(&task, &plan, &Settings::default()))
}

/// Validates with each of the three texts changed.
fn each(change: &dyn Fn(&str, usize) -> Option<String>) -> usize {
    let texts = [DOMAIN, PROBLEM, PLAN];
    let mut understood = 0;
    for (which, text) in texts.iter().enumerate() {
        for at in 0..text.len() {
            let Some(changed) = change(text, at) else {
                continue;
            };
            let mut all = texts.map(str::to_owned);
            all[which] = changed;
            let [domain, problem, plan] = &all;
            understood += usize::from(verdict_of(domain, problem, plan).is_some());
        }
    }
    understood
}

/// Returns the word or parenthesis that begins at a position of a text.
fn word_at(text: &str, at: usize) -> Option<&str> {
    let is_word = |character: char| !character.is_whitespace() && !"()".contains(character);
    let rest = &text[at..];
    let begins = at == 0 || !text[..at].ends_with(is_word);
    if !begins || rest.starts_with(char::is_whitespace) {
        return None;
    }
    let end = rest.find(|character| !is_word(character));
    Some(&rest[..end.unwrap_or(rest.len()).max(1)])
}

#[test]
fn unchanged_texts_are_read_and_valid() {
    let verdict = verdict_of(DOMAIN, PROBLEM, PLAN);
    assert!(
        matches!(verdict, Some(Verdict::Valid(_))),
        "{:?}",
        verdict.as_ref().and_then(Verdict::violation)
    );
}

#[test]
fn truncated_text_and_deleted_or_changed_bytes_do_not_panic() {
    each(&|text, at| Some(text[..at].to_owned()));
    let understood = each(&|text, at| Some(format!("{}{}", &text[..at], &text[at + 1..])));
    assert!(understood > 0, "most white space can be left out");
    for other in ['(', ')', '0', '-', '?', ':', '\0'] {
        each(&|text, at| Some(format!("{}{other}{}", &text[..at], &text[at + 1..])));
    }
}

#[test]
fn deleted_doubled_or_changed_words_do_not_panic() {
    each(&|text, at| {
        let word = word_at(text, at)?;
        Some(format!("{}{}", &text[..at], &text[at + word.len()..]))
    });
    each(&|text, at| {
        let word = word_at(text, at)?;
        Some(format!("{}{word} {}", &text[..at], &text[at..]))
    });
    let others = [
        "?amount",
        "?duration",
        "#t",
        "(place r1)",
        "(level)",
        "undefined",
        "kettle",
        "hall",
        "(open)",
        "0",
        "-1",
        "1e30",
        "number",
        "(* #t #t)",
        "(at start (open))",
        "(not (open))",
        "and",
        "when",
        "forall",
        ":process",
        ":event",
        ":control",
        ":action",
        ":derived",
        "change",
        "scale-up",
    ];
    for other in others {
        each(&|text, at| {
            let word = word_at(text, at)?;
            Some(format!(
                "{}{other}{}",
                &text[..at],
                &text[at + word.len()..]
            ))
        });
    }
}
