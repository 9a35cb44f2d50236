//! Likelihood files: what they mean, and what is said of mistakes.
#![allow(clippy::unwrap_used, reason = "a helper that panics fails the test")]

mod shared;

use elbowroom_model::Task;
use elbowroom_probability::Likelihoods;
use elbowroom_probability::likelihoods::{read, read_authors, write};

fn doors() -> Task {
    let domain = "(define (domain doors) (:types door)
        (:predicates (open ?d - door) (painted ?d - door) (near ?a ?b - door) (quiet))
        (:derived (quiet) (forall (?d - door) (not (open ?d))))
        (:durative-action shut :parameters (?d - door) :duration (= ?duration 1)
          :condition (at start (near ?d ?d))
          :effect (and (at start (not (open ?d))) (at end (painted ?d))))
        (:action wait :parameters () :precondition () :effect ()))";
    let problem = "(define (problem p) (:domain doors) (:objects a b - door)
        (:init (open a) (near a a)) (:goal (painted a)))";
    shared::read_task(domain, problem, "0: (shut a) [1]").0
}

fn mistakes(text: &str) -> String {
    read(text.as_bytes(), &doors()).unwrap_err().to_string()
}

const HEAD: &str = "format = \"elbowroom-likelihoods\"\nversion = 1\n";

