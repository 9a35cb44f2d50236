//! Permitted dependencies between the crates of the workspace.
//!
//! A separate program, with the other tests that only read files: it is compiled in seconds, and
//! `cargo build --workspace --bin elbowroom --test layers` builds the command with the features of
//! dependencies that tests use.
//!
//! Cargo forbids cyclic dependencies, but does not check layers; this table does. The code map of
//! ARCHITECTURE.md has the same list. Change both together, and give the reason there.
//!
//! `[dependencies]`, `[build-dependencies]` and their `[target.….…]` forms count, also under
//! another name. `[dev-dependencies]` do not count: a test may depend on a higher layer, because
//! users of the crate do not get its tests.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use toml::{Table, Value};

mod documents;
mod executor_names;
mod modules;
mod terms;
mod wording;

/// Crates by folder, lowest first, with their permitted dependencies.
const LAYERS: &[(&str, &[&str])] = &[
    ("text", &[]),
    ("num", &[]),
    ("model", &["num"]),
    // The checker of certificates is independent of all search algorithms.
    ("verify", &["num", "model"]),
    ("stn", &["num"]),
    ("network", &["text", "num", "stn"]),
    ("pddl", &["text", "num", "model"]),
    ("plan", &["text", "num", "model", "stn"]),
    ("envelope", &["text", "num", "model", "stn", "pddl", "plan"]),
    ("probability", &["text", "num", "model", "stn", "plan"]),
    ("planner", &["num", "model", "verify"]),
    ("external", &["num", "model", "pddl"]),
    ("execution", &["num", "model", "stn", "plan", "probability"]),
    ("sim", &["text", "num", "model", "probability", "execution"]),
    ("report", &["num", "model", "plan", "execution"]),
    ("mdp", &["num", "model", "execution", "sim"]),
    ("learning", &["text", "num", "sim", "report"]),
    (
        "selection",
        &[
            "num",
            "model",
            "stn",
            "pddl",
            "plan",
            "envelope",
            "probability",
            "planner",
            "external",
            "execution",
            "sim",
            "report",
            "mdp",
        ],
    ),
    // Time zones, used only by the command.
    ("calendar", &["text", "num", "model", "pddl"]),
    (
        "elbowroom",
        &[
            "text",
            "num",
            "model",
            "stn",
            "network",
            "pddl",
            "plan",
            "envelope",
            "probability",
            "planner",
            "external",
            "execution",
            "sim",
            "report",
            "learning",
            "mdp",
            "selection",
            "verify",
        ],
    ),
    (
        "export",
        &[
            "num",
            "model",
            "stn",
            "network",
            "plan",
            "envelope",
            "probability",
            "sim",
            "mdp",
            "elbowroom",
        ],
    ),
    (
        "laboratory",
        &[
            "text",
            "num",
            "model",
            "pddl",
            "plan",
            "probability",
            "planner",
            "external",
            "execution",
            "sim",
            "report",
            "elbowroom",
        ],
    ),
    ("page", &["elbowroom", "laboratory"]),
    ("web", &["elbowroom", "page"]),
    ("executive", &["elbowroom", "page"]),
    (
        "cli",
        &[
            "calendar",
            "elbowroom",
            "export",
            "laboratory",
            "page",
            "executive",
        ],
    ),
    ("python", &["elbowroom", "laboratory", "executive", "cli"]),
    // A separate program that communicates with the command by the protocol of worlds.
    ("plansys2", &[]),
];

#[test]
fn crates_respect_their_layer() {
    for (name, allowed) in LAYERS {
        let violations = forbidden_imports(&manifest_of(name), allowed);
        assert!(
            violations.is_empty(),
            "`{name}` must not import {violations:?}; it may import {allowed:?}"
        );
    }
}

#[test]
fn layer_table_lists_all_workspace_members() {
    let root = read(&workspace().join("Cargo.toml"));
    let members: BTreeSet<_> = root["workspace"]["members"]
        .as_array()
        .expect("a list of members")
        .iter()
        .filter_map(|member| member.as_str()?.strip_prefix("crates/"))
        .collect();
    let table: BTreeSet<_> = LAYERS.iter().map(|(name, _)| *name).collect();
    assert_eq!(members, table);
}

#[test]
fn layers_depend_only_on_lower_layers() {
    for (position, (name, allowed)) in LAYERS.iter().enumerate() {
        for import in *allowed {
            assert!(
                LAYERS[..position].iter().any(|(lower, _)| lower == import),
                "`{import}` must stand above `{name}` in the table"
            );
        }
    }
}

/// Decisions during execution use results that were computed before. The executing crates have no
/// access to solvers for envelopes or plans.
#[test]
fn execution_crates_do_not_depend_on_solvers() {
    for name in ["probability", "execution", "sim", "report"] {
        let reached = reachable(name);
        for solver in ["envelope", "planner", "external"] {
            assert!(
                !reached.contains(solver),
                "`{name}` must not reach `{solver}`, but it does through {reached:?}"
            );
        }
    }
}

/// Experiments need threads and further dependencies. Programs that embed the library must not get
/// either.
#[test]
fn only_the_laboratory_has_a_pool_of_threads() {
    for (name, _) in LAYERS {
        let manifest = manifest_of(name);
        let dependencies = manifest.get("dependencies").and_then(Value::as_table);
        let has_threads = dependencies.is_some_and(|table| table.contains_key("rayon"));
        assert_eq!(has_threads, *name == "laboratory", "`{name}`");
    }
}

/// Crates that communicate with the world. They use threads only to wait for others.
const ADAPTER_CRATES: [&str; 5] = ["cli", "executive", "external", "plansys2", "python"];

