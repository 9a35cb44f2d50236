//! Process groups, signals and limits of Unix systems.

use std::io::{self, Read};
use std::os::fd::AsFd;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::process::{
    Pid, Signal, WaitId, WaitIdOptions, WaitOptions, kill_process_group, waitid, waitpid,
};

use super::super::clock::Clock;
use super::{Ended, Ending, Limits, Stream, Watcher};
use crate::processes::{MARK, Processes, Usage};

/// Interval between checks of the limits.
const LIMIT_CHECK_INTERVAL: Duration = Duration::from_millis(20);
/// Interval between measurements of memory and processor time; reading `/proc` costs a few
/// milliseconds.
const MEASURE: Duration = Duration::from_millis(60);
/// Interval between checks for the end of the process once its output is closed.
const EXIT_POLL_INTERVAL: Duration = Duration::from_millis(2);
/// Maximum time to wait for the end of killed processes.
const REAP_TIMEOUT: Duration = Duration::from_secs(2);
/// Maximum time spent on killing children that keep forking.
const KILL_TIMEOUT: Duration = Duration::from_millis(500);
#[cfg(target_os = "linux")]
const MEGABYTE: u64 = 1 << 20;
/// Maximum length of the output read from the pipes after the end.
const MAX_REMAINING_OUTPUT: usize = 4 << 20;

pub(super) fn supervise(
    mut command: Command,
    limits: Limits,
    stop: &AtomicBool,
    watcher: &mut dyn Watcher,
) -> io::Result<Ended> {
    let clock = Clock::start();
    let mark = mark();
    #[cfg(target_os = "linux")]
    command.env(MARK, &mark);
    let child = command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        // A signal to the group also reaches the children. Ctrl-C on the terminal does not reach
        // the group: the supervisor ends it and keeps its last plan.
        .process_group(0)
        .spawn()?;
    let mut run = Run::of(child, &mark, limits, clock);
    run.restrict();
    let ending = run.watch(stop, watcher);
    run.end_all();
    run.drain(watcher);
    let ended = run.reap();
    Ok(Ended {
        ending: ending.unwrap_or(ended),
        work: run.usage.work,
        peak_memory: run.peak_memory,
    })
}

/// Returns a mark that no other run has.
fn mark() -> String {
    use std::sync::atomic::AtomicU64;
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    format!("{}-{count}", std::process::id())
}

/// A running process.
struct Run {
    child: Child,
    pid: Pid,
    limits: Limits,
    clock: Clock,
    peak_memory: u64,
    usage: Usage,
    measured: Option<Duration>,
    #[cfg(target_os = "linux")]
    processes: Processes,
    is_output_open: bool,
    is_error_open: bool,
    /// `true` if another thread waits for the end of the process.
    is_abandoned: bool,
}

