//! Inputs that the command does not understand or cannot satisfy are refused, never ignored.

use std::fs;
use std::path::{Path, PathBuf};

use crate::command::{elbowroom, root};

/// A folder that no other test uses.
fn folder(name: &str) -> PathBuf {
    let folder =
        std::env::temp_dir().join(format!("elbowroom-{}-refusals-{name}", std::process::id()));
    fs::create_dir_all(&folder).expect("a temporary folder can be made");
    folder
}

/// Returns the message of a refusal: exit code 2, nothing on standard output.
fn refusal(arguments: &[&str]) -> String {
    let output = elbowroom(arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {output:?}");
    assert!(output.stdout.is_empty(), "{arguments:?}: {output:?}");
    String::from_utf8(output.stderr).expect("text")
}

const RUN: [&str; 3] = [
    "run",
    "cases/delivery/domain.pddl",
    "cases/delivery/problem.pddl",
];

#[test]
fn ineffective_options_of_run_are_rejected() {
    for (options, words) in [
        (&["--planner-time", "5"][..], "--planning-budget"),
        (
            &["--method", "irr", "--objective", "widths"],
            "leave out --method irr",
        ),
        (
            &["--planner-time", "5", "--planner", "none"],
            "has no effect with",
        ),
        (
            &["--seed", "3", "--world-process", "cat"],
            "cannot be used with",
        ),
        (
            &["--realtime", "2", "--world-process", "cat"],
            "cannot be used with",
        ),
        (&["--answer-within", "3"], "--world-process"),
        // A simulated world does not outlive the run, so it cannot have a journal. The option was
        // once ignored silently.
        (
            &["--journal", "j", "--world", "cases/delivery/world.toml"],
            "cannot be used with",
        ),
        (&["--journal", "j"], "--world-process"),
        (
            &["--spoil", "{dur_0: [9, 11]}", "--world-process", "cat"],
            "cannot be used with",
        ),
        (&["--spoil", "{dur_0: [9, 11]}"], "--world"),
        (
            &[
                "--spoil",
                "{dur_0: [9, 11]}",
                "--world",
                "cases/delivery/world.toml",
            ],
            "--spoil has no effect without --world spoiler",
        ),
        (&["--realtime", "1e-30"], "between 0.000001"),
        (&["--planning-time", "soon"], "--planning-time 2.5"),
        (&["--jobs", "2", "--planner", "none"], "leave out --jobs"),
        (
            &["--jobs", "2", "--planner", "cat {domain} {problem}"],
            "leave out --jobs",
        ),
        (&["--jobs", "-1"], "--jobs"),
        (
            &["--realtime", "9", "--journal", "journal"],
            "cannot be used with",
        ),
        (
            &["--seed", "9", "--journal", "journal"],
            "cannot be used with",
        ),
    ] {
        let said = refusal(&[&RUN[..], options].concat());
        assert!(said.contains(words), "{options:?}: {said}");
    }
}

#[test]
fn threads_apply_to_embedded_planner_and_do_not_change_plans() {
    fn plan<'a>(options: &[&'a str]) -> Vec<&'a str> {
        [&["plan", RUN[1], RUN[2]], options].concat()
    }
    for (options, words) in [
        (
            &["--jobs", "2", "--planner", "cat {domain} {problem}"][..],
            "leave out --jobs",
        ),
        (
            &["--jobs", "2", "--objective", "slack"],
            "cannot be used with",
        ),
        (
            &["--jobs", "2", "--world", "cases/delivery/world.toml"],
            "cannot be used with",
        ),
        (
            &["--first", "--world", "cases/delivery/world.toml"],
            "cannot be used with",
        ),
        (&["--jobs", "-1"], "--jobs"),
        (&["--jobs", "many"], "--jobs"),
    ] {
        let said = refusal(&plan(options));
        assert!(said.contains(words), "{options:?}: {said}");
    }
    let plans = ["0", "1", "2", "7"].map(|jobs| {
        let output = elbowroom(&plan(&["--jobs", jobs]));
        assert_eq!(output.status.code(), Some(0), "{output:?}");
        output.stdout
    });
    assert!(plans.windows(2).all(|two| two[0] == two[1]), "{plans:?}");
}

