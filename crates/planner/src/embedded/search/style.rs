//! How a search goes about it.

use super::super::compile::Eagerness;

/// How a search goes about it.
#[derive(Clone, Copy, Debug)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "each is one way to go about it, and any of them may be combined"
)]
pub(crate) struct Style {
    /// If present, actions that are at least so eager end at once, and states are compared
    /// roughly. Some plans are lost.
    pub(crate) haste: Option<Eagerness>,
    /// How many states that differ in times only are kept; more are dropped, and some plans lost.
    pub(crate) variants: usize,
    /// Whether what is chosen later also happens later, or at the same time. Then it is known, of
    /// what is under way, by when it must be over. Some plans are lost.
    pub(crate) is_chronological: bool,
    /// Whether what is new comes first, and then what has more of the goal.
    pub(crate) seeks_novelty: bool,
    /// Whether what is used up and never filled up is spared.
    pub(crate) is_sparing: bool,
    /// Whether the estimate counts what a relaxed plan uses up, and fills it up.
    pub(crate) fills_up: bool,
    /// What is looked for.
    pub(crate) aim: Aim,
}

/// What a search looks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Aim {
    /// A plan, whatever its metric, and then shorter ones. The nearest goal comes first.
    Goal,
    /// Plans of a better metric. What costs least to finish comes first.
    CheapRest,
    /// Plans of a better metric. What has been spent counts too, what is still to be spent so many
    /// times as much (weighted A*; Pohl 1970).
    CheapWhole(i64),
    /// Shorter plans of the same metric.
    Shortest,
}

impl Style {
    /// Loses nothing but what [`Search::is_incomplete`] tells.
    pub(crate) const COMPLETE: Self = Self {
        haste: None,
        variants: usize::MAX,
        is_chronological: false,
        is_sparing: false,
        seeks_novelty: false,
        fills_up: false,
        aim: Aim::Goal,
    };

    /// Actions that are at least so eager end at once.
    pub(crate) fn hasty(haste: Eagerness) -> Self {
        Self {
            haste: Some(haste),
            variants: 4,
            is_chronological: false,
            is_sparing: false,
            seeks_novelty: false,
            fills_up: false,
            aim: Aim::Goal,
        }
    }

    /// In the order of time.
    pub(crate) const CHRONOLOGICAL: Self = Self {
        haste: None,
        variants: 32,
        is_chronological: true,
        is_sparing: false,
        seeks_novelty: false,
        fills_up: false,
        aim: Aim::Goal,
    };

    /// Whether it loses nothing but what [`Search::is_incomplete`](super::Search::is_incomplete)
    /// tells.
    pub(crate) fn is_complete(&self) -> bool {
        self.haste.is_none() && !self.is_chronological
    }

    /// The same, filling up what is used up.
    pub(crate) fn filling_up(self) -> Self {
        Self {
            fills_up: true,
            ..self
        }
    }

    /// The same, what is new coming first.
    pub(crate) fn seeking_novelty(self) -> Self {
        Self {
            seeks_novelty: true,
            ..self
        }
    }

    /// The same, sparing what is never filled up.
    pub(crate) fn sparing(self) -> Self {
        Self {
            is_sparing: true,
            variants: 4,
            ..self
        }
    }

    /// The same with another aim.
    pub(crate) fn towards(self, aim: Aim) -> Self {
        Self { aim, ..self }
    }
}
