//! Learning from the journal of an executive between its missions: `docs/reference/learning.md`.
//!
//! A folder contains copies of journals, one for each segment, and `world.toml`, the model of the world learnt from all
//! of them.

use std::collections::BTreeSet;
use std::fs;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use elbowroom::answers::NoObserver;
use elbowroom::answers::learn::{LearnRequest, LearntAction, Log, Settings, learn};
use elbowroom::execution::Entry;
use elbowroom::text::Source;

use crate::clock::Clock;
use crate::error::{Error, WarningSink};
use crate::journal::{Journal, for_owner, is_journal, segments_of};
use crate::messages::io_error_message;

/// Name of the model in the folder.
pub const MODEL: &str = "world.toml";

/// Shortest pause between two updates.
const MIN_UPDATE_INTERVAL: Duration = Duration::from_secs(10);

/// File name extension of the logs in the folder.
pub(crate) const LOG: &str = "journal";

/// Folder of logs with the model learnt from them.
pub struct Learner {
    folder: PathBuf,
    journal: PathBuf,
    warnings: WarningSink,
    /// Warnings about logs and drifts.
    reported: BTreeSet<String>,
}

impl Learner {
    /// Creates the folder if it does not exist. `journal` is the journal of the run, which is read at each update.
    ///
    /// # Errors
    /// When the folder cannot be created or written.
    pub fn new(folder: &Path, journal: &Path, warnings: WarningSink) -> Result<Self, Error> {
        let cannot = |error: &io::Error| {
            Error::new(
                format!(
                    "cannot write to the folder {}: {}",
                    folder.display(),
                    io_error_message(error)
                ),
                "choose another folder for --learn",
            )
        };
        fs::create_dir_all(folder).map_err(|error| cannot(&error))?;
        let probe = folder.join(".probe");
        fs::write(&probe, "").map_err(|error| cannot(&error))?;
        let _ = fs::remove_file(probe);
        Ok(Self {
            folder: folder.to_owned(),
            journal: journal.to_owned(),
            warnings,
            reported: BTreeSet::new(),
        })
    }

    /// Copies the segments of the journal, learns from all logs of the folder, and replaces the model. Logs that cannot be
    /// read are warnings, and so are drifts that were not reported before.
    ///
    /// # Errors
    /// When the folder cannot be read or written.
    pub fn update(&mut self) -> io::Result<()> {
        for segment in segments_of(&self.journal) {
            self.copy(&segment)?;
        }
        let logs = self.logs()?;
        let request = LearnRequest {
            logs,
            settings: Settings::default(),
            conformal_box: None,
            expected: None,
        };
        let answer = match learn(&request, &mut NoObserver) {
            Ok(answer) => answer,
            Err(error) => {
                self.warn(&error.to_string());
                return Ok(());
            }
        };
        if answer.attempts == 0 {
            return Ok(());
        }
        replace(&self.folder.join(MODEL), &answer.world)?;
        for action in &answer.actions {
            self.report_drift(action);
        }
        Ok(())
    }

    /// Copies a segment of the journal to the folder. Its name is the time of its first record.
    fn copy(&self, segment: &Path) -> io::Result<()> {
        let Ok(text) = fs::read_to_string(segment) else {
            return Ok(());
        };
        // The last record may be written at this moment.
        let Ok(journal) = Journal::read(&text) else {
            self.warn(&format!("{} is damaged", segment.display()));
            return Ok(());
        };
        let Some(name) = name_of_copy(&journal) else {
            return Ok(());
        };
        let copy = self.folder.join(name);
        let length = fs::metadata(&copy).map_or(0, |it| it.len());
        if text.len() as u64 > length {
            replace(&copy, &text)?;
        }
        Ok(())
    }

    /// Reads the logs in the folder that belong to the domain of the run, oldest first.
    fn logs(&mut self) -> io::Result<Vec<Log>> {
        let own = read_log(&self.journal).ok().and_then(|it| it.domain);
        let mut paths: Vec<PathBuf> = Vec::new();
        for entry in fs::read_dir(&self.folder)? {
            let path = entry?.path();
            // Opening a named pipe could block forever.
            let is_file = fs::metadata(&path).is_ok_and(|it| it.is_file());
            if is_file && path.extension().is_some_and(|it| it == LOG) {
                paths.push(path);
            }
        }
        paths.sort();
        let mut logs = Vec::with_capacity(paths.len());
        for path in paths {
            let why = match read_log(&path) {
                // A journal in this folder. Its copy is in the same folder.
                Ok(StoredLog {
                    copy: Some(copy), ..
                }) if self.has_other(&copy, &path) => continue,
                Ok(StoredLog {
                    domain: Some(domain),
                    ..
                }) if own.as_ref().is_some_and(|own| *own != domain) => {
                    format!("it belongs to the domain `{domain}`")
                }
                Ok(stored) => {
                    logs.push(stored.log);
                    continue;
                }
                Err(why) => why,
            };
            self.warn_once(format!("{} is ignored: {why}", path.display()));
        }
        Ok(logs)
    }

