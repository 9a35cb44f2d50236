//! Computation in a thread during the run: planning, and preparation of a plan.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread::{self, JoinHandle};

use elbowroom::num::work::Stop;

use crate::completion_signal::{Completion, CompletionSignal};

/// Computation in a thread. Dropping it cancels the computation.
///
/// Computations of the thread obey the stop request of the thread that started it.
pub(crate) struct BackgroundTask<T> {
    cancel: Stop,
    is_done: Arc<AtomicBool>,
    signal: CompletionSignal,
    thread: Option<JoinHandle<T>>,
}

impl<T: Send + 'static> BackgroundTask<T> {
    /// Starts `work` in a thread of this name. `work` receives the request to cancel it, and can end early then.
    /// Returns `None` if there is no thread.
    pub(crate) fn spawn(
        name: &str,
        signal: &CompletionSignal,
        work: impl FnOnce(&Stop) -> T + Send + 'static,
    ) -> Option<Self> {
        let cancel = Stop::default();
        let cancelled = cancel.clone();
        let (guard, is_done) = signal.guard();
        let run_stop = Stop::current();
        let thread = thread::Builder::new().name(name.to_owned());
        let thread = thread.spawn(move || {
            let _notifies = guard;
            run_stop.iter().for_each(Stop::install_for_thread);
            work(&cancelled)
        });
        Some(Self {
            cancel,
            is_done,
            signal: signal.clone(),
            thread: Some(thread.ok()?),
        })
    }

    /// Makes the signal report `completion` when this computation is complete.
    pub(crate) fn arm(&self, completion: Completion) {
        self.signal.arm(Arc::clone(&self.is_done), completion);
    }

    /// Waits for the result. Returns `None` if the thread panicked.
    pub(crate) fn join(mut self) -> Option<T> {
        self.thread.take()?.join().ok()
    }
}

impl<T> Drop for BackgroundTask<T> {
    fn drop(&mut self) {
        self.cancel.request();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;
    use std::time::Duration;

    use super::BackgroundTask;
    use crate::completion_signal::{Completion, CompletionSignal};

    /// Longer than any step takes.
    const LONG: Duration = Duration::from_secs(600);

    #[test]
    fn completion_is_signalled_and_result_is_returned() {
        let signal = CompletionSignal::default();
        let task = BackgroundTask::spawn("test", &signal, |_| 7).expect("a thread");
        task.arm(Completion::PlanMade);
        signal.wait(LONG);
        assert_eq!(signal.poll(), Some(Completion::PlanMade));
        assert_eq!(task.join(), Some(7));
    }

    #[test]
    fn dropped_task_is_cancelled() {
        let (sender, receiver) = channel();
        let task = BackgroundTask::spawn("test", &CompletionSignal::default(), move |cancel| {
            while !cancel.is_requested() {
                std::thread::yield_now();
            }
            let _ = sender.send(());
        });
        drop(task.expect("a thread"));
        assert_eq!(receiver.recv_timeout(LONG), Ok(()));
    }

    #[test]
    fn panic_counts_as_completion_without_result() {
        let signal = CompletionSignal::default();
        let task = BackgroundTask::<()>::spawn("test", &signal, |_| panic!("for this test"));
        let task = task.expect("a thread");
        task.arm(Completion::PlanReady);
        signal.wait(LONG);
        assert_eq!(signal.poll(), Some(Completion::PlanReady));
        assert_eq!(task.join(), None);
    }
}
