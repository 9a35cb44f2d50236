//! Rotation of journals: a long journal is replaced by a new segment while its run is idle.
//!
//! The new segment is written to a temporary file, synced, and renamed. Whenever the program is killed, the
//! file of the journal's name is a complete journal: the old segment or the new one.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use super::{INITIAL_CHECKSUM, JournalFile, WallTime, for_owner, lock, record};
use crate::error::WarningSink;
use crate::messages::io_error_message;

/// Rotation settings of a journal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Segments {
    /// Minimum length at a rotation, in bytes.
    pub size: u64,
    /// Number of earlier segments that are kept: `FILE.1` is the latest one.
    pub kept: usize,
}

impl JournalFile {
    /// Sets the rotation, and the receiver of warnings about segments that cannot be begun.
    #[must_use]
    pub fn with_rotation(self, segments: Option<Segments>, warnings: &WarningSink) -> Self {
        if let Some(segments) = segments {
            // Remains of a killed program.
            let _ = fs::remove_file(beside(&self.path, "new"));
            complete_rotation(&self.path, segments.kept);
        }
        Self {
            segments,
            warnings: warnings.clone(),
            ..self
        }
    }

    /// Returns `true` if the journal is long enough for a rotation.
    pub fn needs_rotation(&self) -> bool {
        let size = self.segments.map(|segments| segments.size);
        self.error.is_none() && size.is_some_and(|size| self.length >= size.max(self.least))
    }

    /// Begins a new segment, which consists of the header and the line `snapshot`. On failure, the journal is
    /// unchanged, a warning is issued, and the next rotation is due at twice the length. Returns `true` on success.
    pub fn rotate(&mut self, snapshot: &str) -> bool {
        let Some(segments) = self.segments else {
            return false;
        };
        let new = beside(&self.path, "new");
        let replaced = self.replace(&new, snapshot, segments.kept);
        // A segment that consists of its snapshot is not rotated at every opportunity.
        self.least = 2 * self.length;
        if let Err(error) = &replaced {
            let _ = fs::remove_file(new);
            self.warnings.warn(&format!(
                "the journal {} keeps growing, as no new segment can be started: {}",
                self.path.display(),
                io_error_message(error)
            ));
        }
        replaced.is_ok()
    }

    fn replace(&mut self, new: &Path, snapshot: &str, kept: usize) -> io::Result<()> {
        let now = WallTime::now();
        let stamped = |line: &str| now.stamped(&format!("{line}\n")).into_owned();
        let (first, header) = record(INITIAL_CHECKSUM, &stamped(&self.header));
        let (last, snapshot) = record(&first, &stamped(snapshot));
        let text = header + &snapshot;
        let mut options = for_owner();
        let mut file = options.write(true).create(true).truncate(true).open(new)?;
        lock(new, &file).map_err(io::Error::other)?;
        file.write_all(text.as_bytes())?;
        file.sync_all()?;
        keep_segment(&self.path, kept)?;
        fs::rename(new, &self.path)?;
        if let Ok(folder) = File::open(folder_of(&self.path)) {
            // Before this, either segment may be found after a power failure.
            let _ = folder.sync_all();
        }
        (self.file, self.last, self.length) = (file, last, text.len() as u64);
        Ok(())
    }
}

/// Reverts an interrupted [`keep_segment`]: removes the second name of the current segment, and closes gaps in the
/// numbers of the earlier ones.
fn complete_rotation(path: &Path, kept: usize) {
    let first = beside(path, "1");
    if kept > 0 && is_one_file(path, &first) {
        let _ = fs::remove_file(first);
    }
    let mut next = 1;
    for number in 1..=kept {
        let segment = beside(path, &number.to_string());
        if !segment.exists() {
            continue;
        }
        // No existing file is overwritten.
        if number > next && fs::rename(segment, beside(path, &next.to_string())).is_err() {
            return;
        }
        next += 1;
    }
}

/// Returns `true` if both paths name the same file.
#[cfg(unix)]
fn is_one_file(one: &Path, other: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let number = |path| fs::metadata(path).map(|it| (it.dev(), it.ino()));
    matches!((number(one), number(other)), (Ok(one), Ok(other)) if one == other)
}

/// Not known on other systems; the segment is kept twice then.
#[cfg(not(unix))]
fn is_one_file(_: &Path, _: &Path) -> bool {
    false
}

