//! Conversion between instants and local times of a time zone.
//!
//! Instants are milliseconds since 1970-01-01T00:00Z. Local times are milliseconds since
//! 1970-01-01T00:00 on the clocks of the zone.

use std::ops::Range;

use elbowroom_text::nearest;
use jiff::Timestamp;
use jiff::civil::DateTime;
use jiff::tz::{AmbiguousOffset, Offset, TimeZone, TimeZoneDatabase};

/// One second, in milliseconds.
pub(crate) const SECOND: i64 = 1000;
/// One calendar day, in milliseconds.
pub(crate) const DAY: i64 = 24 * 60 * 60 * SECOND;
/// One year, in milliseconds.
const YEAR: i64 = 366 * DAY;

/// Time zone of the IANA database that is compiled into the program.
#[derive(Clone, Debug)]
pub(crate) struct Zone {
    rules: TimeZone,
    name: String,
}

/// Message about an invalid text, and advice.
pub(crate) type TextError = (String, String);

impl Zone {
    /// Returns the zone of that name, such as `Europe/Berlin` or `UTC`.
    ///
    /// # Errors
    /// There is no such zone. The advice lists the most similar names.
    pub(crate) fn named(name: &str) -> Result<Self, TextError> {
        let database = TimeZoneDatabase::bundled();
        if let Ok(rules) = database.get(name) {
            let name = rules.iana_name().unwrap_or(name).to_owned();
            return Ok(Self { rules, name });
        }
        let message = format!("there is no time zone `{name}`");
        let known: Vec<String> = database
            .available()
            .map(|known| known.as_str().to_owned())
            .collect();
        let advice = match nearest(name, known.iter().map(String::as_str)) {
            Some(near) => format!("did you mean `{near}`?"),
            None => {
                "write a name of the IANA database, such as `Europe/Berlin` or `UTC`".to_owned()
            }
        };
        Err((message, advice))
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Reads a date with a time of day, optionally with an offset such as `+01:00` or `Z`.
    ///
    /// # Errors
    /// The text has another form, or the local time does not exist or exists twice.
    pub(crate) fn instant(&self, text: &str) -> Result<i64, TextError> {
        let text = text.trim();
        if let Ok(instant) = text.parse::<Timestamp>() {
            let instant = instant.as_millisecond();
            return self.with_known_offset(text, instant).map(|()| instant);
        }
        let has_time = text.contains(':') && !text.contains('[');
        let local: DateTime = match text.parse() {
            Ok(local) if has_time => local,
            _ => {
                let message = format!("`{text}` is not a date with a time of day");
                let advice = "write it like 2026-11-30T07:30, or 2026-11-30T07:30+01:00".to_owned();
                return Err((message, advice));
            }
        };
        let ambiguous = self.rules.to_ambiguous_timestamp(local);
        match ambiguous.offset() {
            AmbiguousOffset::Unambiguous { .. } => {}
            AmbiguousOffset::Gap { .. } => {
                let message = format!("{text} does not exist in {}", self.name);
                let advice = "the clocks are set forward over this time; choose another one";
                return Err((message, advice.to_owned()));
            }
            AmbiguousOffset::Fold { before, after } => {
                let message = format!("{text} is ambiguous in {}", self.name);
                let advice = format!(
                    "the clocks are set back over this time; write {text}{} for the first time or \
                     {text}{} for the second",
                    offset_text(before),
                    offset_text(after),
                );
                return Err((message, advice));
            }
        }
        let instant = ambiguous.compatible();
        let out_of_range = |_| {
            let message = format!("{text} is out of range");
            (message, "choose a year from 1 to 9999".to_owned())
        };
        instant.map(Timestamp::as_millisecond).map_err(out_of_range)
    }

    /// Rejects an instant with an offset that the zone does not have within a year. The offset of
    /// UTC is always allowed.
    fn with_known_offset(&self, text: &str, instant: i64) -> Result<(), TextError> {
        let written = text.parse::<DateTime>().ok();
        let written = written.and_then(|local| TimeZone::UTC.to_timestamp(local).ok());
        // `Z` is not an offset of a local time.
        let Some(local) = written.map(Timestamp::as_millisecond) else {
            return Ok(());
        };
        let offset = local.saturating_sub(instant);
        let begin = timestamp(instant.saturating_sub(YEAR));
        let end = timestamp(instant.saturating_add(YEAR));
        let mut offsets = vec![self.rules.to_offset(begin)];
        let transitions = self.rules.following(begin);
        let transitions = transitions.take_while(|it| it.timestamp() < end);
        offsets.extend(transitions.map(|transition| transition.offset()));
        if offset == 0 || offsets.iter().any(|own| milliseconds(*own) == offset) {
            return Ok(());
        }
        let message = format!("the offset of `{text}` is not that of {}", self.name);
        let own = self.offset(instant);
        let advice = format!(
            "the offset there is {own}: leave the offset out for the local time, or write UTC with `Z`"
        );
        Err((message, advice))
    }

    /// Returns the instant `days` days later at the same local time, or the first instant after it
    /// if that local time does not exist.
    pub(crate) fn days_later(&self, instant: i64, days: i64) -> i64 {
        let local = self.local(instant).saturating_add(days.saturating_mul(DAY));
        let day = local.saturating_add(2 * DAY);
        let later = self.instants(local..day);
        later.first().map_or(day, |first| first.start)
    }

    /// Returns the local time at an instant.
    pub(crate) fn local(&self, instant: i64) -> i64 {
        instant.saturating_add(milliseconds(self.rules.to_offset(timestamp(instant))))
    }

    /// Returns all instants whose local time is in the range, as disjoint ranges in order. A clock
    /// change can shorten, split or repeat the local time.
    pub(crate) fn instants(&self, local: Range<i64>) -> Vec<Range<i64>> {
        // No offset is much larger than a day.
        let first = local.start.saturating_sub(2 * DAY);
        let last = local.end.saturating_add(2 * DAY);
        let mut found = Vec::new();
        let mut add = |since: i64, until: i64, offset: i64| {
            let start = local.start.saturating_sub(offset).max(since);
            let end = local.end.saturating_sub(offset).min(until);
            if start < end {
                found.push(start..end);
            }
        };
        let begin = timestamp(first);
        let mut since = first;
        let mut offset = milliseconds(self.rules.to_offset(begin));
        for transition in self.rules.following(begin) {
            let at = transition.timestamp().as_millisecond();
            if at >= last {
                break;
            }
            add(since, at, offset);
            since = at;
            offset = milliseconds(transition.offset());
        }
        add(since, last, offset);
        found
    }

    /// Returns the local date and time of an instant, rounded to the second. Seconds are omitted if
    /// they are zero, as in `Mon 2026-11-30 07:30`.
    pub(crate) fn date(&self, instant: i64) -> String {
        let second = instant.saturating_add(SECOND / 2).div_euclid(SECOND);
        let instant = second.saturating_mul(SECOND);
        let local = self.rules.to_datetime(timestamp(instant));
        let format = if instant.rem_euclid(60 * SECOND) == 0 {
            "%a %Y-%m-%d %H:%M"
        } else {
            "%a %Y-%m-%d %H:%M:%S"
        };
        local.strftime(format).to_string()
    }

    /// Returns the offset from UTC at an instant, such as `+01:00`.
    pub(crate) fn offset(&self, instant: i64) -> String {
        offset_text(self.rules.to_offset(timestamp(instant)))
    }
}

/// Returns the number of the day since 1970-01-01.
pub(crate) fn day_number(date: jiff::civil::Date) -> i64 {
    let midnight = date.to_datetime(jiff::civil::Time::midnight());
    let instant = TimeZone::UTC.to_timestamp(midnight);
    // Only dates at the ends of the supported range have no instant.
    instant.map_or(0, |it| it.as_millisecond().div_euclid(DAY))
}

fn timestamp(instant: i64) -> Timestamp {
    Timestamp::from_millisecond(instant).unwrap_or(if instant < 0 {
        Timestamp::MIN
    } else {
        Timestamp::MAX
    })
}

fn milliseconds(offset: Offset) -> i64 {
    i64::from(offset.seconds()) * SECOND
}

fn offset_text(offset: Offset) -> String {
    let seconds = offset.seconds();
    let sign = if seconds < 0 { '-' } else { '+' };
    let minutes = seconds.abs() / 60;
    format!("{sign}{:02}:{:02}", minutes / 60, minutes % 60)
}

#[cfg(test)]
mod tests {
    use super::Zone;

