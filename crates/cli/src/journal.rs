//! Journals: traces that survive whatever ends the program, `docs/formats/journal.md`.
//!
//! A record is a line of a trace with eight hexadecimal digits and a space before it: the CRC-32 of
//! the digits of the record before it (zeros before the first) and of the line. So a record that is
//! damaged, missing or out of place is noticed. The last member of each line is `recorded`, the wall-clock time
//! at which it was written, which is not part of the trace.

mod segments;
mod wall_time;

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};
#[cfg(unix)]
use std::time::Duration;

use crate::exit::Failure;
use crate::words::plain;

pub(crate) use segments::Segments;
pub(crate) use wall_time::{Reading, WallTime};

/// The digits before a line, and the space behind them.
const HEAD: usize = 9;

/// The checksum before the first record.
const BEGINNING: &str = "00000000";

/// What to do about a journal that is damaged in the middle.
pub(crate) const DAMAGED: &str = "what comes behind the damage may not be all that happened: put a copy of the file in \
                                  its place, or see to the robot and begin a new run with another journal";

/// A journal that is being written.
pub(crate) struct JournalFile {
    file: File,
    path: PathBuf,
    /// The checksum of the last record.
    last: String,
    error: Option<io::Error>,
    /// The first line, which says what is run.
    header: String,
    /// How long the file is, in bytes.
    length: u64,
    /// When it is begun anew.
    segments: Option<Segments>,
    /// It is not begun anew before it is as long.
    least: u64,
}

/// A journal that was read.
pub(crate) struct Journal {
    /// Its lines as those of a trace.
    pub(crate) text: String,
    /// For each of its lines, the time at which it was recorded; `None` in journals of earlier versions.
    pub(crate) recorded: Vec<Option<WallTime>>,
    /// Whether something at its end is no whole record.
    pub(crate) is_torn: bool,
    /// The length of what is whole, in bytes.
    length: u64,
    last: String,
    /// The same, and the length of the text, without its last record.
    before: (u64, String, usize),
}

/// Returns options for files that only their owner can read. A journal holds all facts about the robots.
fn for_owner() -> OpenOptions {
    let mut options = OpenOptions::new();
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options
}

impl JournalFile {
    /// An empty journal. One that has something in it is not overwritten; `resume` is the command that
    /// goes on with it.
    pub(crate) fn create(path: &Path, resume: &str) -> Result<Self, Failure> {
        let name = path.display();
        let open = || {
            let mut options = for_owner();
            options.write(true).create(true).truncate(false).open(path)
        };
        let file = open().map_err(|error| cannot_write(path, &error))?;
        claim(path, &file)?;
        if file.metadata().is_ok_and(|it| it.is_file() && it.len() > 0) {
            return Err(Failure::new(
                format!("there is a journal {name} already"),
                format!(
                    "`{resume}` goes on with its run; if that is over, choose another file, or remove this one"
                ),
            ));
        }
        // A file that nobody finds after a power failure is none. Not every system can do this.
        let folder = path
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty());
        if let Ok(folder) = File::open(folder.unwrap_or(Path::new("."))) {
            let _ = folder.sync_all();
        }
        Ok(Self {
            file,
            path: path.to_owned(),
            last: BEGINNING.to_owned(),
            error: None,
            header: String::new(),
            length: 0,
            segments: None,
            least: 0,
        })
    }

    /// Goes on behind what is whole of a journal; `before` is how many bytes the file had before
    /// that was read.
    pub(crate) fn go_on(path: &Path, journal: &Journal, before: u64) -> Result<Self, Failure> {
        let open = || OpenOptions::new().write(true).open(path);
        let mut file = open().map_err(|error| cannot_write(path, &error))?;
        claim(path, &file)?;
        // It was read before it was claimed.
        if file.metadata().is_ok_and(|it| it.len() != before) {
            return Err(under_way(path));
        }
        let mut cut = || {
            file.set_len(journal.length)?;
            file.seek(SeekFrom::Start(journal.length))
        };
        cut().map_err(|error| cannot_write(path, &error))?;
        let header = journal.text.lines().next().unwrap_or_default();
        Ok(Self {
            file,
            path: path.to_owned(),
            last: journal.last.clone(),
            error: None,
            header: header.to_owned(),
            length: journal.length,
            segments: None,
            least: 0,
        })
    }

    /// Writes a line of a trace, which ends with its line feed, unless writing has failed before.
    /// Returns whether it is written.
    pub(crate) fn write(&mut self, line: &str) -> bool {
        if self.error.is_none() {
            if self.header.is_empty() {
                line.trim_end_matches('\n').clone_into(&mut self.header);
            }
            let line = WallTime::now().stamped(line);
            let (sum, record) = record(&self.last, &line);
            self.error = self.file.write_all(record.as_bytes()).err();
            self.length += record.len() as u64;
            self.last = sum;
        }
        self.error.is_none()
    }

    /// Has what was written put on the disk before this returns. Returns whether it is.
    pub(crate) fn sync(&mut self) -> bool {
        if self.error.is_none() {
            self.error = match self.file.sync_data() {
                // A pipe or a device has no disk behind it.
                Err(error) if error.kind() == ErrorKind::InvalidInput => None,
                result => result.err(),
            };
        }
        self.error.is_none()
    }

    /// Where it is.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Why not all records were written, if so.
    pub(crate) fn trouble(&self) -> Option<String> {
        self.error.as_ref().map(plain)
    }
}

