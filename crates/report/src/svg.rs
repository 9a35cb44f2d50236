//! Elements of the pictures, as SVG. No fonts are read, and the same picture gives the same bytes.

use std::fmt::Write as _;

pub(crate) const INK: &str = "#3c3c3c";

/// Approximate number of ticks on an axis.
const TICKS: f64 = 6.0;

/// Begins a document of this size, with a white background.
pub(crate) fn begin(width: f64, height: f64) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" \
         viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"sans-serif\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    )
}

pub(crate) fn text(svg: &mut String, (x, y): (f64, f64), size: u32, anchor: &str, words: &str) {
    let _ = writeln!(
        svg,
        "<text x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"{size}\" text-anchor=\"{anchor}\" \
         fill=\"{INK}\">{}</text>",
        escaped(words)
    );
}

pub(crate) fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            other => escaped.push(other),
        }
    }
    escaped
}

/// Returns round numbers between the ends.
pub(crate) fn ticks(from: f64, to: f64) -> Vec<f64> {
    let span = to - from;
    if span.is_nan() || span <= 0.0 || span.is_infinite() {
        return Vec::new();
    }
    let rough = span / TICKS;
    let power = 10_f64.powf(rough.log10().floor());
    let factors = [1.0, 2.0, 5.0, 10.0];
    let fits = factors.iter().find(|factor| *factor * power >= rough);
    let step = fits.unwrap_or(&10.0) * power;
    let first = (from / step).ceil();
    let mut ticks = Vec::new();
    let mut count = 0.0;
    while (first + count) * step <= to && count < 2.0 * TICKS + 2.0 {
        ticks.push((first + count) * step);
        count += 1.0;
    }
    ticks
}

pub(crate) fn number(value: f64) -> String {
    let text = format!("{value:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0" } else { text }.to_owned()
}

#[allow(clippy::cast_precision_loss, reason = "counts of drawn elements")]
pub(crate) fn float(count: usize) -> f64 {
    count as f64
}

#[cfg(test)]
mod tests {
    use super::ticks;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks(0.3, 6.1), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(ticks(-40.0, 40.0), [-40.0, -20.0, 0.0, 20.0, 40.0]);
        assert!(ticks(1.0, 1.0).is_empty() && ticks(0.0, f64::INFINITY).is_empty());
    }
}
