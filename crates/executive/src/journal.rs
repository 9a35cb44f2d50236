//! Journals: traces that survive a crash of the program, `docs/reference/formats/journal.md`.
//!
//! A record is a line of a trace, preceded by eight hexadecimal digits and a space. The digits are the CRC-32 of
//! the digits of the previous record (zeros for the first) and of the line, so that a damaged, missing or
//! misplaced record is detected. The last member of each line is `recorded`, the wall-clock time of writing. It is
//! not part of the trace.

mod segments;
mod wall_time;

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};
#[cfg(unix)]
use std::time::Duration;

use crate::error::{Error, WarningSink};
use crate::messages::io_error_message;

pub use segments::Segments;
pub(crate) use segments::segments_of;
pub use wall_time::{Reading, WallTime};

/// Length of the checksum and the space before a line, in bytes.
const CHECKSUM_PREFIX_LENGTH: usize = 9;

/// Checksum that precedes the first record.
const INITIAL_CHECKSUM: &str = "00000000";

/// Advice for a journal that is damaged in the middle.
pub const DAMAGE_ADVICE: &str = "the records after the damage may be incomplete: restore the file from a copy, or \
                                 check the state of the robot and start a new run with another journal";

/// Journal file of a run, open for writing.
pub struct JournalFile {
    file: File,
    path: PathBuf,
    /// Checksum of the last record.
    last: String,
    error: Option<io::Error>,
    /// First line: the specification of the run.
    header: String,
    /// Length of the file in bytes.
    length: u64,
    /// Rotation settings; `None` for a journal that is not rotated.
    segments: Option<Segments>,
    /// Minimum length at the next rotation, in bytes.
    least: u64,
    warnings: WarningSink,
}

/// Contents of a journal.
pub struct Journal {
    /// Lines of the trace.
    pub text: String,
    /// Time of recording of each line; `None` in journals of earlier versions.
    pub recorded: Vec<Option<WallTime>>,
    /// `true` if the file ends with an incomplete record.
    pub is_torn: bool,
    /// Length of the complete records in bytes.
    length: u64,
    last: String,
    /// Ends of the complete records.
    ends: Vec<RecordEnd>,
}

/// End of a record.
#[derive(Clone)]
struct RecordEnd {
    /// Length of the file, in bytes.
    length: u64,
    /// Length of the trace, in bytes.
    text: usize,
    checksum: String,
}

/// Returns options for files that only their owner can read: a journal contains all facts about the robots.
pub(crate) fn for_owner() -> OpenOptions {
    let mut options = OpenOptions::new();
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options
}

impl JournalFile {
    /// Creates an empty journal. `resume` is the command that resumes a run, for the advice.
    ///
    /// # Errors
    /// When the file cannot be written, contains a journal already, or is written by another program.
    pub fn create(path: &Path, resume: &str) -> Result<Self, Error> {
        let name = path.display();
        let open = || {
            let mut options = for_owner();
            options.write(true).create(true).truncate(false).open(path)
        };
        let file = open().map_err(|error| cannot_write(path, &error))?;
        lock(path, &file)?;
        if file.metadata().is_ok_and(|it| it.is_file() && it.len() > 0) {
            return Err(Error::new(
                format!("the journal {name} already exists"),
                format!(
                    "`{resume}` resumes its run; if the run is over, choose another file, or remove this one"
                ),
            ));
        }
        // The directory entry has to survive a power failure. Not every system can sync folders.
        let folder = path
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty());
        if let Ok(folder) = File::open(folder.unwrap_or(Path::new("."))) {
            let _ = folder.sync_all();
        }
        Ok(Self {
            file,
            path: path.to_owned(),
            last: INITIAL_CHECKSUM.to_owned(),
            error: None,
            header: String::new(),
            length: 0,
            segments: None,
            least: 0,
            warnings: WarningSink::default(),
        })
    }

    /// Opens a journal to append behind its complete records. `before` is the length of the file, in bytes, when
    /// `journal` was read.
    ///
    /// # Errors
    /// When the file cannot be written, or is written by another program.
    pub fn reopen(path: &Path, journal: &Journal, before: u64) -> Result<Self, Error> {
        let open = || OpenOptions::new().write(true).open(path);
        let mut file = open().map_err(|error| cannot_write(path, &error))?;
        lock(path, &file)?;
        // The journal was read before the lock was acquired.
        if file.metadata().is_ok_and(|it| it.len() != before) {
            return Err(locked(path));
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
            warnings: WarningSink::default(),
        })
    }

    /// Appends a line of a trace, which ends with its line feed, unless an earlier write has failed. Returns
    /// `true` if the line is written.
    pub fn write(&mut self, line: &str) -> bool {
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

    /// Flushes all records to the disk. Returns `true` if they are on the disk.
    pub fn sync(&mut self) -> bool {
        if self.error.is_none() {
            self.error = match self.file.sync_data() {
                // Pipes and devices cannot be synced.
                Err(error) if error.kind() == ErrorKind::InvalidInput => None,
                result => result.err(),
            };
        }
        self.error.is_none()
    }

    /// Returns the path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the reason of the first failed write, or `None` if all records are written.
    pub fn failure(&self) -> Option<String> {
        self.error.as_ref().map(io_error_message)
    }
}

/// Limit on attempts to lock a journal, and the interval between them: one second in all.
#[cfg(unix)]
const LOCK_ATTEMPTS: usize = 50;
#[cfg(unix)]
const LOCK_INTERVAL: Duration = Duration::from_millis(20);

