//! Strands of work side by side, such that nothing depends on how many threads there are.
//!
//! A strand is a piece of work that knows nothing of the others. What it reports is heard strand by
//! strand, in their order, as if they had been carried out one after the other; with several threads
//! the later ones have been at work meanwhile. So the same reports are heard in the same order, and
//! whoever hears them can end the work at the same one.

use super::strand::Report;

/// Told of each report; whether to go on.
pub(super) type Tell<'t> = &'t mut dyn FnMut(Report) -> bool;

/// A strand. Once it is told to stop, nobody listens to it any more.
pub(super) type Job<'s, R> = Box<dyn FnOnce(Tell<'_>) -> R + Send + 's>;

/// Carries the strands out. Those whose turn has not come keep no more than `ahead` bytes each. `hear` is asked on this thread, with the number of the strand; when it says
/// no, all is over, and the strands that come later are not asked for what they have found.
///
/// The results, in order; of all strands, if it has not been told to stop.
pub(super) fn side_by_side<R: Send>(
    jobs: Vec<Job<'_, R>>,
    (threads, ahead): (usize, usize),
    hear: &mut dyn FnMut(usize, Report) -> bool,
) -> Vec<R> {
    #[cfg(not(target_family = "wasm"))]
    if threads > 1 && jobs.len() > 1 {
        return threaded::carried_out(jobs, (threads, ahead), hear);
    }
    #[cfg(target_family = "wasm")]
    let _ = (threads, ahead);
    let mut goes_on = true;
    let mut results = Vec::new();
    for (number, job) in jobs.into_iter().enumerate() {
        let result = job(&mut |report| {
            goes_on = goes_on && hear(number, report);
            goes_on
        });
        results.push(result);
        if !goes_on {
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

    /// What a strand sends.
    enum Message<R> {
        Report(Report),
        Result(R),
    }

    /// A strand that has not begun, its number, and where it sends what it has to tell.
    type Waiting<'s, R> = (usize, Job<'s, R>, Sender<Message<R>>);

    /// The number of the strand that is listened to; `None` if all is over.
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

        /// Waits until it is the turn of that strand, or all is over.
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

    /// All is over when this is dropped, also in a panic: then nobody waits for ever.
    struct Ending<'t>(&'t Turn);

    impl Drop for Ending<'_> {
        fn drop(&mut self) {
            self.0.set(None);
        }
    }

    /// As [`side_by_side`](super::side_by_side), by several threads. This one only listens: whoever
    /// is asked may be tied to it.
    pub(super) fn carried_out<R: Send>(
        jobs: Vec<Job<'_, R>>,
        (threads, ahead): (usize, usize),
        hear: &mut dyn FnMut(usize, Report) -> bool,
    ) -> Vec<R> {
        let workers = threads.min(jobs.len());
        let mut queue = VecDeque::new();
        let mut receivers = Vec::new();
        for (number, job) in jobs.into_iter().enumerate() {
            let (sender, receiver) = channel();
            queue.push_back((number, job, sender));
            receivers.push(receiver);
        }
        // The workers alone own it: if one of them panics, nobody waits for what it would have done.
        let queue: Arc<Mutex<VecDeque<Waiting<'_, R>>>> = Arc::new(Mutex::new(queue));
        let turn = &Turn {
            number: Mutex::new(Some(0)),
            changed: Condvar::new(),
        };
        let mut results = Vec::new();
        thread::scope(|scope| {
            let _ending = Ending(turn);
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
                            if !hear(number, report) {
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

    fn work<R>(queue: &Mutex<VecDeque<Waiting<'_, R>>>, turn: &Turn, ahead: usize) {
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
                // Nobody may be listening any more: then all is over.
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

    /// Strand `n` reports `n + 3` times, and gives how many reports it made.
    fn jobs<'s>() -> Vec<Job<'s, (usize, u64)>> {
        let job = |number: usize| -> Job<'s, (usize, u64)> {
            Box::new(move |tell: Tell<'_>| {
                let mut made = 0;
                while made < number as u64 + 3 {
                    made += 1;
                    let mut report = Report::default();
                    report.counts.evaluated = made;
                    report.counts.memory = number;
                    if !tell(report) {
                        break;
                    }
                }
                (number, made)
            })
        };
        (0..5).map(job).collect()
    }

    #[test]
    fn the_same_is_heard_whatever_the_number_of_threads() {
        for most in 1..30 {
            let run = |threads, ahead| {
                let mut heard = Vec::new();
                let results = side_by_side(jobs(), (threads, ahead), &mut |number, report| {
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
