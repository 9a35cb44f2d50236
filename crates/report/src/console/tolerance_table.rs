//! Tolerance table with one row for each parameter.
//!
//! ```text
//!                                 nominal   lower   upper       slack     +-100%
//!  d0  (drive rover depot shelf)       10   0.001  19.996   -99%  +99%  |----o----|
//! !d1  (unlock office)                  6       6       9     0%  +50%       o-|
//! ```
//!
//! All bars have the scale in the heading: deviations relative to the nominal value, which is in
//! the centre. An arrow marks an end beyond the scale. `!` marks parameters with little slack.
//!
//! Numbers are rounded to the safe side: lower ends up, upper ends down, and slack towards zero.

use std::fmt::Write as _;

use elbowroom_num::{End, Interval, Rational};
use unicode_width::UnicodeWidthStr;

use super::{EMPHASIS, SECONDARY, TextLayout, WARNING, styled};
use crate::decimal::{self as number, Rounding};

/// A row of the table.
#[derive(Clone, Debug)]
pub struct Row {
    /// The parameter's name.
    pub name: String,
    /// The quantity in plain words.
    pub quantity: String,
    /// Its value in the original plan.
    pub nominal: Rational,
    /// The values it may take.
    pub interval: Interval,
}

impl Row {
    /// Returns the smaller one of the two tolerated deviations, relative to the nominal value
    /// unless that is 0.
    pub fn smaller_deviation(&self) -> Rational {
        let (lower, upper) = (&self.interval.lower, &self.interval.upper);
        let distance = |end: &End| Some((end.value()? - &self.nominal).abs());
        let room = [distance(lower), distance(upper)];
        let room = room.into_iter().flatten().min();
        let share = |room: Rational| room.checked_div(&self.nominal.abs()).unwrap_or(room);
        // An interval without ends has the most slack.
        room.map_or_else(|| Rational::from(i64::MAX), share)
    }

    /// Returns `true` if the slack in one direction is below [`CRITICAL`] percent.
    pub fn is_critical(&self) -> bool {
        let room = self.smaller_deviation();
        room.is_zero() || (!self.nominal.is_zero() && room < Rational::new(CRITICAL, 100))
    }

    /// Returns the distance of an end from the nominal value, as a fraction of it. Returns `None`
    /// for an infinite end or a nominal value of 0.
    fn deviation(&self, end: &End) -> Option<Rational> {
        let distance = (end.value()? - &self.nominal).abs();
        distance.checked_div(&self.nominal.abs())
    }
}

/// Slack below which a parameter is critical, in percent of the nominal value.
pub const CRITICAL: i64 = 10;
/// Possible scales of the bars: the deviation at their ends, in percent.
const SCALES: [i64; 7] = [1, 2, 5, 10, 20, 50, 100];
/// Possible widths of the bar in columns; the first one that fits is used.
const BARS: [usize; 3] = [11, 9, 7];
/// Maximum width of a separate column of names if the numbers are on their own lines.
const SHORT_NAME: usize = 12;
/// Left margin, and gap between columns.
const GAP: usize = 2;

/// Renders the rows as a table; empty without rows.
pub fn render(rows: &[Row], look: TextLayout) -> String {
    if rows.is_empty() {
        return String::new();
    }
    let cells: Vec<Cells> = rows.iter().map(Cells::of).collect();
    let numbers = Numbers::fitting(&cells);
    let names = widest(rows.iter().map(|row| row.name.as_str()));
    let quantities = widest(rows.iter().map(|row| row.quantity.as_str()));
    let indent = 1;
    let beside = indent + names + GAP + quantities;
    let bar_beside = |text: usize| {
        let room = look.width.saturating_sub(text + numbers.width() + 2 * GAP);
        BARS.into_iter().find(|&bar| bar <= room)
    };
    let layout = match bar_beside(beside) {
        Some(bar) => Layout {
            names,
            text: beside,
            bar,
            stacked: false,
        },
        None => Layout {
            names: names.min(SHORT_NAME),
            text: indent + GAP,
            bar: bar_beside(indent + GAP).unwrap_or(0),
            stacked: true,
        },
    };
    let mut table = String::new();
    let scale = scale(rows);
    let heading = numbers.heading(look.width.saturating_sub(layout.text + GAP));
    let mut heading = format!("{:1$}{heading}", "", layout.text + GAP);
    if layout.bar > 0 {
        let sign = if look.unicode { "±" } else { "+-" };
        let span = format!("{sign}{scale}%");
        let _ = write!(heading, "  {span:^width$}", width = layout.bar);
    }
    push_line(&mut table, &styled(SECONDARY, heading.trim_end()));
    for (row, cells) in rows.iter().zip(&cells) {
        layout.push_row(&mut table, row, cells, (&numbers, scale), look);
    }
    table
}