impl Run {
    #[cfg_attr(
        not(target_os = "linux"),
        allow(unused_variables, reason = "only /proc shows the mark")
    )]
    fn of(child: Child, mark: &str, limits: Limits, clock: Clock) -> Self {
        let pid = Pid::from_child(&child);
        let run = Self {
            pid,
            limits,
            clock,
            peak_memory: 0,
            usage: Usage::default(),
            measured: None,
            #[cfg(target_os = "linux")]
            processes: Processes::of(pid, mark),
            is_output_open: child.stdout.is_some(),
            is_error_open: child.stderr.is_some(),
            is_abandoned: false,
            child,
        };
        // If this fails, reads may block. The limits still end them, because killing the process
        // closes the pipes.
        if let Some(output) = &run.child.stdout {
            let _ = set_nonblocking(output);
        }
        if let Some(error) = &run.child.stderr {
            let _ = set_nonblocking(error);
        }
        run
    }

    /// Sets limits of the operating system, in case the supervisor is killed or too slow. They are
    /// well above the supervised ones.
    fn restrict(&self) {
        #[cfg(target_os = "linux")]
        {
            use rustix::process::{Resource, Rlimit, prlimit};
            let set = |resource, limit: u64| {
                let limit = Rlimit {
                    current: Some(limit),
                    maximum: Some(limit),
                };
                // An error is ignored: the process may have ended, and these limits are only a
                // second line of defence.
                let _ = prlimit(Some(self.pid), resource, limit);
            };
            set(Resource::Core, 0);
            set(Resource::Fsize, 2048 * MEGABYTE);
            if let Some(memory) = self.limits.memory {
                let data = memory
                    .saturating_add(memory / 2)
                    .saturating_add(64 * MEGABYTE);
                set(Resource::Data, data);
            }
            if let Some(time) = self.limits.time {
                let cores = thread::available_parallelism().map_or(64, |n| n.get() as u64);
                let seconds = (time.as_secs() + 1)
                    .saturating_mul(cores)
                    .saturating_add(10);
                set(Resource::Cpu, seconds);
            }
        }
    }

    /// Reads the output and checks the limits. Returns the reason why the process must be ended, or
    /// `None` if it has ended by itself.
    fn watch(&mut self, stop: &AtomicBool, watcher: &mut dyn Watcher) -> Option<Ending> {
        let mut buffer = vec![0; 64 << 10];
        loop {
            if self.has_exited() {
                return None;
            }
            if stop.load(Ordering::SeqCst) {
                return Some(Ending::Stopped);
            }
            let elapsed = self.clock.elapsed();
            let left = self.limits.time.map(|limit| limit.saturating_sub(elapsed));
            if left == Some(Duration::ZERO) {
                return Some(Ending::TimeLimit);
            }
            // Shortly before the limit, a measurement would only delay the end.
            if left.is_none_or(|left| left > LIMIT_CHECK_INTERVAL) {
                self.measure(elapsed);
            }
            let Usage { memory, work } = self.usage;
            if self.limits.memory.is_some_and(|limit| memory > limit) {
                return Some(Ending::MemoryLimit);
            }
            if self.limits.work.is_some_and(|limit| work >= limit) {
                return Some(Ending::TimeLimit);
            }
            watcher.tick(memory);
            let patience = left.map_or(LIMIT_CHECK_INTERVAL, |left| left.min(LIMIT_CHECK_INTERVAL));
            self.wait_for_output(patience);
            self.read(&mut buffer, watcher);
        }
    }

    fn has_exited(&self) -> bool {
        let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
        // The process is not reaped, so its number, which is also the group's, cannot be reused.
        matches!(waitid(WaitId::Pid(self.pid), options), Ok(Some(_)))
    }

    #[cfg(target_os = "linux")]
    fn measure(&mut self, elapsed: Duration) {
        let is_due = |last: Duration| elapsed.saturating_sub(last) >= MEASURE;
        // Very short runs are not measured.
        if elapsed >= LIMIT_CHECK_INTERVAL / 2 && self.measured.is_none_or(is_due) {
            self.measured = Some(elapsed);
            self.usage = self.processes.usage();
            self.peak_memory = self.peak_memory.max(self.usage.memory);
        }
    }

    #[cfg(not(target_os = "linux"))]
    fn measure(&mut self, elapsed: Duration) {
        self.measured = Some(elapsed);
    }

    fn wait_for_output(&self, patience: Duration) {
        let mut watched = Vec::new();
        if let (true, Some(output)) = (self.is_output_open, &self.child.stdout) {
            watched.push(PollFd::new(output, PollFlags::IN));
        }
        if let (true, Some(error)) = (self.is_error_open, &self.child.stderr) {
            watched.push(PollFd::new(error, PollFlags::IN));
        }
        if watched.is_empty() {
            thread::sleep(patience.min(EXIT_POLL_INTERVAL));
            return;
        }
        let timeout = Timespec::try_from(patience).ok();
        // An interrupted poll is repeated by the caller's loop.
        let _ = poll(&mut watched, timeout.as_ref());
    }

    /// Reads available output, at most a few buffers, so that a process that prints without end
    /// does not delay the checks of the limits. Returns the number of bytes read.
    fn read(&mut self, buffer: &mut [u8], watcher: &mut dyn Watcher) -> usize {
        let mut total = 0;
        for _ in 0..8 {
            let mut round = 0;
            if let (true, Some(output)) = (self.is_output_open, &mut self.child.stdout) {
                self.is_output_open = read_some(output, buffer, &mut round, |bytes| {
                    watcher.printed(Stream::Output, bytes);
                });
            }
            if let (true, Some(error)) = (self.is_error_open, &mut self.child.stderr) {
                self.is_error_open = read_some(error, buffer, &mut round, |bytes| {
                    watcher.printed(Stream::Error, bytes);
                });
            }
            if round == 0 {
                break;
            }
            total += round;
        }
        total
    }

    /// Reads the remaining output.
    fn drain(&mut self, watcher: &mut dyn Watcher) {
        let mut buffer = vec![0; 64 << 10];
        let mut total = 0;
        while total < MAX_REMAINING_OUTPUT {
            match self.read(&mut buffer, watcher) {
                0 => return,
                read => total += read,
            }
        }
    }

    /// Kills the group and all other processes of the run.
    fn end_all(&mut self) {
        // An error means that the group is already gone.
        let _ = kill_process_group(self.pid, Signal::KILL);
        #[cfg(target_os = "linux")]
        {
            let hunt = Clock::start();
            while self.processes.kill() > 0 && hunt.elapsed() < KILL_TIMEOUT {
                let _ = kill_process_group(self.pid, Signal::KILL);
                thread::sleep(Duration::from_millis(1));
            }
        }
    }

    /// Reaps the process and returns its end.
    fn reap(&mut self) -> Ending {
        use std::os::unix::process::ExitStatusExt;
        let clock = Clock::start();
        loop {
            match self.child.try_wait() {
                Ok(Some(status)) => {
                    return match (status.code(), status.signal()) {
                        (Some(code), _) => Ending::Exited(code),
                        (None, signal) => Ending::Signalled(signal.unwrap_or(0)),
                    };
                }
                Ok(None) if clock.elapsed() < REAP_TIMEOUT => thread::sleep(EXIT_POLL_INTERVAL / 4),
                // The process is killed but has not ended yet. Another thread waits for it, so that
                // it is reaped.
                Ok(None) => {
                    let pid = self.pid;
                    thread::spawn(move || waitpid(Some(pid), WaitOptions::empty()));
                    self.is_abandoned = true;
                    return Ending::Signalled(Signal::KILL.as_raw());
                }
                Err(_) => return Ending::Signalled(Signal::KILL.as_raw()),
            }
        }
    }
}

/// Ends the process even if the watcher panics.
impl Drop for Run {
    fn drop(&mut self) {
        if !self.is_abandoned
            && let Ok(None) = self.child.try_wait()
        {
            self.end_all();
            self.reap();
        }
    }
}

fn set_nonblocking(stream: impl AsFd) -> io::Result<()> {
    let flags = fcntl_getfl(&stream)?;
    fcntl_setfl(&stream, flags | OFlags::NONBLOCK)?;
    Ok(())
}

/// Reads once. Returns `true` if the stream is still open.
fn read_some(
    stream: &mut impl Read,
    buffer: &mut [u8],
    total: &mut usize,
    mut use_bytes: impl FnMut(&[u8]),
) -> bool {
    match stream.read(buffer) {
        Ok(0) => false,
        Ok(count) => {
            *total += count;
            use_bytes(&buffer[..count]);
            true
        }
        Err(error) => matches!(
            error.kind(),
            io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted
        ),
    }
}
