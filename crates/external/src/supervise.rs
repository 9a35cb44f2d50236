//! Supervision of a process and all its children.

use std::io;
use std::process::Command;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

#[cfg(unix)]
mod unix;

/// Resource limits of a process.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Limits {
    /// Wall-clock time.
    pub(super) time: Option<Duration>,
    /// Processor time of all its processes together.
    pub(super) work: Option<Duration>,
    /// Memory of all its processes together, in bytes.
    pub(super) memory: Option<u64>,
}

/// The end of a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// By itself, with this exit code.
    Exited(i32),
    /// By a signal that the supervisor did not send.
    Signalled(i32),
    /// Ended at the time limit.
    TimeLimit,
    /// Ended at the memory limit.
    MemoryLimit,
    /// Ended on request.
    Stopped,
}

/// Statistics of a planner's run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ended {
    pub(super) ending: Ending,
    /// Measured processor time of all its processes together; 0 if it cannot be measured.
    pub(super) work: Duration,
    /// The largest measured memory use of all its processes together, in bytes; 0 if it cannot be
    /// measured.
    pub(super) peak_memory: u64,
}

/// The output stream of a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stream {
    Output,
    Error,
}

/// Callbacks while a process runs.
pub(super) trait Watcher {
    /// The process has printed something.
    fn printed(&mut self, stream: Stream, bytes: &[u8]);
    /// Called regularly with the memory in use.
    fn tick(&mut self, memory: u64);
}

/// Runs a process until it ends, reaches a limit, or `stop` is set. Its standard input is empty.
/// When this function returns, the process and its children are gone.
///
/// # Errors
/// If the process cannot be started.
pub(super) fn supervise(
    command: Command,
    limits: Limits,
    stop: &AtomicBool,
    watcher: &mut dyn Watcher,
) -> io::Result<Ended> {
    #[cfg(unix)]
    return unix::supervise(command, limits, stop, watcher);
    #[cfg(not(unix))]
    {
        let _ = (command, limits, stop, watcher);
        Err(io::Error::new(
            io::ErrorKind::Unsupported,
            "external planners need a Unix system",
        ))
    }
}
