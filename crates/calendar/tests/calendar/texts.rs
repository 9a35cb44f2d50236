//! The texts that come out of a calendar.

use std::time::UNIX_EPOCH;

use elbowroom_calendar::{Calendar, Origin, read};
use elbowroom_pddl::{Source, read_problem};

const DOMAIN: &str = "(define (domain street) (:predicates (open ?shop)) (:functions (price))
    (:action wait :parameters () :effect (and)))";
const PROBLEM: &str = "(define (problem day) (:domain street) (:objects bakery bank)
  (:init (and)) ; nothing
  (:goal (and)))";

fn calendar(unit: &str, sections: &str) -> (Calendar, Source) {
    let (problem, _) = read_problem(&DOMAIN.into(), &PROBLEM.into()).expect("a problem");
    let text = format!(
        "format = \"elbowroom-calendar\"\nversion = 1\nbegin = 2026-10-24T12:00:00\n\
         time-zone = \"Europe/Berlin\"\nunit = \"{unit}\"\nhorizon = \"2 days\"\n\
         [dates]\nholidays = [\"2026-10-26\", \"2026-12-24 to 2027-01-06\"]\n{sections}"
    );
    let source = Source::new("c.toml", text);
    let origin = Origin {
        begin: None,
        now: UNIX_EPOCH,
        is_live: false,
    };
    (
        read(&source, &problem, &origin).expect("a calendar").0,
        source,
    )
}

#[test]
fn facts_at_the_beginning_are_initial_and_the_others_timed() {
    let (calendar, source) = calendar(
        "minutes",
        "[[window]]\nfact = \"(open _)\"\ndays = \"every day\"\nexcept = \"holidays\"\n\
         hours = [\"8 to 12:30\", \"12 to 18\"]\n\
         [[value]]\nfluent = \"(price)\"\nvalue = 0.32\n\
         [[value]]\nfluent = \"(price)\"\nhours = \"22 to 6\"\nvalue = 0.21\n",
    );
    let timed = calendar.timed_problem(&PROBLEM.into(), &source);
    insta::assert_snapshot!(timed.text(), @r#"
(define (problem day) (:domain street) (:objects bakery bank)
  (:init (and)
    ; c.toml: time 0 is Sat 2026-10-24 12:00 +02:00 (Europe/Berlin), in minutes
    (open bakery)
    (open bank)
    (= (price) 0.32)
    (at 360 (not (open bakery))) ; Sat 2026-10-24 18:00
    (at 360 (not (open bank))) ; Sat 2026-10-24 18:00
    (at 600 (= (price) 0.21)) ; Sat 2026-10-24 22:00
    (at 1140 (= (price) 0.32)) ; Sun 2026-10-25 06:00 +01:00
    (at 1260 (open bakery)) ; Sun 2026-10-25 08:00 +01:00
    (at 1260 (open bank)) ; Sun 2026-10-25 08:00 +01:00
    (at 1860 (not (open bakery))) ; Sun 2026-10-25 18:00 +01:00
    (at 1860 (not (open bank))) ; Sun 2026-10-25 18:00 +01:00
    (at 2100 (= (price) 0.21)) ; Sun 2026-10-25 22:00 +01:00
    (at 2580 (= (price) 0.32)) ; Mon 2026-10-26 06:00 +01:00
  ) ; nothing
  (:goal (and)))
"#);
    let (problem, warnings) = read_problem(&DOMAIN.into(), &timed).expect("a problem");
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(problem.initial_facts.len(), 2);
}

#[test]
fn times_are_rounded_into_the_window() {
    let (calendar, _) = calendar(
        "hours",
        "[[window]]\nfact = \"(open bank)\"\nhours = \"13:20 to 13:40\"\ndays = \"saturday\"\n",
    );
    let windows: Vec<_> = calendar.windows().collect();
    insta::assert_debug_snapshot!(windows, @r#"
[
    (
        "(open bank)",
        [
            Window {
                opens: 666667/500000,
                closes: Some(
                    833333/500000,
                ),
            },
        ],
    ),
]
"#);
}

#[test]
fn one_off_windows_are_exact_to_the_millisecond() {
    let (calendar, _) = calendar(
        "seconds",
        "[[window]]\nfact = \"(open bank)\"\nto = \"2026-10-24T12:00:01.5\"\n\
         [[window]]\nfact = \"(open bakery)\"\nfrom = \"2026-10-25T02:30+01:00\"\n",
    );
    let windows: Vec<_> = calendar.windows().collect();
    insta::assert_debug_snapshot!(windows, @r#"
[
    (
        "(open bank)",
        [
            Window {
                opens: 0,
                closes: Some(
                    3/2,
                ),
            },
        ],
    ),
    (
        "(open bakery)",
        [
            Window {
                opens: 55800,
                closes: Some(
                    176400,
                ),
            },
        ],
    ),
]
"#);
}

#[test]
fn plans_are_dated() {
    let (calendar, _) = calendar("minutes", "");
    let plan = "0.000: (wait) [1.000]\n899.001: (wait a b)\n1000: (w)\n; metric 3\n";
    insta::assert_snapshot!(calendar.dated_plan(plan), @r#"
; time 0 is Sat 2026-10-24 12:00 +02:00 (Europe/Berlin), in minutes
0.000: (wait) [1.000] ; Sat 2026-10-24 12:00
899.001: (wait a b)   ; Sun 2026-10-25 02:59
1000: (w)             ; Sun 2026-10-25 03:40 +01:00
; metric 3
"#);
}

#[test]
fn document_shows_the_calendar_of_the_case() {
    let document = include_str!("../../../../docs/reference/calendars.md");
    assert!(document.contains(include_str!("../../../../examples/market/calendar.toml")));
}
