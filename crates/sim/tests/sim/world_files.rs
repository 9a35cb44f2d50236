//! World files: valid contents, and the positions of mistakes.

use elbowroom_model::Problem;
use elbowroom_pddl::{Source, read_problem};
use elbowroom_sim::WorldModel;

fn problem() -> Problem {
    let domain = "(define (domain post) (:requirements :typing :durative-actions :fluents)
        (:types place) (:predicates (at ?p - place)) (:functions (charge) (level))
        (:durative-action go :parameters (?p - place) :duration (= ?duration 5)
          :condition () :effect (and (at end (at ?p)) (at end (decrease (charge) 2))))
        (:durative-action fill :parameters () :duration (= ?duration 5)
          :condition () :effect (increase (level) (* #t 2))))";
    let problem = "(define (problem p) (:domain post) (:objects a b - place)
        (:init (= (charge) 9) (= (level) 0)) (:goal (at b)))";
    let read = read_problem(
        &Source::new("domain", domain),
        &Source::new("problem", problem),
    );
    read.expect("a correct problem").0
}

/// Returns the error in a file whose third and later lines are `sections`.
fn error_of(sections: &str) -> (usize, String) {
    let text = format!("format = \"elbowroom-world\"\nversion = 1\n{sections}");
    let error = WorldModel::read(&text, &problem()).expect_err(sections);
    let error = error.errors().next().expect("a mistake");
    let advice = error.advice.as_deref().unwrap_or_default();
    (
        error.line(),
        format!("{} {advice}", error.message).trim().to_owned(),
    )
}

#[test]
fn each_error_has_line_and_advice() {
    let cases = [
        (
            "[[duration]]\naction = \"fly\"\nconstant = 1\n",
            4,
            "it has go",
        ),
        (
            "[[duration]]\naction = \"(go c)\"\nconstant = 1\n",
            4,
            "unknown object `c`",
        ),
        (
            "[[duration]]\naction = \"(go a b)\"\nconstant = 1\n",
            4,
            "takes 1 arguments",
        ),
        (
            "[[duration]]\naction = \"go\"\n",
            3,
            "expected a distribution",
        ),
        (
            "[[duration]]\naction = \"go\"\nconstant = 1\nvalues = [1]\n",
            6,
            "one distribution",
        ),
        (
            "[[duration]]\naction = \"go\"\nnormal = { mean = 1 }\n",
            5,
            "`deviation`",
        ),
        (
            "[[duration]]\naction = \"go\"\nnormal = { mean = 1, deviation = -1 }\n",
            5,
            "negative",
        ),
        (
            "[[duration]]\naction = \"go\"\nuniform = { from = 3, to = 1 }\n",
            5,
            "`from`",
        ),
        (
            "[[duration]]\naction = \"go\"\nvalues = []\n",
            5,
            "at least one",
        ),
        ("[[duration]]\naction = \"go\"\nvaleus = [1]\n", 5, "valeus"),
        ("[[duration]]\nconstant = 1\n", 3, "`action` is missing"),
        (
            "[[amount]]\naction = \"go\"\nconstant = 1\n",
            3,
            "`fluent` is missing",
        ),
        (
            "[[failure]]\naction = \"go\"\nprobability = 2\n",
            5,
            "between 0 and 1",
        ),
        (
            "[[failure]]\naction = \"go\"\nprobability = 1\nwhen = \"never\"\n",
            6,
            "midway",
        ),
        (
            "[[failure]]\naction = \"go\"\nprobability = 1\nwhen = \"start\"\nundone = true\n",
            7,
            "no effects to undo",
        ),
        (
            "[[event]]\nfact = \"(at _)\"\nbecomes = true\nconstant = 1\n",
            4,
            "one fact",
        ),
        (
            "[[event]]\nfact = \"(at a)\"\nbecomes = 3\nconstant = 1\n",
            3,
            "true or false",
        ),
        ("resolution = 0.0\n", 3, "greater than 0"),
        ("[reports]\nlost = 1.5\n", 4, "between 0 and 1"),
    ];
    for (sections, line, words) in cases {
        let (found, message) = error_of(sections);
        assert_eq!(found, line, "{sections}: {message}");
        assert!(message.contains(words), "{sections}: {message}");
    }
}

/// Regression: superfluous keys were once ignored. Each line is the one with the superfluous key.
#[test]
fn unknown_keys_are_rejected() {
    let cases = [
        (
            "[[duration]]\naction = \"go\"\nconstant = 1\nprobability = 0.5\n",
            6,
            "`probability`",
        ),
        (
            "[[duration]]\naction = \"go\"\nconstant = 1\nfluent = \"charge\"\n",
            6,
            "`fluent`",
        ),
        (
            "[[duration]]\naction = \"go\"\nconstant = 1\nwhen = \"end\"\n",
            6,
            "`when`",
        ),
        (
            "[[delay]]\naction = \"go\"\nconstant = 1\nrelative = true\n",
            6,
            "`relative`",
        ),
        (
            "[[failure]]\naction = \"go\"\nprobability = 1\nnormal = { mean = 1, deviation = 1 }\n",
            6,
            "`normal`",
        ),
        (
            "[[event]]\nfact = \"(at a)\"\nbecomes = true\nconstant = 1\nrelative = true\n",
            7,
            "`relative`",
        ),
        (
            "[reports]\nlate = 1\nconstant = 1\nrelative = true\n",
            6,
            "`relative`",
        ),
        (
            "[reports]\nlate = 1\nconstant = 1\naction = \"go\"\n",
            6,
            "`action`",
        ),
        (
            "[reports]\nlost = 1\nconstant = 1\n",
            5,
            "`late` is missing",
        ),
        (
            "[[amount]]\naction = \"fill\"\nfluent = \"charge\"\nconstant = 1\n",
            5,
            "does not change this fluent",
        ),
        (
            "[[amount]]\naction = \"*\"\nfluent = \"level\"\nconstant = 1\n",
            5,
            "only continuously",
        ),
    ];
    for (sections, line, words) in cases {
        let (found, message) = error_of(sections);
        assert_eq!(found, line, "{sections}: {message}");
        assert!(message.contains(words), "{sections}: {message}");
    }
}

#[test]
fn invalid_numbers_are_rejected() {
    let cases = [
        (
            "[[duration]]\naction = \"go\"\nconstant = 1\nminimum = 30\nmaximum = 20\n",
            7,
            "less than `minimum`",
        ),
        (
            "[[duration]]\naction = \"go\"\nconstant = 1\nminimum = nan\n",
            6,
            "finite",
        ),
        (
            "[[duration]]\naction = \"go\"\nuniform = { from = 1, to = 2, minimum = 1 }\nminimum = 0\n",
            5,
            "once",
        ),
        (
            "[[duration]]\naction = \"go\"\nconstant = -5\n",
            5,
            "never negative",
        ),
        (
            "[[duration]]\naction = \"go\"\nvalues = [3, -5]\n",
            5,
            "never negative",
        ),
        (
            "[[delay]]\naction = \"go\"\nuniform = { from = -3, to = -1 }\n",
            5,
            "never negative",
        ),
        (
            "[[event]]\nfact = \"(at a)\"\nbecomes = true\nconstant = -1\n",
            6,
            "never negative",
        ),
        (
            "[[event]]\nfact = \"(at a)\"\nbecomes = \"no\"\nconstant = 1\n",
            5,
            "write true or false",
        ),
        (
            "[[duration]]\naction = \"go\"\nvalues = [1, \"a\"]\n",
            5,
            "expected a number",
        ),
    ];
    for (sections, line, words) in cases {
        let (found, message) = error_of(sections);
        assert_eq!(found, line, "{sections}: {message}");
        assert!(message.contains(words), "{sections}: {message}");
    }
}

#[test]
fn invalid_outcomes_are_rejected() {
    let outcome = "[[failure]]\naction = \"go\"\nprobability = 1\n[[failure.outcome]]\n";
    let cases = [
        ("delay = 1\n", 6, "`probability` is missing"),
        ("probability = 0.5\n", 6, "changes nothing"),
        ("probability = 2\ndelay = 1\n", 7, "between 0 and 1"),
        ("probability = -1\ndelay = 1\n", 7, "between 0 and 1"),
        ("probability = 1\ndelay = -1\n", 8, "never negative"),
        ("probability = 1\ndelay = inf\n", 8, "number of seconds"),
        (
            "probability = 1\nbecomes_true = [\"(up)\"]\n",
            8,
            "it has at",
        ),
        (
            "probability = 1\nbecomes_true = [\"(at)\"]\n",
            8,
            "takes 1 arguments",
        ),
        (
            "probability = 1\nbecomes_true = [\"(at c)\"]\n",
            8,
            "unknown object `c`",
        ),
        (
            "probability = 1\nbecomes_true = [\"(at _)\"]\n",
            8,
            "parameter of the action",
        ),
        (
            "probability = 1\nbecomes_true = [\"(at ?q)\"]\n",
            8,
            "it has ?p",
        ),
        (
            "probability = 1\nbecomes_true = [\"\"]\n",
            8,
            "name one fact",
        ),
        (
            "probability = 1\nbecomes_true = [\"(at a)\"]\nbecomes_false = [\"(at a)\"]\n",
            9,
            "twice",
        ),
        (
            "probability = 1\nassign = { \"(fuel)\" = 1 }\n",
            8,
            "it has charge, level",
        ),
        (
            "probability = 1\nincrease = { \"(charge)\" = nan }\n",
            8,
            "finite",
        ),
        ("probability = 1\nchance = 1\n", 8, "chance"),
        (
            "probability = 0.7\ndelay = 1\n[[failure.outcome]]\nprobability = 0.7\ndelay = 2\n",
            10,
            "add up to 1.4",
        ),
    ];
    for (rest, line, words) in cases {
        let sections = format!("{outcome}{rest}");
        let (found, message) = error_of(&sections);
        assert_eq!(found, line, "{sections}: {message}");
        assert!(message.contains(words), "{sections}: {message}");
    }
    let of_any = outcome.replace("\"go\"", "\"*\"");
    let (line, message) = error_of(&format!(
        "{of_any}probability = 1\nbecomes_true = [\"(at ?p)\"]\n"
    ));
    assert_eq!(line, 8);
    assert!(message.contains("give `action` a name"), "{message}");
    let (line, message) =
        error_of("[[delay]]\naction = \"go\"\nconstant = 1\n[[delay.outcome]]\ndelay = 1\n");
    assert!(
        line >= 3 && message.contains("`outcome` has no meaning"),
        "{line} {message}"
    );
}

#[test]
fn lateness_limits_are_applied() {
    let text = "format = \"elbowroom-world\"\nversion = 1\n[reports]\nlate = 1\n\
        uniform = { from = 0, to = 10 }\nminimum = 20\nmaximum = 20\n";
    let model = WorldModel::read(text, &problem()).expect("a correct file");
    let mut rng = elbowroom_sim::draw::keyed(0, "", 0, elbowroom_sim::Purpose::Report);
    let lateness = &model.reports.lateness;
    let drawn = lateness.draw(&0.into(), &model.resolution, &mut rng);
    assert_eq!(drawn, 20.into());
}

#[test]
fn other_format_or_version_is_rejected() {
    for text in [
        "",
        "format = \"elbowroom-world\"\nversion = 2\n",
        "format = \"x\"\nversion = 1\n",
    ] {
        assert!(WorldModel::read(text, &problem()).is_err(), "{text}");
    }
}

#[test]
fn last_matching_rule_applies() {
    let text = "format = \"elbowroom-world\"\nversion = 1\n\
        [[duration]]\naction = \"*\"\nconstant = 2\nrelative = true\n\
        [[duration]]\naction = \"(GO b)\"\nconstant = 7\n";
    let model = WorldModel::read(text, &problem()).expect("a correct file");
    let mut rng = elbowroom_sim::draw::keyed(0, "", 0, elbowroom_sim::Purpose::Duration);
    let planned = 5.into();
    assert_eq!(model.duration("(go a)", &planned, &mut rng), 10.into());
    assert_eq!(model.duration("(go b)", &planned, &mut rng), 7.into());
}
