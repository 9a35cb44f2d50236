//! No action of a plan's text is dropped: it is read, or an error names its line.

mod headings;
mod notations;

use crate::reading::{domain, problem, task};
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_pddl::{Diagnostic, Diagnostics, Source, read_plan, write_plan};
use proptest::prelude::*;

fn house() -> Task {
    let domain = domain(
        "(:durative-action walk :parameters (?from ?to - room) :duration (= ?duration 4))
         (:durative-action wait :duration (>= ?duration 1) :effect (at end (lit)))
         (:action snap :parameters (?b - ball))",
    );
    task(&domain, &problem("(:init) (:goal (lit))"))
}

fn read(text: &str) -> Result<(TimeTriggeredPlan, Vec<Diagnostic>), Diagnostics> {
    read_plan(&Source::new("plan", text), &house())
}

/// Returns the plan in a text, written again on one line.
fn plan(text: &str) -> String {
    match read(text) {
        Ok((plan, _)) => write_plan(&house(), &plan).trim_end().replace('\n', "; "),
        Err(found) => panic!("{}", found.render(false)),
    }
}

/// Returns the messages of the warnings.
fn notes(text: &str) -> String {
    let (_, notes) = read(text).unwrap_or_else(|found| panic!("{}", found.render(false)));
    let messages: Vec<_> = notes.into_iter().map(|note| note.message).collect();
    messages.join("\n")
}

/// Returns line and message of the errors.
fn errors(text: &str) -> String {
    let Err(found) = read(text) else {
        return "none".to_owned();
    };
    let errors: Vec<_> = found
        .errors()
        .map(|error| format!("{}: {}", error.line(), error.message))
        .collect();
    errors.join("\n")
}

/// Generates lines that resemble an action: prefix, time, separator, action, suffix.
fn nearly_an_action() -> impl Strategy<Value = String> {
    let before = prop::sample::select(vec![
        "",
        " ",
        "- ",
        "* ",
        "> ",
        "1. ",
        "2) ",
        "// ",
        "# ",
        "[INFO] ",
        "t=",
        "at ",
        "step ",
        "| ",
        "12:30 ",
        "12:30:45 ",
        "+",
        "~",
        "(",
        "\"",
    ]);
    let time = prop::sample::select(vec![
        "6", "6.5", "06", "6s", "6 s", "6 min", "0x6", "6,5", "6/1", "1e1", "-6", "6.", ".6", "",
    ]);
    let between = prop::sample::select(vec![
        ": ", ":", " ", " : ", "; ", " - ", "= ", ") ", ", ", "\t", " -> ", "::", ". ", "",
    ]);
    let action = prop::sample::select(vec![
        "(snap b1)",
        "(SNAP B2)",
        "( snap b1 )",
        "(walk hall kitchen)",
        "(wait)",
        "(snap b1",
        "((snap b1))",
        "[snap b1]",
        "{snap b1}",
        "snap(b1)",
        "walk(hall, kitchen)",
        "snap b1",
        "walk hall kitchen",
        "start (wait)",
        "(launch rocket)",
        "(snap rocket)",
        "launch(rocket)",
        "(walk hall)",
        "(snap b1) (snap b2)",
    ]);
    let behind = prop::sample::select(vec![
        "",
        " [4]",
        "[4]",
        " 4",
        " [4",
        " 4]",
        " [4 s]",
        " [D:4; C:1]",
        " [4; 5]",
        " ; done",
        " done",
        " (1)",
        " [4] [4]",
        ",",
        " #1",
        " [4] 8",
        " [4 ; 9: (wait) [4]",
    ]);
    (before, time, between, action, behind)
        // `6snap` is another name.
        .prop_filter("a name", |(_, time, between, action, _)| {
            time.is_empty() || !between.is_empty() || !action.starts_with(char::is_alphabetic)
        })
        .prop_map(|(before, time, between, action, behind)| {
            format!("{before}{time}{between}{action}{behind}")
        })
}