    const HOUR: i64 = 3_600_000;

    fn berlin() -> Zone {
        Zone::named("Europe/Berlin").expect("a zone")
    }

    #[test]
    fn local_time_that_exists_twice_gives_two_instants() {
        let zone = berlin();
        let begin = zone.instant("2026-10-25T00:00").expect("an instant");
        let midnight = zone.local(begin);
        let half = midnight + 2 * HOUR..midnight + 2 * HOUR + HOUR / 2;
        let found = zone.instants(half);
        let first = begin + 2 * HOUR;
        assert_eq!(
            found,
            [
                first..first + HOUR / 2,
                first + HOUR..first + HOUR + HOUR / 2
            ]
        );
    }

    #[test]
    fn local_time_that_does_not_exist_gives_no_instant() {
        let zone = berlin();
        let midnight = zone.local(zone.instant("2026-03-29T00:00").expect("an instant"));
        assert!(
            zone.instants(midnight + 2 * HOUR..midnight + 3 * HOUR)
                .is_empty()
        );
        assert!(
            zone.instant("2026-03-29T02:30")
                .is_err_and(|it| it.0.contains("does not exist"))
        );
        let twice = zone.instant("2026-10-25T02:30").unwrap_err();
        assert!(twice.1.contains("2026-10-25T02:30+02:00"), "{twice:?}");
        let second = zone.instant("2026-10-25T02:30+01:00").expect("an instant");
        assert_eq!(zone.date(second), "Sun 2026-10-25 02:30");
        assert_eq!(zone.offset(second), "+01:00");
    }

