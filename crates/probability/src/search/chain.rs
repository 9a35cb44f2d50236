//! How likely one fact is to have the truth that is wanted, while it changes by itself.

use crate::likelihoods::Flip;

/// A fact changing by itself, seen from the truth that is wanted.
#[derive(Clone, Copy)]
pub(super) struct Chain(Flip);

impl Chain {
    pub(super) fn of(flip: Flip, truth: bool) -> Self {
        Self(if truth {
            flip
        } else {
            Flip {
                becomes_true: flip.becomes_false,
                becomes_false: flip.becomes_true,
            }
        })
    }

    /// How likely it is in one step that the truth that is wanted goes.
    pub(super) fn fails(self) -> f64 {
        self.0.becomes_false
    }

    /// Whether chances move to one side only.
    pub(super) fn is_steady(self) -> bool {
        self.0.becomes_true + self.0.becomes_false <= 1.0
    }

    /// The greatest chance after `steps` steps or more.
    ///
    /// Chances move towards `becomes_true / (becomes_true + becomes_false)` from one side, unless
    /// the two sum up to more than 1; then they jump from side to side.
    pub(super) fn best_after(self, p: f64, steps: usize) -> f64 {
        let Flip {
            becomes_true,
            becomes_false,
        } = self.0;
        let sum = becomes_true + becomes_false;
        if sum > 1.0 {
            return 1.0;
        }
        if sum <= 0.0 {
            return p;
        }
        let rest = becomes_true / sum;
        let decayed =
            rest + (p - rest) * (1.0 - sum).powi(i32::try_from(steps).unwrap_or(i32::MAX));
        decayed.max(rest)
    }
}
