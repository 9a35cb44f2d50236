//! Mistakes in calendar files, each reported with its line.

use std::time::{Duration, UNIX_EPOCH};

use elbowroom_calendar::{Calendar, Origin, read};
use elbowroom_pddl::{Source, read_problem};

const DOMAIN: &str = "(define (domain street) (:types shop person)
    (:predicates (open ?shop - shop) (free ?someone - person) (busy))
    (:functions (price) (rate ?shop - shop))
    (:derived (busy) (exists (?p - person) (not (free ?p))))
    (:action wait :parameters () :effect (and)))";
const PROBLEM: &str = "(define (problem day) (:domain street)
    (:objects bakery bank - shop ann - person)
    (:init (free ann) (= (price) 3) (at 5 (not (open bank)))) (:goal (and)))";

const HEAD: &str = "format = \"elbowroom-calendar\"
version = 1
begin = \"2026-11-30T07:30\"
time_zone = \"Europe/Berlin\"
unit = \"minutes\"
horizon = \"3 days\"
";

fn read_with(text: &str, begin: Option<&str>) -> Result<(Calendar, String), String> {
    let (problem, _) = read_problem(&DOMAIN.into(), &PROBLEM.into()).expect("a problem");
    let now = UNIX_EPOCH + Duration::from_millis(1_795_000_000_500);
    let origin = Origin {
        begin,
        now,
        is_live: false,
    };
    let source = Source::new("c.toml", text);
    let (calendar, warnings) =
        read(&source, &problem, &origin).map_err(|mistakes| mistakes.to_string())?;
    let warnings: Vec<String> = warnings.iter().map(ToString::to_string).collect();
    Ok((calendar, warnings.join("\n")))
}

fn wrong(sections: &str) -> String {
    read_with(&format!("{HEAD}{sections}"), None).expect_err("a mistake")
}

fn wrong_head(from: &str, to: &str) -> String {
    let window = "[[window]]\nfact = \"(open bakery)\"\nhours = \"8 to 17\"\n";
    read_with(&format!("{}{window}", HEAD.replace(from, to)), None).expect_err("a mistake")
}

