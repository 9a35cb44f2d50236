//! Where an order's probability is lost: [`Loss`].

use elbowroom_model::ground::{Condition, FactId};
use elbowroom_plan::InstanceId;

/// A share of all worlds that is lost at one place of an order.
#[derive(Clone, Debug, PartialEq)]
pub struct Loss {
    /// The position in the order of the happening after whose beginning it is lost; `None` before
    /// the first, where something is under way.
    pub position: Option<usize>,
    /// The reading at which it is lost.
    pub reading: Reading,
    /// The condition that failed.
    pub cause: LossCause,
    /// How many of all worlds are lost: a probability. Those of all losses of an order and its
    /// P(A ∩ G) add up to 1.
    pub mass: f64,
}

/// The reading of the state that a loss is due to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// The conditions of the happening.
    OnArrival,
    /// An over-all condition of an action under way, after the happening; or, for
    /// [`LossCause::During`], the action itself, before it.
    Throughout(InstanceId),
    /// The goal, after the last happening.
    Goal,
}

/// Why worlds are lost.
#[derive(Clone, Debug, PartialEq)]
pub enum LossCause {
    /// The attempt to start fails.
    Start,
    /// The end fails.
    End,
    /// An action fails while it is under way: that of [`Reading::Throughout`].
    During,
    /// A fact does not have the truth that is needed.
    Fact {
        /// Which one.
        fact: FactId,
        /// The truth it should have.
        truth: bool,
    },
    /// A condition on numbers, or on several facts at once, does not hold.
    Condition(Condition),
}

/// The losses so far, if they are kept.
#[derive(Clone, Debug, Default)]
pub(super) struct Ledger(Option<Vec<Loss>>);

impl Ledger {
    /// One that is kept.
    pub(super) fn kept() -> Self {
        Self(Some(Vec::new()))
    }

    /// Takes note of what is left of a probability, if less is.
    pub(super) fn note(
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

    /// The losses so far; no more are noted.
    pub(super) fn close(&mut self) -> Vec<Loss> {
        self.0.take().unwrap_or_default()
    }
}
