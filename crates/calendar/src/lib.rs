//! Calendar files: dates, time zones and recurring windows ("weekdays 8 to 17"), mapped to timed
//! initials of a planning problem.
//!
//! In: a calendar file (`docs/reference/calendars.md`), the problem that it is about, and an [`Origin`]. Out: a
//! [`Calendar`], which writes the problem with its timed initials ([`Calendar::timed_problem`]) and
//! the dates of a plan ([`Calendar::dated_plan`]).
//!
//! The way through the crate:
//!
//! 1. `file`: the keys of a file. `read`, `sections`: their meaning, with mistakes as diagnostics.
//! 2. `days`, `hours`, `names`, `unit`: one kind of text each.
//! 3. `zone`: instants and local times. `rule`, `ranges`: the windows of a rule.
//! 4. `initials`, `plan_text`: the texts that come out.
//!
//! Windows are exact to the millisecond. The crate reads no clock: the caller gives the current
//! time.
//!
//! ```
//! use std::time::UNIX_EPOCH;
//!
//! use elbowroom_calendar::{Origin, read};
//! use elbowroom_pddl::{Source, read_problem};
//!
//! let domain = Source::from(
//!     "(define (domain street) (:predicates (open ?shop) (fed))
//!        (:durative-action buy :parameters (?shop) :duration (= ?duration 5)
//!          :condition (over all (open ?shop)) :effect (at end (fed))))",
//! );
//! let problem = Source::from(
//!     "(define (problem day) (:domain street) (:objects bakery) (:init) (:goal (fed)))",
//! );
//! let (read_once, _) = read_problem(&domain, &problem)?;
//! let file = Source::from(
//!     r#"format = "elbowroom-calendar"
//!        version = 1
//!        begin = "2026-11-30T07:30"
//!        time_zone = "Europe/Berlin"
//!        unit = "minutes"
//!        horizon = "1 day"
//!
//!        [[window]]
//!        fact = "(open _)"
//!        days = "weekdays"
//!        hours = "8 to 17"
//!     "#,
//! );
//! let origin = Origin { begin: None, now: UNIX_EPOCH, is_live: false };
//! let (calendar, _) = read(&file, &read_once, &origin)?;
//! let timed = calendar.timed_problem(&problem, &file);
//! assert!(timed.text().contains("(at 30 (open bakery)) ; Mon 2026-11-30 08:00"));
//! assert!(timed.text().contains("(at 570 (not (open bakery))) ; Mon 2026-11-30 17:00"));
//! # Ok::<(), elbowroom_pddl::Diagnostics>(())
//! ```

mod days;
mod file;
mod frame;
mod hours;
mod initials;
mod names;
mod plan_text;
mod ranges;
mod read;
mod rule;
mod sections;
mod unit;
mod zone;

use std::time::SystemTime;

use elbowroom_num::Rational;

use ranges::Ranges;
pub use read::read;
use unit::{Rounding, Unit};
use zone::Zone;

/// Date of time 0, if the calendar file does not set it.
#[derive(Clone, Copy, Debug)]
pub struct Origin<'a> {
    /// A date or `now`, which overrides the file's `begin`.
    pub begin: Option<&'a str>,
    /// The current time.
    pub now: SystemTime,
    /// If `true`, time 0 is the current time if there is no other `begin`.
    pub is_live: bool,
}

/// Windows of facts and values of fluents, from time 0 on.
#[derive(Clone, Debug)]
pub struct Calendar {
    zone: Zone,
    /// The instant of time 0.
    begin: i64,
    begins_now: bool,
    unit: Unit,
    facts: Vec<CalendarFact>,
    fluents: Vec<CalendarFluent>,
}

/// Fact with the instants at which it holds.
#[derive(Clone, Debug)]
struct CalendarFact {
    name: String,
    windows: Ranges,
}

/// Fluent with its values and the instants at which it gets them.
#[derive(Clone, Debug)]
struct CalendarFluent {
    name: String,
    values: Vec<(i64, Rational)>,
}

/// Interval during which a fact holds, in the problem's time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Window {
    /// Start time; 0 if the fact holds at the beginning.
    pub opens: Rational,
    /// End time; `None` if the window never closes.
    pub closes: Option<Rational>,
}

impl Calendar {
    /// Returns `true` if time 0 is the current time.
    pub fn begins_now(&self) -> bool {
        self.begins_now
    }

    /// Returns the length of the problem's unit of time, in seconds.
    pub fn unit_in_seconds(&self) -> Rational {
        Rational::new(self.unit.length, zone::SECOND)
    }

    /// Returns each fact with its disjoint windows, in order. Times without a short decimal are
    /// rounded into the window, by less than a millionth of the unit.
    pub fn windows(&self) -> impl Iterator<Item = (&str, Vec<Window>)> {
        self.facts.iter().map(|fact| {
            let windows = fact.windows.iter().filter_map(|window| {
                let opens = self.time(window.start, Rounding::Up);
                let closes = (window.end < i64::MAX).then(|| self.time(window.end, Rounding::Down));
                let is_empty = closes.as_ref().is_some_and(|closes| *closes <= opens);
                (!is_empty).then_some(Window { opens, closes })
            });
            (fact.name.as_str(), windows.collect())
        })
    }

    /// Returns each fluent with its values and the times at which it gets them, the first at 0.
    pub fn values(&self) -> impl Iterator<Item = (&str, Vec<(Rational, Rational)>)> {
        self.fluents.iter().map(|fluent| {
            let values = fluent.values.iter();
            let values = values.map(|(at, value)| (self.time(*at, Rounding::Up), value.clone()));
            (fluent.name.as_str(), values.collect())
        })
    }

    /// Describes time 0: its date, the zone and the unit.
    pub fn origin(&self) -> String {
        format!(
            "time 0 is {} {} ({}), in {}",
            self.zone.date(self.begin),
            self.zone.offset(self.begin),
            self.zone.name(),
            self.unit.name
        )
    }

    /// Returns the local date of a time of the problem, to the second, with the offset from UTC if
    /// it differs from that at time 0.
    pub fn date(&self, time: &Rational) -> String {
        let scaled = time * &Rational::from(self.unit.length);
        // Half a millisecond is added, so that truncation rounds to the nearest.
        let milliseconds = (scaled + Rational::new(1, 2)).floor();
        let milliseconds = milliseconds
            .to_decimal(0)
            .parse::<i64>()
            .unwrap_or(i64::MAX);
        let instant = self.begin.saturating_add(milliseconds);
        let date = self.zone.date(instant);
        let offset = self.zone.offset(instant);
        if offset == self.zone.offset(self.begin) {
            date
        } else {
            format!("{date} {offset}")
        }
    }

    fn time(&self, instant: i64, rounding: Rounding) -> Rational {
        self.unit.time(instant.saturating_sub(self.begin), rounding)
    }
}
