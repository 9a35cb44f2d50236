//! Simulated robots in Python: their folders and records, and random numbers for tests that kill processes.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::skipped::skipped;

/// Returns `true` if Python is available for simulated robots; otherwise reports the test as
/// skipped.
pub(crate) fn python_is_there() -> bool {
    let is_there = Command::new("python3").arg("--version").output().is_ok();
    if !is_there {
        skipped("there is no python3");
    }
    is_there
}

/// A folder that no other test uses.
pub(crate) fn folder(name: &str) -> PathBuf {
    let name = format!("elbowroom-{}-robots-{name}", std::process::id());
    let folder = std::env::temp_dir().join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir(&folder).expect("a folder can be made");
    folder
}

/// Returns the lines of a file of a folder, or none if it is missing.
pub(crate) fn lines(folder: &Path, file: &str) -> Vec<String> {
    let text = fs::read_to_string(folder.join(file)).unwrap_or_default();
    text.lines().map(str::to_owned).collect()
}

/// Checks by the robot's own records that no ticket was started twice.
pub(crate) fn check_tickets(folder: &Path, what: &str) {
    let begun = lines(folder, "begun");
    let tickets = begun.iter().filter_map(|line| line.split(' ').next());
    let tickets: BTreeSet<_> = tickets.collect();
    assert_eq!(
        tickets.len(),
        begun.len(),
        "{what}: begun twice: {begun:#?}"
    );
}

/// Returns the number of complete records of a journal.
pub(crate) fn record_count(journal: &str) -> u64 {
    let bytes = fs::read(journal).unwrap_or_default();
    bytes.iter().map(|byte| u64::from(*byte == b'\n')).sum()
}

/// Pseudo-random numbers: the upper bits of a linear congruential generator.
pub(crate) struct Rng(pub(crate) u64);

impl Rng {
    pub(crate) fn below(&mut self, limit: u64) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % limit
    }
}