#[test]
fn trace_does_not_depend_on_number_of_threads() {
    let folder = folder("jobs");
    let trace = folder.join("trace.jsonl").display().to_string();
    let world = ["--world", "cases/delivery/world.toml", "--seed", "3"];
    let traces = ["0", "1", "2", "7"].map(|jobs| {
        let options = [&world[..], &["--trace", &trace, "--jobs", jobs]].concat();
        let output = elbowroom(&[&RUN[..], &options].concat());
        assert!(output.status.code() != Some(2), "{output:?}");
        fs::read_to_string(&trace).expect("a trace")
    });
    assert!(traces.windows(2).all(|two| two[0] == two[1]), "{traces:?}");
    let said = refusal(&["run", "--replay", &trace, "--jobs", "2"]);
    assert!(said.contains("cannot be used with"), "{said}");
    fs::remove_dir_all(folder).expect("it is there");
}

#[test]
fn options_of_largest_box_select_it_or_are_rejected() {
    let plan = [
        "envelope",
        "cases/delivery/domain.pddl",
        "cases/delivery/problem.pddl",
        "cases/delivery/plan.plan",
    ];
    for options in [
        &["--objective", "widths"][..],
        &["--symmetric"],
        &["--cap", "3"],
    ] {
        let said = refusal(&[&plan[..], &["--method", "irr"], options].concat());
        assert!(said.contains(options[0]), "{said}");
        assert!(said.contains("leave out --method irr"), "{said}");
        let implied = elbowroom(&[&plan[..], &["--json"], options].concat());
        let answer = String::from_utf8(implied.stdout).expect("text");
        assert!(
            answer.contains("\"method\": \"best\""),
            "{options:?}: {answer}"
        );
    }
}

#[test]
fn unknown_quantity_cannot_be_left_open() {
    for (spec, words) in [
        ("duration drve", "did you mean `drive`?"),
        ("deadline (at rover moon)", "--vary"),
    ] {
        let said = refusal(&[&RUN[..], &["--vary", spec]].concat());
        assert!(said.contains(words), "{spec}: {said}");
    }
    for spec in ["duration drive", "duration n0", "duration n99"] {
        let output = elbowroom(&[&RUN[..], &["--vary", spec]].concat());
        assert_ne!(output.status.code(), Some(2), "{spec}: {output:?}");
    }
}

#[test]
fn advice_on_files_is_about_the_file_that_is_missing() {
    let said = refusal(&[&RUN[..], &["--world", "no.toml"]].concat());
    assert!(!said.contains("DOMAIN PROBLEM PLAN"), "{said}");
    let said = refusal(&["compare", "no.toml"]);
    assert!(!said.contains("DOMAIN PROBLEM PLAN"), "{said}");
    let said = refusal(&["run", "no.pddl", RUN[2]]);
    assert!(said.contains("DOMAIN PROBLEM PLAN"), "{said}");
}

#[test]
fn tables_are_no_wider_than_eighty_columns() {
    let folder = folder("wide");
    let more = ["b", "c", "d", "e"]
        .map(|name| format!("[[column]]\nname = \"{name}\"\nworld = \"world.toml\"\n"))
        .concat();
    let more = format!("{more}[[column]]");
    let changes = [("trials = 6", "trials = 1"), ("[[column]]", more.as_str())];
    let file = experiment(&folder, &changes);
    let output = elbowroom(&["compare", &file]);
    let table = String::from_utf8(output.stdout).expect("text");
    for name in ["b:", "c:", "d:", "e:", "late:", "replans", "clairvoyant"] {
        assert!(table.contains(name), "{name}: {table}");
    }
    let longest = table.lines().map(|line| line.chars().count()).max();
    assert!(longest <= Some(80), "{table}");
    fs::remove_dir_all(folder).expect("it is there");
}

#[test]
fn replay_rejects_other_options() {
    for option in [
        ["--executor", "stn"],
        ["--trace", "x.jsonl"],
        ["--seed", "1"],
        ["--world-process", "cat"],
        ["--epsilon", "1"],
    ] {
        let said = refusal(&["run", "--replay", "t.jsonl", option[0], option[1]]);
        assert!(said.contains("cannot be used with"), "{option:?}: {said}");
    }
}

/// Writes the shipped experiment with changes.
fn experiment(folder: &Path, changes: &[(&str, &str)]) -> String {
    let text = fs::read_to_string(root().join("crates/cli/tests/files/late-drives.toml"));
    let mut text = text.expect("the experiment");
    for file in ["domain.pddl", "problem.pddl"] {
        let from = root().join("cases/delivery").join(file);
        fs::copy(from, folder.join(file)).expect("copied");
    }
    let world = root().join("crates/cli/tests/files/late-drives-world.toml");
    fs::copy(world, folder.join("world.toml")).expect("copied");
    for (from, to) in [
        ("../../../../cases/delivery/", ""),
        ("late-drives-world.toml", "world.toml"),
    ]
    .iter()
    .chain(changes)
    {
        assert!(text.contains(from), "{from}: {text}");
        text = text.replace(from, to);
    }
    let file = folder.join("experiment.toml");
    fs::write(&file, text).expect("written");
    file.display().to_string()
}

