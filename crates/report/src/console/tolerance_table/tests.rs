use elbowroom_num::{End, Interval};
use insta::assert_snapshot;
use unicode_width::UnicodeWidthStr;

use super::{Row, render};
use crate::console::TextLayout;

const UTF8: TextLayout = TextLayout {
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

/// Renders the table without escape sequences.
fn shown(rows: &[Row], look: TextLayout) -> String {
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
    let text = shown(&delivery(), TextLayout::PLAIN);
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
    let narrow = TextLayout {
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
fn all_bars_have_one_scale_with_the_nominal_value_in_the_middle() {
    let bar = |lower: &str, upper: &str, scale: i64| {
        super::bar(&row("x", "", "1000", lower, upper), scale, 11, false)
    };
    assert_eq!(bar("0", "2000", 100), "|----o----|");
    assert_eq!(bar("500", "1200", 100), "  |--o|");
    assert_eq!(bar("1000", "1000", 100), "     o");
    assert_eq!(bar("1000", "2001", 100), "     o---->");
    assert_eq!(bar("inf", "inf", 100), "<----o---->");
    assert_eq!(bar("950", "1100", 10), "  |--o----|");
    // Less than half a column is not drawn.
    assert_eq!(bar("901", "1099", 100), "     o");
    assert_eq!(bar("900", "1100", 100), "    |o|");
}

#[test]
fn the_scale_is_the_least_that_has_room_for_all_ends() {
    let scale = |upper: &str| super::scale(&[row("x", "", "1000", "1000", upper)]);
    assert_eq!(scale("1000"), 1);
    assert_eq!(scale("1010"), 1);
    assert_eq!(scale("1011"), 2);
    assert_eq!(scale("1500"), 50);
    assert_eq!(scale("9000"), 100);
    assert_eq!(scale("inf"), 1);
}

#[test]
fn what_may_hardly_deviate_in_one_direction_is_critical() {
    let is_critical =
        |nominal: &str, lower: &str, upper: &str| row("x", "", nominal, lower, upper).is_critical();
    assert!(is_critical("10", "0", "10.9"));
    assert!(!is_critical("10", "9", "11"));
    assert!(is_critical("10", "9.1", "inf"));
    assert!(is_critical("0", "0", "5"));
    assert!(!is_critical("0", "inf", "inf"));
}
