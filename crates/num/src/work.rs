//! Counts the work of a thread, equally on every machine.
//!
//! A computation with a budget cannot read a clock if its answer must not depend on the speed of
//! the machine. Slow operations count their work here, and computations with a budget read the sum:
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
//!
//! Such computations can also be interrupted: they poll [`is_stopped`], and return their
//! intermediate result once the thread's [`Stop`] has been requested.

use std::cell::{Cell, RefCell};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

thread_local! {
    static SPENT: Cell<u64> = const { Cell::new(0) };
    static STOP: RefCell<Option<Stop>> = const { RefCell::new(None) };
}

/// Request that computations end early. Clones are the same request.
///
/// ```
/// use elbowroom_num::work::{self, Stop};
///
/// let stop = Stop::default();
/// stop.install_for_thread();
/// assert!(!work::is_stopped());
/// stop.request();
/// assert!(work::is_stopped() && work::Budget::new(1_000).is_spent());
/// ```
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Requests that the computations of all threads that obey it end early. Cannot be undone.
    pub fn request(&self) {
        self.0.store(true, Ordering::SeqCst);
    }

    /// Returns `true` if it has been requested.
    pub fn is_requested(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }

    /// Makes computations of this thread obey this request instead of any other.
    ///
    /// Threads that are started later do not inherit it: pass [`Stop::current`] on to them.
    pub fn install_for_thread(&self) {
        STOP.set(Some(self.clone()));
    }

    /// Makes computations of this thread obey no request. Returns the one that they obeyed.
    pub fn uninstall_for_thread() -> Option<Self> {
        STOP.take()
    }

    /// Returns the request that computations of this thread obey.
    pub fn current() -> Option<Self> {
        STOP.with_borrow(Clone::clone)
    }
}

impl PartialEq for Stop {
    /// Returns `true` if they are the same request.
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Eq for Stop {}

/// Returns `true` if computations of this thread should end early: see [`Stop`].
pub fn is_stopped() -> bool {
    STOP.with_borrow(|stop| stop.as_ref().is_some_and(Stop::is_requested))
}

/// Counts work of this thread.
pub fn spend(units: u64) {
    SPENT.set(SPENT.get().saturating_add(units));
}

/// Returns the work of this thread since an arbitrary time in the past. Only differences are
/// meaningful.
pub fn spent() -> u64 {
    SPENT.get()
}

/// Work limit of this thread, which counts from the creation of the budget.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    begin: u64,
    units: u64,
}

impl Budget {
    /// Creates a budget of this number of units; [`u64::MAX`] has no limit.
    pub fn new(units: u64) -> Self {
        Self {
            begin: spent(),
            units,
        }
    }

    /// Returns the work since the budget was created.
    pub fn used(&self) -> u64 {
        spent().saturating_sub(self.begin)
    }

    /// Returns the remaining units.
    pub fn remaining(&self) -> u64 {
        self.units.saturating_sub(self.used())
    }

    /// Returns `true` if nothing is left, or if the thread's computations should end early ([`is_stopped`]).
    pub fn is_spent(&self) -> bool {
        self.remaining() == 0 && self.units < u64::MAX || is_stopped()
    }
}

/// Executes a task, and counts exactly `units(&result)` for this thread: for tasks that are divided among threads.
pub fn with_fixed_cost<R>(task: impl FnOnce() -> R, units: impl FnOnce(&R) -> u64) -> R {
    let begin = spent();
    let result = task();
    SPENT.set(begin.saturating_add(units(&result)));
    result
}
