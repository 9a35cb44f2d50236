//! The documents mention only files that exist.

use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Returns all Markdown files at the root and under `docs`, and the chapters of the tutorial in the
/// packages that compile them.
fn documents() -> Vec<PathBuf> {
    let folders = ["docs", "crates/elbowroom/docs", "crates/laboratory/docs"];
    let mut folders: Vec<PathBuf> = folders.map(|folder| root().join(folder)).into();
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

/// Returns the targets of `[text](target)` that are not URLs.
fn links(text: &str) -> Vec<&str> {
    text.split("](")
        .skip(1)
        .filter_map(|rest| rest.split_once(')'))
        .map(|(target, _)| target.split('#').next().unwrap_or(""))
        .filter(|target| !target.is_empty() && !target.contains("://"))
        .collect()
}

/// Returns words in backquotes that look like paths from the root.
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
fn links_and_paths_in_documents_exist() {
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

/// The map and the site list every document, so that a new one can be found.
#[test]
fn map_and_site_list_all_documents() {
    let docs = root().join("docs");
    let mut missing = Vec::new();
    for list in ["README.md", "SUMMARY.md"] {
        let text = fs::read_to_string(docs.join(list)).expect("the list");
        let listed: Vec<&str> = links(&text);
        for document in documents() {
            let Ok(path) = document.strip_prefix(&docs) else {
                continue;
            };
            let path = path.to_str().expect("a name in UTF-8");
            if !["README.md", "SUMMARY.md"].contains(&path) && !listed.contains(&path) {
                missing.push(format!("docs/{list} does not list {path}"));
            }
        }
    }
    assert!(missing.is_empty(), "{}", missing.join("\n"));
}

/// A package must contain all of its files. Links to files outside are lost when a repository is
/// copied in some ways, so the licences are identical copies.
#[test]
fn packages_contain_the_licence_texts() {
    let crates = fs::read_dir(root().join("crates")).expect("the folder of crates");
    for entry in crates {
        let folder = entry.expect("an entry").path();
        for name in ["LICENSE-MIT", "LICENSE-APACHE"] {
            let text = fs::read_to_string(root().join(name)).expect("a licence");
            let carried = fs::read_to_string(folder.join(name));
            let carried = carried.unwrap_or_else(|_| panic!("{} has no {name}", folder.display()));
            assert_eq!(carried, text, "{} has another {name}", folder.display());
        }
    }
}

#[test]
fn tutorial_chapters_are_not_empty() {
    let chapters = documents();
    let chapters = chapters.iter().filter(|path| {
        let folder = path.parent().and_then(Path::file_name);
        folder.is_some_and(|folder| folder == "tutorial")
    });
    let chapters: Vec<String> = chapters
        .map(|path| fs::read_to_string(path).expect("a chapter"))
        .collect();
    assert_eq!(chapters.len(), 5);
    for chapter in chapters {
        assert!(chapter.starts_with("# "), "{chapter}");
    }
}

/// Examples in documents are copied by readers, and a reflowed comment breaks a file.
#[test]
fn examples_in_toml_can_be_read() {
    let mut wrong = Vec::new();
    let mut count = 0;
    for document in documents() {
        let text = fs::read_to_string(&document).expect("a document");
        for block in text.split("\n```toml\n").skip(1) {
            let example = block.split("\n```").next().expect("a block");
            count += 1;
            if let Err(error) = example.parse::<toml::Table>() {
                wrong.push(format!("{}: {error}", document.display()));
            }
        }
    }
    assert!(count > 5, "{count} examples");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
