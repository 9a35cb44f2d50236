//! Rules for the instants at which a window is open.

use std::ops::Range;

use crate::days::Days;
use crate::ranges::Ranges;
use crate::zone::{DAY, Zone};

/// A whole day.
const WHOLE_DAY: Range<i64> = 0..DAY;

/// Instants from `from` to `to` whose local time is in the given hours of a day in `days` and not
/// in `except`. Hours across midnight belong to the day on which they begin.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Rule {
    /// `None` for every day.
    pub(crate) days: Option<Days>,
    pub(crate) except: Days,
    /// Empty for the whole day.
    pub(crate) hours: Vec<Range<i64>>,
    pub(crate) from: Option<i64>,
    pub(crate) to: Option<i64>,
}

impl Rule {
    /// Returns `true` if the rule does not depend on days and hours.
    fn is_plain(&self) -> bool {
        self.days.is_none() && self.hours.is_empty() && self.except == Days::default()
    }

    /// Returns `true` if the rule holds always.
    pub(crate) fn is_always(&self) -> bool {
        self.is_plain() && self.from.is_none() && self.to.is_none()
    }

    /// Returns `true` if windows recur without an end.
    pub(crate) fn is_endless(&self) -> bool {
        let is_dated = self.days.as_ref().is_some_and(|days| days.last().is_some());
        !self.is_plain() && self.to.is_none() && !is_dated
    }

    /// Returns the number of days that [`Rule::windows`] visits.
    pub(crate) fn day_count(&self, within: &Range<i64>) -> i64 {
        let (first, last) = self.day_range(&self.clipped(within));
        if self.is_plain() {
            0
        } else {
            last.saturating_sub(first)
        }
    }

    /// Returns the windows inside `within`, which must be bounded if the rule is not.
    pub(crate) fn windows(&self, zone: &Zone, within: &Range<i64>) -> Ranges {
        let within = self.clipped(within);
        if self.is_plain() {
            return Ranges::union(vec![within]);
        }
        let hours = if self.hours.is_empty() {
            std::slice::from_ref(&WHOLE_DAY)
        } else {
            &self.hours
        };
        let (first, last) = self.day_range(&within);
        let mut windows = Vec::new();
        for day in first..=last {
            let is_open = self.days.as_ref().is_none_or(|days| days.contains(day));
            if !is_open || self.except.contains(day) {
                continue;
            }
            for hours in hours {
                let midnight = day.saturating_mul(DAY);
                let local = midnight + hours.start..midnight + hours.end;
                let instants = zone.instants(local).into_iter();
                windows
                    .extend(instants.map(|it| it.start.max(within.start)..it.end.min(within.end)));
            }
        }
        Ranges::union(windows)
    }

    fn clipped(&self, within: &Range<i64>) -> Range<i64> {
        let start = self
            .from
            .map_or(within.start, |from| from.max(within.start));
        let end = self.to.map_or(within.end, |to| to.min(within.end));
        start..end
    }

    /// Returns the first and the last day whose hours may overlap with the range.
    fn day_range(&self, within: &Range<i64>) -> (i64, i64) {
        // Hours may extend into the next day, and local time differs by up to a day.
        let first = within.start.div_euclid(DAY) - 3;
        let last = within.end.div_euclid(DAY).saturating_add(2);
        let dated = self.days.as_ref().and_then(Days::last);
        (first, dated.map_or(last, |dated| dated.min(last)))
    }
}
