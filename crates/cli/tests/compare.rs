//! Experiments that are split over processes.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn compare(experiment: &[&str], arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_elbowroom"))
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."))
        .args(["compare", "--json"])
        .args(experiment)
        .args(arguments)
        .output()
        .expect("the command can be started");
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).expect("text")
}

fn temporary(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("elbowroom-{}-{name}", std::process::id()))
}

/// `whole` are the options that a merge does not take.
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
fn parts_made_by_other_processes_add_up_to_the_whole() {
    parts_add_up("crates/cli/tests/files/late-drives.toml", &[]);
}

#[test]
fn so_do_those_of_experiments_in_perturbed_worlds() {
    parts_add_up("experiments/olisipo_sf3.toml", &["--trials", "15"]);
}

#[test]
fn an_experiment_in_perturbed_worlds_leaves_tables_and_plots() {
    let folder = temporary("perturbed");
    let path = folder.display().to_string();
    let experiment = ["experiments/olisipo.toml"];
    compare(&experiment, &["--trials", "5", "--output", &path]);
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

/// The lines of trials.csv of an experiment, and the names of the files beside it.
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
fn each_trial_has_a_row_of_its_own_whatever_the_number_of_threads() {
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
fn so_has_each_trial_without_time() {
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
