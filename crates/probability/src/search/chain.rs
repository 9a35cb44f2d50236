//! Markov chain of one fact under spontaneous changes, relative to a required truth value.

use crate::likelihoods::SpontaneousChange;

/// Spontaneous changes of a fact, relative to the required truth value.
#[derive(Clone, Copy)]
pub(super) struct Chain(SpontaneousChange);

impl Chain {
    pub(super) fn of(flip: SpontaneousChange, truth: bool) -> Self {
        Self(if truth {
            flip
        } else {
            SpontaneousChange {
                becomes_true: flip.becomes_false,
                becomes_false: flip.becomes_true,
            }
        })
    }

    /// Returns the probability that the required truth value is lost in one step.
    pub(super) fn fails(self) -> f64 {
        self.0.becomes_false
    }

    /// Returns `true` if probabilities converge monotonically.
    pub(super) fn is_steady(self) -> bool {
        self.0.becomes_true + self.0.becomes_false <= 1.0
    }

    /// Returns the greatest probability after at least `steps` steps.
    ///
    /// Probabilities converge to `becomes_true / (becomes_true + becomes_false)` from one side,
    /// unless the sum of the two is greater than 1; then they oscillate.
    pub(super) fn best_after(self, p: f64, steps: usize) -> f64 {
        let SpontaneousChange {
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