#[test]
fn experiments_without_meaningful_table_are_rejected() {
    let folder = folder("empty-experiments");
    let cases = [
        ("trials = 6", "trials = 0", "expected at least one trial"),
        (
            "executors = [\"guarded\", \"live\", \"fixed:10\"]",
            "executors = []",
            "at least one executor",
        ),
        (
            "[[column]]",
            "[blanks]\nfoo = []\n[[column]]",
            "at least one value for the blank",
        ),
        (
            "[[column]]",
            "[[together]]\nnames = [\"foo\"]\nrows = []\n[[column]]",
            "at least one row",
        ),
        (
            "trials = 6",
            "trials = 6\nplanner_time = 5",
            "`planner_time` needs an external",
        ),
    ];
    for (from, to, words) in cases {
        let file = experiment(&folder, &[(from, to)]);
        let said = refusal(&["compare", &file]);
        assert!(said.contains(words), "{to}: {said}");
        assert!(said.contains("experiment.toml:"), "{to}: {said}");
    }
    for (figures, words) in [
        (
            "executor = \"nobody\"\ncoverage = [1]",
            "unknown row `nobody`",
        ),
        (
            "executor = \"live\"\ncoverage = [1, 2]",
            "each of the 1 columns",
        ),
        (
            "executor = \"live\"\ncoverage = [1]\nreplans = [1, 2]",
            "each of the 1 columns",
        ),
    ] {
        let file = experiment(&folder, &[]);
        let text = fs::read_to_string(&file).expect("the experiment");
        fs::write(&file, format!("{text}\n[[published]]\n{figures}\n")).expect("written");
        let said = refusal(&["compare", &file]);
        assert!(said.contains(words), "{figures}: {said}");
    }
    let file = experiment(&folder, &[]);
    assert!(refusal(&["compare", &file, "--trials", "0"]).contains("0 is not in 1.."));
    // Executors in perturbed worlds are checked as well.
    let text = fs::read_to_string(root().join("experiments/olisipo_sf3.toml")).expect("there");
    let is_list = |line: &&str| line.starts_with("executors =");
    let executors = text.lines().find(is_list).expect("executors");
    fs::write(&file, text.replace(executors, "executors = []")).expect("written");
    assert!(refusal(&["compare", &file]).contains("the experiment is empty"));
    // A problem without placeholders is reported as such.
    let file = experiment(
        &folder,
        &[("executors", "planner = \"{domain} {problem}\"\nexecutors")],
    );
    let said = refusal(&["compare", &file]);
    assert!(!said.contains("with :"), "{said}");
    fs::remove_dir_all(folder).expect("it is there");
}

#[test]
fn only_results_of_the_experiment_are_merged_and_missing_parts_are_named() {
    let folder = folder("merging");
    let file = experiment(&folder, &[]);
    let part = |shard: &str| {
        let name = folder.join(shard.replace('/', "-")).display().to_string();
        let made = elbowroom(&["compare", &file, "--shard", shard, "-o", &name]);
        assert!(made.status.success(), "{made:?}");
        let table = String::from_utf8(made.stdout).expect("text");
        (format!("{name}/results.json"), table)
    };
    let ((first, table), (last, _)) = (part("0/3"), part("2/3"));
    let words = "incomplete: 2 of 6 trials of each problem; parts made: 0/3";
    assert!(table.contains(words), "{table}");
    let merged = elbowroom(&["compare", &file, "--merge", &first, &last]);
    let table = String::from_utf8(merged.stdout).expect("text");
    let words = "incomplete: 4 of 6 trials of each problem; parts made: 0/3, 2/3";
    assert!(table.contains(words), "{table}");

    // Results of another experiment, with another column and title, once caused a panic.
    let more = "[[column]]\nname = \"more\"\nworld = \"world.toml\"\n[[column]]";
    let other = experiment(&folder, &[("[[column]]", more), ("Late drives", "Others")]);
    let said = refusal(&["compare", &other, "--merge", &first, &last]);
    assert!(said.contains("belongs to another experiment"), "{said}");

    let text = fs::read_to_string(&first).expect("results");
    let impossible = text.replace("\"shards\": 3", "\"shards\": 0");
    assert_ne!(text, impossible);
    fs::write(&first, impossible).expect("written");
    let said = refusal(&["compare", &experiment(&folder, &[]), "--merge", &first]);
    assert!(said.contains("these parts do not exist"), "{said}");
    fs::remove_dir_all(folder).expect("it is there");
}

