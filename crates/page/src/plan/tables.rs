//! Tables of a plan.

use elbowroom::answers::envelope::timeline::{TimedAction, Timeline, WindowAnswer};
use elbowroom::answers::envelope::{LimitedRange, Quantity, Range};
use elbowroom::num::{End, Rational};
use elbowroom::report::decimal::{Rounding, nearest, rounded_inwards};

use super::window_words;
use crate::document::{Table, Text, Texts};

/// Formats both ends of an interval, rounded inwards.
pub(super) fn ends(range: &Range) -> (String, String) {
    let nominal = &range.quantity.nominal;
    let end = |end: &End, infinite: &str, rounding| match end.value() {
        Some(value) => rounded_inwards(value, nominal, rounding),
        None => infinite.to_owned(),
    };
    (
        end(&range.lower, "-inf", Rounding::Up),
        end(&range.upper, "inf", Rounding::Down),
    )
}

fn columns(names: &[(&str, bool)]) -> Vec<(String, bool)> {
    names
        .iter()
        .map(|(name, is_number)| ((*name).to_owned(), *is_number))
        .collect()
}

/// Builds the table of the envelope.
pub(super) fn slack_table(limited_ranges: &[LimitedRange], texts: &mut Texts) -> Table {
    let mut limit = |limit: &Option<String>| match limit {
        Some(limit) => texts.share(limit),
        None => "".into(),
    };
    let mut rows = Vec::with_capacity(limited_ranges.len());
    for limited in limited_ranges {
        let (lower, upper) = ends(&limited.range);
        let quantity = &limited.range.quantity;
        rows.push(vec![
            quantity.name.as_str().into(),
            quantity.quantity.as_str().into(),
            nearest(&quantity.nominal).into(),
            lower.into(),
            upper.into(),
            timeout(&limited.range).into(),
            limit(&limited.lower_limit),
            limit(&limited.upper_limit),
        ]);
    }
    Table {
        heading: "How far each quantity may deviate".to_owned(),
        columns: columns(&[
            ("parameter", false),
            ("quantity", false),
            ("nominal", true),
            ("lower", true),
            ("upper", true),
            ("time-out", true),
            ("limit of the lower end", false),
            ("limit of the upper end", false),
        ]),
        rows,
        ..Table::default()
    }
}

/// Formats the time-out of the action, if the quantity is its duration.
fn timeout(range: &Range) -> String {
    range.timeout.as_ref().map(nearest).unwrap_or_default()
}

pub(super) fn ranges(ranges: &[Range]) -> Table {
    let row = |range: &Range| {
        let (lower, upper) = ends(range);
        let quantity = &range.quantity;
        vec![
            quantity.name.as_str().into(),
            quantity.quantity.as_str().into(),
            nearest(&quantity.nominal).into(),
            lower.into(),
            upper.into(),
        ]
    };
    Table {
        heading: "The box".to_owned(),
        columns: columns(&[
            ("parameter", false),
            ("quantity", false),
            ("nominal", true),
            ("lower", true),
            ("upper", true),
        ]),
        rows: ranges.iter().map(row).collect(),
        ..Table::default()
    }
}

pub(crate) fn quantities(quantities: &[Quantity]) -> Table {
    let row = |quantity: &Quantity| {
        vec![
            quantity.name.as_str().into(),
            quantity.quantity.as_str().into(),
            nearest(&quantity.nominal).into(),
        ]
    };
    Table {
        heading: "Open questions".to_owned(),
        columns: columns(&[("parameter", false), ("quantity", false), ("nominal", true)]),
        rows: quantities.iter().map(row).collect(),
        ..Table::default()
    }
}

/// Builds the table of actions and times; `values` describes the values for which the windows hold.
pub(crate) fn times(timeline: &Timeline, values: &str) -> Table {
    let has_windows = timeline
        .actions
        .iter()
        .any(|it| window_words(&it.start_window).is_some());
    let mut names = vec![("action", false), ("start", true), ("end", true)];
    if has_windows {
        names.extend([("may start at", true), ("may end at", true)]);
    }
    let words = |window: Option<&WindowAnswer>| -> Text {
        window.and_then(window_words).unwrap_or_default().into()
    };
    let row = |action: &TimedAction| {
        let end = action.end.as_ref().map(|end| nearest(&end.0));
        let mut cells: Vec<Text> = vec![
            action.action.as_str().into(),
            nearest(&action.start.0).into(),
            end.unwrap_or_default().into(),
        ];
        if has_windows {
            cells.push(words(Some(&action.start_window)));
            cells.push(words(action.end_window.as_ref()));
        }
        cells
    };
    let mut rows: Vec<(&Rational, usize, Vec<Text>)> = timeline
        .actions
        .iter()
        .enumerate()
        .map(|(index, action)| (&action.start.0, index, row(action)))
        .collect();
    rows.sort_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)));
    Table {
        heading: "Actions".to_owned(),
        note: if has_windows {
            format!(
                "Planned start and end, each as early as possible, and the possible times for all \
                 values {values}."
            )
        } else {
            String::new()
        },
        columns: columns(&names),
        bars: rows.iter().map(|(_, index, _)| *index).collect(),
        rows: rows.into_iter().map(|(_, _, cells)| cells).collect(),
        ..Table::default()
    }
}