const PLAN: [&str; 3] = [
    "0: (wait) [2]",
    "2.001: (walk hall kitchen) [4]",
    "7: (snap b1)",
];

/// Generates text that planners print before and after plans.
fn log_text() -> impl Strategy<Value = &'static str> {
    prop::sample::select(vec![
        "",
        "; States evaluated: 4",
        "b (10.000 | 0.100)b (8.000 | 0.200)(G)",
        "Initial heuristic = 9.000, admissible cost estimate 0.000",
        "80% of the ground temporal actions in this problem are compression-safe",
        "Solution with original makespan 12 found (ignoring no-moving-targets-rule).",
        "Plan length: 3 step(s).",
        "Plan cost: 2",
        "Plan quality: 8.0",
        "Planning Time (msec): 200",
        "[t=0.003s, 10084 KB] Evaluated 6 state(s).",
        "Cueing down from goal distance:    4 into depth [1][2]",
        "                                   3            [1]",
        "Total time:      0.01",
        "-------------",
        "```",
        "3. This is the plan of today:",
    ])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn line_similar_to_an_action_is_read_or_reported(
        line in nearly_an_action(),
        at in 0..=PLAN.len(),
        head in log_text(),
        tail in log_text(),
    ) {
        // Words that are neither an action nor a number are log text.
        prop_assume!(!line.contains("launch") || line.contains(|c: char| c.is_ascii_digit()));
        prop_assume!(!line.trim_start().starts_with(';'));
        let mut lines = vec![head];
        lines.extend(&PLAN[..at]);
        lines.push(&line);
        lines.extend(&PLAN[at..]);
        lines.push(tail);
        let text = lines.join("\n");
        match read(&text) {
            Ok((plan, _)) => {
                let shown = write_plan(&house(), &plan);
                // `(snap b1) (snap b2)` are two.
                prop_assert!(plan.steps.len() > PLAN.len(), "dropped from\n{text}\n->\n{shown}");
                for step in ["0.000: (wait) [2.000]", "2.001: (walk hall kitchen) [4.000]", "7.000: (snap b1)"] {
                    prop_assert!(shown.contains(step), "{step} is gone from\n{text}\n->\n{shown}");
                }
            }
            Err(found) => {
                let is_named = found.errors().any(|error| error.line() == at + 2);
                prop_assert!(is_named, "no error at line {}\n{text}\n{found}", at + 2);
            }
        }
    }

    #[test]
    fn log_text_around_a_plan_changes_nothing(head in log_text(), tail in log_text()) {
        let text = [&[head], &PLAN[..], &[tail]].concat().join("\n");
        prop_assert_eq!(plan(&text), plan(&PLAN.join("\n")));
    }

    #[test]
    fn log_text_between_actions_is_an_error_or_begins_a_plan(text in log_text(), at in 1..PLAN.len()) {
        let lines = [&PLAN[..at], &[text], &PLAN[at..]].concat().join("\n");
        match read(&lines) {
            Ok((plan, notes)) if text.is_empty() => {
                prop_assert!(plan.steps.len() == PLAN.len() && notes.is_empty());
            }
            Ok((_, notes)) => prop_assert!(notes[0].message.contains("the file has 2 plans"), "{lines}"),
            Err(found) => prop_assert!(found.errors().all(|error| error.line() == at + 1), "{found}"),
        }
    }

    #[test]
    fn arbitrary_text_does_not_panic(text in "([ -~]{0,30}\n?){0,6}") {
        let _ = read(&text);
    }
}

#[test]
fn text_between_actions_is_an_error_with_its_line() {
    assert_eq!(
        errors("0: (wait) [2]\nand then\n3: (snap b1)"),
        "2: this line between actions is not an action of a plan"
    );
    assert_eq!(errors("0: (wait) [2]\n; and then\n\n3: (snap b1)"), "none");
    assert_eq!(
        errors("0: (wait) [2]\n-----\n3: (snap b1)")
            .split(':')
            .next(),
        Some("2")
    );
}