/// How often it is looked whether another program still claims a journal, and after which time: for a second.
#[cfg(unix)]
const MOST_GLANCES: usize = 50;
#[cfg(unix)]
const GLANCE: Duration = Duration::from_millis(20);

/// Keeps every other program from writing this journal, until this one ends, however it does. Where
/// files cannot be locked, nothing is kept.
fn claim(path: &Path, file: &File) -> Result<(), Failure> {
    #[cfg(unix)]
    {
        use rustix::fs::{FlockOperation, flock};
        use rustix::io::Errno;
        // A program that was killed while it started another one leaves its claim to that, until the other is what
        // it is to be.
        let mut glances = 0;
        while flock(file, FlockOperation::NonBlockingLockExclusive) == Err(Errno::WOULDBLOCK) {
            if glances == MOST_GLANCES {
                return Err(under_way(path));
            }
            glances += 1;
            std::thread::sleep(GLANCE);
        }
    }
    #[cfg(not(unix))]
    let _ = (path, file);
    Ok(())
}

fn under_way(path: &Path) -> Failure {
    Failure::new(
        format!("the run of {} is under way", path.display()),
        "another program writes this journal; wait for its end, or end it",
    )
}

fn cannot_write(path: &Path, error: &io::Error) -> Failure {
    Failure::new(
        format!(
            "cannot write the journal {}: {}",
            path.display(),
            plain(error)
        ),
        "choose a file in a folder that exists and that you may write to",
    )
}

/// Whether a file is a journal, and no trace without checksums.
pub(crate) fn is_journal(text: &str) -> bool {
    let head = text.as_bytes().get(..HEAD + 1);
    head.is_some_and(|head| {
        head[..HEAD - 1].iter().all(u8::is_ascii_hexdigit) && &head[HEAD - 1..] == b" {"
    })
}

impl Journal {
    /// Reads a journal. What is not whole at its end is left out.
    ///
    /// # Errors
    /// In words, when there are whole records behind one that is not: then it was damaged, not cut
    /// off.
    pub(crate) fn read(text: &str) -> Result<Self, String> {
        let mut journal = Self {
            text: String::with_capacity(text.len()),
            recorded: Vec::new(),
            is_torn: false,
            length: 0,
            last: BEGINNING.to_owned(),
            before: (0, BEGINNING.to_owned(), 0),
        };
        let mut before = None::<&str>;
        for (index, record) in text.split_inclusive('\n').enumerate() {
            let parts = record.strip_suffix('\n').and_then(|record| {
                let (sum, line) = record.split_at_checked(HEAD)?;
                Some((sum.strip_suffix(' ')?, line))
            });
            match parts {
                Some((sum, line)) if !journal.is_torn && sum == checksum(&journal.last, line) => {
                    journal.before = (journal.length, journal.last.clone(), journal.text.len());
                    let (line, recorded) = wall_time::split(line);
                    journal.text.push_str(&line);
                    journal.text.push('\n');
                    journal.recorded.push(recorded);
                    journal.length += record.len() as u64;
                    sum.clone_into(&mut journal.last);
                }
                Some((sum, line)) if before.is_some_and(|before| sum == checksum(before, line)) => {
                    return Err(format!(
                        "it is damaged in the middle: record {} is whole, but one before it is not",
                        index + 1
                    ));
                }
                _ => journal.is_torn = true,
            }
            before = parts.map(|(sum, _)| sum);
        }
        Ok(journal)
    }
}

