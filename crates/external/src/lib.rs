//! Other people's planners, as supervised processes.
//!
//! In: a task and a situation, the texts that it was read from, and a [`Planner`]: one of the
//! [`REGISTRY`], an engine of unified-planning (`up:NAME`), or any command line that says where
//! the files go. Out: a [`Report`] with one of the [`Outcome`]s, and meanwhile an [`Event`]
//! for each plan.
//!
//! The way through the module:
//!
//! 1. `registry`, `command`: which program to start with which arguments.
//! 2. `request`, `start`: the files that it gets. At the beginning of a task these are the user's
//!    own texts, to the letter; in mid-execution the problem is written anew
//!    ([`elbowroom_pddl::write_problem`]).
//! 3. `supervise`: the process. It has a process group, a folder and limits of its own, its output
//!    is read as it comes, and at the end nothing of it is left.
//! 4. `reader`, `log`: plans and telling phrases in what it prints. Memory stays bounded whatever
//!    that is.
//! 5. `run`, `judge`: each plan is judged before anyone sees it, and repaired where only its times
//!    are rounded.
//!
//! This is the one crate below the command line that looks at a clock, starts threads and processes
//! and writes files; hence it is a crate of its own. Processes are supervised on Unix systems; on
//! others, WebAssembly among them, the answer is [`Outcome::NotStarted`] before any of these is
//! touched. Memory limits, and finding children that left the process group, need Linux's `/proc`.
//!
//! ```
//! use elbowroom_external::{Planner, REGISTRY};
//!
//! assert!(REGISTRY.iter().any(|known| known.name == "popf"));
//! // Any program that prints a plan will do.
//! let planner = Planner::named("my-planner --first {domain} {problem}");
//! assert!(planner.is_ok());
//! # // A word alone is the name of a planner.
//! assert!(Planner::named("poppf").is_err());
//! ```

#![cfg_attr(
    not(unix),
    allow(
        dead_code,
        reason = "what supervises processes has no use where there are none"
    )
)]

mod clock;
mod command;
mod judge;
mod log;
mod mailbox;
mod outcome;
#[cfg(target_os = "linux")]
mod processes;
mod reader;
mod registry;
mod request;
mod run;
mod settings;
mod start;
mod supervise;
mod workspace;

pub use command::{Command, CommandError};
pub use judge::Repair;
pub use outcome::{Event, Found, Outcome, Report, Statistics};
pub use registry::{Habits, Kind, Planner, PlannerError, REGISTRY, Registered};
pub use request::{Question, Request};
pub use run::plan;
pub use settings::Settings;
pub use supervise::Ending;