/// Files of computing crates that may create threads: the parallel search of the planner, and the search behind an
/// iterator of improving plans, which runs between the calls of its user.
const FILES_WITH_THREADS: [&str; 2] = ["improving.rs", "parallel.rs"];

/// The third convention of ARCHITECTURE.md. Tests may create threads.
#[test]
fn threads_are_spawned_in_the_listed_files() {
    let mut found = Vec::new();
    for (name, _) in LAYERS {
        if ADAPTER_CRATES.contains(name) {
            continue;
        }
        let mut left = vec![workspace().join("crates").join(name).join("src")];
        while let Some(folder) = left.pop() {
            for entry in fs::read_dir(&folder).expect("a folder") {
                let path = entry.expect("an entry").path();
                if path.is_dir() {
                    left.push(path);
                    continue;
                }
                let text = fs::read_to_string(&path).unwrap_or_default();
                let code = text.split("#[cfg(test)]\nmod tests").next();
                if code.is_some_and(creates_threads) {
                    found.push(path.file_name().expect("a name").to_owned());
                }
            }
        }
    }
    found.sort();
    assert_eq!(found, FILES_WITH_THREADS);
}

/// Returns true if the code creates threads, also by imported names.
fn creates_threads(code: &str) -> bool {
    let names = ["thread::spawn", "thread::scope", "thread::Builder"];
    names.iter().any(|name| code.contains(name))
        || code.contains("use std::thread::")
            && [" spawn(", " scope(", "Builder::new("]
                .iter()
                .any(|call| code.contains(call))
}

/// Cargo lists the dependencies of the library alone.
#[test]
fn library_builds_neither_thread_pool_nor_command_line() {
    let output = Command::new(env!("CARGO"))
        .args(["tree", "--offline", "--locked", "--package", "elbowroom"])
        .args(["--edges", "normal", "--prefix", "none", "--format", "{p}"])
        .current_dir(workspace())
        .output()
        .expect("cargo starts");
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{errors}");
    let tree = String::from_utf8(output.stdout).expect("UTF-8");
    let has = |package: &str| {
        let mut names = tree.lines().filter_map(|line| line.split(' ').next());
        names.any(|name| name == package)
    };
    assert!(has("elbowroom-execution"), "{tree}");
    for unwanted in ["rayon", "clap"] {
        assert!(!has(unwanted), "{unwanted} is in\n{tree}");
    }
}

/// Returns the transitive dependencies of a crate, by the table.
fn reachable(name: &'static str) -> BTreeSet<&'static str> {
    let mut reached = BTreeSet::new();
    let mut open = vec![name];
    while let Some(next) = open.pop() {
        let (_, imports) = LAYERS
            .iter()
            .find(|(crate_name, _)| *crate_name == next)
            .expect("a crate of the table");
        open.extend(imports.iter().filter(|import| reached.insert(**import)));
    }
    reached
}

#[test]
fn forbidden_import_is_detected_in_every_form() {
    let forbidden = |manifest: &str| {
        let manifest: Table = manifest.parse().expect("a manifest");
        forbidden_imports(&manifest, &["num"])
    };
    let clean = "
        [dependencies]
        elbowroom-num.workspace = true
        serde = '1'
        [dev-dependencies]
        elbowroom-envelope.workspace = true
    ";
    assert_eq!(forbidden(clean), [""; 0]);
    assert_eq!(
        forbidden("[dependencies]\nelbowroom-stn.workspace = true"),
        ["stn"]
    );
    assert_eq!(
        forbidden("[build-dependencies]\nelbowroom-plan = { path = '../plan' }"),
        ["plan"]
    );
    assert_eq!(
        forbidden("[target.'cfg(unix)'.dependencies]\nelbowroom-pddl.workspace = true"),
        ["pddl"]
    );
    assert_eq!(
        forbidden("[dependencies]\nnetworks = { package = 'elbowroom-stn', path = '../stn' }"),
        ["stn"]
    );
    assert_eq!(
        forbidden("[dependencies]\nelbowroom.workspace = true"),
        ["elbowroom"]
    );
}

/// Returns the crates of this workspace that a manifest imports although `allowed` does not list
/// them.
fn forbidden_imports(manifest: &Table, allowed: &[&str]) -> Vec<String> {
    imports_of(manifest)
        .into_iter()
        .filter(|import| !allowed.contains(&import.as_str()))
        .collect()
}

/// Returns the folders of the workspace's crates that a manifest imports.
fn imports_of(manifest: &Table) -> BTreeSet<String> {
    let mut sections = vec![manifest];
    if let Some(targets) = manifest.get("target").and_then(Value::as_table) {
        sections.extend(targets.values().filter_map(Value::as_table));
    }
    sections
        .iter()
        .flat_map(|section| {
            ["dependencies", "build-dependencies"].map(|kind| section.get(kind)?.as_table())
        })
        .flatten()
        .flatten()
        .filter_map(|(key, dependency)| {
            let renamed = dependency.get("package").and_then(Value::as_str);
            folder(renamed.unwrap_or(key))
        })
        .collect()
}

/// Returns the folder of a package of this workspace, or `None` for other packages.
fn folder(package: &str) -> Option<String> {
    match package {
        "elbowroom" => Some(package.to_owned()),
        _ => package.strip_prefix("elbowroom-").map(str::to_owned),
    }
}

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn manifest_of(name: &str) -> Table {
    let manifest = read(&workspace().join("crates").join(name).join("Cargo.toml"));
    let package = manifest["package"]["name"]
        .as_str()
        .expect("a package name");
    assert_eq!(folder(package).as_deref(), Some(name));
    manifest
}

fn read(path: &Path) -> Table {
    let text = fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    text.parse()
        .unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}
