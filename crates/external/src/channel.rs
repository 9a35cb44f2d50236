//! Queue of plan texts from the reading thread to the validating thread.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Maximum number of queued plans. The oldest ones are dropped.
const MAX_QUEUED: usize = 64;
/// Maximum total length of the queued plans, in bytes.
const MAX_BYTES: usize = 64 << 20;

/// Queue that never blocks the writer, because the writing thread also enforces the time limit.
#[derive(Debug, Default)]
pub(super) struct PlanQueue {
    inner: Mutex<Inner>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct Inner {
    waiting: VecDeque<String>,
    bytes: usize,
    is_closed: bool,
}

/// Result of [`Mailbox::take`].
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Received {
    Text(String),
    /// Nothing arrived in time.
    TimedOut,
    /// The queue is closed and empty.
    Closed,
}

impl PlanQueue {
    pub(super) fn push(&self, text: String) {
        let mut inner = self.lock();
        inner.bytes += text.len();
        inner.waiting.push_back(text);
        while inner.waiting.len() > 1
            && (inner.waiting.len() > MAX_QUEUED || inner.bytes > MAX_BYTES)
        {
            let dropped = inner.waiting.pop_front().map_or(0, |text| text.len());
            inner.bytes -= dropped;
        }
        self.changed.notify_one();
    }

    pub(super) fn close(&self) {
        self.lock().is_closed = true;
        self.changed.notify_one();
    }

    /// Removes the next text, and waits for it for at most `patience`.
    pub(super) fn pop_timeout(&self, patience: Duration) -> Received {
        let inner = self.lock();
        let (mut inner, _) = self
            .changed
            .wait_timeout_while(inner, patience, |inner| {
                inner.waiting.is_empty() && !inner.is_closed
            })
            .unwrap_or_else(PoisonError::into_inner);
        match inner.waiting.pop_front() {
            Some(text) => {
                inner.bytes -= text.len();
                Received::Text(text)
            }
            None if inner.is_closed => Received::Closed,
            None => Received::TimedOut,
        }
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_queue_drops_oldest() {
        let mailbox = PlanQueue::default();
        for number in 0..1000 {
            mailbox.push(number.to_string());
        }
        mailbox.close();
        let mut taken = Vec::new();
        while let Received::Text(text) = mailbox.pop_timeout(Duration::ZERO) {
            taken.push(text);
        }
        assert_eq!(taken.len(), MAX_QUEUED);
        assert_eq!(taken.last().map(String::as_str), Some("999"));
        assert_eq!(mailbox.pop_timeout(Duration::ZERO), Received::Closed);
    }

    #[test]
    fn empty_queue_times_out() {
        assert_eq!(
            PlanQueue::default().pop_timeout(Duration::ZERO),
            Received::TimedOut
        );
    }
}