#[test]
fn text_that_may_hold_an_action_is_an_error_before_and_after_a_plan() {
    let possible = "this line may contain an action, but cannot be read";
    for line in [
        "- 6: (snap b1)",
        "[INFO] 6.0: (snap b1)",
        "t=6: (launch rocket) [3]",
        "5.002; (wait) [1]",
        "at 6 snap b1",
        "then (snap b1)",
        "6 launch rocket [3]",
    ] {
        let (before, after) = (
            format!("{line}\n0: (wait) [2]"),
            format!("0: (wait) [2]\n{line}"),
        );
        assert_eq!(errors(&before), format!("1: {possible}"), "{line}");
        assert_eq!(errors(&after), format!("2: {possible}"), "{line}");
    }
}

#[test]
fn action_name_with_number_or_bracket_is_an_error_next_to_plan() {
    for line in [
        "t1: ('wait') [1]",
        "t9= (:action wait)[1]",
        "<7.000>: (:action snap)",
        "t7:: snap {1}",
        "1) wait",
        "(1) wait 1",
        "t1: wait",
        "8.000   （snap b1）",
        "(1.000)：【wait】",
        "٧: ‘wait’",
        "12:30 -> then WAIT",
        "{\"action\": \"wait\"}",
        "+8->snap_b1",
        "(1): walk-hall-kitchen",
        "<wait_start>",
        "[snap/b1/2]",
        "1.000; (wait_start)",
        "('jump') [1]",
        "go and wait, then [3]",
    ] {
        for (text, number) in [
            (format!("{line}\n0: (wait) [2]"), 1),
            (format!("0: (wait) [2]\n{line}"), 2),
        ] {
            assert!(
                errors(&text).starts_with(&format!("{number}: ")),
                "{text}\n{}",
                errors(&text)
            );
        }
    }
}

#[test]
fn action_name_in_prose_is_an_error_next_to_plan() {
    for line in [
        "executing: wait",
        "Executing wait",
        "then wait.",
        "start wait",
        "wait again",
        "next action: wait for the door",
        "action=wait name=rest",
        "-> \"wait\" at once",
        "|40|jump|hall kitchen|",
        "|40|jump|hall kitchen|20|",
        "| 40 | 'jump' | hall | kitchen | 20 |",
        "| hall | jump | 20 |",
        "- 'jump' 'hall'",
    ] {
        for (text, number) in [
            (format!("{line}\n0: (wait) [2]"), 1),
            (format!("0: (wait) [2]\n{line}"), 2),
        ] {
            assert!(
                errors(&text).starts_with(&format!("{number}: ")),
                "{text}\n{}",
                errors(&text)
            );
        }
    }
    for line in [
        "3. This is the plan of today:",
        "The robot must not wait for the lift.",
        "domain 'WAIT' defined",
        "|F|:14",
        "| start | action | duration |",
        "| hall | kitchen | 20 |",
    ] {
        let text = format!("{line}\n0: (wait) [2]\n{line}\n");
        assert_eq!(errors(&text), "none", "{line}");
    }
}

#[test]
fn statistics_of_planners_that_hold_the_name_of_an_action_are_skipped() {
    let names = ["b", "load", "plan", "search", "state", "step"];
    let actions: Vec<_> = names.map(|it| format!("(:action {it})")).into();
    let task = task(
        &domain(&actions.join(" ")),
        &problem("(:init) (:goal (lit))"),
    );
    for line in [
        "b (10.000 | 0.100)b (8.000 | 0.200)(G)",
        "[t=0.003s, 10084 KB] Actual search time: 0.001s",
        "[t=0.001s, 10084 KB] Conducting best first search with reopening closed nodes, (real) bound = 2147483647",
        "[t=0.003s, 10084 KB] Int hash set load factor: 6/8 = 0.750000",
        "[t=0.003s, 10084 KB] Expanded 5 state(s).",
        "Plan length: 3 step(s).",
        "ff: search configuration is  best-first on 1*g(s) + 5*h(s) where",
        " Search time:     0.01",
        "Metric (Search):5.0",
        "Search Time (msec): 20",
        "Fixed constraint violations during search (zero-crossing):0",
    ] {
        let text = format!("{line}\n0: (load)\n1: (search)\n{line}\n");
        let read = read_plan(&Source::new("plan", text), &task);
        let (plan, _) = read.unwrap_or_else(|found| panic!("{}", found.render(false)));
        assert_eq!(plan.steps.len(), 2, "{line}");
    }
}

