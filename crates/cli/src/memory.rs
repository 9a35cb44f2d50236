//! How much memory this process takes.

use std::fs;
use std::time::Duration;

use crate::clock::Clock;

/// How often the system is asked: it takes some ten microseconds.
const QUESTION: Duration = Duration::from_millis(5);

/// A limit on the memory that the process takes, beyond what it took when the limit was set.
///
/// It is kept where the system tells (Linux's `/proc`), and never reached elsewhere.
pub(crate) struct MemoryLimit {
    /// In bytes, of the whole process.
    most: u64,
    asked: Clock,
    is_exceeded: bool,
}

impl MemoryLimit {
    /// A limit of so many bytes more.
    pub(crate) fn of(more: u64) -> Self {
        Self {
            most: resident().unwrap_or(0).saturating_add(more),
            asked: Clock::start(),
            is_exceeded: false,
        }
    }

    /// Whether it is exceeded, or was when somebody asked.
    pub(crate) fn is_exceeded(&mut self) -> bool {
        if !self.is_exceeded && self.asked.elapsed() >= QUESTION {
            self.asked = Clock::start();
            self.is_exceeded = resident().is_some_and(|resident| resident > self.most);
        }
        self.is_exceeded
    }
}

/// How much of this process is in memory, in bytes.
fn resident() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kilobytes: u64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kilobytes << 10)
}

#[cfg(test)]
mod tests {
    use std::thread;

    use super::{MemoryLimit, QUESTION, resident};

    #[test]
    fn a_limit_is_exceeded_by_what_is_taken_and_not_before() {
        if resident().is_none() {
            return;
        }
        let mut enough = MemoryLimit::of(4 << 30);
        let mut little = MemoryLimit::of(32 << 20);
        let taken = vec![1_u8; 128 << 20];
        thread::sleep(2 * QUESTION);
        assert!(little.is_exceeded());
        assert!(!enough.is_exceeded());
        assert_eq!(
            taken.iter().map(|&byte| u64::from(byte)).sum::<u64>(),
            128 << 20
        );
        drop(taken);
        thread::sleep(2 * QUESTION);
        assert!(little.is_exceeded(), "what was told once is not taken back");
    }
}