    /// Returns `true` if the folder has a file of this name that is not the one at `path`.
    fn has_other(&self, name: &str, path: &Path) -> bool {
        let other = self.folder.join(name);
        other != path && other.exists()
    }

    fn report_drift(&mut self, action: &LearntAction) {
        let durations = action.drift.as_ref().map(|drift| (drift, "durations"));
        let failures = (&action.failure_drift, "failures");
        for (drift, what) in durations.into_iter().chain([failures]) {
            let Some(since) = drift.since else { continue };
            let text = format!(
                "the {what} of `{}` have changed, detected at sample {since}: the model in {} mixes samples from \
                 before and after the change",
                action.action,
                self.folder.display()
            );
            self.warn_once(text);
        }
    }

    /// Issues a warning that was not issued before.
    fn warn_once(&mut self, text: String) {
        if !self.reported.contains(&text) {
            self.warn(&text);
            self.reported.insert(text);
        }
    }

    fn warn(&self, text: &str) {
        self.warnings.warn(&format!("learning: {text}"));
    }
}

/// Log of the folder.
struct StoredLog {
    log: Log,
    /// Name of the domain, if the log contains it.
    domain: Option<String>,
    /// Name of its copy in the folder, if it is a journal.
    copy: Option<String>,
}

/// Returns the file name of the copy of a journal: the time of its first record.
fn name_of_copy(journal: &Journal) -> Option<String> {
    let first = journal.recorded.first()?.as_ref()?;
    Some(format!("{first}.{LOG}"))
}

fn read_log(path: &Path) -> Result<StoredLog, String> {
    let text = fs::read_to_string(path).map_err(|error| io_error_message(&error))?;
    let (text, copy) = if is_journal(&text) {
        let journal = Journal::read(&text)?;
        let copy = name_of_copy(&journal);
        (journal.text, copy)
    } else {
        (text, None)
    };
    let source = Source::new(path.display().to_string(), text);
    let log = Log::read(&source).map_err(|error| error.to_string())?;
    let domain = log
        .fact_history
        .as_ref()
        .map(|course| course.domain().to_owned());
    Ok(StoredLog { log, domain, copy })
}

/// Replaces a file, which is complete at any moment.
fn replace(path: &Path, text: &str) -> io::Result<()> {
    let new = path.with_extension("new");
    let mut options = for_owner();
    let mut file = options.write(true).create(true).truncate(true).open(&new)?;
    file.write_all(text.as_bytes())?;
    file.sync_all()?;
    fs::rename(new, path)
}

/// Learning in a separate thread: whenever the executive is idle, and at the end of the run.
pub struct Learning {
    missions: Sender<()>,
    thread: JoinHandle<()>,
}

impl Learning {
    /// Starts the thread.
    pub fn start(learner: Learner) -> Self {
        let (missions, ended) = channel();
        Self {
            missions,
            thread: thread::spawn(move || updates(learner, &ended)),
        }
    }

    /// Returns a callback for entries of the record, which notices the end of a mission.
    pub fn observer(&self) -> impl FnMut(&Entry<'_>) + Send + use<> {
        let missions = self.missions.clone();
        move |entry| {
            if matches!(entry, Entry::Resting { .. }) {
                let _ = missions.send(());
            }
        }
    }

    /// Learns from the whole run, once its journal is closed and its observer is dropped.
    pub fn finish(self) {
        drop(self.missions);
        let _ = self.thread.join();
    }
}

/// Updates after missions and when all senders are dropped. Between updates, it is idle for ten times as long as the last
/// one took.
fn updates(mut learner: Learner, ended: &Receiver<()>) {
    let mut is_due = false;
    while is_due || ended.recv().is_ok() {
        let begun = Clock::start();
        update(&mut learner);
        let pause = (begun.elapsed() * 10).max(MIN_UPDATE_INTERVAL);
        let begun = Clock::start();
        let mut has_ended = false;
        while let Some(left) = pause.checked_sub(begun.elapsed()) {
            match ended.recv_timeout(left) {
                Ok(()) => has_ended = true,
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => break,
            }
        }
        is_due = has_ended;
    }
    update(&mut learner);
}

fn update(learner: &mut Learner) {
    if let Err(error) = learner.update() {
        learner.warn(&format!(
            "{}: {}",
            learner.folder.display(),
            io_error_message(&error)
        ));
    }
}
