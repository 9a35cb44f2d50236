//! What a planner may use up.

use std::path::PathBuf;
use std::time::Duration;

/// Settings for running a planner.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The time limit.
    pub time_limit: Option<Duration>,
    /// How much processor time all its processes may use together. Holds as it stands on a busy
    /// machine too; Linux only.
    pub work_limit: Option<Duration>,
    /// How much memory all its processes may use together, in bytes.
    pub memory_limit: Option<u64>,
    /// Where its folder is made; by default where the system keeps temporary files.
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
