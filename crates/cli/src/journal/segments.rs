//! Journals in segments: a journal that has become long is begun anew, where its run rests.
//!
//! The new segment is written beside the old one and is on the disk before it takes its name, in one step:
//! whenever the program is killed, the file of that name is a whole journal, the old one or the new one.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use super::{BEGINNING, JournalFile, WallTime, claim, for_owner, record};
use crate::output;
use crate::words::plain;

/// When a journal is begun anew, and what becomes of what it had.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Segments {
    /// From this length on, in bytes.
    pub(crate) size: u64,
    /// How many earlier segments are kept: `FILE.1` is the last one.
    pub(crate) kept: usize,
}

impl JournalFile {
    /// The same journal, which is begun anew when it has become long.
    pub(crate) fn in_segments(self, segments: Option<Segments>) -> Self {
        if let Some(segments) = segments {
            // What a killed program has left half done.
            let _ = fs::remove_file(beside(&self.path, "new"));
            close_up(&self.path, segments.kept);
        }
        Self { segments, ..self }
    }

    /// Whether it has become so long that it is to be begun anew.
    pub(crate) fn is_long(&self) -> bool {
        let size = self.segments.map(|segments| segments.size);
        self.error.is_none() && size.is_some_and(|size| self.length >= size.max(self.least))
    }

    /// Begins a new segment, which has only the header and this line. If that cannot be, the journal
    /// is as it was, which is told, and it is tried again when it is twice as long. Returns whether it
    /// has been begun.
    pub(crate) fn begin_anew(&mut self, snapshot: &str) -> bool {
        let Some(segments) = self.segments else {
            return false;
        };
        let new = beside(&self.path, "new");
        let replaced = self.replace(&new, snapshot, segments.kept);
        // If all of a segment is its snapshot, it is not begun anew at every opportunity.
        self.least = 2 * self.length;
        if let Err(error) = &replaced {
            let _ = fs::remove_file(new);
            output::warn(&format!(
                "the journal {} goes on growing, as no new segment can be begun: {}",
                self.path.display(),
                plain(error)
            ));
        }
        replaced.is_ok()
    }

    fn replace(&mut self, new: &Path, snapshot: &str, kept: usize) -> io::Result<()> {
        let now = WallTime::now();
        let stamped = |line: &str| now.stamped(&format!("{line}\n")).into_owned();
        let (first, header) = record(BEGINNING, &stamped(&self.header));
        let (last, snapshot) = record(&first, &stamped(snapshot));
        let text = header + &snapshot;
        let mut options = for_owner();
        let mut file = options.write(true).create(true).truncate(true).open(new)?;
        claim(new, &file).map_err(|failure| io::Error::other(failure.message().to_owned()))?;
        file.write_all(text.as_bytes())?;
        file.sync_all()?;
        keep(&self.path, kept)?;
        fs::rename(new, &self.path)?;
        if let Ok(folder) = File::open(folder_of(&self.path)) {
            // Until then, either segment may be found after a power failure.
            let _ = folder.sync_all();
        }
        (self.file, self.last, self.length) = (file, last, text.len() as u64);
        Ok(())
    }
}

/// Takes back what a program that was killed in [`keep`] has done of it: a segment that has its further
/// name already is not over, and where a number is missing, the earlier segments are not yet, or not
/// any more, where they are looked for.
fn close_up(path: &Path, kept: usize) {
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
        // A name that is not free is never taken.
        if number > next && fs::rename(segment, beside(path, &next.to_string())).is_err() {
            return;
        }
        next += 1;
    }
}

/// Whether these are two names for one file.
#[cfg(unix)]
fn is_one_file(one: &Path, other: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let number = |path| fs::metadata(path).map(|it| (it.dev(), it.ino()));
    matches!((number(one), number(other)), (Ok(one), Ok(other)) if one == other)
}

/// Elsewhere, that cannot be asked; the segment is then kept twice.
#[cfg(not(unix))]
fn is_one_file(_: &Path, _: &Path) -> bool {
    false
}

/// Gives a segment that is over a further name, and each earlier one the next number, up to the first
/// number that is free; if none is, the oldest one is forgotten.
fn keep(path: &Path, kept: usize) -> io::Result<()> {
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
    // Not every disk knows two names for a file.
    fs::hard_link(path, numbered(1)).or_else(|_| fs::copy(path, numbered(1)).map(drop))
}

/// `FILE.name`.
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

    /// Each segment is a journal with the same header, and as many as were asked for are kept.
    #[test]
    fn segments_follow_each_other() {
        for kept in 0..4 {
            let folder = folder(&format!("follow-{kept}"));
            let path = folder.join("run.journal");
            let segments = Some(Segments { size: 60, kept });
            let Ok(journal) = JournalFile::create(&path, "elbowroom serve --resume") else {
                panic!("it can be made");
            };
            let mut journal = journal.in_segments(segments);
            journal.write("{\"event\":\"header\"}\n");
            for number in 1..6 {
                assert!(!journal.is_long(), "{number}");
                while !journal.is_long() {
                    journal.write(&format!("{{\"of\":{number}}}\n"));
                }
                journal.begin_anew(&format!("{{\"snapshot\":{number}}}"));
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

    /// Wherever a program is killed while the earlier segments get their next numbers, the next one finds
    /// them all, without a number that is missing or a segment that is there twice.
    #[test]
    fn segments_whose_numbers_were_being_changed_are_all_found() {
        const KEPT: usize = 5;
        let segments = Some(Segments {
            size: 1,
            kept: KEPT,
        });
        // After so many of the steps: three segments get the next number, and the last one its first.
        // Elsewhere it is not known that two names are those of one file.
        for step in 0..=(if cfg!(unix) { 4 } else { 3 }) {
            let folder = folder(&format!("renumbered-{step}"));
            let path = folder.join("run.journal");
            let numbered = |number: usize| folder.join(format!("run.journal.{number}"));
            let Ok(journal) = JournalFile::create(&path, "elbowroom serve --resume") else {
                panic!("it can be made");
            };
            let mut journal = journal.in_segments(segments);
            journal.write("{\"event\":\"header\"}\n");
            for number in 1..4 {
                journal.begin_anew(&format!("{{\"snapshot\":{number}}}"));
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
            let Ok(journal) = JournalFile::go_on(&path, &read, length) else {
                panic!("it can be gone on with");
            };
            let mut journal = journal.in_segments(segments);
            whole(3);
            assert!(journal.begin_anew("{\"snapshot\":4}"), "step {step}");
            whole(4);
            fs::remove_dir_all(&folder).expect("the folder is there");
        }
    }

    /// Where no new segment can be begun, the journal goes on as it was.
    #[test]
    fn a_segment_that_cannot_be_begun_changes_nothing() {
        let folder = folder("cannot");
        let path = folder.join("run.journal");
        let segments = Some(Segments { size: 1, kept: 1 });
        let Ok(journal) = JournalFile::create(&path, "elbowroom serve --resume") else {
            panic!("it can be made");
        };
        let mut journal = journal.in_segments(segments);
        // The name of the new segment is taken by a folder.
        fs::create_dir(folder.join("run.journal.new")).expect("made");
        journal.write("{\"event\":\"header\"}\n");
        assert!(journal.is_long());
        journal.begin_anew("{\"snapshot\":1}");
        assert!(!journal.is_long(), "not before it is twice as long");
        assert!(journal.write("{\"next\":1}\n"));
        assert_eq!(read(&path), "{\"event\":\"header\"}\n{\"next\":1}\n");
        fs::remove_dir_all(&folder).expect("the folder is there");
    }
}
