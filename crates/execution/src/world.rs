//! Port: worlds that execute plans.

use elbowroom_model::ground::{FactId, FluentId};
use elbowroom_num::Rational;

use crate::event::{Command, Observation};

/// A world that executes actions and reports observations: a simulation, a robot, a stored trace.
///
/// The contract:
///
/// - Each [`Command::Start`] is answered by a `Started` and, if the action has a duration, later by
///   one `Ended`. An instantaneous action is answered by `Started` alone, or by `Ended` with a
///   failure.
/// - A start that is refused is answered by an `Ended` with a failure, at once.
/// - Each [`Command::Cancel`] of a running action is answered by an `Ended`; if the action had
///   ended before the command came, that `Ended` is the answer.
/// - Time advances and never goes back: a wait without events ends at the requested time. Many
///   answers without progress of time indicate a broken world.
///
/// Worlds can violate the contract. The handling is defined in [`Run`](crate::run::Run): the run
/// never hangs, and no report is processed twice.
pub trait World: Send {
    /// Sends a command. Returns at once; the outcome is observed later.
    ///
    /// # Errors
    /// If the world is gone, or does not understand the command.
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError>;

    /// Waits until an event is observed, or until `until`.
    ///
    /// # Errors
    /// If the world is gone, or its answer cannot be read.
    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError>;

    /// Looks at facts and fluents, before the goal is accepted as reached. A world that cannot look
    /// returns no observations.
    ///
    /// # Errors
    /// As [`World::wait`].
    fn look(
        &mut self,
        _facts: &[FactId],
        _fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        Ok(Vec::new())
    }
}

/// Answer to a wait.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeAdvance {
    /// The present time.
    pub now: Rational,
    /// The observations since the last call, in the order of their reports.
    pub observations: Vec<Observation>,
}

/// The outside world failed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct WorldError {
    /// The error, with advice.
    pub message: String,
    /// `true` if the world can still receive commands. Its running actions are cancelled then.
    pub is_reachable: bool,
}

impl WorldError {
    /// Returns the error of a world that can receive no more commands.
    pub fn new(message: impl Into<String>) -> Self {
        Self {
            message: message.into(),
            is_reachable: false,
        }
    }

    /// Returns the same error of a world that can still receive commands.
    #[must_use]
    pub fn reachable(self) -> Self {
        let is_reachable = true;
        Self {
            is_reachable,
            ..self
        }
    }
}
