//! Enforcement of the conditions of a plan.

use serde::{Deserialize, Serialize};

/// The number of conditions of a plan, by the mechanism that enforces them inside the envelope.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Conditions {
    /// Bounds on the difference of two times: the plan's network implies them.
    pub differences: usize,
    /// Conditions on numbers, and on several differences at once: every schedule of the network
    /// satisfies them.
    pub all_schedules: usize,
    /// Bounds added to the network for the dispatcher to enforce
    /// ([`EnvelopeRequest::enforce`](super::EnvelopeRequest::enforce)).
    pub enforced: usize,
}

impl Conditions {
    /// Combines the oracle's counts with the number of added bounds.
    pub(super) fn new(met: elbowroom_envelope::soundness::Conditions, enforced: usize) -> Self {
        Self {
            differences: met.differences,
            all_schedules: met.all_schedules,
            enforced,
        }
    }
}