/// The widths and positions of the columns.
struct Layout {
    /// Width of the names.
    names: usize,
    /// Start column of the numbers, without the gap.
    text: usize,
    /// Columns of the bar; 0 if it does not fit.
    bar: usize,
    /// `true` if the numbers are on a separate line below name and quantity.
    stacked: bool,
}

impl Layout {
    fn push_row(
        &self,
        table: &mut String,
        row: &Row,
        cells: &Cells,
        (numbers, scale): (&Numbers, i64),
        look: TextLayout,
    ) {
        let is_critical = row.is_critical();
        let style = if is_critical { WARNING } else { EMPHASIS };
        let mark = if is_critical { '!' } else { ' ' };
        let name = pad_right(&format!("{mark}{}", row.name), self.names + 1);
        let name = styled(style, &name);
        let bar = bar(row, scale, self.bar, look.unicode);
        let figures = numbers.line(cells);
        if self.stacked {
            let name_width = UnicodeWidthStr::width(&*row.name).max(self.names);
            let room = look.width.saturating_sub(1 + name_width + GAP);
            let quantity = shorten(&row.quantity, room.max(12), look.unicode);
            push_line(table, &format!("{name}  {quantity}"));
            let indent = self.text + GAP;
            push_line(table, &format!("{:indent$}{figures}  {bar}", ""));
        } else {
            let quantity = pad_right(&row.quantity, self.text - 1 - self.names - GAP);
            push_line(table, &format!("{name}  {quantity}  {figures}  {bar}"));
        }
    }
}

/// Formatted numbers of one row.
struct Cells {
    nominal: String,
    lower: String,
    upper: String,
    less: String,
    more: String,
}

impl Cells {
    fn of(row: &Row) -> Self {
        let end = |end: &End, rounding| match end.value() {
            Some(value) => number::rounded_inwards(value, &row.nominal, rounding),
            None if rounding == Rounding::Up => "-inf".to_owned(),
            None => "inf".to_owned(),
        };
        Self {
            nominal: number::nearest(&row.nominal),
            lower: end(&row.interval.lower, Rounding::Up),
            upper: end(&row.interval.upper, Rounding::Down),
            less: slack(&row.nominal, &row.interval.lower, '-'),
            more: slack(&row.nominal, &row.interval.upper, '+'),
        }
    }
}

/// Formats the distance of the end from the nominal value in percent, rounded towards zero.
fn slack(nominal: &Rational, end: &End, sign: char) -> String {
    let Some(value) = end.value() else {
        return format!("{sign}inf");
    };
    let distance = (value - nominal).abs();
    if distance.is_zero() {
        return "0%".to_owned();
    }
    let Some(share) = distance.checked_div(&nominal.abs()) else {
        return "-".to_owned(); // no percentage of a nominal 0
    };
    let percent = &share * &Rational::from(100);
    let digits = u32::from(percent < Rational::from(10));
    format!(
        "{sign}{}%",
        number::rounded(&percent, digits, Rounding::Down)
    )
}

/// Widths of the number columns, with aligned decimal points.
struct Numbers {
    nominal: Split,
    lower: Split,
    upper: Split,
    less: usize,
    more: usize,
}

/// Digits before and after the decimal point.
#[derive(Clone, Copy)]
struct Split {
    whole: usize,
    part: usize,
    width: usize,
}

impl Split {
    fn fitting<'a>(heading: &str, texts: impl Iterator<Item = &'a str>) -> Self {
        let (mut whole, mut part) = (0, 0);
        for text in texts {
            let at = text.find('.').unwrap_or(text.len());
            whole = whole.max(at);
            part = part.max(text.len() - at);
        }
        let width = (whole + part).max(heading.len());
        Self { whole, part, width }
    }

    fn align(self, text: &str) -> String {
        let at = text.find('.').unwrap_or(text.len());
        let left = self.width - self.part - at;
        let right = self.part - (text.len() - at);
        format!("{:left$}{text}{:right$}", "", "")
    }
}

impl Numbers {
    fn fitting(cells: &[Cells]) -> Self {
        let column = |heading, text: fn(&Cells) -> &str| {
            let split = Split::fitting(heading, cells.iter().map(text));
            debug_assert!(split.width >= split.whole + split.part);
            split
        };
        Self {
            nominal: column("nominal", |c| &c.nominal),
            lower: column("lower", |c| &c.lower),
            upper: column("upper", |c| &c.upper),
            less: widest(cells.iter().map(|c| c.less.as_str())),
            more: widest(cells.iter().map(|c| c.more.as_str())),
        }
    }

