use elbowroom::num::{End, Interval, Rational};
use insta::assert_snapshot;
use unicode_width::UnicodeWidthStr;

use super::{Row, render};
use crate::look::Look;

const UTF8: Look = Look {
    width: 80,
    unicode: true,
};

fn row(name: &str, quantity: &str, nominal: &str, lower: &str, upper: &str) -> Row {
    let end = |text: &str| match text {
        "inf" => End::Infinite,
        number => End::Closed(number.parse().expect("a number")),
    };
    Row {
        name: name.to_owned(),
        quantity: quantity.to_owned(),
        nominal: nominal.parse().expect("a number"),
        interval: Interval {
            lower: end(lower),
            upper: end(upper),
        },
    }
}

/// The table without escape sequences.
fn shown(rows: &[Row], look: Look) -> String {
    let text = anstream::adapter::strip_str(&render(rows, look)).to_string();
    for line in text.lines() {
        assert!(
            UnicodeWidthStr::width(line) <= look.width,
            "too wide: {line:?}"
        );
    }
    text
}

fn delivery() -> Vec<Row> {
    vec![
        row("d0", "(drive rover depot shelf)", "10", "0.001", "17.5"),
        row("d1", "(unlock office)", "6", "0", "inf"),
        row("d2", "(pick rover parcel shelf)", "2", "0.001", "2.5"),
        row("d3", "(drive rover shelf office)", "15", "15", "15"),
        row("r", "initial (charge rover)", "0", "inf", "100/3"),
    ]
}

#[test]
fn a_row_shows_the_interval_and_where_the_nominal_value_sits_in_it() {
    assert_snapshot!(shown(&delivery(), UTF8));
}

#[test]
fn without_unicode_the_table_is_plain_ascii() {
    let text = shown(&delivery(), Look::PLAIN);
    assert!(text.is_ascii());
    assert_snapshot!(text);
}

#[test]
fn long_names_move_the_numbers_to_a_line_of_their_own() {
    let rows = vec![
        row(
            "duration_of_the_second_inspection",
            "(inspect-structure-with-manipulator auv_number_one waypoint_initial_12 panel_7)",
            "139/7",
            "1/3",
            "123456.789",
        ),
        row("short", "(hover auv)", "1", "0", "2"),
    ];
    assert_snapshot!(shown(&rows, UTF8));
}

#[test]
fn a_narrow_terminal_loses_the_bar_but_no_number() {
    let narrow = Look {
        width: 44,
        unicode: true,
    };
    assert_snapshot!(shown(&delivery()[..2], narrow));
}

#[test]
fn the_table_of_no_parameters_is_empty() {
    assert_eq!(render(&[], UTF8), "");
}

#[test]
fn the_dot_touches_an_end_of_the_bar_only_when_the_value_does() {
    let at = |nominal: &str| {
        let row = row("x", "", nominal, "0", "1000");
        super::bar(&row.nominal, &row.interval, 11, false)
    };
    assert_eq!(at("0"), "o---------|");
    assert_eq!(at("1"), "|o--------|");
    assert_eq!(at("500"), "|----o----|");
    assert_eq!(at("999"), "|--------o|");
    assert_eq!(at("1000"), "|---------o");
    let _ = Rational::ONE;
}
