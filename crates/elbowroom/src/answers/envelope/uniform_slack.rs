//! Deviation of all open quantities at once.

use elbowroom_envelope::{DeviationBounds, Oracle, balance as shares};
use elbowroom_num::Rational;
use serde::{Deserialize, Serialize};

use super::search::continue_or_stop;
use crate::answers::{Observer, exact};

/// Deviations that all open quantities may have at once, as shares of their nominal values.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct UniformSlack {
    /// Upwards.
    pub more: Deviation,
    /// Downwards, each quantity at most to the end of its range.
    pub less: Deviation,
    /// Each upwards or downwards.
    pub either: Deviation,
}

/// Bounds on the share of the nominal values that all quantities may deviate at once.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Deviation {
    /// A deviation by this share is safe.
    #[serde(with = "exact")]
    pub share: Rational,
    /// A deviation by more than this share is not safe. Equals `share` if the limit is known
    /// exactly; `None` if no larger share was examined.
    #[serde(with = "exact::option")]
    pub limit: Option<Rational>,
}

impl From<DeviationBounds> for Deviation {
    fn from(share: DeviationBounds) -> Self {
        Self {
            share: share.lower_bound,
            limit: share.upper_bound,
        }
    }
}

/// Computes the deviations that all quantities may have at once; `None` if the watcher ends the
/// work or there are too many cases to distinguish. `oracle` reuses the proofs that it has found
/// for other boxes.
pub(super) fn uniform_slack(
    mut oracle: Oracle,
    watcher: &mut dyn Observer,
) -> Option<UniformSlack> {
    let shares = shares(&mut oracle, &mut || continue_or_stop(watcher));
    shares.unwrap_or_default().map(|shares| UniformSlack {
        more: shares.increase.into(),
        less: shares.decrease.into(),
        either: shares.both_directions.into(),
    })
}
