//! An answer from the library, or what is known when there is no more time for one.

use std::ops::ControlFlow;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use elbowroom::answers::{Halt, Watcher};

use crate::stopwatch::Stopwatch;

/// How often the clock is looked at.
const TICK: Duration = Duration::from_millis(10);
/// How long the library has for an answer when its time is up: more than most of its steps take.
const GRACE: Duration = Duration::from_millis(50);
/// As much as the main thread has.
const STACK: usize = 64 << 20;

/// What `work` answers, or `so_far` soon after its time is up or somebody pressed Ctrl-C. The library
/// looks at the clock between its steps, and a single step can take long; so it works on a thread of
/// its own.
pub(crate) fn in_time<T: Send + 'static>(
    mut stopwatch: Stopwatch,
    work: impl FnOnce() -> T + Clone + Send + 'static,
    so_far: impl FnOnce(Halt) -> T,
) -> T {
    let (sender, receiver) = mpsc::channel();
    let theirs = work.clone();
    let worker = thread::Builder::new().stack_size(STACK).spawn(move || {
        // Nobody listens any more when there was no time left.
        let _ = sender.send(theirs());
    });
    if worker.is_err() {
        // A system without threads to spare: the limit is kept between the steps.
        return work();
    }
    loop {
        match receiver.recv_timeout(TICK) {
            Ok(answer) => return answer,
            // A thread that is gone without an answer has panicked, which has ended the program.
            Err(RecvTimeoutError::Disconnected) => return work(),
            Err(RecvTimeoutError::Timeout) => {}
        }
        if let ControlFlow::Break(halt) = stopwatch.flow() {
            let last = receiver.recv_timeout(GRACE);
            return last.unwrap_or_else(|_| so_far(halt));
        }
    }
}