#[test]
fn each_line_break_ends_a_comment() {
    let usual = "; a comment\n0: (wait) [2] ; and another\n; one more\n3: (snap b1)\n";
    for end in [
        "\r", "\r\n", "\u{b}", "\u{c}", "\u{85}", "\u{2028}", "\u{2029}",
    ] {
        assert_eq!(plan(&usual.replace('\n', end)), plan(usual), "{end:?}");
    }
    assert_eq!(
        errors("; a comment\r0: (wait) [2]\rand then\r3: (snap b1)\r"),
        "3: this line between actions is not an action of a plan"
    );
}

#[test]
fn action_that_is_written_in_part_or_with_unknown_words_is_an_error() {
    let timed = "0: (walk hall kitchen) [4]\n4.001: (walk kitchen hall) [4]\n";
    let untimed = "walk hall kitchen (1)\nwalk kitchen hall (1)\n";
    for line in [
        "walk hall cellar (1)",
        "walk hall (1)",
        "jump hall (1)",
        "jump (1)",
        "walk hall cellar",
        "walk hall",
        "walk: hall",
        "walk:",
        "jump hall kitchen",
        "- jump hall kitchen",
        "- jump(hall, kitchen)",
        "- (jump hall kitchen)",
        "40.0 jump hall kitchen",
        "6. jump hall",
        "walk_hall_kitchen",
        "walk-hall-kitchen",
        "walk.hall.kitchen",
        "then snap/b1",
        "wait [3]",
        "wait 8",
        "{\"time\": 7, \"name\": \"walk\", \"args\": [\"hall\", \"kitchen\"]}",
    ] {
        for plan in [timed, untimed] {
            for text in [format!("{line}\n{plan}"), format!("{plan}{line}\n")] {
                assert_ne!(errors(&text), "none", "{text}");
            }
        }
    }
    for text in [format!("jump\n{untimed}"), format!("{untimed}jump\n")] {
        assert_ne!(errors(&text), "none", "{text}");
    }
    // A blank line separates a word of a log.
    assert_eq!(errors(&format!("{untimed}\nDone\n")), "none");
    assert_eq!(errors(&format!("{timed}Done\n")), "none");
    let log =
        "[ INFO] [1515.9]: KCL: (/rosplan_planner_interface) (problem.pddl) Planning complete";
    assert_eq!(errors(&format!("{log}\n{timed}")), "none");
}

#[test]
fn comment_begins_at_the_line_or_behind_a_complete_action() {
    assert_eq!(
        plan("0: (wait) [2] ; (snap b1)\n  ; 3: (snap b1)"),
        "0.000: (wait) [2.000]"
    );
    assert_ne!(errors("0: (wait) ; [2]"), "none");
    assert_ne!(errors("0: (wait) [2]\n5; (snap b1)"), "none");
    assert_ne!(errors("0: (wait) [2 ; 5: (snap b1) [1]"), "none");
}

#[test]
fn text_without_action_is_a_plan_only_if_goal_holds_initially() {
    let no_plan = "1: this is not a plan: it has no action";
    for text in [
        "",
        "; nothing\n",
        "no plan was found\n",
        "# Title\n\nSome text.",
    ] {
        assert_eq!(errors(text), no_plan, "{text}");
    }
    let idle = task(
        &domain("(:action rest)"),
        &problem("(:init (lit)) (:goal (lit))"),
    );
    let read = |text: &str| read_plan(&Source::new("plan", text), &idle);
    assert!(read("; nothing to do\n").unwrap().0.steps.is_empty());
    assert!(read("no plan was found\n").is_err());
}
