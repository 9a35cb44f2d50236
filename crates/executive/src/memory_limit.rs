//! Limit on the resident memory of this process.

use std::fs;
use std::time::Duration;

use crate::clock::Clock;

/// Interval between two queries of the system. A query takes about ten microseconds.
const QUERY_INTERVAL: Duration = Duration::from_millis(5);

/// Limit on the memory of the process, relative to its memory when the limit was created.
///
/// Effective on Linux (`/proc`); never exceeded elsewhere.
pub struct MemoryLimit {
    /// Limit on the resident memory of the process, in bytes.
    max_bytes: u64,
    since_query: Clock,
    is_exceeded: bool,
}

impl MemoryLimit {
    /// Creates a limit of `more` bytes above the present memory.
    pub fn of(more: u64) -> Self {
        Self {
            max_bytes: resident().unwrap_or(0).saturating_add(more),
            since_query: Clock::start(),
            is_exceeded: false,
        }
    }

    /// Returns `true` if the limit is exceeded, or was at an earlier call.
    pub fn is_exceeded(&mut self) -> bool {
        if !self.is_exceeded && self.since_query.elapsed() >= QUERY_INTERVAL {
            self.since_query = Clock::start();
            self.is_exceeded = resident().is_some_and(|resident| resident > self.max_bytes);
        }
        self.is_exceeded
    }
}

/// Returns the resident memory of this process in bytes, or `None` if the system does not report it.
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

    use super::{MemoryLimit, QUERY_INTERVAL, resident};

    #[test]
    fn allocation_exceeds_limit_permanently() {
        if resident().is_none() {
            return;
        }
        let mut enough = MemoryLimit::of(4 << 30);
        let mut little = MemoryLimit::of(32 << 20);
        let taken = vec![1_u8; 128 << 20];
        thread::sleep(2 * QUERY_INTERVAL);
        assert!(little.is_exceeded());
        assert!(!enough.is_exceeded());
        assert_eq!(
            taken.iter().map(|&byte| u64::from(byte)).sum::<u64>(),
            128 << 20
        );
        drop(taken);
        thread::sleep(2 * QUERY_INTERVAL);
        assert!(little.is_exceeded(), "an exceeded limit stays exceeded");
    }
}
