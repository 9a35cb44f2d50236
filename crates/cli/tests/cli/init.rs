//! Projects that `init` writes: every command of their README.md works.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::command::root;
use crate::robots::python_is_there;

/// Returns a path that does not exist yet.
fn place(name: &str) -> PathBuf {
    let place = std::env::temp_dir().join(format!("elbowroom-{}-init-{name}", std::process::id()));
    let _ = fs::remove_dir_all(&place);
    place
}

/// Runs `init` for this folder.
fn init(folder: &Path, options: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_elbowroom"))
        .arg("init")
        .arg(folder)
        .args(options)
        .output()
        .expect("the command can be started")
}

/// Returns the lines of the shell blocks of a document.
fn commands(document: &str) -> Vec<String> {
    let mut lines = Vec::new();
    for block in document.split("```sh\n").skip(1) {
        let (block, _) = block.split_once("```").expect("the block ends");
        lines.extend(block.lines().map(str::to_owned));
    }
    lines
}

/// Executes all commands of README.md in the project, as a shell does, and returns their number.
fn follow_readme(template: &str) -> usize {
    let folder = place(template);
    let output = init(&folder, &["--template", template]);
    assert!(output.status.success(), "{output:?}");
    let readme = fs::read_to_string(folder.join("README.md")).expect("README.md");
    assert!(readme.starts_with("# elbowroom-"), "{readme}");
    let program = Path::new(env!("CARGO_BIN_EXE_elbowroom"));
    let mut paths = vec![program.parent().expect("a folder").to_owned()];
    let inherited = std::env::var_os("PATH").unwrap_or_default();
    paths.extend(std::env::split_paths(&inherited));
    let path = std::env::join_paths(paths).expect("a search path");
    let mut executed = 0;
    let has_python = python_is_there();
    for line in commands(&readme) {
        if !has_python && (line.contains("python3") || line.contains("robot.jsonl")) {
            continue;
        }
        // The debug build needs seconds for each trial.
        let line = line.replace(
            "compare experiment.toml",
            "compare experiment.toml --trials 2",
        );
        let output = Command::new("sh")
            .args(["-c", &line])
            .current_dir(&folder)
            .env("PATH", &path)
            .env("NO_COLOR", "1")
            .output()
            .expect("there is a shell");
        assert!(output.status.success(), "{template}: {line}\n{output:?}");
        executed += 1;
    }
    for page in ["envelope.html", "run.html", "results.html"] {
        let page = fs::read_to_string(folder.join(page)).expect("the page");
        assert!(page.starts_with("<!doctype html>"), "{template}");
    }
    fs::remove_dir_all(folder).expect("the project can be removed");
    executed
}

#[test]
fn commands_of_delivery_readme_succeed() {
    assert!(follow_readme("delivery") >= 10);
}

#[test]
fn commands_of_ward_readme_succeed() {
    assert!(follow_readme("ward") >= 10);
}

#[test]
fn commands_of_calendar_readme_succeed() {
    assert!(follow_readme("calendar") >= 11);
}

#[test]
fn library_of_projects_is_that_of_the_clients() {
    let folder = place("library");
    assert!(init(&folder, &[]).status.success());
    let written = fs::read(folder.join("elbowroom_world.py")).expect("the library");
    let original = fs::read(root().join("clients/python/elbowroom_world.py")).expect("the library");
    assert!(
        written == original,
        "copy clients/python/elbowroom_world.py to crates/cli/templates"
    );
    let notebook = fs::read(folder.join("notebook.ipynb")).expect("the notebook");
    let notebook: serde_json::Value = serde_json::from_slice(&notebook).expect("JSON");
    let title = notebook["cells"][0]["source"][0].as_str();
    assert!(title.is_some_and(|title| title.starts_with("# elbowroom-")));
    fs::remove_dir_all(folder).expect("the project can be removed");
}

#[test]
fn project_named_with_quotes_has_a_valid_notebook() {
    let folder = place("a \\ \"b\"");
    assert!(init(&folder, &[]).status.success());
    let notebook = fs::read(folder.join("notebook.ipynb")).expect("the notebook");
    let notebook: serde_json::Value = serde_json::from_slice(&notebook).expect("JSON");
    let title = notebook["cells"][0]["source"][0].as_str();
    assert!(title.is_some_and(|title| title.ends_with("a \\ \"b\"\n")));
    fs::remove_dir_all(folder).expect("the project can be removed");
}

#[test]
fn folders_with_content_and_files_are_refused_unchanged() {
    let folder = place("occupied");
    fs::create_dir_all(&folder).expect("a folder");
    fs::write(folder.join("notes.txt"), "mine").expect("a file");
    let output = init(&folder, &[]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    let message = String::from_utf8(output.stderr).expect("text");
    assert!(message.contains("is not empty"), "{message}");
    assert_eq!(fs::read_dir(&folder).expect("the folder").count(), 1);
    let output = init(&folder.join("notes.txt"), &[]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    let message = String::from_utf8(output.stderr).expect("text");
    assert!(message.contains("is a file"), "{message}");
    fs::remove_file(folder.join("notes.txt")).expect("the file");
    assert!(init(&folder, &[]).status.success());
    fs::remove_dir_all(folder).expect("the project can be removed");
}
