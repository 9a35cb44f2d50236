//! Plan texts on their way from the thread that reads to the one that judges.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// More plans do not wait to be judged; the oldest give way.
const MOST_WAITING: usize = 64;
/// More text neither.
const MOST_BYTES: usize = 64 << 20;

/// A queue that never blocks who writes, because that thread also keeps the time.
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

/// The result of reading the mailbox.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Mail {
    Text(String),
    /// Nothing came in time.
    Nothing,
    /// Nothing will come any more.
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

    /// The next text, waiting for it as long as `patience` at most.
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
