//! The modules of the embedded planner depend on each other in one direction.
//!
//! The imports of a file are read from its paths (`super::…`, `crate::embedded::…`). A module
//! includes all its submodules. Tests do not count.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

#[test]
fn modules_of_embedded_planner_are_acyclic() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/embedded");
    let mut imports: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for file in files_below(&root) {
        let text = fs::read_to_string(&file).expect("a source file");
        let inside = file.strip_prefix(&root).expect("a file below it");
        let place: Vec<String> = inside
            .with_extension("")
            .iter()
            .map(|part| part.to_string_lossy().into_owned())
            .collect();
        if place.last().is_some_and(|name| name == "tests") {
            continue;
        }
        let imported = imports.entry(place[0].clone()).or_default();
        imported.extend(imports_of(&place, &text));
    }
    assert!(imports.len() > 10, "the modules were not found");
    let names: BTreeSet<String> = imports.keys().cloned().collect();
    for (name, imported) in &mut imports {
        imported.retain(|import| import != name && names.contains(import));
    }
    assert_eq!(cyclic_modules(imports), BTreeSet::new());
}

#[test]
fn cycle_is_found_for_every_form_of_import() {
    let imports = |place: &[&str], text: &str| {
        let place: Vec<String> = place.iter().map(|&part| part.to_owned()).collect();
        imports_of(&place, text)
    };
    let names = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
    let expected: BTreeSet<String> = names(&["state", "time"]);
    assert_eq!(
        imports(&["a"], "use super::{state::State, time};"),
        expected
    );
    let nested = "use super::super::state::State;\nlet x = crate::embedded::time::NEVER;";
    assert_eq!(imports(&["a", "b"], nested), expected);
    let comment = "// super::state\n/// [`State`](super::state::State)\nuse super::b;";
    let own: BTreeSet<String> = names(&["a"]);
    assert_eq!(imports(&["a", "c"], comment), own);
    let edges = [("a", "b"), ("b", "c"), ("c", "b"), ("d", "a")];
    let mut graph: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (from, to) in edges {
        graph
            .entry(from.to_owned())
            .or_default()
            .insert(to.to_owned());
    }
    assert_eq!(cyclic_modules(graph), names(&["b", "c"]));
}

fn files_below(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder of sources").flatten() {
        let path = entry.path();
        if path.is_dir() {
            files.extend(files_below(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    files
}

/// Returns the top modules that a file imports; `place` is its path below the root.
fn imports_of(place: &[String], text: &str) -> BTreeSet<String> {
    let code: String = text
        .lines()
        .take_while(|line| line.trim() != "mod tests {")
        .map(|line| line.split("//").next().unwrap_or_default())
        .collect::<Vec<_>>()
        .join(" ");
    let mut imports = BTreeSet::new();
    for (marker, is_absolute) in [("super::", false), ("crate::embedded::", true)] {
        let mut rest = code.as_str();
        while let Some(found) = rest.find(marker) {
            let mut tail = &rest[found + marker.len()..];
            let mut ups = 1;
            while let Some(further) = tail.strip_prefix("super::") {
                tail = further;
                ups += 1;
            }
            rest = tail;
            let above = if is_absolute || ups >= place.len() {
                None
            } else {
                place.first().cloned()
            };
            match above {
                // It stays within the top module.
                Some(own) => _ = imports.insert(own),
                None => imports.extend(first_names(tail)),
            }
        }
    }
    imports
}

/// Returns the first names of a path: one, or those between braces.
fn first_names(tail: &str) -> Vec<String> {
    let name = |text: &str| {
        let end = text.find(|c: char| !c.is_alphanumeric() && c != '_');
        text[..end.unwrap_or(text.len())].to_owned()
    };
    let Some(list) = tail.strip_prefix('{') else {
        return vec![name(tail)];
    };
    let (mut depth, mut names, mut begins) = (0, Vec::new(), true);
    for (position, letter) in list.char_indices() {
        match letter {
            '{' => depth += 1,
            '}' if depth == 0 => break,
            '}' => depth -= 1,
            ',' if depth == 0 => begins = true,
            letter if begins && !letter.is_whitespace() => {
                names.push(name(&list[position..]));
                begins = false;
            }
            _ => {}
        }
    }
    names
}

/// Removes the modules that import no remaining module, or that no remaining module imports, until
/// nothing changes. Returns the remaining modules: none if there is no cycle.
fn cyclic_modules(mut imports: BTreeMap<String, BTreeSet<String>>) -> BTreeSet<String> {
    loop {
        let left: BTreeSet<String> = imports.keys().cloned().collect();
        for imported in imports.values_mut() {
            imported.retain(|import| left.contains(import));
        }
        let imported: BTreeSet<String> = imports.values().flatten().cloned().collect();
        imports.retain(|name, imports| !imports.is_empty() && imported.contains(name));
        if imports.len() == left.len() {
            return left;
        }
    }
}
