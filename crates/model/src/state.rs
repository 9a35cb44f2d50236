//! What holds at one moment, and what the problem lets happen at others.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_num::Rational;

use crate::ground::{Change, FactId, FluentId};

/// The truth of facts and the values of fluents at one moment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// The true facts, except derived ones.
    pub facts: BTreeSet<FactId>,
    /// The defined fluents' values.
    pub values: BTreeMap<FluentId, Rational>,
}

/// All timed initials of one time.
#[derive(Clone, Debug, PartialEq)]
pub struct TimedHappening {
    /// When they happen.
    pub time: Rational,
    /// The changes: additions, deletions and assignments of constants.
    pub changes: Vec<Change>,
}
