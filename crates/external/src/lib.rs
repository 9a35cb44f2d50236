//! Third-party planners, as supervised processes.
//!
//! The input is a task and a situation, their texts, and a [`Planner`]: one of the [`REGISTRY`], an
//! engine of unified-planning (`up:NAME`), or any command line with placeholders for the files. The
//! output is a [`Report`] with one of the [`Outcome`]s, and an [`Event`] for each plan during the
//! run.
//!
//! The parts of the crate:
//!
//! 1. `registry`, `command`: the program to start and its arguments.
//! 2. `request`, `start`: its input files. At the beginning of a task these are the user's own
//!    texts, unchanged; in mid-execution a new problem is written
//!    ([`elbowroom_pddl::write_problem`]).
//! 3. `supervise`: the process. It has its own process group, folder and limits, its output is read
//!    as it is printed, and nothing of it remains at the end.
//! 4. `reader`, `log`: extraction of plans and known phrases from the output. Memory use is bounded
//!    for any output.
//! 5. `run`, `judge`: each plan is validated before it is reported, and repaired if only its times
//!    are rounded.
//!
//! This is the only crate below `elbowroom-executive` that reads a clock, starts processes and writes
//! files, and is therefore separate. Processes are supervised on Unix systems. On others, including
//! WebAssembly, the outcome is [`Outcome::NotStarted`] before any of these is used. Memory limits, and
//! the search for children that left the process group, need Linux's `/proc`.
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

mod channel;
mod clock;
mod command;
mod outcome;
mod output_parser;
mod plan_check;
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
pub use outcome::{Event, Found, Outcome, Report, Statistics};
pub use plan_check::Repair;
pub use registry::{ExitPhrases, Kind, Planner, PlannerError, REGISTRY, Registered};
pub use request::{Question, Request};
pub use run::plan;
pub use settings::Settings;
pub use supervise::Ending;
