//! Decision processes in the language of PRISM, for Storm and PRISM.
//!
//! - [`untimed`]: the process of a problem with likelihoods, without time, whose greatest
//!   probability of reaching the goal is the optimum of
//!   [`optimum`](elbowroom_probability::optimum).
//! - [`timed`]: the process of a problem in a world, with its clock cut into cells, whose value
//!   bounds what the best executor without foresight reaches ([`crate::timed`]).
//!
//! Both are written from the actions' conditions and effects; states are for the program that reads
//! the text to find. Probabilities are decimal numbers, with all their digits, so that what
//! calculates with fractions has an exact answer.

mod dead_ends;
mod formula;
mod timed;
mod untimed;

use elbowroom_probability::Unsupported;
use elbowroom_probability::likelihoods::Missing;
use elbowroom_probability::optimum::NotSmall;

use crate::timed::NotTabulated;

pub use timed::{Bound, timed};
pub use untimed::untimed;

/// More commands than this are not written: programs that read them look at each in each state.
pub const MOST_COMMANDS: usize = 20_000;

/// No process is written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PrismError {
    /// There is time or a number in the problem.
    #[error(transparent)]
    Unsupported(#[from] Unsupported),
    /// Likelihoods are missing.
    #[error(transparent)]
    Missing(#[from] Missing),
    /// There are too many states to say which of them are dead ends.
    #[error(transparent)]
    NotSmall(#[from] NotSmall),
    /// The world is one for which there is no timed optimum.
    #[error(transparent)]
    NotTabulated(#[from] NotTabulated),
    /// Facts change at a rate: again and again.
    #[error(
        "the world has facts that change by themselves at a rate ([[hazard]]), and only events that \
         happen at most once are written as a process; `elbowroom compare` with `optimum = true` \
         knows rates"
    )]
    Rates,
    /// Numbers change that conditions compare.
    #[error(
        "the problem has numbers that change and that matter, and only facts are written as a process; \
         `elbowroom compare` with `optimum = true` knows numbers"
    )]
    Numbers,
    /// Failures have several outcomes, or take time.
    #[error(
        "the world has failures with several outcomes or with delays ([[failure.outcome]]), and only \
         failures that all leave the same behind are written as a process; `elbowroom compare` with \
         `optimum = true` knows outcomes"
    )]
    Outcomes,
    /// Likelihoods are rates per second.
    #[error(
        "the likelihoods have rates per second, and the process without time has steps only: give \
         `becomes_true` and `becomes_false` instead, and `end` instead of `during_per_second`"
    )]
    Seconds,
    /// It has too many commands.
    #[error(
        "the process has {commands} commands, and {most} is the most that is written: say fewer \
         --cells, or take a problem with fewer actions",
        most = MOST_COMMANDS
    )]
    TooLarge {
        /// How many there are.
        commands: usize,
    },
    /// There is nothing to cut into so many cells.
    #[error("there can be 1 to 65533 cells, not {cells}")]
    Cells {
        /// How many were asked for.
        cells: usize,
    },
    /// A limit on the steps of a run.
    #[error("a process is written for runs of any length only: leave the horizon unlimited")]
    Horizon,
}

/// The lines of a text, without what makes it too large.
fn checked(text: String) -> Result<String, PrismError> {
    let commands = text.lines().filter(|line| line.contains(" -> ")).count();
    if commands > MOST_COMMANDS {
        return Err(PrismError::TooLarge { commands });
    }
    Ok(text)
}

/// A name as it stands in a comment, and from which names of variables are made.
fn bare(name: &str) -> &str {
    name.trim_start_matches('(').trim_end_matches(')')
}
