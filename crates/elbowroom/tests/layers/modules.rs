//! Cyclic dependencies between modules of a crate, and of a binary in a separate folder.
//!
//! Rust permits cycles inside a crate. The modules of a cycle cannot be understood, tested or moved
//! separately, so each cycle among a crate's top-level modules must be listed here with its reason.
//! The insides of some modules have no cycle at all; there, the module's own file counts as one of
//! its modules.
//!
//! The dependencies are read from the sources: paths that begin with `crate::`, or with as many
//! `super::` as lead to the root of the crate, outside tests, comments and strings. A re-export of
//! the root counts as its module's.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Crate, modules, and the reason for the cycle.
const ALLOWED_CYCLES: &[(&str, &[&str], &str)] = &[
    (
        "elbowroom",
        &["answers", "execute", "pipeline"],
        "`pipeline::robust_plan` is a line over the answer, which is built by the steps of the pipeline, \
         as what is executed is; a run is an answer too",
    ),
    (
        "execution",
        &["record", "run"],
        "the last entry of a record is the run's report",
    ),
    (
        "model",
        &[
            "autonomous",
            "constraint",
            "expression",
            "ground",
            "problem",
        ],
        "lifted and ground expressions are one type with different leaves, and so are constraints; \
         processes and events stand beside their ground forms",
    ),
];

/// Crate, and module without cycles inside; the crate itself if the module is empty.
const WITHOUT_CYCLES: &[(&str, &str)] = &[("execution", "run"), ("mdp", ""), ("mdp", "process")];

#[test]
fn modules_have_no_unlisted_cycles() {
    for folder in folders(&workspace().join("crates")) {
        let name = folder.file_name().expect("a folder's name");
        let name = name.to_str().expect("plain names");
        let mut library = sources(&folder.join("src"));
        library.retain(|path, _| !path.starts_with("bin/"));
        assert_only_allowed_cycles(name, &library);
        for binary in folders_in(&folder.join("src/bin")) {
            assert_only_allowed_cycles(name, &sources(&binary));
        }
    }
}

fn assert_only_allowed_cycles(name: &str, sources: &BTreeMap<String, String>) {
    for circle in cycles(&uses(sources, "crate::")) {
        let is_known = ALLOWED_CYCLES.iter().any(|(known, modules, _)| {
            *known == name
                && circle
                    .iter()
                    .all(|module| modules.contains(&module.as_str()))
        });
        assert!(
            is_known,
            "in `{name}`, {circle:?} use each other in a circle: move what ties them, or list \
             them above with the reason"
        );
    }
}

#[test]
fn insides_of_listed_modules_have_no_cycles() {
    for (name, module) in WITHOUT_CYCLES {
        let (sources, prefix) = inside(name, module);
        let found = cycles(&uses_with_root(&sources, &prefix));
        assert_eq!(found, [], "in `{name}::{module}`");
    }
}

#[test]
fn added_cycle_inside_module_is_detected() {
    let (sources, prefix) = inside("execution", "run");
    let with = |path: &str, line: &str| {
        let mut sources = sources.clone();
        sources.get_mut(path).expect("a file").push_str(line);
        cycles(&uses_with_root(&sources, &prefix))
    };
    assert_eq!(with("decisions.rs", "use super::agenda::Agenda;"), []);
    for (path, line) in [
        ("agenda.rs", "use super::Run;"),
        ("agenda.rs", "fn f(run: &crate::run::Run<'_>) {}"),
        ("action_log.rs", "use crate::run::{goals, view::RunView};"),
        ("background/search.rs", "use super::super::decisions;"),
        ("lib.rs", "fn f() { decisions::f(); }"),
    ] {
        let found = with(path, line);
        assert_eq!(found.len(), 1, "{path}: {line}");
    }
}

/// Returns the files inside a module, with the module's own file as `lib.rs`, and the prefix of
/// their paths.
fn inside(name: &str, module: &str) -> (BTreeMap<String, String>, String) {
    let folder = workspace().join("crates").join(name).join("src");
    if module.is_empty() {
        return (sources(&folder), "crate::".to_owned());
    }
    let mut files = sources(&folder.join(module));
    let root = fs::read_to_string(folder.join(format!("{module}.rs")));
    files.insert("lib.rs".to_owned(), root.expect("readable"));
    (files, format!("crate::{module}::"))
}

