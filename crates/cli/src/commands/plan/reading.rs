//! Reads the problem within the limits of the search.

use std::ops::ControlFlow;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use elbowroom::answers::{Halt, Watcher};

use super::watch::Watch;
use crate::args::PlanArgs;
use crate::exit::Failure;
use crate::input::{self, ReadProblem};
use crate::output::Output;

/// As much as the main thread has: files nest.
const STACK: usize = 16 << 20;

/// Interval between calls of the watch.
const QUESTION: Duration = Duration::from_millis(10);

/// Reads domain, problem and calendar, as long as the watch says so. Warnings go to standard error.
///
/// It is done on a thread of its own, which ends with the process: so a limit holds whatever takes
/// its time, also a file that never comes to its end.
///
/// # Errors
/// When there is something wrong with the files.
pub(super) fn read(
    arguments: &PlanArgs,
    watch: &mut Watch,
    output: &mut Output,
) -> Result<Result<ReadProblem, Halt>, Failure> {
    let (sender, receiver) = mpsc::channel();
    let (files, epsilon) = (arguments.problem.clone(), arguments.epsilon.clone());
    let read = move || {
        // Nobody listens any longer once time is up.
        let _ = sender.send(input::read(&files, &epsilon));
    };
    thread::Builder::new()
        .stack_size(STACK)
        .spawn(read)
        .map_err(|error| Failure::new(format!("no thread to read files on: {error}"), ""))?;
    loop {
        match receiver.recv_timeout(QUESTION) {
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
