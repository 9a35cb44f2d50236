//! Likelihood files: their meaning, and messages about mistakes.

use crate::shared;
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
fn more_specific_entry_takes_precedence() {
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
        let flip = likelihoods.spontaneous_change(&task, fact).unwrap();
        (flip.becomes_true, flip.becomes_false)
    };
    assert_eq!(flip("a"), (0.1, 0.5));
    let task = task.clone();
    let shut = task.problem().schema("shut").unwrap();
    let a = task.instantiate(shut, &[object("a")]).unwrap();
    let b = task.instantiate(shut, &[object("b")]).unwrap();
    assert_eq!(likelihoods.start(&a), Ok(0.75));
    // `likelihoods::read` recognises the format.
    let known = elbowroom_probability::likelihoods::read(text.as_str(), &task);
    assert_eq!(known.unwrap(), likelihoods);
    assert_eq!(likelihoods.start(&b), Ok(0.5));
    let fact = task.find_fact(open, &[object("b")]).unwrap();
    let flip = likelihoods.spontaneous_change(&task, fact).unwrap();
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
    // Writing and reading preserves the likelihoods.
    let written = write(task.problem(), &likelihoods);
    assert_eq!(
        read(written.as_bytes(), &task).unwrap(),
        likelihoods,
        "{written}"
    );
}

