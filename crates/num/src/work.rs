//! Counts the work of a thread, equally on every machine.
//!
//! If a computation has a budget, but its answer must not depend on the speed of the machine, it cannot read a
//! clock. Slow operations count their work here, and computations with a budget read the sum:
//!
//! ```
//! use elbowroom_num::work;
//!
//! let budget = work::Budget::new(1_000);
//! while !budget.is_spent() {
//!     work::spend(300);
//! }
//! assert_eq!(budget.used(), 1_200);
//! ```
//!
//! One unit is about a nanosecond of one core of a machine of 2024.

use std::cell::Cell;

thread_local! {
    static SPENT: Cell<u64> = const { Cell::new(0) };
}

/// Counts work of this thread.
pub fn spend(units: u64) {
    SPENT.set(SPENT.get().saturating_add(units));
}

/// The work of this thread so far, since some time in the past. Only differences mean something.
pub fn spent() -> u64 {
    SPENT.get()
}

/// A work limit of this thread, which counts from the creation of the budget.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    begin: u64,
    units: u64,
}

impl Budget {
    /// A budget of this number of units; [`u64::MAX`] is never spent.
    pub fn new(units: u64) -> Self {
        Self {
            begin: spent(),
            units,
        }
    }

    /// The work since the budget was made.
    pub fn used(&self) -> u64 {
        spent().saturating_sub(self.begin)
    }

    /// The units that are left.
    pub fn left(&self) -> u64 {
        self.units.saturating_sub(self.used())
    }

    /// Returns `true` if nothing is left.
    pub fn is_spent(&self) -> bool {
        self.left() == 0 && self.units < u64::MAX
    }
}

/// Executes a task, and counts exactly `units(&result)` for this thread: for tasks that are divided among threads.
pub fn counted_as<R>(task: impl FnOnce() -> R, units: impl FnOnce(&R) -> u64) -> R {
    let begin = spent();
    let result = task();
    SPENT.set(begin.saturating_add(units(&result)));
    result
}
