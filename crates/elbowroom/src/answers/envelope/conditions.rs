//! How the conditions that a plan has to meet are met.

use serde::{Deserialize, Serialize};

/// The number of conditions of a plan, by what enforces them inside the envelope.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Conditions {
    /// Bounds on the difference of two times: the plan's network implies them.
    pub differences: usize,
    /// Conditions on numbers, and on several differences at once: every schedule of the network
    /// meets them.
    pub all_schedules: usize,
    /// Bounds that were added to the network for the dispatcher to keep to
    /// ([`EnvelopeRequest::enforce`](super::EnvelopeRequest::enforce)).
    pub enforced: usize,
}

impl Conditions {
    /// What the oracle says, and how many bounds were added.
    pub(super) fn new(met: elbowroom_envelope::soundness::Conditions, enforced: usize) -> Self {
        Self {
            differences: met.differences,
            all_schedules: met.all_schedules,
            enforced,
        }
    }
}
