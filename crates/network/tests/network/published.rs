//! Networks as published by their authors, if they are available.

#![allow(clippy::print_stdout, reason = "a test that is skipped should say so")]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::skipped::skipped;
use elbowroom_network::{Format, NetworkFile, read};

/// Returns the folder with the networks; prints a note and returns `None` if it does not exist.
fn folder() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/stn");
    if folder.is_dir() {
        return Some(folder);
    }
    skipped(format_args!("{} is not there", folder.display()));
    None
}

fn all_files(folder: &Path, into: &mut Vec<PathBuf>) {
    let entries = fs::read_dir(folder).expect("a folder");
    let mut paths: Vec<_> = entries
        .map(|entry| entry.expect("an entry").path())
        .collect();
    paths.sort();
    for path in paths {
        if path.is_dir() {
            all_files(&path, into);
        } else {
            into.push(path);
        }
    }
}

fn read_file(path: &Path) -> Result<NetworkFile, String> {
    let bytes = fs::read(path).expect("a readable file");
    read(&path.display().to_string(), &bytes).map_err(|mistakes| mistakes.to_string())
}

#[test]
fn every_file_of_a_supported_format_is_read_and_others_are_named_as_unsupported() {
    let Some(folder) = folder() else { return };
    let mut files = Vec::new();
    all_files(&folder, &mut files);
    let mut formats: BTreeMap<&str, usize> = BTreeMap::new();
    let mut refused: BTreeMap<&str, usize> = BTreeMap::new();
    for path in &files {
        let name = path
            .strip_prefix(&folder)
            .expect("inside")
            .display()
            .to_string();
        if !name.contains('/') {
            continue; // the tables beside the folders
        }
        match read_file(path) {
            Ok(file) => *formats.entry(file.format.name()).or_default() += 1,
            Err(message) if message.contains("execution traces, not a network") => {
                *refused.entry("traces").or_default() += 1;
            }
            Err(message) if message.contains("conditional network") => {
                *refused.entry("conditional").or_default() += 1;
            }
            Err(message) => panic!("{message}"),
        }
    }
    let count = |format: Format| formats.get(format.name()).copied().unwrap_or_default();
    println!("{formats:?}, refused {refused:?}");
    assert_eq!(count(Format::Heatlab), 171 + 118 + 201 + 54);
    assert_eq!(count(Format::PstnLib), 42);
    assert_eq!(count(Format::GraphMl), 6 + 31);
    assert_eq!(count(Format::Plain), 44);
    assert_eq!(count(Format::Dimacs), 19);
    assert_eq!(count(Format::Inequalities), 7);
    assert_eq!(
        refused,
        BTreeMap::from([("conditional", 12), ("traces", 31)])
    );
}

#[test]
fn the_published_verdicts_are_reproduced() {
    let Some(folder) = folder() else { return };
    let labels = fs::read_to_string(folder.join("labels.csv")).expect("the labels");
    let mut checked = 0;
    for line in labels.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let [name, _, verdict, points, edges, links] = cells[..] else {
            panic!("{line}");
        };
        let file = read_file(&folder.join(name)).expect(name);
        assert_eq!(file.network.links().len().to_string(), links, "{name}");
        let _ = (points, edges);
        let is_controllable = file.network.dispatchable().is_ok();
        assert_eq!(is_controllable, verdict == "DC", "{name}");
        let check = file.network.check_controllability();
        assert_eq!(check.is_ok(), is_controllable, "{name}");
        checked += 1;
    }
    println!("{checked} verdicts");
    assert!(checked >= 334);
}