#[test]
fn the_more_specific_entry_counts() {
    let task = doors();
    let text = format!(
        "{HEAD}
        [defaults]
        becomes_true = 0
        becomes_false = 0.5
        start = 1.0
        effect = 0.9
        [facts.open]
        becomes_true = 0.1
        [facts.\"OPEN  b\"]
        becomes_true = 0.2
        [actions.shut]
        start = 0.75
        effects = {{ open = 0.5, \"not open\" = 0.25 }}
        [actions.\"shut b\"]
        start = 0.5
        [beliefs]
        \"open a\" = 0.3"
    );
    let likelihoods = read(text.as_bytes(), &task).unwrap();
    let open = task.problem().predicate("open").unwrap();
    let object = |name: &str| task.problem().object(name).unwrap();
    let flip = |name: &str| {
        let fact = task.find_fact(open, &[object(name)]).unwrap();
        let flip = likelihoods.flip(&task, fact).unwrap();
        (flip.becomes_true, flip.becomes_false)
    };
    assert_eq!(flip("a"), (0.1, 0.5));
    let mut task = task.clone();
    let shut = task.problem().schema("shut").unwrap();
    let a = task.instantiate(shut, &[object("a")]).unwrap();
    let b = task.instantiate(shut, &[object("b")]).unwrap();
    assert_eq!(likelihoods.start(&a), Ok(0.75));
    assert_eq!(likelihoods.start(&b), Ok(0.5));
    let fact = task.find_fact(open, &[object("b")]).unwrap();
    let flip = likelihoods.flip(&task, fact).unwrap();
    assert_eq!((flip.becomes_true, flip.becomes_false), (0.2, 0.5));
    assert_eq!(likelihoods.effect(&task, &b, fact, false), Ok(0.25));
    let fact = task.find_fact(open, &[object("a")]).unwrap();
    assert_eq!(
        likelihoods
            .initial_belief(&task)
            .probability(fact)
            .to_string(),
        "0.3"
    );
    // Written and read again, it is the same.
    let written = write(task.problem(), &likelihoods);
    assert_eq!(
        read(written.as_bytes(), &task).unwrap(),
        likelihoods,
        "{written}"
    );
}

#[test]
fn mistakes_are_reported_with_their_place_and_what_to_do() {
    let complete = "[defaults]\nbecomes_true = 0\nbecomes_false = 0\nstart = 1\neffect = 1\n";
    for (text, expected) in [
        (
            "",
            "line 1, column 1: the file does not say what it is: format = \"elbowroom-likelihoods\"
line 1, column 1: the version of the format is missing: version = 1",
        ),
        (
            "format = \"other\"\nversion = 1",
            "line 1, column 10: this is another kind of file: format = \"elbowroom-likelihoods\"",
        ),
        (
            "format = \"elbowroom-likelihoods\"\nversion = 2",
            "line 2, column 11: this version is not known: version = 1",
        ),
        (
            "format = ",
            "line 1, column 10: string values must be quoted, expected literal string",
        ),
        (
            &format!("{HEAD}{complete}[fact.open]\n"),
            "line 8, column 2: unknown entry `fact`: did you mean `facts`?",
        ),
        (
            &format!("{HEAD}{complete}[facts.opn]\n"),
            "line 8, column 8: unknown predicate `opn`: did you mean `open`?",
        ),
        (
            &format!("{HEAD}{complete}[facts.quiet]\n"),
            "line 8, column 8: `quiet` follows from rules, so it has no likelihood of its own: state those of the facts that its rules read",
        ),
        (
            &format!("{HEAD}{complete}[facts.\"open c\"]\n"),
            "line 8, column 8: unknown object `c`",
        ),
        (
            &format!("{HEAD}{complete}[facts.\"near a\"]\n"),
            "line 8, column 8: `near` takes 2 arguments, not 1",
        ),
        (
            &format!("{HEAD}{complete}[facts.open]\nbecomes_true = 1.5\n"),
            "line 9, column 16: 1.5 is not a probability: a number from 0 to 1",
        ),
        (
            &format!("{HEAD}{complete}[facts.open]\nbecomes_true = nan\n"),
            "line 9, column 16: nan is not a probability: a number from 0 to 1",
        ),
        (
            &format!("{HEAD}{complete}[facts.open]\nbecomes_tru = 0\n"),
            "line 9, column 1: unknown entry `becomes_tru`: did you mean `becomes_true`?",
        ),
        (
            &format!("{HEAD}{complete}[actions.shut]\neffects.near = 0.5\n"),
            "line 9, column 9: `shut` has no effect `near`: it has effects on open, painted",
        ),
        (
            &format!("{HEAD}{complete}[actions.shut]\neffects.\"not painted\" = 0.5\n"),
            "line 9, column 9: `shut` has no effect `not painted`: it has effects on open, painted",
        ),
        (
            &format!("{HEAD}{complete}[actions.shutt]\n"),
            "line 8, column 10: unknown action `shutt`: did you mean `shut`?",
        ),
        (
            &format!("{HEAD}{complete}[facts.open]\n[facts.OPEN]\n"),
            "line 9, column 8: `OPEN` is there twice",
        ),
        (
            &format!("{HEAD}{complete}[beliefs]\nopen = 0.5\n"),
            "line 9, column 1: `open` is a predicate, not a fact: a predicate with its objects",
        ),
        (
            &format!("{HEAD}[facts.open]\n"),
            "line 1, column 1: the file does not say how likely (shut a) is to start: [actions.shut], or [defaults]",
        ),
    ] {
        let found = mistakes(text);
        assert!(
            found.contains(expected),
            "{text}\nfound: {found}\nexpected: {expected}"
        );
    }
}

#[test]
fn the_authors_format_is_read_and_its_mistakes_reported() {
    let task = doors();
    let read = |text: &str| read_authors(text.as_bytes(), &task);
    let facts = "open#a 0.1 0.2\nopen#b 0 0\npainted#a 0 0.5\npainted#b 0 0\n";
    let text = format!("{facts}-\nshut#a 0.75 open%0.5 painted%0.25\nshut#b 1 open%1 painted%1");
    let likelihoods: Likelihoods = read(&text).unwrap();
    let shut = task.problem().schema("shut").unwrap();
    let a = task
        .clone()
        .instantiate(shut, &[task.problem().object("a").unwrap()])
        .unwrap();
    assert_eq!(likelihoods.start(&a), Ok(0.75));
    for (text, expected) in [
        (
            "open#a 0.1\n-\n",
            "line 1, column 1: 1 numbers after the fact `open#a`: two: P(false becomes true) P(true becomes false)",
        ),
        (
            "open#a 0.1 x\n-\n",
            "line 1, column 12: `x` is not a number: a probability, from 0 to 1",
        ),
        (
            "open#a 0.1 -0.2\n-\n",
            "line 1, column 12: -0.2 is not a probability: a number from 0 to 1",
        ),
        (
            "opne#a 0.1 0.2\n-\n",
            "line 1, column 1: unknown predicate `opne`: did you mean `open`?",
        ),
        (
            facts,
            "line 4, column 14: the line `-` between facts and actions is missing",
        ),
        (
            "open#a 0 0\n-\n",
            "line 2, column 1: the file says nothing of (open b): one line for each fact, before this one",
        ),
        (
            &format!("{facts}-\nshut#a 0.75 open%0.5"),
            "line 6, column 1: the effect of `shut#a` on painted has no probability: add `painted%P`",
        ),
        (
            &format!("{facts}-\nshut#a 0.75 near%0.5"),
            "line 6, column 13: `shut` has no effect `near`: it has effects on open, painted",
        ),
        (
            &format!("{facts}-\nshut#a 0.75 open=0.5"),
            "line 6, column 13: `open=0.5` is not an effect with its probability: predicate%P",
        ),
        (
            &format!("{facts}-\nshut#a 0.75 open%1.5 painted%1"),
            "line 6, column 18: 1.5 is not a probability: a number from 0 to 1",
        ),
        (
            &format!("{facts}-\nshot#a 0.75"),
            "line 6, column 1: unknown action `shot`: did you mean `shut`?",
        ),
        (
            &format!("{facts}open#a 0 0\n-\n"),
            "line 5, column 1: `open#a` is listed twice",
        ),
    ] {
        let found = read(text).unwrap_err().to_string();
        assert!(
            found.contains(expected),
            "{text}\nfound: {found}\nexpected: {expected}"
        );
    }
}

#[test]
fn no_bytes_upset_the_readers() {
    let task = doors();
    let text =
        format!("{HEAD}[facts.open]\nbecomes_true = 0.5\n[actions.\"shut é\"]\n-\nopen#a 0 0%");
    let bytes = text.as_bytes();
    for at in 0..bytes.len() {
        for change in [0, 0xff, b'\n', b'"', b'#', b'[', b'%', 0xc3] {
            let mut changed = bytes.to_vec();
            changed[at] = change;
            // Whatever they answer, they answer.
            let _ = read(&changed, &task).map_err(|errors| errors.to_string());
            let _ = read_authors(&changed, &task).map_err(|errors| errors.to_string());
            let _ = read(&changed[..at], &task);
        }
    }
}

#[test]
fn the_authors_files_say_the_same_in_our_format() {
    for world in shared::sf3().iter().chain(&shared::af3()) {
        let written = write(world.task.problem(), &world.likelihoods);
        // They say nothing of actions from a machine to itself, which ours has to.
        let default = "\n[defaults]\nstart = 0.0\neffect = 0.0\n\n[facts";
        let written = written.replacen("\n[facts", default, 1);
        let read = read(written.as_bytes(), &world.task).unwrap();
        assert_eq!(read.facts, world.likelihoods.facts, "{}", world.name);
        assert_eq!(read.actions, world.likelihoods.actions, "{}", world.name);
    }
}
