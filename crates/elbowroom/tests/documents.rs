//! The documents name only files that exist.

use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// All Markdown files at the root and under `docs`.
fn documents() -> Vec<PathBuf> {
    let mut folders = vec![root().join("docs")];
    let mut files: Vec<PathBuf> = markdown_in(&root());
    while let Some(folder) = folders.pop() {
        files.extend(markdown_in(&folder));
        let entries = fs::read_dir(&folder).expect("a folder of documents");
        folders.extend(
            entries
                .filter_map(|entry| Some(entry.ok()?.path()))
                .filter(|path| path.is_dir()),
        );
    }
    files.sort();
    files
}

fn markdown_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder");
    entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|ending| ending == "md"))
        .collect()
}

/// The targets of `[text](target)` that are not on the web.
fn links(text: &str) -> Vec<&str> {
    text.split("](")
        .skip(1)
        .filter_map(|rest| rest.split_once(')'))
        .map(|(target, _)| target.split('#').next().unwrap_or(""))
        .filter(|target| !target.is_empty() && !target.contains("://"))
        .collect()
}

/// Words in backquotes that look like paths from the root.
fn paths(text: &str) -> Vec<&str> {
    let quoted = text.split('`').skip(1).step_by(2);
    quoted
        .filter(|word| {
            let begins = ["crates/", "cases/", "docs/", ".ci/"];
            begins.iter().any(|begin| word.starts_with(begin))
                && !word.contains(char::is_whitespace)
                && !word.contains("NAME")
        })
        .collect()
}

#[test]
fn links_and_paths_in_documents_lead_somewhere() {
    let mut missing = Vec::new();
    for document in documents() {
        let text = fs::read_to_string(&document).expect("a document");
        let folder = document.parent().expect("a folder");
        let targets = links(&text).into_iter().map(|link| folder.join(link));
        let named = paths(&text).into_iter().map(|path| root().join(path));
        for target in targets.chain(named) {
            if !target.exists() {
                missing.push(format!("{} names {}", document.display(), target.display()));
            }
        }
    }
    assert!(missing.is_empty(), "{}", missing.join("\n"));
}
