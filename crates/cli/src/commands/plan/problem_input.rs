//! Reading of the problem within the limits of the search.

use std::ops::ControlFlow;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use elbowroom::answers::{Observer, StopRequest};

use super::monitor::PlanMonitor;
use crate::args::PlanArgs;
use crate::exit::Failure;
use crate::input::{self, ReadProblem};
use crate::output::Output;

/// Stack size of the reading thread, in bytes: that of the main thread, because files are nested.
const STACK_SIZE: usize = 16 << 20;

/// Interval between calls of the watch.
const POLL_INTERVAL: Duration = Duration::from_millis(10);

/// Reads domain, problem and calendar until the watch ends the search. Warnings go to standard
/// error.
///
/// Reading happens on its own thread, which ends with the process. A limit therefore holds for any
/// file, including one without an end.
///
/// # Errors
/// If the files contain errors.
pub(super) fn read(
    arguments: &PlanArgs,
    watch: &mut PlanMonitor,
    output: &mut Output,
) -> Result<Result<ReadProblem, StopRequest>, Failure> {
    let (sender, receiver) = mpsc::channel();
    let (files, epsilon) = (arguments.problem.clone(), arguments.epsilon.clone());
    let read = move || {
        // After the time limit, the receiver is gone.
        let _ = sender.send(input::read(&files, &epsilon));
    };
    thread::Builder::new()
        .stack_size(STACK_SIZE)
        .spawn(read)
        .map_err(|error| Failure::new(format!("no thread to read files on: {error}"), ""))?;
    loop {
        match receiver.recv_timeout(POLL_INTERVAL) {
            Ok(read) => {
                let (read, warnings) = read?;
                output.warn_about(&warnings);
                return Ok(Ok(read));
            }
            Err(RecvTimeoutError::Timeout) => {
                if let ControlFlow::Break(halt) = watch.flow() {
                    return Ok(Err(halt));
                }
            }
            Err(RecvTimeoutError::Disconnected) => {
                unreachable!("the reader answers, or its panic ends the process")
            }
        }
    }
}
