//! The options for calendar files.

use std::path::PathBuf;

use clap::Args;

/// A calendar file beside the problem.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct CalendarArgs {
    /// A calendar file (docs/reference/calendars.md): its dates and recurring windows become timed initials of
    /// the problem
    #[arg(long, value_name = "CALENDAR.toml")]
    pub(crate) calendar: Option<PathBuf>,
    /// Date of time 0, such as `2026-11-30T07:30`, or `now`, in place of the calendar's `begin`
    #[arg(long, value_name = "DATE", requires = "calendar")]
    pub(crate) begin: Option<String>,
}
