//! Experiments split over processes.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn compare(experiment: &[&str], arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_elbowroom"))
        .current_dir(root())
        .args(["compare", "--json"])
        .args(experiment)
        .args(arguments)
        .output()
        .expect("the command can be started");
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).expect("text")
}

fn temporary(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("elbowroom-{}-compare-{name}", std::process::id()))
}

/// Checks that merged parts equal the whole experiment. `whole` are options that a merge rejects.
fn parts_add_up(experiment: &str, whole: &[&str]) {
    let make = |arguments: &[&str]| compare(&[experiment], &[whole, arguments].concat());
    let all = make(&["--jobs", "2"]);
    let files: Vec<PathBuf> = ["0/2", "1/2"]
        .iter()
        .enumerate()
        .map(|(number, shard)| {
            let name = experiment.replace('/', "-");
            let file = temporary(&format!("{name}-part-{number}.json"));
            fs::write(&file, make(&["--jobs", "1", "--shard", shard])).expect("written");
            file
        })
        .collect();
    let names: Vec<_> = files
        .iter()
        .map(|file| file.display().to_string())
        .collect();
    let merged = compare(&[experiment], &["--merge", &names[0], &names[1]]);
    assert_eq!(merged, all);
    for file in files {
        fs::remove_file(file).expect("it is there");
    }
}

#[test]
fn parts_of_separate_processes_merge_to_the_whole() {
    parts_add_up("crates/cli/tests/files/late-drives.toml", &[]);
}

#[test]
fn perturbed_parts_of_separate_processes_merge_to_the_whole() {
    parts_add_up("experiments/olisipo_sf3.toml", &["--trials", "4"]);
}

#[test]
fn an_experiment_in_perturbed_worlds_leaves_tables_and_plots() {
    let folder = temporary("perturbed");
    let path = folder.display().to_string();
    let experiment = ["experiments/olisipo.toml"];
    compare(&experiment, &["--trials", "1", "--output", &path]);
    let mut names: Vec<String> = fs::read_dir(&folder)
        .expect("the folder")
        .map(|entry| entry.expect("a file").file_name().display().to_string())
        .collect();
    names.sort();
    let expected = [
        "as-published-actions-failure.svg",
        "as-published-actions-success.svg",
        "as-published-replans.svg",
        "as-published-success.svg",
        "failures",
        "results.json",
        "sound-actions-failure.svg",
        "sound-actions-success.svg",
        "sound-replans.svg",
        "sound-success.svg",
        "table.csv",
        "table.md",
    ];
    assert_eq!(names, expected);
    let table = fs::read_to_string(folder.join("table.md")).expect("the table");
    for case in ["SF3 p10", "AF3 p8"] {
        assert!(table.contains(case), "{table}");
    }
    fs::remove_dir_all(folder).expect("it is there");
}

/// Returns the lines of an experiment's trials.csv, and the names of the other files.
fn each_trial(experiment: &str, arguments: &[&str], name: &str) -> (Vec<String>, Vec<String>) {
    let folder = temporary(name);
    let path = folder.display().to_string();
    let output = ["--each-trial", "--output", &path];
    compare(&[experiment], &[&output, arguments].concat());
    let mut names: Vec<String> = fs::read_dir(&folder)
        .expect("the folder")
        .map(|entry| entry.expect("a file").file_name().display().to_string())
        .collect();
    names.sort();
    let table = fs::read_to_string(folder.join("trials.csv")).expect("the table");
    fs::remove_dir_all(folder).expect("it is there");
    (table.lines().map(str::to_owned).collect(), names)
}

#[test]
fn trials_have_distinct_rows_for_any_number_of_threads() {
    let experiment = "crates/cli/tests/files/late-drives.toml";
    let (one, names) = each_trial(experiment, &["--trials", "3", "--jobs", "1"], "each-1");
    let (two, _) = each_trial(experiment, &["--trials", "3", "--jobs", "2"], "each-2");
    assert_eq!(one, two);
    let expected = [
        "coverage.svg",
        "replans.svg",
        "results.json",
        "table.csv",
        "table.md",
        "trials.csv",
    ];
    assert_eq!(names, expected);
    assert_eq!(
        one[0],
        "seed,case,column,trial,executor,verdict,time,replans"
    );
    let text = fs::read_to_string(
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/files/late-drives.toml"),
    );
    let executors = text.expect("the experiment").matches("\"guarded\"").count();
    assert_eq!(executors, 1);
    let guarded = one.iter().filter(|line| line.contains(",guarded,"));
    assert_eq!(guarded.count() % 3, 0);
    for line in &one[1..] {
        let cells: Vec<&str> = line.split(',').collect();
        assert_eq!(cells.len(), 8, "{line}");
        assert!(
            cells[6].parse::<f64>().is_ok() && cells[7].parse::<u32>().is_ok(),
            "{line}"
        );
    }
}

