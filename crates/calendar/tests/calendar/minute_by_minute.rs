//! Random calendars: the windows are those that are found by asking for each minute whether a rule
//! holds.

use std::fmt::Write as _;
use std::ops::Range;
use std::time::UNIX_EPOCH;

use elbowroom_calendar::{Origin, read};
use elbowroom_num::Rational;
use elbowroom_pddl::{Source, read_problem};
use jiff::Timestamp;
use jiff::civil::{Date, DateTime, Weekday, date};
use jiff::tz::{TimeZone, TimeZoneDatabase};
use proptest::prelude::*;

const DOMAIN: &str = "(define (domain street) (:predicates (open ?shop)) (:functions (price))
    (:action wait :parameters () :effect (and)))";
const PROBLEM: &str =
    "(define (problem day) (:domain street) (:objects a b) (:init) (:goal (and)))";

/// Zones whose clocks change by an hour or half an hour on the days below, by a whole day, or not.
const ZONES: [&str; 6] = [
    "Europe/Berlin",
    "America/New_York",
    "Australia/Lord_Howe",
    "Pacific/Apia",
    "Africa/Casablanca",
    "Asia/Kathmandu",
];

/// Days on which calendars begin: around changes of the clocks.
const BEGINS: [Date; 6] = [
    date(2026, 3, 27),
    date(2026, 10, 23),
    date(2026, 3, 6),
    date(2026, 10, 30),
    date(2011, 12, 28),
    date(2026, 2, 13),
];

const DAYS: i64 = 5;

/// A rule in the terms of the file.
#[derive(Clone, Debug)]
struct Rule {
    /// Weekdays from Monday, or `None`.
    weekdays: Option<[bool; 7]>,
    /// Days after the beginning.
    dates: Vec<i8>,
    except: Vec<i8>,
    /// Minutes of the day; the end may be smaller.
    hours: Vec<(i16, i16)>,
    /// Minutes after the beginning.
    from: Option<i64>,
    to: Option<i64>,
}

impl Rule {
    fn file(&self, begin: Date, start: Timestamp) -> String {
        let day = |offset: &i8| {
            let date = begin
                .checked_add(jiff::Span::new().days(i64::from(*offset)))
                .expect("a date");
            format!("\"{date}\"")
        };
        let mut days: Vec<String> = self.dates.iter().map(day).collect();
        for (weekday, is_open) in self.weekdays.into_iter().flatten().enumerate() {
            if is_open {
                days.push(format!("\"{}\"", NAMES[weekday]));
            }
        }
        let mut text = String::new();
        if self.is_dated() {
            writeln!(text, "days = [{}]", days.join(", ")).expect("a string");
        }
        let except: Vec<String> = self.except.iter().map(day).collect();
        if !except.is_empty() {
            writeln!(text, "except = [{}]", except.join(", ")).expect("a string");
        }
        let time = |minute: i16| format!("{}:{:02}", minute / 60, minute % 60);
        let hours = self
            .hours
            .iter()
            .map(|(a, b)| format!("\"{} to {}\"", time(*a), time(*b)));
        let hours: Vec<String> = hours.collect();
        if !hours.is_empty() {
            writeln!(text, "hours = [{}]", hours.join(", ")).expect("a string");
        }
        for (key, minutes) in [("from", self.from), ("to", self.to)] {
            if let Some(minutes) = minutes {
                let at = start + jiff::SignedDuration::from_mins(minutes);
                writeln!(text, "{key} = \"{at}\"").expect("a string");
            }
        }
        text
    }

    fn is_dated(&self) -> bool {
        self.weekdays.is_some() || !self.dates.is_empty()
    }

    fn is_empty(&self) -> bool {
        !self.is_dated()
            && self.except.is_empty()
            && self.hours.is_empty()
            && self.from.is_none()
            && self.to.is_none()
    }

    /// Returns `true` if the rule holds at a local time, `minute` minutes after the beginning.
    fn holds(&self, begin: Date, local: DateTime, minute: i64) -> bool {
        if self.from.is_some_and(|from| minute < from) || self.to.is_some_and(|to| minute >= to) {
            return false;
        }
        let of_day = i16::from(local.hour()) * 60 + i16::from(local.minute());
        let whole = [(0, 1440)];
        let hours = if self.hours.is_empty() {
            &whole[..]
        } else {
            &self.hours
        };
        hours.iter().any(|(start, end)| {
            if start < end {
                self.is_day(begin, local.date()) && (*start..*end).contains(&of_day)
            } else {
                let before = local.date().yesterday().expect("a date");
                (self.is_day(begin, local.date()) && of_day >= *start)
                    || (self.is_day(begin, before) && of_day < *end)
            }
        })
    }

    fn is_day(&self, begin: Date, day: Date) -> bool {
        let is_one = |offset: &i8| {
            begin
                .checked_add(jiff::Span::new().days(i64::from(*offset)))
                .expect("a date")
                == day
        };
        let weekday = usize::try_from(day.weekday().to_monday_zero_offset()).expect("a weekday");
        let is_weekday = self.weekdays.is_some_and(|days| days[weekday]);
        let is_open = !self.is_dated() || is_weekday || self.dates.iter().any(is_one);
        is_open && !self.except.iter().any(is_one)
    }
}

