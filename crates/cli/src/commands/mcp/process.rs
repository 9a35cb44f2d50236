//! Processes of this program that answer questions.

use std::fs;
use std::io::{self, Read};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use elbowroom_executive::clock::Clock;
use elbowroom_executive::messages::io_error_message;

use super::POLL_INTERVAL;

/// Time that a process gets after its own limit.
const GRACE_PERIOD: Duration = Duration::from_secs(2);
/// Maximum length of an answer, in bytes.
const MAX_ANSWER: u64 = 16 << 20;

/// An answered question.
pub(super) struct Finished {
    /// The exit code of the command.
    pub(super) exit: i32,
    /// Standard output; for a failure without a document also standard error.
    pub(super) text: String,
}

/// Reason why a question has no answer.
pub(super) enum Stopped {
    /// The caller has ended it.
    Ended,
    /// It has reached its limit, or the process cannot be started.
    Failed(String),
}

/// A question with its files, in a folder of its own, and its time limit.
pub(super) struct Question<'a> {
    folder: PathBuf,
    /// Error of the first file that could not be written.
    unwritten: Option<String>,
    clock: Clock,
    limit: Duration,
    must_end: &'a mut dyn FnMut() -> bool,
}

impl<'a> Question<'a> {
    pub(super) fn new(
        files: &[(&str, &str)],
        limit: Duration,
        must_end: &'a mut dyn FnMut() -> bool,
    ) -> Self {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let name = format!("elbowroom-mcp-{}-{count}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        let mut written = fs::create_dir(&folder);
        for (name, text) in files {
            written = written.and_then(|()| fs::write(folder.join(name), text));
        }
        let unwritten = written.err().map(|error| {
            let why = io_error_message(&error);
            format!("cannot write to {}: {why}", folder.display())
        });
        Self {
            folder,
            unwritten,
            clock: Clock::start(),
            limit,
            must_end,
        }
    }

    /// Runs a command of this program in the folder.
    pub(super) fn ask(
        &mut self,
        command: &str,
        options: &[String],
        is_document: bool,
    ) -> Result<Finished, Stopped> {
        if let Some(why) = &self.unwritten {
            return Err(Stopped::Failed(why.clone()));
        }
        let failed = |error: &io::Error| {
            Stopped::Failed(format!(
                "cannot start `elbowroom {command}`: {}",
                io_error_message(error)
            ))
        };
        let mut program = this_program().map_err(|error| failed(&error))?;
        program
            .arg(command)
            .args(options)
            .args(is_document.then_some("--json"));
        program
            .current_dir(&self.folder)
            .env("NO_COLOR", "1")
            .env("COLUMNS", "100");
        program
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let mut child = program.spawn().map_err(|error| failed(&error))?;
        let outputs = (read(child.stdout.take()), read(child.stderr.take()));
        let exit = self.wait(&mut child);
        if exit.is_err() {
            let _ = child.kill();
            let _ = child.wait();
        }
        let (output, errors) = (outputs.0.join(), outputs.1.join());
        let exit = exit?;
        let (output, errors) = (output.unwrap_or_default(), errors.unwrap_or_default());
        let text = match (output.is_empty(), is_document) {
            (true, _) => errors,
            (false, true) => output,
            (false, false) => format!("{output}{errors}"),
        };
        Ok(Finished { exit, text })
    }

    /// Waits for the process, until the time limit or until the caller ends it.
    fn wait(&mut self, child: &mut Child) -> Result<i32, Stopped> {
        loop {
            match child.try_wait() {
                Ok(Some(status)) => return Ok(status.code().unwrap_or(70)),
                Ok(None) => {}
                Err(error) => return Err(Stopped::Failed(io_error_message(&error))),
            }
            if (self.must_end)() {
                return Err(Stopped::Ended);
            }
            if self.clock.elapsed() >= self.limit + GRACE_PERIOD {
                let seconds = self.limit.as_secs_f64();
                return Err(Stopped::Failed(format!(
                    "no answer within {seconds} s; raise `time_limit`, or ask about a smaller problem"
                )));
            }
            thread::sleep(POLL_INTERVAL);
        }
    }
}

impl Drop for Question<'_> {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// Returns a command line that runs this program. The Python package runs it in the interpreter.
fn this_program() -> io::Result<Command> {
    let path = std::env::current_exe()?;
    let name = path
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase();
    let mut program = Command::new(&path);
    if name.starts_with("python") {
        program.args(["-m", "elbowroom"]);
    }
    Ok(program)
}

/// Reads an output in a separate thread, so that a full pipe does not block the process.
fn read(output: Option<impl Read + Send + 'static>) -> thread::JoinHandle<String> {
    thread::spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut output) = output {
            let _ = output.by_ref().take(MAX_ANSWER).read_to_end(&mut bytes);
            let _ = io::copy(&mut output, &mut io::sink());
        }
        String::from_utf8_lossy(&bytes).into_owned()
    })
}
