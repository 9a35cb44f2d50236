//! By how much everything may deviate at once.

use elbowroom_envelope::{Oracle, Share, balance as shares};
use elbowroom_num::Rational;
use serde::{Deserialize, Serialize};

use super::search::flow;
use crate::answers::{Watcher, exact};

/// By how much everything that is left open may deviate from its nominal value at once, as shares
/// of these.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Balance {
    /// Upwards.
    pub more: Deviation,
    /// Downwards, as far as each can.
    pub less: Deviation,
    /// Each upwards or downwards.
    pub either: Deviation,
}

/// A share of the nominal values by which all may deviate at once.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Deviation {
    /// By so much they may.
    #[serde(with = "exact")]
    pub share: Rational,
    /// By more than this they may not: the same as `share` where that is known exactly. `None` if
    /// nobody asked about more than `share`.
    #[serde(with = "exact::option")]
    pub limit: Option<Rational>,
}

impl From<Share> for Deviation {
    fn from(share: Share) -> Self {
        Self {
            share: share.inside,
            limit: share.outside,
        }
    }
}

/// By how much everything may deviate at once, unless the watcher wants no more or there are too
/// many cases to tell apart. The oracle brings the proofs that it has found for other boxes.
pub(super) fn balance(mut oracle: Oracle, watcher: &mut dyn Watcher) -> Option<Balance> {
    let shares = shares(&mut oracle, &mut || flow(watcher));
    shares.unwrap_or_default().map(|shares| Balance {
        more: shares.more.into(),
        less: shares.less.into(),
        either: shares.either.into(),
    })
}
