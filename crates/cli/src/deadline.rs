//! Computations of the library with a time limit and Ctrl-C.

use std::ops::ControlFlow;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use elbowroom::answers::{Observer, StopRequest};

use crate::time_limit::Stopwatch;

/// Interval between checks of the time limit and Ctrl-C.
const POLL_INTERVAL: Duration = Duration::from_millis(10);
/// Grace period for an answer after the time limit; longer than most steps of the library take.
const GRACE_PERIOD: Duration = Duration::from_millis(50);
/// Stack size of the worker, in bytes: that of the main thread.
const STACK_SIZE: usize = 64 << 20;

/// Returns the result of `work`, or that of `so_far` shortly after the time limit or Ctrl-C. The
/// library checks the time only between its steps, and a single step can take long, so `work` runs
/// on its own thread.
pub(crate) fn run_with_deadline<T: Send + 'static>(
    mut stopwatch: Stopwatch,
    work: impl FnOnce() -> T + Clone + Send + 'static,
    so_far: impl FnOnce(StopRequest) -> T,
) -> T {
    let (sender, receiver) = mpsc::channel();
    let theirs = work.clone();
    let worker = thread::Builder::new()
        .stack_size(STACK_SIZE)
        .spawn(move || {
            // After the time limit, the receiver is gone.
            let _ = sender.send(theirs());
        });
    if worker.is_err() {
        // No thread is available: the limit is checked between steps only.
        return work();
    }
    loop {
        match receiver.recv_timeout(POLL_INTERVAL) {
            Ok(answer) => return answer,
            // The thread has ended without an answer: it panicked, which has ended the program.
            Err(RecvTimeoutError::Disconnected) => return work(),
            Err(RecvTimeoutError::Timeout) => {}
        }
        if let ControlFlow::Break(halt) = stopwatch.flow() {
            let last = receiver.recv_timeout(GRACE_PERIOD);
            return last.unwrap_or_else(|_| so_far(halt));
        }
    }
}