#[test]
fn rates_and_step_likelihoods_combine() {
    let task = doors();
    let text = format!(
        "{HEAD}
        [defaults]
        becomes_true = 0
        becomes_true_per_second = 0.5
        start = 1.0
        effect = 0.9
        [facts.painted]
        becomes_false_per_second = 0.25
        [facts.open]
        becomes_false = 0.1
        becomes_true_per_second = 0
        [facts.\"open b\"]
        becomes_false_per_second = 2"
    );
    let likelihoods = read(text.as_bytes(), &task).unwrap();
    assert!(likelihoods.has_rates());
    let fact = |name: &str| task.fact_named(name).unwrap();
    let said = |name: &str| {
        let flip = likelihoods.spontaneous_change(&task, fact(name)).unwrap();
        let rate = likelihoods.rate(&task, fact(name));
        let flips = [flip.becomes_true, flip.becomes_false];
        (flips, [rate.becomes_true, rate.becomes_false])
    };
    // With a rate per second, the probability per step is optional.
    assert_eq!(said("(painted a)"), ([0.0, 0.0], [0.5, 0.25]));
    assert_eq!(said("(open a)"), ([0.0, 0.1], [0.0, 0.0]));
    assert_eq!(said("(open b)"), ([0.0, 0.1], [0.0, 2.0]));
    // Maps do not change, whatever the defaults are.
    assert_eq!(said("(near a b)"), ([0.0, 0.0], [0.0, 0.0]));
    let written = write(task.problem(), &likelihoods);
    assert_eq!(
        read(written.as_bytes(), &task).unwrap(),
        likelihoods,
        "{written}"
    );
    for wrong in ["-1", "\"often\"", "inf"] {
        let text = format!("{HEAD}[facts.open]\nbecomes_true_per_second = {wrong}\n");
        let mistakes = mistakes(&text);
        assert!(mistakes.contains("a rate, 0 or more"), "{mistakes}");
    }
}

#[test]
fn failures_after_start_have_given_effects() {
    let task = doors();
    let text = format!(
        "{HEAD}
        [defaults]
        becomes_true = 0
        becomes_false = 0
        start = 1
        effect = 1
        end = 0.9
        during_per_second = 0.5
        undone = true
        [actions.shut]
        end = 0.8
        [[actions.shut.outcome]]
        probability = 0.25
        becomes_false = [\"(near ?d b)\", \"open b\"]
        becomes_true = [\"(painted ?D)\"]
        [actions.\"shut b\"]
        end = 0.7
        undone = false"
    );
    let likelihoods = read(text.as_bytes(), &task).unwrap();
    assert!(likelihoods.has_failures() && likelihoods.has_rates());
    let shut = |name: &str| {
        let schema = task.problem().schema("shut").unwrap();
        let object = task.problem().object(name).unwrap();
        task.instantiate(schema, &[object]).unwrap()
    };
    let left = |name: &str| {
        let aftermaths = likelihoods.failure_outcomes(&task, &shut(name)).into_iter();
        let words = |(fact, truth): (_, bool)| format!("{} {truth}", task.fact_name(fact));
        let told = aftermaths.map(|it| {
            let changes = it.changes.into_iter().map(words);
            (it.probability, changes.collect::<Vec<_>>().join(", "))
        });
        told.collect::<Vec<_>>()
    };
    let leaves = |p: f64, words: &str| (p, words.to_owned());
    assert_eq!(
        (likelihoods.end(&shut("a")), likelihoods.end(&shut("b"))),
        (0.8, 0.7)
    );
    assert_eq!(
        (
            likelihoods.failure_rate(&shut("a")),
            likelihoods.end(&shut("a"))
        ),
        (0.5, 0.8)
    );
    assert!(
        (likelihoods.success_probability(&shut("a"), 2.0) - 0.8 * (-1.0_f64).exp()).abs() < 1e-15
    );
    // Order: undone effects, facts that become true, facts that become false.
    assert_eq!(
        left("a"),
        [
            leaves(
                0.25,
                "(open a) true, (painted a) true, (near a b) false, (open b) false"
            ),
            leaves(0.75, "(open a) true"),
        ]
    );
    assert_eq!(
        left("b"),
        [
            leaves(0.25, "(painted b) true, (near b b) false, (open b) false"),
            leaves(0.75, ""),
        ]
    );
    // An instantaneous action has no end, whatever the defaults are.
    let wait = task.problem().schema("wait").unwrap();
    let wait = task.instantiate(wait, &[]).unwrap();
    assert_eq!(
        (likelihoods.end(&wait), likelihoods.failure_rate(&wait)),
        (1.0, 0.0)
    );
    let written = write(task.problem(), &likelihoods);
    assert_eq!(
        read(written.as_bytes(), &task).unwrap(),
        likelihoods,
        "{written}"
    );
}

#[test]
fn mistakes_about_failures_are_reported_with_their_place() {
    let complete = "[defaults]\nbecomes_true = 0\nbecomes_false = 0\nstart = 1\neffect = 1\n";
    let outcome = "end = 0.5\n[[actions.shut.outcome]]\n";
    for (entry, expected) in [
        (
            "end = 1.5",
            "text:9:7: error: 1.5 is not a probability; a number from 0 to 1",
        ),
        (
            "during_per_second = -1",
            "text:9:21: error: this is not a number of failures per second; a rate, 0 or more",
        ),
        (
            "undone = 1",
            "text:9:10: error: found a number; true or false",
        ),
        (
            "undone = true",
            "text:8:10: error: effects of failures without a probability that the action fails after its start; `end`: how likely its end is to succeed",
        ),
        (
            "ende = 0.5",
            "text:9:1: error: unknown entry `ende`; did you mean `end`?",
        ),
        (
            "outcome = 1",
            "text:9:11: error: `outcome` is a number; tables: [[actions.NAME.outcome]]",
        ),
        (
            &format!("{outcome}becomes_true = [\"(open ?d)\"]"),
            "error: the outcome has no `probability`; how likely it is if the action fails",
        ),
        (
            &format!("{outcome}probability = 0.5"),
            "error: this outcome changes nothing; becomes_true or becomes_false",
        ),
        (
            &format!("{outcome}probability = 0.5\ndelay = 3"),
            "text:12:1: error: unknown entry `delay`; one of probability, becomes_true, becomes_false",
        ),
        (
            &format!("{outcome}probability = 0.5\nbecomes_true = [\"(open ?door)\"]"),
            "text:12:17: error: `shut` has no parameter `?door`; it has ?d",
        ),
        (
            &format!("{outcome}probability = 0.5\nbecomes_true = [\"(open)\"]"),
            "text:12:17: error: `open` takes 1 arguments, not 0",
        ),
        (
            &format!("{outcome}probability = 0.5\nbecomes_true = [\"(quiet)\"]"),
            "text:12:17: error: `quiet` is a derived predicate",
        ),
        (
            &format!(
                "{outcome}probability = 0.5\nbecomes_true = [\"(open ?d)\"]\nbecomes_false = [\"open ?D\"]"
            ),
            "text:13:18: error: one outcome changes `open ?D` twice",
        ),
        (
            &format!(
                "{outcome}probability = 0.6\nbecomes_true = [\"(open ?d)\"]\n[[actions.shut.outcome]]\nprobability = 0.5\nbecomes_true = [\"(open ?d)\"]"
            ),
            "error: with this outcome the probabilities add up to 1.1; shares of the failures, at most 1 in total",
        ),
        (
            "[actions.wait]\nend = 0.5",
            "text:10:1: error: `wait` takes no time, so it does not fail after its start; `start`",
        ),
        (
            "end = 0.5\n[[defaults.outcome]]\nprobability = 0.5\nbecomes_true = [\"(open ?d)\"]",
            "text:12:17: error: `?d` is not a parameter of any action named here; [[actions.NAME.outcome]]",
        ),
    ] {
        let text = format!("{HEAD}{complete}[actions.shut]\n{entry}\n");
        let found = mistakes(&text);
        assert!(
            found.contains(expected),
            "{text}\nfound: {found}\nexpected: {expected}"
        );
    }
}

#[test]
fn mistakes_are_reported_with_their_place_and_what_to_do() {
    let complete = "[defaults]\nbecomes_true = 0\nbecomes_false = 0\nstart = 1\neffect = 1\n";
    for (text, expected) in [
        (
            "",
            "text:1:1: error: the file does not state its format; format = \"elbowroom-likelihoods\"
text:1:1: error: the version of the format is missing; version = 1",
        ),
        (
            "format = \"other\"\nversion = 1",
            "text:1:10: error: this is not a likelihood file; format = \"elbowroom-likelihoods\"",
        ),
        (
            "format = \"elbowroom-likelihoods\"\nversion = 2",
            "text:2:11: error: unsupported version; version = 1",
        ),
        (
            "format = ",
            "text:1:10: error: string values must be quoted, expected literal string",
        ),
        (
            &format!("{HEAD}{complete}[fact.open]\n"),
            "text:8:2: error: unknown entry `fact`; did you mean `facts`?",
        ),
        (
            &format!("{HEAD}{complete}[facts.opn]\n"),
            "text:8:8: error: unknown predicate `opn`; did you mean `open`?",
        ),
        (
            &format!("{HEAD}{complete}[facts.quiet]\n"),
            "text:8:8: error: `quiet` is a derived predicate, so it cannot have likelihoods; give likelihoods of the facts that its rules read",
        ),
        (
            &format!("{HEAD}{complete}[facts.\"open c\"]\n"),
            "text:8:8: error: unknown object `c`",
        ),
        (
            &format!("{HEAD}{complete}[facts.\"near a\"]\n"),
            "text:8:8: error: `near` takes 2 arguments, not 1",
        ),
        (
            &format!("{HEAD}{complete}[facts.open]\nbecomes_true = 1.5\n"),
            "text:9:16: error: 1.5 is not a probability; a number from 0 to 1",
        ),
        (
            &format!("{HEAD}{complete}[facts.open]\nbecomes_true = nan\n"),
            "text:9:16: error: nan is not a probability; a number from 0 to 1",
        ),
        (
            &format!("{HEAD}{complete}[facts.open]\nbecomes_tru = 0\n"),
            "text:9:1: error: unknown entry `becomes_tru`; did you mean `becomes_true`?",
        ),
        (
            &format!("{HEAD}{complete}[actions.shut]\neffects.near = 0.5\n"),
            "text:9:9: error: `shut` has no effect `near`; it has effects on open, painted",
        ),
        (
            &format!("{HEAD}{complete}[actions.shut]\neffects.\"not painted\" = 0.5\n"),
            "text:9:9: error: `shut` has no effect `not painted`; it has effects on open, painted",
        ),
        (
            &format!("{HEAD}{complete}[actions.shutt]\n"),
            "text:8:10: error: unknown action `shutt`; did you mean `shut`?",
        ),
        (
            &format!("{HEAD}{complete}[facts.open]\n[facts.OPEN]\n"),
            "text:9:8: error: `OPEN` is there twice",
        ),
        (
            &format!("{HEAD}{complete}[beliefs]\nopen = 0.5\n"),
            "text:9:1: error: `open` is a predicate, not a fact; a predicate with its objects",
        ),
        (
            &format!("{HEAD}[facts.open]\n"),
            "text:1:1: error: the file does not define how likely (shut a) is to start; give `start` and `effect` in [actions.shut], or in [defaults]",
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
            "text:1:1: error: 1 numbers after the fact `open#a`; two: P(false becomes true) P(true becomes false)",
        ),
        (
            "open#a 0.1 x\n-\n",
            "text:1:12: error: `x` is not a number; a probability, from 0 to 1",
        ),
        (
            "open#a 0.1 -0.2\n-\n",
            "text:1:12: error: -0.2 is not a probability; a number from 0 to 1",
        ),
        (
            "opne#a 0.1 0.2\n-\n",
            "text:1:1: error: unknown predicate `opne`; did you mean `open`?",
        ),
        (
            facts,
            "text:4:14: error: the line `-` between facts and actions is missing",
        ),
        (
            "open#a 0 0\n-\n",
            "text:2:1: error: the file has no line for (open b); one line for each fact, before this one",
        ),
        (
            &format!("{facts}-\nshut#a 0.75 open%0.5"),
            "text:6:1: error: the effect of `shut#a` on painted has no probability; add `painted%P`",
        ),
        (
            &format!("{facts}-\nshut#a 0.75 near%0.5"),
            "text:6:13: error: `shut` has no effect `near`; it has effects on open, painted",
        ),
        (
            &format!("{facts}-\nshut#a 0.75 open=0.5"),
            "text:6:13: error: `open=0.5` is not an effect with its probability; predicate%P",
        ),
        (
            &format!("{facts}-\nshut#a 0.75 open%1.5 painted%1"),
            "text:6:18: error: 1.5 is not a probability; a number from 0 to 1",
        ),
        (
            &format!("{facts}-\nshot#a 0.75"),
            "text:6:1: error: unknown action `shot`; did you mean `shut`?",
        ),
        (
            &format!("{facts}open#a 0 0\n-\n"),
            "text:5:1: error: `open#a` is listed twice",
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
fn readers_do_not_panic_on_any_bytes() {
    let task = doors();
    let text =
        format!("{HEAD}[facts.open]\nbecomes_true = 0.5\n[actions.\"shut é\"]\n-\nopen#a 0 0%");
    let bytes = text.as_bytes();
    for at in 0..bytes.len() {
        for change in [0, 0xff, b'\n', b'"', b'#', b'[', b'%', 0xc3] {
            let mut changed = bytes.to_vec();
            changed[at] = change;
            // The readers must not panic.
            let _ = read(&changed, &task).map_err(|errors| errors.to_string());
            let _ = read_authors(&changed, &task).map_err(|errors| errors.to_string());
            let _ = read(&changed[..at], &task);
        }
    }
}

#[test]
fn converted_published_files_are_equal() {
    for world in shared::sf3().iter().chain(&shared::af3()) {
        let written = write(world.task.problem(), &world.likelihoods);
        // The authors' file has no actions from a machine to itself, which Elbowroom's format
        // requires.
        let default = "\n[defaults]\nstart = 0.0\neffect = 0.0\n\n[facts";
        let written = written.replacen("\n[facts", default, 1);
        let read = read(written.as_bytes(), &world.task).unwrap();
        assert_eq!(read.facts, world.likelihoods.facts, "{}", world.name);
        assert_eq!(read.actions, world.likelihoods.actions, "{}", world.name);
    }
}