    fn width(&self) -> usize {
        self.nominal.width + self.lower.width + self.upper.width + self.slack() + 3 * GAP
    }

    fn slack(&self) -> usize {
        (self.less + 1 + self.more).max("slack".len())
    }

    fn heading(&self, room: usize) -> String {
        let heading = format!(
            "{:>1$}  {2:>3$}  {4:>5$}  {6:>7$}",
            "nominal",
            self.nominal.width,
            "lower",
            self.lower.width,
            "upper",
            self.upper.width,
            "slack",
            self.slack(),
        );
        heading.chars().take(room).collect()
    }

    fn line(&self, cells: &Cells) -> String {
        let slack = format!(
            "{:>1$} {2:>3$}",
            cells.less, self.less, cells.more, self.more
        );
        format!(
            "{}  {}  {}  {slack:>width$}",
            self.nominal.align(&cells.nominal),
            self.lower.align(&cells.lower),
            self.upper.align(&cells.upper),
            width = self.slack(),
        )
    }
}

/// Returns the smallest scale, in percent, at which all ends fit into the bars, and at most 100.
fn scale(rows: &[Row]) -> i64 {
    let ends = rows.iter().flat_map(|row| {
        let ends = [&row.interval.lower, &row.interval.upper];
        ends.into_iter().filter_map(|end| row.deviation(end))
    });
    let greatest = ends.max().unwrap_or(Rational::ONE);
    let fits = |percent: &i64| greatest <= Rational::new(*percent, 100);
    SCALES.into_iter().find(fits).unwrap_or(100)
}

/// Renders the interval around the nominal value as a bar: `|--o---|`, or `|--o---->` if an end is
/// beyond the scale. Empty if the nominal value is 0.
fn bar(row: &Row, scale: i64, width: usize, unicode: bool) -> String {
    if width == 0 || row.nominal.is_zero() {
        return String::new();
    }
    let [left, right, endless_left, endless_right, line, dot] = if unicode {
        ['├', '┤', '◀', '▶', '─', '●']
    } else {
        ['|', '|', '<', '>', '-', 'o']
    };
    let middle = width / 2;
    let side = |end: &End, limit: char, endless: char| -> Vec<char> {
        let columns = row
            .deviation(end)
            .and_then(|share| columns(&share, scale, middle));
        let mut side = vec![line; columns.unwrap_or(middle)];
        if let Some(last) = side.last_mut() {
            *last = if columns.is_none() { endless } else { limit };
        }
        side
    };
    let below = side(&row.interval.lower, left, endless_left);
    let above = side(&row.interval.upper, right, endless_right);
    let blank = " ".repeat(middle - below.len());
    let below: String = below.into_iter().rev().collect();
    let above: String = above.into_iter().collect();
    format!("{blank}{below}{dot}{above}")
}

/// Returns the number of columns for a fraction of the nominal value, rounded to the nearest;
/// `None` if it exceeds the scale.
fn columns(share: &Rational, scale: i64, middle: usize) -> Option<usize> {
    // There are few columns, so a linear search is the simplest solution.
    let steps = i64::try_from(middle).expect("a narrow bar");
    let part = (share * &Rational::from(100)).checked_div(&Rational::from(scale))?;
    if part > Rational::ONE {
        return None;
    }
    (0..=middle).find(|&column| {
        let column = i64::try_from(column).expect("a narrow bar");
        part < Rational::new(2 * column + 1, 2 * steps)
    })
}

fn widest<'a>(texts: impl Iterator<Item = &'a str>) -> usize {
    texts.map(UnicodeWidthStr::width).max().unwrap_or(0)
}

fn pad_right(text: &str, width: usize) -> String {
    let missing = width.saturating_sub(UnicodeWidthStr::width(text));
    format!("{text}{:missing$}", "")
}

/// Shortens the text to `width` columns by omitting its middle.
fn shorten(text: &str, width: usize, unicode: bool) -> String {
    if UnicodeWidthStr::width(text) <= width {
        return text.to_owned();
    }
    let gap = if unicode { "…" } else { "..." };
    let keep = width.saturating_sub(UnicodeWidthStr::width(gap));
    let head: String = text.chars().take(keep.div_ceil(2)).collect();
    let count = text.chars().count();
    let tail: String = text.chars().skip(count - keep / 2).collect();
    format!("{head}{gap}{tail}")
}

fn push_line(text: &mut String, line: &str) {
    text.push_str(line.trim_end());
    text.push('\n');
}

#[cfg(test)]
mod tests;