    #[test]
    fn days_later_keeps_the_local_time() {
        let zone = berlin();
        let before = zone.instant("2026-03-28T02:30").expect("an instant");
        assert_eq!(
            zone.date(zone.days_later(before, 1)),
            "Sun 2026-03-29 03:00"
        );
        assert_eq!(
            zone.date(zone.days_later(before, 2)),
            "Mon 2026-03-30 02:30"
        );
    }

    #[test]
    fn offset_that_the_zone_does_not_have_is_refused() {
        let zone = berlin();
        let instant = |text: &str| zone.instant(text);
        let utc = instant("2026-11-30T06:30Z").expect("an instant");
        for text in [
            "2026-11-30T07:30+01:00",
            "2026-11-30T08:30+02:00",
            "2026-11-30T06:30+00:00",
        ] {
            assert_eq!(instant(text), Ok(utc), "{text}");
        }
        for text in ["2026-11-30T11:30+05:00", "2026-11-30T05:30-01:00"] {
            let (message, advice) = instant(text).unwrap_err();
            assert!(message.ends_with("is not that of Europe/Berlin"));
            assert!(advice.starts_with("the offset there is +01:00"), "{advice}");
        }
    }

    #[test]
    fn dates_are_rounded_to_the_second() {
        let zone = berlin();
        let eight = zone.instant("2026-11-30T08:00").expect("an instant");
        assert_eq!(zone.date(eight - 400), "Mon 2026-11-30 08:00");
        assert_eq!(zone.date(eight + 600), "Mon 2026-11-30 08:00:01");
    }

    #[test]
    fn misspelt_zone_is_refused_with_the_nearest_name() {
        let (message, advice) = Zone::named("Europe/Belrin").unwrap_err();
        assert_eq!(message, "there is no time zone `Europe/Belrin`");
        assert_eq!(advice, "did you mean `Europe/Berlin`?");
        assert_eq!(
            Zone::named("europe/berlin").expect("a zone").name(),
            "Europe/Berlin"
        );
    }
}