#[test]
fn mistakes_in_the_head_are_refused() {
    insta::assert_snapshot!(wrong_head("Berlin", "Belrin"), @"c.toml:4:13: error: there is no time zone `Europe/Belrin`; did you mean `Europe/Berlin`?");
    insta::assert_snapshot!(wrong_head("minutes", "fortnights"), @"c.toml:5:8: error: `fortnights` is not a unit of time; write `seconds`, `minutes`, `hours` or `days`");
    insta::assert_snapshot!(wrong_head("11-30T07:30", "11-30"), @"c.toml:3:9: error: `2026-11-30` is not a date with a time of day; write it like 2026-11-30T07:30, or 2026-11-30T07:30+01:00");
    insta::assert_snapshot!(wrong_head("11-30T07:30", "03-29T02:30"), @"c.toml:3:9: error: 2026-03-29T02:30 does not exist in Europe/Berlin; the clocks are set forward over this time; choose another one");
    insta::assert_snapshot!(wrong_head("11-30T07:30", "10-25T02:30"), @"c.toml:3:9: error: 2026-10-25T02:30 is ambiguous in Europe/Berlin; the clocks are set back over this time; write 2026-10-25T02:30+02:00 for the first time or 2026-10-25T02:30+01:00 for the second");
    insta::assert_snapshot!(wrong_head("horizon = \"3 days\"\n", ""), @r#"c.toml:6:1: error: the window recurs without an end; add `horizon = "7 days"` to the head of the file, or `to` here"#);
    insta::assert_snapshot!(wrong_head("3 days", "soon"), @"c.toml:6:11: error: `soon` is not a date with a time of day; write it like 2026-11-30T07:30, or 2026-11-30T07:30+01:00, or as a length like `7 days`");
    insta::assert_snapshot!(wrong_head("3 days", "2026-11-29T00:00"), @"c.toml:6:11: error: the horizon is not after time 0; time 0 is Mon 2026-11-30 07:30");
    insta::assert_snapshot!(wrong_head("begin = \"2026-11-30T07:30\"\n", ""), @r#"c.toml:1:1: error: `begin` is missing: the date of time 0; add `begin = "2026-11-30T07:30"`, or give --begin"#);
    insta::assert_snapshot!(wrong_head("elbowroom-calendar", "elbowroom-world"), @r#"c.toml:1:10: error: this is not a calendar file; write format = "elbowroom-calendar""#);
    insta::assert_snapshot!(wrong_head("unit = ", "units = "), @"c.toml:5:1: error: unknown key `units`; did you mean `unit`?");
}

#[test]
fn mistakes_in_windows_are_refused() {
    let window = |rest: &str| wrong(&format!("[[window]]\nfact = \"(open bakery)\"\n{rest}"));
    insta::assert_snapshot!(window("hours = \"8 to 8\""), @"c.toml:9:9: error: the window `8 to 8` is empty; for the whole day, write `0 to 24`");
    insta::assert_snapshot!(window("hours = \"8-17\""), @"c.toml:9:9: error: `8-17` is not a range of hours; write them like `8 to 17` or `8:30 to 12`");
    insta::assert_snapshot!(window("days = [\"monday\", \"holidys\"]"), @"c.toml:9:8: error: `holidys` is not a day; write `weekdays`, `monday to thursday`, `2026-12-24`, `2026-12-24 to 2027-01-06`, or a name from `[dates]`");
    insta::assert_snapshot!(window("days = 7"), @"c.toml:9:8: error: expected a text in quotes, or a list of texts");
    insta::assert_snapshot!(window(""), @r#"c.toml:7:1: error: the window has neither begin nor end; add `days`, `except`, `hours`, `from` or `to`; `days = "every day"` for all times"#);
    insta::assert_snapshot!(window("from = \"2026-12-01T10:00\"\nto = \"2026-12-01T09:00\""), @"c.toml:10:6: error: the window is empty; `to` must be later than `from`");
    insta::assert_snapshot!(window("value = 3\nhours = \"8 to 9\""), @"c.toml:9:9: error: `value` is not a key of [[window]]; leave it out");
    insta::assert_snapshot!(window("hour = \"8 to 9\""), @"c.toml:9:1: error: unknown key `hour`; did you mean `hours`?");
}

#[test]
fn calendars_without_measure_are_refused() {
    let long = |horizon: &str| {
        let window = "[[window]]\nfact = \"(open bakery)\"\nhours = [\"8 to 9\", \"10 to 11\"]\n";
        read_with(
            &format!("{}{window}", HEAD.replace("3 days", horizon)),
            None,
        )
    };
    insta::assert_snapshot!(long("99999999999 weeks").expect_err("a mistake"), @"c.toml:6:11: error: the horizon is too far away; leave it out if no window recurs");
    let many =
        "[[window]]\nfact = \"(open bakery)\"\nhours = [\"8 to 9\", \"10 to 11\", \"12 to 13\"]\n";
    let text = HEAD.replace("3 days", "36000 days") + &many.repeat(3);
    insta::assert_snapshot!(read_with(&text, None).expect_err("a mistake"), @"c.toml:10:1: error: the calendar has more than 200000 windows (counted up to here); choose a nearer `horizon`, or name fewer objects");
    assert!(long("9000 days").is_ok());
}

#[test]
fn unknown_facts_are_refused() {
    let fact = |fact: &str| wrong(&format!("[[window]]\nfact = {fact}\nhours = \"8 to 17\"\n"));
    insta::assert_snapshot!(fact("\"(opne bakery)\""), @"c.toml:8:8: error: the domain has no predicate `opne`; did you mean `open`?");
    insta::assert_snapshot!(fact("\"(open bakrey)\""), @"c.toml:8:8: error: the problem has no object `bakrey`; did you mean `bakery`?");
    insta::assert_snapshot!(fact("\"(open ann)\""), @"c.toml:8:8: error: the type of `ann` does not match that of `?shop`; give an object of type shop");
    insta::assert_snapshot!(fact("\"(open)\""), @"c.toml:8:8: error: `open` takes 1 arguments, but 0 are given; `_` means any object");
    insta::assert_snapshot!(fact("\"open\""), @"c.toml:8:8: error: `open` is not the name of a fact; write it like `(open bakery)` or `(open _)`");
    insta::assert_snapshot!(fact("\"(busy)\""), @"c.toml:8:8: error: `busy` is derived from other facts; give windows for those facts");
    insta::assert_snapshot!(fact("\"(free ann)\""), @"c.toml:8:8: error: the problem itself sets (free ann) at the beginning; remove it from the problem's `:init`, or from the calendar");
    insta::assert_snapshot!(fact("\"(open _)\""), @"c.toml:8:8: error: the problem itself sets (open bank) with a timed initial; remove it from the problem's `:init`, or from the calendar");
    insta::assert_snapshot!(fact("[]"), @"c.toml:8:8: error: expected a text in quotes, or a list of texts");
}

#[test]
fn mistakes_in_values_are_refused() {
    let value =
        |fluent: &str, rest: &str| wrong(&format!("[[value]]\nfluent = \"{fluent}\"\n{rest}"));
    insta::assert_snapshot!(value("(rate bank)", "value = 2\nhours = \"8 to 9\""), @"c.toml:8:10: error: (rate bank) does not yet have a value for all other times; the first [[value]] of a fluent must have none of `days`, `hours`, `from` and `to`; the others must have at least one");
    insta::assert_snapshot!(value("(rate bank)", "hours = \"8 to 9\""), @"c.toml:7:1: error: `value` is missing; add `value = 1.5`");
    insta::assert_snapshot!(value("(rate bank)", "value = \"high\""), @"c.toml:9:9: error: expected a number");
    insta::assert_snapshot!(value("(price)", "value = 2"), @"c.toml:8:10: error: the problem itself sets (price) at the beginning; remove it from the problem's `:init`, or from the calendar");
    let twice = "value = 2\n[[value]]\nfluent = \"(rate _)\"\nvalue = 3";
    insta::assert_snapshot!(value("(rate bank)", twice), @"c.toml:11:10: error: (rate bank) already has a value for all other times; the first [[value]] of a fluent must have none of `days`, `hours`, `from` and `to`; the others must have at least one");
}

#[test]
fn fact_without_a_window_is_a_warning() {
    let text = format!("{HEAD}[[window]]\nfact = \"(open bakery)\"\ndays = \"2027-01-01\"\n");
    let (_, warnings) = read_with(&text, None).expect("a calendar");
    insta::assert_snapshot!(warnings, @"c.toml:8:8: warning: (open bakery) is never true before the horizon");
}

#[test]
fn begin_of_the_caller_replaces_that_of_the_file() {
    let (calendar, _) = read_with(HEAD, Some("2026-07-01T09:00")).expect("a calendar");
    insta::assert_snapshot!(calendar.origin(), @"time 0 is Wed 2026-07-01 09:00 +02:00 (Europe/Berlin), in minutes");
    let (calendar, _) = read_with(HEAD, Some("now")).expect("a calendar");
    insta::assert_snapshot!(calendar.origin(), @"time 0 is Wed 2026-11-18 12:06:41 +01:00 (Europe/Berlin), in minutes");
    assert!(calendar.begins_now());
    insta::assert_snapshot!(read_with(HEAD, Some("tomorrow")).expect_err("a mistake"), @"--begin:1:1: error: `tomorrow` is not a date with a time of day; write it like 2026-11-30T07:30, or 2026-11-30T07:30+01:00");
}

#[test]
fn mistake_gives_exactly_one_message() {
    for rest in [
        "hours = \"8-17\"",
        "days = \"holidys\"",
        "except = 3",
        "hours = []",
    ] {
        let window = wrong(&format!("[[window]]\nfact = \"(open bakery)\"\n{rest}"));
        assert_eq!(window.lines().count(), 1, "{window}");
    }
    let value = wrong(
        "[[value]]\nfluent = \"(rate bank)\"\nvalue = \"high\"
         [[value]]\nfluent = \"(rate bank)\"\nvalue = 2\nhours = \"8 to 9\"\n",
    );
    assert_eq!(value.lines().count(), 1, "{value}");
}

#[test]
fn names_of_days_cannot_be_redefined() {
    let window = "[[window]]\nfact = \"(open bakery)\"\nhours = \"8 to 17\"\n";
    for name in [
        "mon",
        "Monday",
        "weekday",
        "weekends",
        "every day",
        "mon to fri",
        "2026-12-24",
    ] {
        let found = wrong(&format!("{window}[dates]\n\"{name}\" = \"2026-12-01\"\n"));
        let expected = format!("error: `{name}` is already a name of days; choose another name");
        assert!(found.ends_with(&expected), "{found}");
    }
}

#[test]
fn unused_parts_are_warnings() {
    let window = "[[window]]\nfact = \"(open bakery)\"\nhours = \"8 to 17\"\nexcept = \"feast\"\n";
    let dates = "[dates]\nfeast = \"2026-12-01\"\nrest = \"2026-12-02\"\n";
    let (_, warnings) = read_with(&format!("{HEAD}{window}{dates}"), None).expect("a calendar");
    assert!(
        warnings.ends_with(
            "warning: no `days` or `except` uses `rest`; use it in a section, or remove it"
        ),
        "{warnings}"
    );
    assert_eq!(warnings.lines().count(), 1, "{warnings}");
    let (_, warnings) = read_with(HEAD, None).expect("a calendar");
    assert!(
        warnings.contains("the calendar has no [[window]] and no [[value]]"),
        "{warnings}"
    );
}

#[test]
fn dates_of_windows_are_exact_from_any_instant() {
    for milliseconds in [0, 1, 300, 500, 700, 999] {
        let (problem, _) = read_problem(&DOMAIN.into(), &PROBLEM.into()).expect("a problem");
        let origin = Origin {
            begin: Some("now"),
            now: UNIX_EPOCH + Duration::from_millis(1_795_000_000_000 + milliseconds),
            is_live: false,
        };
        let text = format!("{HEAD}[[window]]\nfact = \"(open bakery)\"\nhours = \"8 to 17\"\n");
        let (calendar, _) =
            read(&Source::new("c.toml", text.as_str()), &problem, &origin).expect("a calendar");
        let timed = calendar.timed_problem(&PROBLEM.into(), &Source::new("c.toml", text));
        assert!(
            timed
                .text()
                .contains("(not (open bakery))) ; Wed 2026-11-18 17:00\n"),
            "{}",
            timed.text()
        );
        assert!(
            timed
                .text()
                .contains("(open bakery)) ; Thu 2026-11-19 08:00\n"),
            "{}",
            timed.text()
        );
    }
}
