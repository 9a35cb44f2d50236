//! A process that cannot get away.

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

/// The way in which a process ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// By itself, with this exit code.
    Exited(i32),
    /// By a signal that we did not send.
    Signalled(i32),
    /// We ended it: its time was up.
    TimeLimit,
    /// We ended it: it used too much memory.
    MemoryLimit,
    /// We ended it: we were asked to.
    Stopped,
}

/// Statistics of a planner's run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ended {
    pub(super) ending: Ending,
    /// Processor time that its processes were seen to use together; 0 where that cannot be
    /// measured.
    pub(super) work: Duration,
    /// The most memory that its processes were seen to use together, in bytes; 0 where that cannot
    /// be measured.
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
    /// Called every now and then, with the memory in use.
    fn tick(&mut self, memory: u64);
}

/// Runs a process to its end, or to that of its limits, or until `stop` is set. It gets nothing to
/// read. When this returns, it and its children are gone.
///
/// # Errors
/// When it cannot be started.
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
            "other planners are run on Unix systems only",
        ))
    }
}
