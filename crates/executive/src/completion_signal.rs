//! Signal from background workers to the run: a plan is made or prepared.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Signal that a background task is complete. Clones share the same signal.
#[derive(Clone, Default)]
pub struct CompletionSignal(Arc<Inner>);

#[derive(Default)]
struct Inner {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    /// Completion flag and kind of the awaited task; `None` if the signal is disarmed.
    awaited: Option<(Arc<AtomicBool>, Completion)>,
    /// `true` until the first wait after arming.
    is_new: bool,
}

/// Kind of a completed task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Completion {
    /// A plan is made.
    PlanMade,
    /// A plan is prepared for its executor.
    PlanReady,
}

/// Timeout of the first wait for a preparation. Most preparations are complete by then, and the run continues without
/// another question to the world.
const SHORT_WAIT: Duration = Duration::from_millis(2);

/// Guard of a background task. Reports completion when dropped, even after a panic of its thread.
pub struct NotifyOnDrop {
    is_done: Arc<AtomicBool>,
    signal: CompletionSignal,
}

impl Drop for NotifyOnDrop {
    fn drop(&mut self) {
        self.is_done.store(true, Ordering::SeqCst);
        // A waiting thread holds the lock until it waits.
        drop(self.signal.lock());
        self.signal.0.changed.notify_all();
    }
}

impl CompletionSignal {
    fn lock(&self) -> MutexGuard<'_, State> {
        let state = self.0.state.lock();
        state.unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns a guard for a new task, and its completion flag for [`CompletionSignal::arm`].
    pub fn guard(&self) -> (NotifyOnDrop, Arc<AtomicBool>) {
        let is_done = Arc::new(AtomicBool::new(false));
        let guard = NotifyOnDrop {
            is_done: Arc::clone(&is_done),
            signal: self.clone(),
        };
        (guard, is_done)
    }

    /// Waits for this task instead of any other.
    pub fn arm(&self, is_done: Arc<AtomicBool>, completion: Completion) {
        let mut state = self.lock();
        state.awaited = Some((is_done, completion));
        state.is_new = true;
    }

    /// Waits for no task.
    pub fn disarm(&self) {
        self.lock().awaited = None;
    }

    /// Returns `true` if the signal is armed and its completion has not been polled.
    pub fn is_awaited(&self) -> bool {
        self.lock().awaited.is_some()
    }

    /// Returns the completion of the awaited task, once, or `None` if it is not complete.
    pub fn poll(&self) -> Option<Completion> {
        let mut state = self.lock();
        if !state.is_complete() {
            return None;
        }
        state.awaited.take().map(|(_, completion)| completion)
    }

    /// Like [`CompletionSignal::poll`], for preparations. The first call after arming waits up to 2 ms.
    pub fn poll_timeout(&self) -> Option<Completion> {
        let mut state = self.lock();
        let is_new = std::mem::take(&mut state.is_new);
        let is_readying = matches!(state.awaited, Some((_, Completion::PlanReady)));
        drop(state);
        if !is_new || !is_readying {
            return None;
        }
        self.wait(SHORT_WAIT);
        self.poll()
    }

    /// Waits until the awaited task is complete, for at most `at_most`.
    pub fn wait(&self, at_most: Duration) {
        let state = self.lock();
        let waits = |state: &mut State| !state.is_complete();
        let waited = self.0.changed.wait_timeout_while(state, at_most, waits);
        drop(waited);
    }
}

impl State {
    fn is_complete(&self) -> bool {
        let awaited = self.awaited.as_ref();
        awaited.is_some_and(|(is_done, _)| is_done.load(Ordering::SeqCst))
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::{Completion, CompletionSignal};

    #[test]
    fn completion_is_reported_once_and_only_for_awaited_task() {
        let signal = CompletionSignal::default();
        let (guard, is_done) = signal.guard();
        assert!(!signal.is_awaited() && signal.poll().is_none());
        signal.arm(is_done, Completion::PlanMade);
        assert!(signal.is_awaited() && signal.poll().is_none());
        // A task that is not awaited.
        drop(signal.guard());
        signal.wait(Duration::from_millis(1));
        assert!(signal.poll().is_none() && signal.poll_timeout().is_none());
        let thread = std::thread::spawn(move || {
            let _notifies = guard;
        });
        thread.join().expect("it ends");
        signal.wait(Duration::from_secs(60));
        assert_eq!(signal.poll(), Some(Completion::PlanMade));
        assert!(signal.poll().is_none() && !signal.is_awaited());
        let (guard, is_done) = signal.guard();
        drop(guard);
        signal.arm(is_done, Completion::PlanMade);
        signal.disarm();
        assert!(signal.poll().is_none());
    }

    #[test]
    fn short_preparation_is_awaited_once() {
        let signal = CompletionSignal::default();
        let (guard, is_done) = signal.guard();
        signal.arm(is_done, Completion::PlanReady);
        // Only the first call waits.
        assert!(signal.poll_timeout().is_none() && signal.is_awaited());
        drop(guard);
        assert!(signal.poll_timeout().is_none());
        assert_eq!(signal.poll(), Some(Completion::PlanReady));
        let (guard, is_done) = signal.guard();
        signal.arm(is_done, Completion::PlanReady);
        drop(guard);
        assert_eq!(signal.poll_timeout(), Some(Completion::PlanReady));
    }
}