#[test]
fn cycle_is_detected_in_every_path_form() {
    let found = |sources: &[(&str, &str)]| {
        let own = |&(path, text): &(&str, &str)| (path.to_owned(), text.to_owned());
        cycles(&uses(&sources.iter().map(own).collect(), "crate::"))
    };
    let root = (
        "lib.rs",
        "mod a; mod b; pub use b::{Other, Thing as Renamed};",
    );
    let circle = vec![BTreeSet::from(["a".to_owned(), "b".to_owned()])];
    let to_b = ("a.rs", "use crate::{c::X, b::{Y, Z}};");
    for to_a in [
        "use crate::a::X;",
        "fn f() -> crate::a::X {}",
        "use super::a;",
        "use crate::{\n    // why\n    a::{X, Y},\n};",
    ] {
        assert_eq!(found(&[root, to_b, ("b.rs", to_a)]), circle, "{to_a}");
    }
    let through_the_root = ("a/inner.rs", "use super::super::Other;");
    assert_eq!(
        found(&[root, through_the_root, ("b.rs", "use crate::a;")]),
        circle
    );
    for to_none in [
        "use crate::c::X; use super::b;",
        "// use crate::a::X;",
        "/* use crate::a::X; */",
        "const TEXT: &str = \"use crate::a::X; \\\" use crate::a;\";",
        "#[cfg(test)]\nmod tests { use crate::a::X; fn f() { {} } }",
        "use super::super::a;",
        "use other_crate::a;",
    ] {
        assert_eq!(found(&[root, to_b, ("b.rs", to_none)]), [], "{to_none}");
    }
    assert_eq!(found(&[root, to_b, ("b/tests.rs", "use crate::a::X;")]), []);
}

/// Returns the files below a folder with their texts, by relative path.
fn sources(folder: &Path) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        for entry in fs::read_dir(&next).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let name = path.strip_prefix(folder).expect("below it");
                let name = name.to_str().expect("plain names").replace('\\', "/");
                found.insert(name, fs::read_to_string(&path).expect("readable"));
            }
        }
    }
    found
}

/// Returns the same as [`uses`], with the root as a module: it uses the modules that it mentions
/// other than in declarations and re-exports, and provides its own definitions.
fn uses_with_root(
    sources: &BTreeMap<String, String>,
    prefix: &str,
) -> BTreeMap<String, BTreeSet<String>> {
    let text = code(&sources["lib.rs"]);
    let is_exported = |item: &&str| item.trim_start().starts_with("pub use");
    let own: String = text.split(';').filter(|it| !is_exported(it)).collect();
    let words = || own.split(|c: char| !c.is_alphanumeric() && c != '_');
    let kinds = ["struct", "enum", "trait", "type", "fn", "const", "static"];
    let pairs = words().zip(words().skip(1));
    let items = pairs.filter(|(kind, _)| kinds.contains(kind));
    let defined: BTreeSet<&str> = items.map(|(_, name)| name).collect();
    let mut uses = uses(sources, prefix);
    let modules: BTreeSet<String> = uses.keys().cloned().collect();
    let is_mentioned = |module: &&String| {
        let path = format!("{module}::");
        let mut mentions = own.match_indices(&path);
        mentions
            .any(|(at, _)| !own[..at].ends_with(|c: char| c.is_alphanumeric() || ":_".contains(c)))
    };
    let mentioned = modules.iter().filter(is_mentioned).cloned().collect();
    for (path, text) in files(sources) {
        let heads = heads_of(path, &code(text), prefix);
        if heads
            .iter()
            .any(|name| defined.contains(name.as_str()) && !modules.contains(name))
        {
            uses.entry(top(path)).or_default().insert("lib".to_owned());
        }
    }
    uses.insert("lib".to_owned(), mentioned);
    uses
}

fn is_root(path: &str) -> bool {
    matches!(path, "lib.rs" | "main.rs")
}

fn top(path: &str) -> String {
    let first = path.split('/').next().unwrap_or(path);
    first.trim_end_matches(".rs").to_owned()
}

/// Returns the files other than the root and tests.
fn files(sources: &BTreeMap<String, String>) -> impl Iterator<Item = (&String, &String)> {
    let is_test = |path: &str| path.ends_with("tests.rs") || path.contains("tests/");
    sources
        .iter()
        .filter(move |(path, _)| !is_root(path) && !is_test(path))
}

/// Returns the first names of all paths in a file that lead through the root.
fn heads_of(path: &str, text: &str, prefix: &str) -> Vec<String> {
    let to = [prefix.to_owned(), "super::".repeat(path.split('/').count())];
    to.iter().flat_map(|prefix| heads(text, prefix)).collect()
}

