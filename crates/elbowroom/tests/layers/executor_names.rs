//! The name of an executor stands only in its own file.

use std::fs;

use elbowroom::execution::executors::EXECUTORS;

use crate::workspace;

/// Strings that are equal to an executor's name and mean something else, by file.
const OTHER_MEANINGS: &[(&str, &str)] = &[
    // The ending of files with networks, a command, and a kind of plan.
    ("stn", "crates/cli/src/args.rs"),
    ("stn", "crates/cli/src/input.rs"),
    ("stn", "crates/cli/src/commands/network.rs"),
    ("stn", "crates/network/src/read/graphml.rs"),
    ("stn", "crates/python/python/elbowroom/_up_engines.py"),
];

#[test]
fn executor_names_stand_only_in_their_own_files() {
    let mut found = Vec::new();
    for (path, text) in sources() {
        for executor in EXECUTORS {
            let name = executor.name;
            let is_other = OTHER_MEANINGS.contains(&(name, path.as_str()));
            if !is_other && !is_own_file(&path, name) && mentions(&text, name) {
                found.push(format!("{path}: {name}"));
            }
        }
    }
    let found = found.join("\n");
    assert!(
        found.is_empty(),
        "use the registry (`Needs`, `Roles`, `DEFAULT_EXECUTOR`) instead of names of executors:\n{found}"
    );
}

#[test]
fn names_in_code_are_found_and_names_in_comments_and_tests_are_not() {
    assert!(mentions("let it = \"live\".parse();", "live"));
    assert!(mentions("executor: str = \"live:5\"", "live"));
    assert!(mentions("format!(\"use `live` here\")", "live"));
    assert!(mentions("x = \"a \\\n  `live` b\";", "live"));
    assert!(!mentions("let it = \"lively\";", "live"));
    assert!(!mentions("/// Parses `live`, \"live\".\nfn f() {}", "live"));
    assert!(!mentions(
        "fn f() {}\n#[cfg(test)]\nmod tests { \"live\" }",
        "live"
    ));
}

/// Returns `true` for the files of executors, which may describe themselves by other executors, for their variants for
/// worlds without time, and for unit tests.
fn is_own_file(path: &str, name: &str) -> bool {
    let without_time = format!("crates/laboratory/src/untimed/{name}.rs");
    path.starts_with("crates/execution/src/executors/")
        || path == without_time
        || path.ends_with("/tests.rs")
}

/// Returns `true` if the code, without comments and tests, has a string that is the name, with or without an argument,
/// or that has the name in backticks.
fn mentions(text: &str, name: &str) -> bool {
    let code = text.split("\n#[cfg(test)]").next().unwrap_or_default();
    code.lines()
        .filter(|line| {
            !["//", "#!", "\"\"\"", ">>>"]
                .iter()
                .any(|it| line.trim_start().starts_with(it))
        })
        .any(|line| {
            [
                format!("\"{name}\""),
                format!("\"{name}:"),
                format!("`{name}`"),
                format!("`{name}:"),
            ]
            .iter()
            .any(|it| line.contains(it.as_str()))
        })
}

/// Returns the sources of all crates and of the Python package, with their paths.
fn sources() -> Vec<(String, String)> {
    let mut left = vec![workspace().join("crates/python/python")];
    for entry in fs::read_dir(workspace().join("crates")).expect("a folder") {
        left.push(entry.expect("an entry").path().join("src"));
    }
    let mut sources = Vec::new();
    while let Some(folder) = left.pop() {
        for entry in fs::read_dir(&folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                left.push(path);
            } else if path.extension().is_some_and(|it| it == "rs" || it == "py") {
                let text = fs::read_to_string(&path).expect("a source file");
                let path = path.strip_prefix(workspace()).expect("below the root");
                sources.push((path.display().to_string(), text));
            }
        }
    }
    assert!(sources.len() > 500, "{}", sources.len());
    sources
}
