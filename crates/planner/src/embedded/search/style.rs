//! How a search goes about it.

use super::super::compile::Eagerness;

/// How a search goes about it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Style {
    /// If present, actions that are at least so eager end at once, and states are compared
    /// roughly. Some plans are lost.
    pub(crate) haste: Option<Eagerness>,
    /// How many states that differ in times only are kept; more are dropped, and some plans lost.
    pub(crate) variants: usize,
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
        fills_up: false,
        aim: Aim::Goal,
    };

    /// Actions that are at least so eager end at once.
    pub(crate) fn hasty(haste: Eagerness) -> Self {
        Self {
            haste: Some(haste),
            variants: 4,
            fills_up: false,
            aim: Aim::Goal,
        }
    }

    /// The same, filling up what is used up.
    pub(crate) fn filling_up(self) -> Self {
        Self {
            fills_up: true,
            ..self
        }
    }

    /// The same with another aim.
    pub(crate) fn towards(self, aim: Aim) -> Self {
        Self { aim, ..self }
    }
}