#[test]
fn first_trial_of_each_failure_kind_can_be_replayed() {
    let folder = temporary("failures");
    let path = folder.display().to_string();
    let output = ["--each-trial", "--trials", "12", "--output", &path];
    // The optimum takes most of the time, and does not affect the trials.
    let text = fs::read_to_string(root().join("experiments/clumsy.toml")).expect("the experiment");
    let text = text.replace("optimum = true\n", "");
    let text = text.replace("\"../", &format!("\"{}/", root().display()));
    let text = text.replace(
        "\"clumsy/",
        &format!("\"{}/experiments/clumsy/", root().display()),
    );
    let experiment = temporary("clumsy.toml");
    fs::write(&experiment, text).expect("written");
    let results = compare(&[&experiment.display().to_string()], &output);
    fs::remove_file(experiment).expect("it is there");
    let results: serde_json::Value = serde_json::from_str(&results).expect("a document");
    let trials = fs::read_to_string(folder.join("trials.csv")).expect("the table");
    let (mut traces, mut actions) = (0, 0);
    for (row, cells) in results["cells"]
        .as_array()
        .expect("rows")
        .iter()
        .enumerate()
    {
        for (column, cell) in cells.as_array().expect("columns").iter().enumerate() {
            let failures = cell["failures"].as_array().cloned().unwrap_or_default();
            let failed: u64 = failures
                .iter()
                .filter_map(|kind| kind["runs"].as_u64())
                .sum();
            let count = |name: &str| cell[name].as_u64().expect("a count");
            assert_eq!(failed, count("runs") - count("successes"));
            actions += failures
                .iter()
                .filter(|kind| kind["action"].is_string())
                .count();
            let mut kinds = failures.clone();
            kinds.sort_by_key(|kind| std::cmp::Reverse(kind["runs"].as_u64()));
            for kind in 0..kinds.len().min(3) {
                let file = folder.join(format!("failures/{row}-{column}-{kind}.jsonl"));
                let text = fs::read_to_string(&file).expect("a trace");
                let last: serde_json::Value =
                    serde_json::from_str(text.lines().last().expect("lines")).expect("the end");
                let (executor, world) = (&results["rows"][row], &results["columns"][column]);
                // The same end, at the same time, as in the experiment.
                let is_it = |line: &&str| {
                    let cells: Vec<&str> = line.split(',').collect();
                    let time: f64 = cells[6].parse().unwrap_or(-1.0);
                    cells[2] == world.as_str().expect("a name")
                        && cells[4] == executor.as_str().expect("a name")
                        && cells[5] == last["verdict"].as_str().expect("a verdict")
                        && (time - last["time"]["decimal"].as_f64().expect("a time")).abs() < 1e-5
                };
                assert!(
                    trials.lines().any(|line| is_it(&line)),
                    "{}",
                    file.display()
                );
                let replay = Command::new(env!("CARGO_BIN_EXE_elbowroom"))
                    .args(["run", "--json", "--replay"])
                    .arg(&file)
                    .output()
                    .expect("the command can be started");
                let replay: serde_json::Value =
                    serde_json::from_slice(&replay.stdout).expect("a document");
                assert_eq!(replay["agrees"], true, "{}: {replay}", file.display());
                traces += 1;
            }
        }
    }
    assert!(traces > 3 && actions > 0, "{traces} {actions}");
    let page = Command::new(env!("CARGO_BIN_EXE_elbowroom"))
        .args(["report", &path])
        .output()
        .expect("the command can be started");
    let page = String::from_utf8(page.stdout).expect("text");
    // The page contains a subpage for each trace.
    assert_eq!(page.matches("\"title\":\"Run of ").count(), traces);
    fs::remove_dir_all(folder).expect("it is there");
}

#[test]
fn untimed_trials_have_distinct_rows() {
    let experiment = "experiments/olisipo_sf3.toml";
    let (lines, _) = each_trial(experiment, &["--trials", "2"], "each-3");
    // Ten cases, two worlds, four executors, two trials.
    assert_eq!(lines.len(), 1 + 160);
    assert!(
        lines[1].contains(",SF3 p1,as-published,0,esterel,"),
        "{}",
        lines[1]
    );
}

/// The experiment "detour" with `guarded` only, and a second column with `world` as its believed
/// world.
fn with_believed(world: &str) -> PathBuf {
    let text = fs::read_to_string(root().join("experiments/detour.toml")).expect("the experiment");
    let (head, column) = text.split_once("[[column]]").expect("a column");
    let head: Vec<&str> = head
        .lines()
        .filter(|line| !line.starts_with("optimum") && !line.starts_with("executors"))
        .collect();
    let column = format!("[[column]]{column}");
    let second = column.replace("\"52\"", "\"believed\"");
    let text = format!(
        "{}\nexecutors = [\"guarded\"]\n{column}\n{second}\nbelieved = \"{world}\"\n",
        head.join("\n")
    );
    let files = format!("\"{}/experiments/detour/", root().display());
    let experiment = temporary("believed.toml");
    fs::write(&experiment, text.replace("\"detour/", &files)).expect("written");
    experiment
}

#[test]
fn believed_world_gives_results_without_traces() {
    let folder = temporary("believed");
    let (output, path) = (
        folder.display().to_string(),
        with_believed("detour/world.toml"),
    );
    let arguments = ["--trials", "40", "--output", &output];
    let results = compare(&[&path.display().to_string()], &arguments);
    fs::remove_file(path).expect("it is there");
    let results: serde_json::Value = serde_json::from_str(&results).expect("a document");
    for cell in results["cells"][0].as_array().expect("columns") {
        assert_eq!(cell["runs"], 40);
        assert!(cell["successes"].as_u64().expect("a count") < 40, "{cell}");
    }
    let traces = fs::read_dir(folder.join("failures")).expect("the folder");
    let names: Vec<String> = traces
        .map(|entry| entry.expect("a file").file_name().display().to_string())
        .collect();
    assert!(!names.is_empty());
    assert!(
        names.iter().all(|name| name.starts_with("0-0-")),
        "{names:?}"
    );
    fs::remove_dir_all(folder).expect("it is there");

    let missing = with_believed("nowhere.toml");
    let output = Command::new(env!("CARGO_BIN_EXE_elbowroom"))
        .arg("compare")
        .arg(&missing)
        .output()
        .expect("the command can be started");
    fs::remove_file(missing).expect("it is there");
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(
        !output.status.success() && message.contains("nowhere.toml"),
        "{message}"
    );
}
