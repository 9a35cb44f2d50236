//! Days: weekdays, dates and ranges of dates.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use elbowroom_text::nearest;
use jiff::civil::Date;

use crate::zone::{TextError, day_number};

/// Set of days, numbered from 1970-01-01.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Days {
    /// Weekdays in the set, from Monday to Sunday.
    weekdays: [bool; 7],
    dates: Vec<RangeInclusive<i64>>,
}

/// Named sets of days, for `days` and `except`.
pub(crate) type NamedDays = BTreeMap<String, Days>;

const WEEKDAYS: [&str; 7] = [
    "monday",
    "tuesday",
    "wednesday",
    "thursday",
    "friday",
    "saturday",
    "sunday",
];

impl Days {
    /// Adds the days named by a text: a weekday, `weekdays`, `weekends`, `every day`, a date, a
    /// range such as `monday to thursday` or `2026-12-24 to 2027-01-06`, or one of `named`.
    ///
    /// # Errors
    /// The text names no days.
    pub(crate) fn add(&mut self, text: &str, named: &NamedDays) -> Result<(), TextError> {
        let text = text.trim();
        if let Some(days) = named.get(text) {
            self.include(days);
            return Ok(());
        }
        let lower = text.to_ascii_lowercase();
        let (first, last) = match lower.as_str() {
            "weekdays" => ("monday", "friday"),
            "weekends" => ("saturday", "sunday"),
            "every day" => ("monday", "sunday"),
            _ => lower.split_once(" to ").unwrap_or((&lower, &lower)),
        };
        if let (Some(first), Some(last)) = (weekday(first), weekday(last)) {
            self.add_weekdays(first, last);
            return Ok(());
        }
        let (Some(first), Some(last)) = (date(first), date(last)) else {
            return Err(unknown(text, named));
        };
        if last < first {
            let message = format!("`{text}` ends before it begins");
            return Err((message, "give the earlier date first".to_owned()));
        }
        self.dates.push(first..=last);
        Ok(())
    }

    /// Returns `true` if the text names days without `[dates]`: `mon`, `weekdays`, `2026-12-24`. The
    /// singular forms `weekday` and `weekend` count as such names.
    pub(crate) fn are_named(text: &str) -> bool {
        let is_day = |text: &str| Self::default().add(text, &NamedDays::new()).is_ok();
        is_day(text) || is_day(&format!("{}s", text.trim()))
    }

    /// Adds the weekdays from `first` to `last`, across the end of the week if `last` is smaller.
    fn add_weekdays(&mut self, first: usize, last: usize) {
        let mut day = first;
        self.weekdays[day] = true;
        while day != last {
            day = (day + 1) % 7;
            self.weekdays[day] = true;
        }
    }

    fn include(&mut self, other: &Self) {
        for (own, other) in self.weekdays.iter_mut().zip(other.weekdays) {
            *own |= other;
        }
        self.dates.extend(other.dates.iter().cloned());
    }

    pub(crate) fn contains(&self, day: i64) -> bool {
        // 1970-01-01 was a Thursday.
        let weekday = usize::try_from((day + 3).rem_euclid(7)).unwrap_or(0);
        self.weekdays[weekday] || self.dates.iter().any(|dates| dates.contains(&day))
    }

    /// Returns the last day, or `None` if the days recur without an end.
    pub(crate) fn last(&self) -> Option<i64> {
        if self.weekdays.contains(&true) {
            return None;
        }
        Some(
            self.dates
                .iter()
                .map(|dates| *dates.end())
                .max()
                .unwrap_or(i64::MIN),
        )
    }
}

/// Returns the number of a weekday, given by its name or its first three letters.
fn weekday(text: &str) -> Option<usize> {
    let text = text.trim();
    WEEKDAYS
        .iter()
        .position(|name| *name == text || (text.len() == 3 && name.starts_with(text)))
}

fn date(text: &str) -> Option<i64> {
    let text = text.trim();
    // A longer text has a time of day.
    let date: Date = (text.len() == "2026-12-24".len()).then(|| text.parse().ok())??;
    Some(day_number(date))
}

fn unknown(text: &str, named: &NamedDays) -> TextError {
    let message = format!("`{text}` is not a day");
    let words = WEEKDAYS
        .iter()
        .copied()
        .chain(["weekdays", "weekends", "every day"]);
    let near = nearest(text, words.chain(named.keys().map(String::as_str)));
    let advice = match near {
        Some(near) => format!("did you mean `{near}`?"),
        None => {
            "write `weekdays`, `monday to thursday`, `2026-12-24`, `2026-12-24 to 2027-01-06`, \
                 or a name from `[dates]`"
                .to_owned()
        }
    };
    (message, advice)
}

#[cfg(test)]
mod tests {
    use super::{Days, NamedDays, date};

    fn days(text: &str) -> Days {
        let mut days = Days::default();
        days.add(text, &NamedDays::new()).expect("days");
        days
    }

    #[test]
    fn weekdays_are_those_of_the_calendar() {
        let monday = date("2026-11-30").expect("a date");
        let found: Vec<i64> = (0..7)
            .filter(|day| days("fri to mon").contains(monday + day))
            .collect();
        assert_eq!(found, [0, 4, 5, 6]);
        assert!(days("Weekdays").contains(monday) && !days("weekends").contains(monday));
        assert_eq!(days("weekdays").last(), None);
    }

    #[test]
    fn ranges_of_dates_include_both_ends() {
        let christmas = days("2026-12-24 to 2026-12-26");
        let first = date("2026-12-24").expect("a date");
        let found: Vec<i64> = (-1..4)
            .filter(|day| christmas.contains(first + day))
            .collect();
        assert_eq!(found, [0, 1, 2]);
        assert_eq!(christmas.last(), Some(first + 2));
    }

    #[test]
    fn texts_that_name_no_day_are_refused() {
        let mut days = Days::default();
        for (text, advice) in [
            ("wendesday", "did you mean `wednesday`?"),
            ("2026-02-30", "write `weekdays`"),
            ("2026-12-26 to 2026-12-24", "give the earlier date first"),
        ] {
            let objection = days.add(text, &NamedDays::new()).unwrap_err();
            assert!(objection.1.starts_with(advice), "{objection:?}");
        }
    }
}
