//! Losses of an order's probability: [`Loss`].

use elbowroom_model::ground::{Condition, FactId};
use elbowroom_plan::InstanceId;

/// Share of all worlds that is lost at one position of an order.
#[derive(Clone, Debug, PartialEq)]
pub struct Loss {
    /// Position in the order of the happening at which it is lost; `None` before the first one, if
    /// actions are running.
    pub position: Option<usize>,
    /// The reading at which it is lost.
    pub reading: Reading,
    /// Cause of the loss.
    pub cause: LossCause,
    /// Lost share of all worlds: a probability. Those of all losses of an order and its P(A ∩ G)
    /// add up to 1.
    pub mass: f64,
}

/// Reading of the state that causes a loss.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// The conditions of the happening.
    OnArrival,
    /// An over-all condition of a running action, after the happening; or, for
    /// [`LossCause::During`], the action itself, before it.
    Throughout(InstanceId),
    /// The goal, after the last happening.
    Goal,
}

/// Cause of a loss.
#[derive(Clone, Debug, PartialEq)]
pub enum LossCause {
    /// The attempt to start fails.
    Start,
    /// The end fails.
    End,
    /// A running action fails: that of [`Reading::Throughout`].
    During,
    /// A fact does not have the required truth value.
    Fact {
        /// The fact.
        fact: FactId,
        /// The required truth value.
        truth: bool,
    },
    /// A condition on numbers, or on several facts at once, does not hold.
    Condition(Condition),
}

/// Losses until now, if they are recorded.
#[derive(Clone, Debug, Default)]
pub(super) struct Ledger(Option<Vec<Loss>>);

impl Ledger {
    /// Creates a ledger that records losses.
    pub(super) fn recording() -> Self {
        Self(Some(Vec::new()))
    }

    /// Records the loss, if the probability has decreased.
    pub(super) fn record(
        &mut self,
        position: Option<usize>,
        reading: Reading,
        (before, after): (f64, f64),
        cause: impl FnOnce() -> LossCause,
    ) {
        let Some(losses) = &mut self.0 else {
            return;
        };
        let mass = before - after;
        if mass > 0.0 {
            losses.push(Loss {
                position,
                reading,
                cause: cause(),
                mass,
            });
        }
    }

    /// Returns the losses and stops recording.
    pub(super) fn close(&mut self) -> Vec<Loss> {
        self.0.take().unwrap_or_default()
    }
}
