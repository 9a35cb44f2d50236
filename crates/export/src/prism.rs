//! Decision processes in the language of PRISM, for Storm and PRISM.
//!
//! - [`untimed`]: the process of a problem with likelihoods, without time. Its greatest probability
//!   of reaching the goal is the optimum of [`optimum`](elbowroom_probability::optimum).
//! - [`timed`]: the process of a problem in a world, with its clock divided into cells. Its value
//!   bounds the success probability of the best executor without foresight ([`elbowroom_mdp`]).
//!
//! Both are written from the actions' conditions and effects; the model checker enumerates the
//! states. Probabilities are decimal numbers with all their digits, so that tools with exact
//! arithmetic return exact answers.

mod dead_ends;
mod formula;
mod timed;
mod untimed;

use elbowroom_mdp::NotTabulated;
use elbowroom_probability::Unsupported;
use elbowroom_probability::likelihoods::Missing;
use elbowroom_probability::optimum::TabulationError;

pub use timed::{Bound, timed};
pub use untimed::untimed;

/// Maximum number of commands: model checkers evaluate each of them in each state.
pub const MAX_COMMANDS: usize = 20_000;

/// Reasons why no process is written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PrismError {
    /// The problem has time or numbers.
    #[error(transparent)]
    Unsupported(#[from] Unsupported),
    /// Likelihoods are missing.
    #[error(transparent)]
    Missing(#[from] Missing),
    /// There are too many states to find the dead ends.
    #[error(transparent)]
    NotSmall(#[from] TabulationError),
    /// The world has no timed optimum.
    #[error(transparent)]
    NotTabulated(#[from] NotTabulated),
    /// The world has facts that change at a rate, and thus repeatedly.
    #[error(
        "the world has facts that change by themselves at a rate ([[hazard]]), but the export \
         supports only events that happen at most once; `elbowroom compare` with `optimum = true` \
         supports rates"
    )]
    Rates,
    /// The problem has changing numbers in conditions.
    #[error(
        "the problem has relevant numbers that change, but the export supports only facts; \
         `elbowroom compare` with `optimum = true` supports numbers"
    )]
    Numbers,
    /// Failures have several outcomes, or take time.
    #[error(
        "the world has failures with several outcomes or with delays ([[failure.outcome]]), but \
         the export supports only failures with the same effects; `elbowroom compare` with \
         `optimum = true` supports outcomes"
    )]
    Outcomes,
    /// Likelihoods are rates per second.
    #[error(
        "the likelihoods have rates per second, but the process without time has only steps: give \
         `becomes_true` and `becomes_false` instead, and `end` instead of `during_per_second`"
    )]
    Seconds,
    /// The process has too many commands.
    #[error(
        "the process has {commands} commands, more than the limit of {most}: give fewer --cells, \
         or a problem with fewer actions",
        most = MAX_COMMANDS
    )]
    TooLarge {
        /// Number of commands.
        commands: usize,
    },
    /// The number of cells is out of range.
    #[error("expected 1 to 65533 cells, found {cells}")]
    Cells {
        /// The requested number.
        cells: usize,
    },
    /// A run has a limited number of steps.
    #[error("the export does not support a horizon: remove it")]
    Horizon,
}

/// Returns the text, unless it has too many commands.
fn checked(text: String) -> Result<String, PrismError> {
    let commands = text.lines().filter(|line| line.contains(" -> ")).count();
    if commands > MAX_COMMANDS {
        return Err(PrismError::TooLarge { commands });
    }
    Ok(text)
}

/// Returns a name without parentheses, for comments and names of variables.
fn bare(name: &str) -> &str {
    name.trim_start_matches('(').trim_end_matches(')')
}
