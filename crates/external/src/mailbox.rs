//! Queue of plan texts from the reading thread to the validating thread.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Maximum number of queued plans. The oldest ones are dropped.
const MOST_WAITING: usize = 64;
/// Maximum total length of the queued plans, in bytes.
const MOST_BYTES: usize = 64 << 20;

/// Queue that never blocks the writer, because the writing thread also enforces the time limit.
#[derive(Debug, Default)]
pub(super) struct Mailbox {
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
pub(super) enum Mail {
    Text(String),
    /// Nothing arrived in time.
    Nothing,
    /// The queue is closed and empty.
    Closed,
}

impl Mailbox {
    pub(super) fn put(&self, text: String) {
        let mut inner = self.lock();
        inner.bytes += text.len();
        inner.waiting.push_back(text);
        while inner.waiting.len() > 1
            && (inner.waiting.len() > MOST_WAITING || inner.bytes > MOST_BYTES)
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
    pub(super) fn take(&self, patience: Duration) -> Mail {
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
                Mail::Text(text)
            }
            None if inner.is_closed => Mail::Closed,
            None => Mail::Nothing,
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
    fn the_oldest_give_way_and_the_last_is_kept() {
        let mailbox = Mailbox::default();
        for number in 0..1000 {
            mailbox.put(number.to_string());
        }
        mailbox.close();
        let mut taken = Vec::new();
        while let Mail::Text(text) = mailbox.take(Duration::ZERO) {
            taken.push(text);
        }
        assert_eq!(taken.len(), MOST_WAITING);
        assert_eq!(taken.last().map(String::as_str), Some("999"));
        assert_eq!(mailbox.take(Duration::ZERO), Mail::Closed);
    }

    #[test]
    fn without_mail_one_waits_no_longer_than_one_is_patient() {
        assert_eq!(Mailbox::default().take(Duration::ZERO), Mail::Nothing);
    }
}