impl Journal {
    /// The same without its last record, which is then written over.
    pub(crate) fn without_last(mut self) -> Self {
        let (length, last, text) = self.before.clone();
        self.text.truncate(text);
        self.recorded.pop();
        Self {
            length,
            last,
            ..self
        }
    }
}

/// A line as a record, and its checksum.
fn record(before: &str, line: &str) -> (String, String) {
    let sum = checksum(before, line.trim_end_matches('\n'));
    let record = format!("{sum} {line}");
    (sum, record)
}

fn checksum(before: &str, line: &str) -> String {
    format!("{:08x}", crc32(before.bytes().chain(line.bytes())))
}

/// CRC-32 as in ISO 3309 and zip files.
fn crc32(bytes: impl Iterator<Item = u8>) -> u32 {
    let step = |sum: u32, byte: u8| {
        (0..8).fold(sum ^ u32::from(byte), |sum, _| {
            let carried = if sum & 1 == 1 { 0xedb8_8320 } else { 0 };
            (sum >> 1) ^ carried
        })
    };
    !bytes.fold(!0, step)
}

#[cfg(test)]
mod tests {
    use super::{BEGINNING, Journal, checksum, crc32, is_journal};

    /// The check value that the catalogues of such sums give.
    #[test]
    fn the_checksum_is_that_of_zip_files() {
        assert_eq!(crc32("123456789".bytes()), 0xcbf4_3926);
    }

    fn journal(lines: &[&str]) -> String {
        let mut last = BEGINNING.to_owned();
        let records = lines.iter().map(|line| {
            last = checksum(&last, line);
            format!("{last} {line}\n")
        });
        records.collect()
    }

    const LINES: [&str; 3] = ["{\"event\":\"header\"}", "{\"a\":1}", "{\"b\":\"é\"}"];

    #[test]
    fn what_was_written_is_read() {
        let text = journal(&LINES);
        assert!(is_journal(&text));
        assert!(!is_journal(LINES[0]));
        let read = Journal::read(&text).expect("whole");
        assert_eq!(
            read.text,
            "{\"event\":\"header\"}\n{\"a\":1}\n{\"b\":\"é\"}\n"
        );
        assert_eq!((read.is_torn, read.length), (false, text.len() as u64));
    }

    /// Wherever a journal is cut off, its whole records are read, and nothing else.
    #[test]
    fn a_torn_tail_is_left_out() {
        let text = journal(&LINES);
        let ends: Vec<usize> = text.match_indices('\n').map(|(at, _)| at + 1).collect();
        for cut in (0..text.len()).filter(|cut| text.is_char_boundary(*cut)) {
            let read = Journal::read(&text[..cut]).expect("cut off, not damaged");
            let whole = ends.iter().filter(|end| **end <= cut);
            assert_eq!(read.text.lines().count(), whole.clone().count(), "at {cut}");
            let length = whole.max().copied().unwrap_or(0);
            assert_eq!(read.length, length as u64, "at {cut}");
            assert_eq!(read.is_torn, cut > length, "at {cut}");
        }
    }

    #[test]
    fn damage_in_the_middle_is_no_torn_tail() {
        let lines = [
            "{\"event\":\"header\"}",
            "{\"a\":1}",
            "{\"b\":2}",
            "{\"c\":3}",
        ];
        let text = journal(&lines);
        assert!(Journal::read(&text.replace("\"a\":1", "\"a\":7")).is_err());
        let records: Vec<&str> = text.split_inclusive('\n').collect();
        let without_the_second = [records[0], records[2], records[3]].concat();
        assert!(Journal::read(&without_the_second).is_err());
        // Of a last record alone nobody can say what happened to it.
        let last = text.replace("\"c\":3", "\"c\":7");
        assert!(Journal::read(&last).expect("torn").is_torn);
    }
}
