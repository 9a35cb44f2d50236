//! Resource limits of a planner.

use std::path::PathBuf;
use std::time::Duration;

/// Settings for running a planner.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The time limit.
    pub time_limit: Option<Duration>,
    /// Limit of the processor time of all its processes together. Independent of the load of the
    /// machine; Linux only.
    pub work_limit: Option<Duration>,
    /// Limit of the memory of all its processes together, in bytes.
    pub memory_limit: Option<u64>,
    /// Parent of its folder; the system's temporary folder by default.
    pub scratch: Option<PathBuf>,
}

impl Default for Settings {
    /// No limits.
    fn default() -> Self {
        Self {
            time_limit: None,
            work_limit: None,
            memory_limit: None,
            scratch: None,
        }
    }
}
