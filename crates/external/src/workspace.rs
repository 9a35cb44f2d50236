//! Working folder of a planner.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use elbowroom_pddl::LineKind;
use tempfile::TempDir;

/// Maximum size of a plan file; larger files are ignored.
const LARGEST_PLAN: u64 = 16 << 20;
/// Maximum number of files that are checked.
const MAX_FILES: usize = 1000;

/// A temporary folder, removed with its content on drop.
#[derive(Debug)]
pub(super) struct Workspace {
    folder: TempDir,
    /// Known plan files with their last state, and whether that state was read.
    files: BTreeMap<PathBuf, PlanFile>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct FileStamp {
    size: u64,
    modified: Option<SystemTime>,
}

#[derive(Clone, Copy, Debug)]
struct PlanFile {
    stamp: FileStamp,
    is_read: bool,
}

impl Workspace {
    /// Creates a folder in `parent`, or in the system's temporary folder, with the two texts.
    pub(super) fn new(parent: Option<&Path>, domain: &str, problem: &str) -> io::Result<Self> {
        let mut builder = tempfile::Builder::new();
        builder.prefix("elbowroom-");
        let folder = match parent {
            Some(parent) => builder.tempdir_in(parent)?,
            None => builder.tempdir()?,
        };
        let workspace = Self {
            folder,
            files: BTreeMap::new(),
        };
        fs::write(workspace.domain(), domain)?;
        fs::write(workspace.problem(), problem)?;
        Ok(workspace)
    }

    pub(super) fn path(&self) -> &Path {
        self.folder.path()
    }

    pub(super) fn domain(&self) -> PathBuf {
        self.path().join("domain.pddl")
    }

    pub(super) fn problem(&self) -> PathBuf {
        self.path().join("problem.pddl")
    }

    /// Returns the path for `{plan}`. The file does not exist yet.
    pub(super) fn plan(&self) -> PathBuf {
        self.path().join("plan")
    }

    /// Returns the contents of new plan files since the last call, the oldest first. A file that is
    /// still growing is skipped, except in the `last` call.
    pub(super) fn new_plans(&mut self, last: bool) -> Vec<String> {
        let Ok(entries) = fs::read_dir(self.path()) else {
            return Vec::new();
        };
        let mut ready = Vec::new();
        for entry in entries.flatten().take(MAX_FILES) {
            let path = entry.path();
            let is_plan = entry.file_name().to_string_lossy().starts_with("plan");
            let Ok(metadata) = entry.metadata() else {
                continue;
            };
            if !is_plan || !metadata.is_file() || metadata.len() == 0 {
                continue;
            }
            let look = FileStamp {
                size: metadata.len(),
                modified: metadata.modified().ok(),
            };
            let before = self.files.get(&path);
            let is_settled = last || before.is_some_and(|seen| seen.stamp == look);
            let is_old = before.is_some_and(|seen| seen.is_read && seen.stamp == look);
            if is_settled && !is_old {
                ready.push((look.modified, path.clone()));
            }
            let is_read = is_settled || is_old;
            self.files.insert(
                path,
                PlanFile {
                    stamp: look,
                    is_read,
                },
            );
        }
        ready.sort();
        let texts = ready.iter().filter_map(|(_, path)| text_of(path).ok());
        texts.filter(|text| has_actions(text)).collect()
    }
}

/// Returns `true` if the text contains a plan. Some planners also write files if there is none.
fn has_actions(text: &str) -> bool {
    let kinds = text.split(['\n', '\r']).map(LineKind::of);
    kinds
        .into_iter()
        .any(|kind| matches!(kind, LineKind::Timed | LineKind::Untimed))
}

fn text_of(path: &Path) -> io::Result<String> {
    let mut bytes = Vec::new();
    File::open(path)?
        .take(LARGEST_PLAN)
        .read_to_end(&mut bytes)?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plan_files_are_read_once_they_have_settled_and_again_when_they_change() {
        let mut workspace = Workspace::new(None, "d", "p").unwrap();
        let plan = workspace.plan();
        fs::write(&plan, "0: (a)").unwrap();
        fs::write(plan.with_extension("1"), "").unwrap();
        fs::write(plan.with_extension("2"), "; Time 0.1\nno solution\n").unwrap();
        assert_eq!(workspace.new_plans(false), [""; 0]);
        assert_eq!(workspace.new_plans(false), ["0: (a)"]);
        assert_eq!(workspace.new_plans(true), [""; 0]);
        fs::write(plan.with_extension("1"), "0: (bb)").unwrap();
        assert_eq!(workspace.new_plans(true), ["0: (bb)"]);
    }

    #[test]
    fn folder_is_removed_on_drop() {
        let workspace = Workspace::new(None, "d", "p").unwrap();
        let path = workspace.path().to_owned();
        assert_eq!(fs::read_to_string(workspace.domain()).unwrap(), "d");
        drop(workspace);
        assert!(!path.exists());
    }
}
