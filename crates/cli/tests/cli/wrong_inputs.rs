//! Errors of new users, with the messages of the command.

use crate::command;
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use crate::command::elbowroom;
use serde_json::Value;

const DELIVERY: [&str; 3] = [
    "cases/delivery/domain.pddl",
    "cases/delivery/problem.pddl",
    "cases/delivery/plan.plan",
];
const BATTERY: [&str; 3] = [
    "cases/battery/domain.pddl",
    "cases/battery/problem.pddl",
    "cases/battery/plan.plan",
];
const TANK: [&str; 3] = [
    "cases/tank/domain.pddl",
    "cases/tank/problem.pddl",
    "cases/tank/plan.plan",
];

/// A file that no other test uses, removed on drop.
struct Temporary(PathBuf);

impl Temporary {
    fn new(name: &str, content: &str) -> Self {
        let name = format!("elbowroom-{}-wrong-{name}", std::process::id());
        let path = std::env::temp_dir().join(name);
        fs::write(&path, content).expect("a temporary file can be written");
        Self(path)
    }

    fn name(&self) -> &str {
        self.0.to_str().expect("a name in UTF-8")
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

/// Runs the command, checks its exit code, and returns standard error.
fn message(code: i32, arguments: &[&str]) -> String {
    let output = elbowroom(arguments);
    assert_eq!(
        output.status.code(),
        Some(code),
        "{arguments:?}: {output:?}"
    );
    String::from_utf8(output.stderr).expect("text")
}

fn envelope<'a>(problem: &[&'a str; 3], options: &[&'a str]) -> Vec<&'a str> {
    [&["envelope"], &problem[..], options].concat()
}

#[test]
fn unknown_parameter_is_reported_with_known_ones() {
    for (contains, words) in [
        ("d0=[5,12]", "the parameters are `dur_0`, `dur_1`"),
        (
            "(drive rover depot shelff)=[5,12]",
            "did you mean `(drive rover depot shelf)`?",
        ),
    ] {
        let said = message(2, &envelope(&DELIVERY, &["--contains", contains]));
        assert!(said.contains(words), "{contains}: {said}");
    }
}

/// The schedule, the sentence above it and the document contain the same number.
#[test]
fn the_shortfall_of_a_box_is_the_same_everywhere() {
    let outside = envelope(&DELIVERY, &["--contains", "dur_0=[5,30] dur_3=[10,30]"]);
    let text = elbowroom(&outside);
    let text = String::from_utf8(text.stdout).expect("text");
    let document = elbowroom(&[&outside[..], &["--json"]].concat());
    assert_eq!(document.status.code(), Some(1), "{document:?}");
    let document: Value = serde_json::from_slice(&document.stdout).expect("a document");
    let shortfall = &document["counterexample"]["shortfall"];
    let decimal = shortfall["decimal"].as_f64().expect("a number");
    // 30 + 2 + 30 + 3 s and four separations of 0.001 s exceed the deadline at 60.
    assert!((decimal - 5.004).abs() < 1e-9, "{document:#}");
    assert!(text.contains("too late by 5.004"), "{text}");
    assert_eq!(text.matches(" by ").count(), 1, "{text}");
}

#[test]
fn rate_is_varied_through_its_fluent() {
    let said = message(2, &envelope(&TANK, &["--vary", "constant drain level"]));
    assert!(said.contains("`initial (outflow barrel)`"), "{said}");
}

#[test]
fn initial_value_of_duration_is_varied_as_duration() {
    let vary = ["--vary", "initial (survey-time crater)"];
    let said = message(2, &envelope(&BATTERY, &vary));
    assert!(
        said.contains("vary `duration (survey rover crater)`"),
        "{said}"
    );
}

#[test]
fn unsatisfiable_bound_is_shown_with_its_position() {
    let network = Temporary::new(
        "empty-bound.stn",
        "durative-action instance n0 : (fill barrel);\n\
         c: n0.end - n0.start in [9, 8];\n\
         c: n0.start - .zero in [0, inf];\n",
    );
    let problem = [TANK[0], TANK[1], network.name()];
    let said = message(2, &envelope(&problem, &[]));
    assert!(
        said.contains("empty range: the lower bound 9 is above the upper bound 8"),
        "{said}"
    );
    assert!(said.contains(":2:26"), "{said}");
}

#[test]
fn offered_algorithms_work() {
    let refused = message(2, &envelope(&DELIVERY, &["--method", "greedy"]));
    let offered = refused.split("possible values: ").nth(1).expect("a list");
    let offered = offered.split(']').next().expect("an end of the list");
    let offered: Vec<&str> = offered.split(", ").collect();
    assert_eq!(offered, ["irr", "best", "exact"]);
    for method in offered {
        let done = elbowroom(&envelope(&DELIVERY, &["--method", method]));
        assert!(done.status.success(), "{method}: {done:?}");
    }
}

#[test]
fn files_in_the_wrong_order_are_recognised() {
    let [domain, problem, plan] = DELIVERY;
    let plan_first = message(2, &["check", domain, plan, problem]);
    assert!(plan_first.contains("it looks like a plan"), "{plan_first}");
    let problem_first = message(2, &["check", problem, domain]);
    assert!(
        problem_first.contains("in the wrong order?"),
        "{problem_first}"
    );
}

#[test]
fn tolerated_plan_syntax_is_a_warning() {
    for (name, plan, words) in [
        (
            "unit",
            "0: (fill barrel) [15 min]\n15.001: (drain barrel) [10]\n",
            "`min` is ignored",
        ),
        (
            "no-brackets",
            "0: (fill barrel) 15\n15.001: (drain barrel) [10]\n",
            "read as a plan from the terminal of PlanSys2",
        ),
        (
            "no-times",
            "(fill barrel) [15]\n(drain barrel) [10]\n",
            "no action has a time",
        ),
    ] {
        let plan = Temporary::new(&format!("{name}.plan"), plan);
        let output = elbowroom(&["check", TANK[0], TANK[1], plan.name()]);
        let said = String::from_utf8(output.stderr).expect("text");
        assert!(said.contains("warning: "), "{name}: {said}");
        assert!(said.contains(words), "{name}: {said}");
    }
}

#[test]
fn negative_numbers_are_values_and_not_options() {
    let world = "cases/delivery/world.toml";
    let experiment = "crates/cli/tests/files/late-drives.toml";
    let run = |option| vec!["run", DELIVERY[0], DELIVERY[1], option, "-1"];
    for arguments in [
        [&run("--seed")[..], &["--world", world]].concat(),
        run("--max-replans"),
        run("--planner-states"),
        run("--improve-states"),
        run("--epsilon"),
        run("--time-limit"),
        run("--planning-time"),
        vec!["compare", experiment, "--jobs", "-1"],
        vec!["compare", experiment, "--trials", "-1"],
        vec!["plan", DELIVERY[0], DELIVERY[1], "--memory", "-1"],
    ] {
        let said = message(2, &arguments);
        assert!(
            !said.contains("unexpected argument"),
            "{arguments:?}: {said}"
        );
        assert!(said.contains("-1"), "{arguments:?}: {said}");
    }
}

#[test]
fn text_instead_of_number_is_explained() {
    let text = fs::read_to_string(command::root().join("experiments/olisipo_sf3.toml"));
    let text = text.expect("the experiment");
    let wrong = text.replacen("seed = 1", "seed = \"one\"", 1);
    assert_ne!(text, wrong);
    let file = Temporary::new("seed.toml", &wrong);
    let said = message(2, &["compare", file.name()]);
    assert!(said.contains("a whole number"), "{said}");
    assert!(!said.contains("u64"), "{said}");
}

/// The sliding-tile puzzle with two tiles exchanged has no plan. The proof needs more than 1 MB.
#[test]
fn memory_limit_is_reported_in_megabytes_and_proves_nothing() {
    let domain = Temporary::new(
        "tiles-domain.pddl",
        "(define (domain tiles)
           (:requirements :typing :durative-actions)
           (:types cell tile)
           (:predicates (on ?t - tile ?c - cell) (empty ?c - cell) (beside ?a ?b - cell))
           (:durative-action slide
             :parameters (?t - tile ?from ?to - cell)
             :duration (= ?duration 1)
             :condition (and (at start (on ?t ?from)) (at start (empty ?to))
                             (at start (beside ?from ?to)))
             :effect (and (at start (not (on ?t ?from))) (at start (not (empty ?to)))
                          (at end (on ?t ?to)) (at end (empty ?from)))))",
    );
    let mut beside = String::new();
    for (a, b) in (0..9).flat_map(|a| (0..9).map(move |b| (a, b))) {
        let distance = i32::abs(a / 3 - b / 3) + i32::abs(a % 3 - b % 3);
        if distance == 1 {
            let _ = write!(beside, " (beside c{a} c{b})");
        }
    }
    let on = |cells: [u8; 8]| {
        let on = cells.iter().enumerate();
        let words: Vec<String> = on
            .map(|(tile, cell)| format!(" (on t{tile} c{cell})"))
            .collect();
        words.concat()
    };
    let problem = Temporary::new(
        "tiles-problem.pddl",
        &format!(
            "(define (problem exchanged) (:domain tiles)
               (:objects c0 c1 c2 c3 c4 c5 c6 c7 c8 - cell t0 t1 t2 t3 t4 t5 t6 t7 - tile)
               (:init (empty c8){beside}{})
               (:goal (and{})))",
            on([0, 1, 2, 3, 4, 5, 6, 7]),
            on([1, 0, 2, 3, 4, 5, 6, 7]),
        ),
    );
    let output = elbowroom(&["plan", domain.name(), problem.name(), "--memory", "1"]);
    assert_eq!(output.status.code(), Some(3), "{output:?}");
    let said = String::from_utf8([output.stdout, output.stderr].concat()).expect("text");
    assert!(said.contains("memory limit of 1 MB"), "{said}");
    assert!(said.contains("does not prove that none exists"), "{said}");
}

