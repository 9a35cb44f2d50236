//! Concurrent strands of work, with results that do not depend on the number of threads.
//!
//! A strand is a piece of work that is independent of the others. Its reports are processed strand
//! by strand, in their order, as if the strands had run one after the other. With several threads,
//! later strands run in the meantime. So the receiver gets the same reports in the same order, and
//! can stop the work at the same report.

use super::worker::Report;

/// Callback for each report. Returns `false` to stop.
pub(super) type ReportCallback<'t> = &'t mut dyn FnMut(Report) -> bool;

/// A strand. Its reports are ignored after it was stopped.
pub(super) type Job<'s, R> = Box<dyn FnOnce(ReportCallback<'_>) -> R + Send + 's>;

/// Runs the strands. Strands whose turn has not come use at most `ahead` bytes each. `on_report` is
/// called on this thread with the number of the strand. When it returns `false`, all strands end,
/// and the results of later strands are dropped.
///
/// Returns the results in order: those of all strands, unless `on_report` has returned `false`.
pub(super) fn run_parallel<R: Send>(
    jobs: Vec<Job<'_, R>>,
    (threads, ahead): (usize, usize),
    on_report: &mut dyn FnMut(usize, Report) -> bool,
) -> Vec<R> {
    #[cfg(not(target_family = "wasm"))]
    if threads > 1 && jobs.len() > 1 {
        return threaded::run_threads(jobs, (threads, ahead), on_report);
    }
    #[cfg(target_family = "wasm")]
    let _ = (threads, ahead);
    let mut may_continue = true;
    let mut results = Vec::new();
    for (number, job) in jobs.into_iter().enumerate() {
        let result = job(&mut |report| {
            may_continue = may_continue && on_report(number, report);
            may_continue
        });
        results.push(result);
        if !may_continue {
            break;
        }
    }
    results
}

#[cfg(not(target_family = "wasm"))]
mod threaded {
    use std::collections::VecDeque;
    use std::sync::mpsc::{Sender, channel};
    use std::sync::{Arc, Condvar, Mutex, PoisonError};
    use std::thread;

    use super::{Job, Report};

    /// Message from a strand.
    enum Message<R> {
        Report(Report),
        Result(R),
    }

    /// A strand that has not begun, its number, and the channel for its messages.
    type PendingWorker<'s, R> = (usize, Job<'s, R>, Sender<Message<R>>);

    /// The number of the strand whose reports are processed; `None` if all strands must end.
    struct Turn {
        number: Mutex<Option<usize>>,
        changed: Condvar,
    }

    impl Turn {
        fn set(&self, number: Option<usize>) {
            *self.number.lock().unwrap_or_else(PoisonError::into_inner) = number;
            self.changed.notify_all();
        }

        fn get(&self) -> Option<usize> {
            *self.number.lock().unwrap_or_else(PoisonError::into_inner)
        }

        /// Waits for the turn of that strand, or for the end of all.
        fn wait(&self, strand: usize) {
            let turn = self.number.lock().unwrap_or_else(PoisonError::into_inner);
            let is_early = |turn: &mut Option<usize>| turn.is_some_and(|turn| turn < strand);
            drop(
                self.changed
                    .wait_while(turn, is_early)
                    .unwrap_or_else(PoisonError::into_inner),
            );
        }
    }

    /// Ends all strands when dropped, even in a panic, so that no thread waits for ever.
    struct StopOnDrop<'t>(&'t Turn);

    impl Drop for StopOnDrop<'_> {
        fn drop(&mut self) {
            self.0.set(None);
        }
    }

    /// Does the same as [`run_parallel`](super::run_parallel) with several threads. The calling
    /// thread only receives reports, because `on_report` may be bound to it.
    pub(super) fn run_threads<R: Send>(
        jobs: Vec<Job<'_, R>>,
        (threads, ahead): (usize, usize),
        on_report: &mut dyn FnMut(usize, Report) -> bool,
    ) -> Vec<R> {
        let workers = threads.min(jobs.len());
        let mut queue = VecDeque::new();
        let mut receivers = Vec::new();
        for (number, job) in jobs.into_iter().enumerate() {
            let (sender, receiver) = channel();
            queue.push_back((number, job, sender));
            receivers.push(receiver);
        }
        // Only the workers own the queue: if one of them panics, its senders are dropped and the
        // receivers do not block.
        let queue: Arc<Mutex<VecDeque<PendingWorker<'_, R>>>> = Arc::new(Mutex::new(queue));
        let turn = &Turn {
            number: Mutex::new(Some(0)),
            changed: Condvar::new(),
        };
        let mut results = Vec::new();
        thread::scope(|scope| {
            let _ending = StopOnDrop(turn);
            for _ in 0..workers {
                let queue = Arc::clone(&queue);
                scope.spawn(move || work(&queue, turn, ahead));
            }
            drop(queue);
            for (number, receiver) in receivers.iter().enumerate() {
                turn.set(Some(number));
                while let Ok(message) = receiver.recv() {
                    match message {
                        Message::Report(report) => {
                            if !on_report(number, report) {
                                return;
                            }
                        }
                        Message::Result(result) => results.push(result),
                    }
                }
            }
        });
        results
    }

    fn work<R>(queue: &Mutex<VecDeque<PendingWorker<'_, R>>>, turn: &Turn, ahead: usize) {
        while turn.get().is_some() {
            let next = queue
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .pop_front();
            let Some((number, job, sender)) = next else {
                return;
            };
            let result = job(&mut |report| {
                if report.counts.memory > ahead {
                    turn.wait(number);
                }
                // If the receiver is gone, the work is over.
                let is_heard = sender.send(Message::Report(report)).is_ok();
                is_heard && turn.get().is_some()
            });
            let _ = sender.send(Message::Result(result));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns jobs; strand `n` reports `n + 3` times, and returns the number of its reports.
    fn jobs<'s>() -> Vec<Job<'s, (usize, u64)>> {
        let job = |number: usize| -> Job<'s, (usize, u64)> {
            Box::new(move |on_report: ReportCallback<'_>| {
                let mut made = 0;
                while made < number as u64 + 3 {
                    made += 1;
                    let mut report = Report::default();
                    report.counts.evaluated = made;
                    report.counts.memory = number;
                    if !on_report(report) {
                        break;
                    }
                }
                (number, made)
            })
        };
        (0..5).map(job).collect()
    }

    #[test]
    fn reports_are_independent_of_thread_count() {
        for most in 1..30 {
            let run = |threads, ahead| {
                let mut heard = Vec::new();
                let results = run_parallel(jobs(), (threads, ahead), &mut |number, report| {
                    heard.push((number, report.counts.evaluated));
                    heard.len() < most
                });
                let whole = (heard.len() < most).then_some(results);
                (heard, whole)
            };
            let alone = run(1, 0);
            assert_eq!(alone.0.len(), most.min(25));
            for threads in [2, 3, 8] {
                for ahead in [0, 2, 100] {
                    let other = run(threads, ahead);
                    assert_eq!(other, alone, "{threads} threads, {most} reports");
                }
            }
        }
    }
}