const NAMES: [&str; 7] = [
    "monday",
    "tuesday",
    "wednesday",
    "thursday",
    "friday",
    "saturday",
    "sunday",
];

fn rule() -> impl Strategy<Value = Rule> {
    let minute = || (0_i16..96).prop_map(|quarter| quarter * 15);
    let hours = (minute(), minute()).prop_filter("a length", |(start, end)| start != end);
    let weekdays =
        prop::array::uniform7(any::<bool>()).prop_filter("some day", |days| days.contains(&true));
    let offsets = || prop::collection::vec(0_i8..6, 0..3);
    let ends = (0_i64..7200, 1_i64..7200);
    (
        prop::option::of(weekdays),
        offsets(),
        offsets(),
        prop::collection::vec(hours, 0..3),
        prop::option::weighted(0.3, ends),
        0..3,
    )
        .prop_map(|(weekdays, dates, except, hours, ends, which)| Rule {
            weekdays,
            dates,
            except,
            hours,
            from: ends.filter(|_| which != 1).map(|(from, _)| from),
            to: ends
                .filter(|_| which != 2)
                .map(|(from, length)| from + length),
        })
        .prop_filter("it restricts something", |rule| !rule.is_empty())
}

/// Returns the minutes at which something holds, as ranges.
fn ranges(holds: impl Fn(i64) -> bool, end: i64) -> Vec<Range<i64>> {
    let mut ranges: Vec<Range<i64>> = Vec::new();
    for minute in (0..end).filter(|minute| holds(*minute)) {
        match ranges.last_mut() {
            Some(last) if last.end == minute => last.end = minute + 1,
            _ => ranges.push(minute..minute + 1),
        }
    }
    ranges
}

/// A calendar of rules for the fact, and of rules with values for the fluent.
fn calendar(rules: &[Rule], values: &[Rule], begin: Date, zone: &TimeZone) -> (String, Timestamp) {
    let noon = begin.at(12, 0, 0, 0);
    let start = zone.to_timestamp(noon).expect("a time");
    let name = zone.iana_name().expect("a name");
    let mut text = format!(
        "format = \"elbowroom-calendar\"\nversion = 1\nbegin = \"{start}\"\n\
         time_zone = \"{name}\"\nunit = \"minutes\"\nhorizon = \"{} hours\"\n",
        DAYS * 24
    );
    for rule in rules {
        write!(
            text,
            "[[window]]\nfact = \"(open a)\"\n{}",
            rule.file(begin, start)
        )
        .expect("a string");
    }
    if !values.is_empty() {
        text.push_str("[[value]]\nfluent = \"(price)\"\nvalue = 0\n");
    }
    for (index, rule) in values.iter().enumerate() {
        let rule = rule.file(begin, start);
        let value = index % 2 + 1;
        write!(
            text,
            "[[value]]\nfluent = \"(price)\"\nvalue = {value}\n{rule}"
        )
        .expect("a string");
    }
    (text, start)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn windows_are_those_of_each_minute(
        rules in prop::collection::vec(rule(), 0..4),
        values in prop::collection::vec(rule(), 0..3),
        begin in prop::sample::select(&BEGINS[..]),
        zone in prop::sample::select(&ZONES[..]),
    ) {
        let zone = TimeZoneDatabase::bundled().get(zone).expect("a zone");
        let (text, start) = calendar(&rules, &values, begin, &zone);
        let (problem, _) = read_problem(&DOMAIN.into(), &PROBLEM.into()).expect("a problem");
        let origin = Origin { begin: None, now: UNIX_EPOCH, is_live: false };
        let (calendar, _) = read(&Source::from(&text), &problem, &origin).expect(&text);

        let local = |minute: i64| {
            zone.to_datetime(start + jiff::SignedDuration::from_mins(minute))
        };
        let end = DAYS * 24 * 60;
        let is_open = |minute| rules.iter().any(|rule| rule.holds(begin, local(minute), minute));
        let expected: Vec<Range<Rational>> = ranges(is_open, end)
            .into_iter()
            .map(|range| Rational::from(range.start)..Rational::from(range.end))
            .collect();
        let found: Vec<Range<Rational>> = calendar
            .windows()
            .flat_map(|(_, windows)| windows)
            .map(|window| window.opens..window.closes.expect("the horizon closes it"))
            .collect();
        prop_assert_eq!(found, expected, "{}", text);

        let value = |minute: i64| {
            let covers = |rule: &&Rule| rule.holds(begin, local(minute), minute);
            let last = values.iter().enumerate().rev().find(|(_, rule)| covers(rule));
            Rational::from(last.map_or(0, |(index, _)| i64::try_from(index % 2 + 1).expect("small")))
        };
        let mut expected = Vec::new();
        for minute in 0..if values.is_empty() { 0 } else { end } {
            let value = value(minute);
            if expected.last().is_none_or(|(_, last)| *last != value) {
                expected.push((Rational::from(minute), value));
            }
        }
        let found: Vec<(Rational, Rational)> =
            calendar.values().flat_map(|(_, values)| values).collect();
        prop_assert_eq!(found, expected, "{}", text);
    }
}

/// The days of a week are not shifted: 2026-03-29 is a Sunday.
#[test]
fn weekday_names_are_those_of_the_library() {
    assert_eq!(date(2026, 3, 29).weekday(), Weekday::Sunday);
    assert_eq!(NAMES[6], "sunday");
}