/// A world that answers with an unknown ticket without advancing its time is reported.
#[test]
fn unknown_ticket_is_named() {
    let world = Temporary::new(
        "ticket.sh",
        "while read -r line; do case \"$line\" in *'\"wait\"'*|*'\"look\"'*)\n\
         echo '{\"type\":\"ended\",\"ticket\":77,\"time\":0,\"outcome\":\"succeeded\"}'\n\
         echo '{\"type\":\"time\",\"now\":0}';; esac; done\n",
    );
    let command = format!("sh {}", world.name());
    let run = ["run", DELIVERY[0], DELIVERY[1], "--world-process", &command];
    let output = elbowroom(&run);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    let told = String::from_utf8(output.stderr).expect("text");
    assert!(told.contains("its clock does not advance"), "{told}");
    assert!(told.contains("unknown ticket 77"), "{told}");
    // The report states that the world failed, without repeating the reason.
    let report = String::from_utf8(output.stdout).expect("text");
    assert!(report.contains("the world failed at 0"), "{report}");
    assert!(!report.contains("stands still"), "{report}");
    let strict = message(2, &[&run[..], &["--strict-world"]].concat());
    assert!(strict.contains("unknown ticket 77"), "{strict}");
}

/// Column names are unique, and each cell contains one number, for use by programs.
#[test]
fn table_of_experiment_is_machine_readable() {
    let folder = std::env::temp_dir().join(format!("elbowroom-{}-tidy", std::process::id()));
    let path = folder.display().to_string();
    let experiment = "crates/cli/tests/files/late-drives.toml";
    let output = elbowroom(&["compare", experiment, "--trials", "2", "-o", &path]);
    assert!(output.status.success(), "{output:?}");
    let table = fs::read_to_string(folder.join("table.csv")).expect("a table");
    let rows: Vec<Vec<&str>> = table.lines().map(|row| row.split(',').collect()).collect();
    let mut headings = rows[0].clone();
    headings.sort_unstable();
    headings.dedup();
    assert_eq!(headings.len(), rows[0].len(), "{table}");
    for row in &rows[1..] {
        assert_eq!(row.len(), rows[0].len(), "{table}");
        for cell in &row[2..] {
            assert!(cell.parse::<f64>().is_ok(), "`{cell}`: {table}");
        }
    }
    fs::remove_dir_all(folder).expect("it is there");
}