/// Links the finished segment as `FILE.1`. Increments the numbers of earlier segments up to the first gap; without a
/// gap, the oldest segment is removed.
fn keep_segment(path: &Path, kept: usize) -> io::Result<()> {
    let numbered = |number: usize| beside(path, &number.to_string());
    let free = (1..kept).find(|number| !numbered(*number).exists());
    for number in (1..free.unwrap_or(kept)).rev() {
        match fs::rename(numbered(number), numbered(number + 1)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
    }
    if kept == 0 {
        return Ok(());
    }
    match fs::remove_file(numbered(1)) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    // Not every file system has hard links.
    fs::hard_link(path, numbered(1)).or_else(|_| fs::copy(path, numbered(1)).map(drop))
}

/// Returns the existing segments of a journal, oldest first.
pub(crate) fn segments_of(path: &Path) -> Vec<PathBuf> {
    let earlier = (1..).map(|number: usize| beside(path, &number.to_string()));
    let mut segments: Vec<PathBuf> = earlier.take_while(|it| it.exists()).collect();
    segments.reverse();
    segments.push(path.to_owned());
    segments
}

/// Returns `FILE.name`.
fn beside(path: &Path, name: &str) -> PathBuf {
    let mut file = OsString::from(path);
    file.push(".");
    file.push(name);
    PathBuf::from(file)
}

fn folder_of(path: &Path) -> &Path {
    let folder = path.parent().filter(|it| !it.as_os_str().is_empty());
    folder.unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::PathBuf;

    use super::super::{Journal, JournalFile};
    use super::Segments;
    use crate::error::WarningSink;

    fn folder(name: &str) -> PathBuf {
        let name = format!("elbowroom-segments-{}-{name}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir(&folder).expect("a folder can be made");
        folder
    }

    fn read(path: &std::path::Path) -> String {
        let text = fs::read_to_string(path).expect("it is there");
        Journal::read(&text).expect("whole").text
    }

    /// Each segment is a journal with the same header. The given number of them is kept.
    #[test]
    fn rotation_keeps_given_number_of_segments() {
        for kept in 0..4 {
            let folder = folder(&format!("follow-{kept}"));
            let path = folder.join("run.journal");
            let segments = Some(Segments { size: 60, kept });
            let Ok(journal) = JournalFile::create(&path, "elbowroom serve --resume") else {
                panic!("it can be made");
            };
            let mut journal = journal.with_rotation(segments, &WarningSink::default());
            journal.write("{\"event\":\"header\"}\n");
            for number in 1..6 {
                assert!(!journal.needs_rotation(), "{number}");
                while !journal.needs_rotation() {
                    journal.write(&format!("{{\"of\":{number}}}\n"));
                }
                journal.rotate(&format!("{{\"snapshot\":{number}}}"));
            }
            journal.write("{\"last\":true}\n");
            assert_eq!(
                read(&path),
                "{\"event\":\"header\"}\n{\"snapshot\":5}\n{\"last\":true}\n"
            );
            for number in 1..=kept {
                let text = read(&folder.join(format!("run.journal.{number}")));
                let of = 6 - number;
                assert!(text.starts_with("{\"event\":\"header\"}\n"), "{text}");
                assert!(text.contains(&format!("{{\"of\":{of}}}")), "{text}");
            }
            let files = fs::read_dir(&folder).expect("the folder").count();
            assert_eq!(files, kept + 1, "nothing else is left");
            fs::remove_dir_all(&folder).expect("the folder is there");
        }
    }

    /// A program that is killed at any step of the renumbering leaves all segments: none is missing or duplicated
    /// after the next start.
    #[test]
    fn interrupted_renumbering_is_reverted() {
        const KEPT: usize = 5;
        let segments = Some(Segments {
            size: 1,
            kept: KEPT,
        });
        // Number of completed steps: three segments are renumbered, then the current one is linked. Only on Unix
        // can two names of one file be recognized.
        for step in 0..=(if cfg!(unix) { 4 } else { 3 }) {
            let folder = folder(&format!("renumbered-{step}"));
            let path = folder.join("run.journal");
            let numbered = |number: usize| folder.join(format!("run.journal.{number}"));
            let Ok(journal) = JournalFile::create(&path, "elbowroom serve --resume") else {
                panic!("it can be made");
            };
            let mut journal = journal.with_rotation(segments, &WarningSink::default());
            journal.write("{\"event\":\"header\"}\n");
            for number in 1..4 {
                journal.rotate(&format!("{{\"snapshot\":{number}}}"));
            }
            drop(journal);
            let whole = |count: usize| {
                let found = (1..).take_while(|number| numbered(*number).exists());
                assert_eq!(found.count(), count, "step {step}");
                let files = fs::read_dir(&folder).expect("the folder").count();
                assert_eq!(files, count + 1, "step {step}: nothing else is left");
                for number in 1..=count {
                    let text = read(&numbered(number));
                    let of = format!("{{\"snapshot\":{}}}", count - number);
                    assert_eq!(text.contains(&of), number < count, "step {step}: {text}");
                }
            };
            whole(3);
            for number in (1..4).rev().take(step) {
                fs::rename(numbered(number), numbered(number + 1)).expect("renamed");
            }
            if step == 4 {
                fs::hard_link(&path, numbered(1)).expect("a second name");
            }
            let text = fs::read_to_string(&path).expect("it is there");
            let (read, length) = (Journal::read(&text).expect("whole"), text.len() as u64);
            let Ok(journal) = JournalFile::reopen(&path, &read, length) else {
                panic!("it can be reopened");
            };
            let mut journal = journal.with_rotation(segments, &WarningSink::default());
            whole(3);
            assert!(journal.rotate("{\"snapshot\":4}"), "step {step}");
            whole(4);
            fs::remove_dir_all(&folder).expect("the folder is there");
        }
    }

    /// If no new segment can be begun, the journal is continued.
    #[test]
    fn failed_rotation_changes_nothing() {
        let folder = folder("cannot");
        let path = folder.join("run.journal");
        let segments = Some(Segments { size: 1, kept: 1 });
        let Ok(journal) = JournalFile::create(&path, "elbowroom serve --resume") else {
            panic!("it can be made");
        };
        let mut journal = journal.with_rotation(segments, &WarningSink::default());
        // A folder has the name of the new segment.
        fs::create_dir(folder.join("run.journal.new")).expect("made");
        journal.write("{\"event\":\"header\"}\n");
        assert!(journal.needs_rotation());
        journal.rotate("{\"snapshot\":1}");
        assert!(!journal.needs_rotation(), "not before it is twice as long");
        assert!(journal.write("{\"next\":1}\n"));
        assert_eq!(read(&path), "{\"event\":\"header\"}\n{\"next\":1}\n");
        fs::remove_dir_all(&folder).expect("the folder is there");
    }
}
