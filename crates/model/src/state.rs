//! State at one moment, and timed initials at later ones.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_num::Rational;

use crate::ground::{Change, FactId, FluentId};

/// The truth of facts and the values of fluents at one moment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// The true facts, except derived ones.
    pub facts: BTreeSet<FactId>,
    /// Values of the defined fluents.
    pub values: BTreeMap<FluentId, Rational>,
}

/// All timed initials of one time.
#[derive(Clone, Debug, PartialEq)]
pub struct TimedHappening {
    /// Their time.
    pub time: Rational,
    /// The changes: additions, deletions and assignments of constants.
    pub changes: Vec<Change>,
}
