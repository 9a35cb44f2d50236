//! Experiments that are split over processes.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const EXPERIMENT: &str = "crates/cli/tests/files/late-drives.toml";

fn compare(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_elbowroom"))
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."))
        .args(["compare", EXPERIMENT, "--json"])
        .args(arguments)
        .output()
        .expect("the command can be started");
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).expect("text")
}

fn temporary(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("elbowroom-{}-{name}", std::process::id()))
}

#[test]
fn parts_made_by_other_processes_add_up_to_the_whole() {
    let whole = compare(&["--jobs", "2"]);
    let files: Vec<PathBuf> = ["0/2", "1/2"]
        .iter()
        .enumerate()
        .map(|(number, shard)| {
            let file = temporary(&format!("part-{number}.json"));
            fs::write(&file, compare(&["--jobs", "1", "--shard", shard])).expect("written");
            file
        })
        .collect();
    let names: Vec<_> = files
        .iter()
        .map(|file| file.display().to_string())
        .collect();
    let merged = compare(&["--merge", &names[0], &names[1]]);
    assert_eq!(merged, whole);
    for file in files {
        fs::remove_file(file).expect("it is there");
    }
}
