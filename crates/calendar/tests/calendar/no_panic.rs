//! The reader of calendar files never panics.

use std::time::UNIX_EPOCH;

use elbowroom_calendar::{Origin, read};
use elbowroom_pddl::{Source, read_problem};
use proptest::prelude::*;

const DOMAIN: &str = include_str!("../../../../examples/market/domain.pddl");
const PROBLEM: &str = include_str!("../../../../examples/market/problem.pddl");
const CALENDAR: &str = include_str!("../../../../examples/market/calendar.toml");

/// Fragments of calendar files, including the ends of their ranges.
const PARTS: [&str; 24] = [
    "\"",
    "[",
    "]",
    "=",
    "_",
    "now",
    " to ",
    "24",
    "0",
    "-1",
    "1e308",
    "9999-12-31",
    "-009999-01-01",
    "2026-10-25T02:30",
    "9999-12-31T23:59:59",
    "-9999-01-01T00:00Z",
    "9223372036854775807 weeks",
    "1 days",
    "every day",
    "holidays",
    "(open _)",
    "Pacific/Apia",
    "from = \"2026-12-24T00:00\"\n",
    "\u{e9}",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    #[test]
    fn altered_calendars_are_read_or_refused(
        edits in prop::collection::vec(
            (any::<prop::sample::Index>(), 0_usize..12, prop::sample::select(&PARTS[..])),
            1..6,
        ),
        live in any::<bool>(),
    ) {
        let mut text: Vec<char> = CALENDAR.chars().collect();
        for (place, length, part) in edits {
            let start = place.index(text.len());
            let end = (start + length).min(text.len());
            text.splice(start..end, part.chars());
        }
        let text: String = text.into_iter().collect();
        let (problem, _) = read_problem(&DOMAIN.into(), &PROBLEM.into()).expect("a problem");
        let origin = Origin { begin: None, now: UNIX_EPOCH, is_live: live };
        let source = Source::from(&text);
        if let Ok((calendar, _)) = read(&source, &problem, &origin) {
            let timed = calendar.timed_problem(&PROBLEM.into(), &source);
            prop_assert!(read_problem(&DOMAIN.into(), &timed).is_ok(), "{}", timed.text());
        }
    }
}