/// Locks the journal until this program ends. Other programs cannot write it then. No effect on systems without
/// file locks.
fn lock(path: &Path, file: &File) -> Result<(), Error> {
    #[cfg(unix)]
    {
        use rustix::fs::{FlockOperation, flock};
        use rustix::io::Errno;
        // A program that is killed between fork and exec leaves its lock to the child until exec.
        let mut attempts = 0;
        while flock(file, FlockOperation::NonBlockingLockExclusive) == Err(Errno::WOULDBLOCK) {
            if attempts == LOCK_ATTEMPTS {
                return Err(locked(path));
            }
            attempts += 1;
            std::thread::sleep(LOCK_INTERVAL);
        }
    }
    #[cfg(not(unix))]
    let _ = (path, file);
    Ok(())
}

fn locked(path: &Path) -> Error {
    Error::new(
        format!("the run of {} has not ended", path.display()),
        "another program is writing this journal; wait for its end, or stop it",
    )
}

fn cannot_write(path: &Path, error: &io::Error) -> Error {
    Error::new(
        format!(
            "cannot write the journal {}: {}",
            path.display(),
            io_error_message(error)
        ),
        "choose a file in a folder that exists and that you may write to",
    )
}

/// Returns `true` for the text of a journal, `false` for a trace without checksums.
pub fn is_journal(text: &str) -> bool {
    let head = text.as_bytes().get(..CHECKSUM_PREFIX_LENGTH + 1);
    head.is_some_and(|head| {
        head[..CHECKSUM_PREFIX_LENGTH - 1]
            .iter()
            .all(u8::is_ascii_hexdigit)
            && &head[CHECKSUM_PREFIX_LENGTH - 1..] == b" {"
    })
}

impl Journal {
    /// Reads a journal. An incomplete record at the end is omitted.
    ///
    /// # Errors
    /// When complete records follow a damaged one: the journal was damaged, not cut off.
    pub fn read(text: &str) -> Result<Self, String> {
        let mut journal = Self {
            text: String::with_capacity(text.len()),
            recorded: Vec::new(),
            is_torn: false,
            length: 0,
            last: INITIAL_CHECKSUM.to_owned(),
            ends: Vec::new(),
        };
        let mut before = None::<&str>;
        for (index, record) in text.split_inclusive('\n').enumerate() {
            let parts = record.strip_suffix('\n').and_then(|record| {
                let (sum, line) = record.split_at_checked(CHECKSUM_PREFIX_LENGTH)?;
                Some((sum.strip_suffix(' ')?, line))
            });
            match parts {
                Some((sum, line)) if !journal.is_torn && sum == checksum(&journal.last, line) => {
                    let (line, recorded) = wall_time::split(line);
                    journal.text.push_str(&line);
                    journal.text.push('\n');
                    journal.recorded.push(recorded);
                    journal.length += record.len() as u64;
                    sum.clone_into(&mut journal.last);
                    journal.ends.push(RecordEnd {
                        length: journal.length,
                        text: journal.text.len(),
                        checksum: sum.to_owned(),
                    });
                }
                Some((sum, line)) if before.is_some_and(|before| sum == checksum(before, line)) => {
                    return Err(format!(
                        "it is damaged: record {} is intact, but an earlier one is not",
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
    /// Returns the first `count` records of the journal. [`JournalFile::reopen`] overwrites the others.
    #[must_use]
    pub fn truncated(mut self, count: usize) -> Self {
        self.ends.truncate(count);
        self.recorded.truncate(count);
        let last = self.ends.last().cloned().unwrap_or(RecordEnd {
            length: 0,
            text: 0,
            checksum: INITIAL_CHECKSUM.to_owned(),
        });
        self.text.truncate(last.text);
        Self {
            length: last.length,
            last: last.checksum,
            ..self
        }
    }
}

/// Returns the checksum and the record of a line.
fn record(before: &str, line: &str) -> (String, String) {
    let sum = checksum(before, line.trim_end_matches('\n'));
    let record = format!("{sum} {line}");
    (sum, record)
}

fn checksum(before: &str, line: &str) -> String {
    format!("{:08x}", crc32(before.bytes().chain(line.bytes())))
}

/// Returns the CRC-32 of ISO 3309 and zip files.
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
    use super::{INITIAL_CHECKSUM, Journal, checksum, crc32, is_journal};

    /// The check value in catalogues of checksums.
    #[test]
    fn checksum_is_that_of_zip_files() {
        assert_eq!(crc32("123456789".bytes()), 0xcbf4_3926);
    }

    fn journal(lines: &[&str]) -> String {
        let mut last = INITIAL_CHECKSUM.to_owned();
        let records = lines.iter().map(|line| {
            last = checksum(&last, line);
            format!("{last} {line}\n")
        });
        records.collect()
    }

    const LINES: [&str; 3] = ["{\"event\":\"header\"}", "{\"a\":1}", "{\"b\":\"é\"}"];

    #[test]
    fn written_journal_is_read() {
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

    /// A journal that is cut off at any byte yields its complete records.
    #[test]
    fn torn_tail_is_omitted() {
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
    fn truncated_journal_is_that_of_its_first_records() {
        let text = journal(&LINES);
        for count in 0..=LINES.len() {
            let read = Journal::read(&text).expect("whole").truncated(count);
            let first = journal(&LINES[..count]);
            assert_eq!(read.length, first.len() as u64);
            let again = Journal::read(&first).expect("whole");
            assert_eq!((read.text, read.last), (again.text, again.last));
            assert_eq!(read.recorded.len(), count);
        }
    }

    #[test]
    fn damage_in_the_middle_is_an_error() {
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
        // A damaged last record cannot be distinguished from a torn one.
        let last = text.replace("\"c\":3", "\"c\":7");
        assert!(Journal::read(&last).expect("torn").is_torn);
    }
}