/// Returns the top-level modules that each of them uses.
fn uses(sources: &BTreeMap<String, String>, prefix: &str) -> BTreeMap<String, BTreeSet<String>> {
    let modules: BTreeSet<String> = sources.keys().map(|path| top(path)).collect();
    let mut home: BTreeMap<String, String> = BTreeMap::new();
    for (_, text) in sources.iter().filter(|(path, _)| is_root(path)) {
        let text = code(text);
        for module in modules
            .iter()
            .filter(|module| !matches!(module.as_str(), "lib" | "main"))
        {
            home.insert(module.clone(), module.clone());
            for (at, _) in text.match_indices(&format!("use {module}::")) {
                let names = text[at..].split(';').next().unwrap_or_default();
                let words = names.split(|c: char| !c.is_alphanumeric() && c != '_');
                let words = words.filter(|word| !modules.contains(*word));
                home.extend(words.map(|word| (word.to_owned(), module.clone())));
            }
        }
    }
    let mut uses: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (path, text) in files(sources) {
        let from = top(path);
        let names = heads_of(path, &code(text), prefix);
        let others = names
            .iter()
            .filter_map(|name| home.get(name))
            .filter(|to| **to != from);
        let others: BTreeSet<String> = others.cloned().collect();
        uses.entry(from).or_default().extend(others);
    }
    uses
}

/// Returns the first names of all paths that begin with the prefix, and not inside a longer path.
fn heads(text: &str, prefix: &str) -> Vec<String> {
    let mut found = Vec::new();
    for (at, _) in text.match_indices(prefix) {
        let before = text[..at].trim_end();
        let is_whole = !text[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_');
        if !is_whole || before.ends_with("::") {
            continue;
        }
        let rest = &text[at + prefix.len()..];
        // In braces, the names after the first brace or a comma of that level.
        let mut level = 0;
        let mut is_head = true;
        let mut name = String::new();
        for c in rest.chars() {
            if c.is_alphanumeric() || c == '_' {
                name.push(c);
                continue;
            }
            if is_head && !name.is_empty() {
                found.push(std::mem::take(&mut name));
                is_head = false;
            }
            name.clear();
            match c {
                '{' => level += 1,
                '}' => level -= 1,
                ',' if level == 1 => is_head = true,
                _ => {}
            }
            if level == 0 && !is_head {
                break;
            }
        }
        if is_head && !name.is_empty() {
            found.push(name);
        }
    }
    found.retain(|name| name != "super");
    found
}

/// Returns the text without comments, contents of strings, and test modules.
fn code(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(next) = rest.chars().next() {
        let end = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            rest.find("*/").map_or(rest.len(), |end| end + 2)
        } else if next == '"' {
            plain.push_str("\"\"");
            end_of_text(rest)
        } else if rest.starts_with("'\"'") {
            3
        } else {
            plain.push(next);
            next.len_utf8()
        };
        rest = &rest[end..];
    }
    while let Some(at) = plain.find("#[cfg(test)]") {
        let module = plain[at..]
            .find('{')
            .filter(|open| !plain[at..at + open].contains(';'));
        let mut level = 0;
        let end = module.and_then(|open| {
            plain[at + open..].char_indices().find_map(|(index, c)| {
                level += i32::from(c == '{') - i32::from(c == '}');
                (level == 0).then_some(at + open + index + 1)
            })
        });
        let end = end.unwrap_or(at + "#[cfg(test)]".len());
        plain.replace_range(at..end, "");
    }
    plain
}

/// Returns the end of the string literal at the beginning of `rest`.
fn end_of_text(rest: &str) -> usize {
    let mut is_escaped = false;
    for (index, c) in rest.char_indices().skip(1) {
        if c == '"' && !is_escaped {
            return index + 1;
        }
        is_escaped = c == '\\' && !is_escaped;
    }
    rest.len()
}

/// Returns the strongly connected components with more than one module.
fn cycles(uses: &BTreeMap<String, BTreeSet<String>>) -> Vec<BTreeSet<String>> {
    let reached = |from: &String| {
        let mut reached: BTreeSet<String> = BTreeSet::new();
        let mut open = vec![from];
        while let Some(next) = open.pop() {
            for to in uses.get(next).into_iter().flatten() {
                if reached.insert(to.clone()) {
                    open.push(to);
                }
            }
        }
        reached
    };
    let reached: BTreeMap<&String, BTreeSet<String>> = uses
        .keys()
        .map(|module| (module, reached(module)))
        .collect();
    let mut circles: Vec<BTreeSet<String>> = Vec::new();
    for (module, all) in &reached {
        if !all.contains(*module) || circles.iter().any(|circle| circle.contains(*module)) {
            continue;
        }
        let comes_back =
            |other: &&String| reached.get(other).is_some_and(|it| it.contains(*module));
        circles.push(all.iter().filter(comes_back).cloned().collect());
    }
    circles
}

/// Returns the folders of the crates.
fn folders(folder: &Path) -> Vec<PathBuf> {
    let mut folders = folders_in(folder);
    folders.retain(|path| path.join("src").is_dir());
    folders
}

/// Returns the folders in a folder, which need not exist.
fn folders_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut folders: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    folders.retain(|path| path.is_dir());
    folders.sort();
    folders
}

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}