#[test]
fn unwritable_folder_is_reported_before_the_trials() {
    let folder = folder("no-folder");
    let file = experiment(&folder, &[("trials = 6", "trials = 1000000000")]);
    let bad = folder.join("experiment.toml/results").display().to_string();
    let said = refusal(&["compare", &file, "-o", &bad]);
    assert!(said.contains("cannot create the folder"), "{said}");
    // The results are printed although they cannot be written.
    let file = experiment(&folder, &[("trials = 6", "trials = 1")]);
    let taken = folder.join("out");
    fs::create_dir_all(taken.join("results.json")).expect("made");
    let output = elbowroom(&["compare", &file, "-o", &taken.display().to_string()]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    let table = String::from_utf8(output.stdout).expect("text");
    assert!(table.contains("guarded"), "{table}");
    fs::remove_dir_all(folder).expect("it is there");
}

#[test]
fn numbers_below_zero_are_refused_as_numbers() {
    let said = refusal(&[
        "envelope",
        "cases/delivery/domain.pddl",
        "cases/delivery/problem.pddl",
        "cases/delivery/plan.plan",
        "--precision",
        "-1",
    ]);
    assert!(said.contains("greater than 0"), "{said}");
}

#[test]
fn misspelt_planner_is_not_suggested_for_installation() {
    let output = elbowroom(&[&RUN[..], &["--planner", "up:nosuch"]].concat());
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("up:nosuch"), "{said}");
    assert!(!said.contains("up-nosuch"), "{said}");
}

#[test]
fn file_that_is_no_trace_is_reported() {
    let said = refusal(&["run", "--replay", "cases/delivery/plan.plan"]);
    assert!(said.contains("not the trace of a run"), "{said}");
}

#[test]
fn missing_plan_file_is_not_reported_as_wrong_order() {
    let said = refusal(&[&RUN[..], &["--plan", "nope.plan"]].concat());
    assert!(!said.contains("DOMAIN PROBLEM PLAN"), "{said}");
}

#[test]
fn unsupported_quantity_lists_supported_ones() {
    for (spec, words) in [
        ("deadlin (counter-open office)", "did you mean `deadline`?"),
        ("initial battery rover", "`initial (battery rover)`"),
    ] {
        let said = refusal(&[
            "envelope",
            "cases/delivery/domain.pddl",
            "cases/delivery/problem.pddl",
            "cases/delivery/plan.plan",
            "--vary",
            spec,
        ]);
        assert!(said.contains(words), "{spec}: {said}");
    }
}

#[test]
fn misspelt_key_of_world_file_gets_suggestion() {
    let folder = folder("misspelt-key");
    let world = folder.join("world.toml");
    let text = "format = \"elbowroom-world\"\nversion = 1\n[[duration]]\nactoin = \"drive\"\n";
    fs::write(&world, text).expect("a file can be written");
    let world = world.display().to_string();
    let said = refusal(&[&RUN[..], &["--world", &world]].concat());
    assert!(said.contains("did you mean `action`?"), "{said}");
    assert!(said.contains(":4:1"), "{said}");
    fs::remove_dir_all(folder).expect("it was there");
}

/// With `--json`, the failure document contains the message shown to users.
#[test]
fn failure_is_a_document_with_json() {
    let output = elbowroom(&[
        "check",
        "crates/cli/tests/files/misspelt.pddl",
        "cases/delivery/problem.pddl",
        "--json",
    ]);
    assert_eq!(output.status.code(), Some(2));
    let document: serde_json::Value =
        serde_json::from_slice(&output.stdout).expect("one JSON document");
    assert_eq!(document["format"], "elbowroom-failure");
    let first = &document["diagnostics"][0];
    assert_eq!(first["severity"], "error");
    for member in ["line", "column", "length"] {
        assert!(first[member].as_u64().is_some(), "{member}: {first}");
    }
    for member in ["file", "message"] {
        assert!(first[member].as_str().is_some(), "{member}: {first}");
    }
}
