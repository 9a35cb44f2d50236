//! Plots of results, as SVG.
//!
//! An [`IntervalPlot`] shows, for each group, one value of each series, with its interval. No fonts
//! are read, and the same plot gives the same bytes.

use std::fmt::Write as _;

use crate::statistics::{Mean, Proportion};
use crate::svg::{self, INK, escaped, float, number, text, ticks};

/// Values of several series, group by group.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct IntervalPlot {
    /// The title.
    pub title: String,
    /// The label of the vertical axis, with its unit.
    pub axis: String,
    /// The groups, from left to right.
    pub groups: Vec<String>,
    /// The series compared in each group.
    pub series: Vec<Series>,
    /// Reference line across each group, with its name, for example an upper bound.
    pub reference: Option<Series>,
}

/// Values, one for each group.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// The name.
    pub name: String,
    /// Values in the order of the groups; `None` if missing.
    pub points: Vec<Option<Point>>,
}

/// A value with its interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// The value.
    pub value: f64,
    /// The lower and the upper end of its interval.
    pub interval: Option<(f64, f64)>,
}

impl Point {
    /// Returns a value without an interval.
    pub fn exact(value: f64) -> Self {
        Self {
            value,
            interval: None,
        }
    }

    /// Returns a share in percent, with Wilson's interval.
    pub fn share(of: Proportion) -> Option<Self> {
        let percent = |(lower, upper)| (100.0 * lower, 100.0 * upper);
        Some(Self {
            value: 100.0 * of.share()?,
            interval: of.wilson().map(percent),
        })
    }

    /// Returns a mean without an interval.
    pub fn mean(of: Mean) -> Option<Self> {
        of.value().map(Self::exact)
    }
}

/// Colours that colour-blind readers can distinguish (Okabe & Ito 2008).
const COLOURS: [&str; 6] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00",
];

/// Size of the plotted area, in pixels.
const HEIGHT: f64 = 320.0;
const GROUP_WIDTH: f64 = 64.0;
const MAX_GROUPS: usize = 60;
/// Area for title and legend above it, and margins on the other sides.
const HEAD: f64 = 72.0;
const LEFT_MARGIN: f64 = 66.0;
const RIGHT_MARGIN: f64 = 16.0;
const BOTTOM_MARGIN: f64 = 34.0;

impl IntervalPlot {
    /// Renders the plot as an SVG document.
    pub fn svg(&self) -> String {
        let groups = float(self.groups.len().clamp(1, MAX_GROUPS));
        let margins = LEFT_MARGIN + RIGHT_MARGIN;
        let width = (margins + GROUP_WIDTH * groups)
            .max(560.0)
            .max(self.head_width());
        let mut svg = svg::begin(width, HEAD + HEIGHT + BOTTOM_MARGIN);
        let column = (width - margins) / float(self.groups.len().max(1));
        let top = self.top();
        let at = |group: f64, value: f64| {
            let height = HEIGHT * (1.0 - value / top);
            (LEFT_MARGIN + column * group, HEAD + height)
        };
        self.draw_head(&mut svg);
        for value in ticks(0.0, top) {
            let (x, y) = at(0.0, value);
            line(&mut svg, (x, y), (width - RIGHT_MARGIN, y), "#e1e1e1", 1);
            text(&mut svg, (x - 6.0, y + 4.0), 11, "end", &number(value));
        }
        line(&mut svg, at(0.0, 0.0), at(0.0, top), INK, 1);
        let (x, y) = (18.0, HEAD + HEIGHT / 2.0);
        let _ = writeln!(
            svg,
            "<text x=\"{x}\" y=\"{y}\" font-size=\"13\" text-anchor=\"middle\" fill=\"{INK}\" \
             transform=\"rotate(-90 {x} {y})\">{}</text>",
            escaped(&self.axis)
        );
        for (index, group) in self.groups.iter().enumerate() {
            let (x, y) = at(float(index) + 0.5, 0.0);
            text(&mut svg, (x, y + 18.0), 12, "middle", group);
        }
        for (index, point) in self
            .reference
            .iter()
            .flat_map(|it| it.points.iter().enumerate())
        {
            if let Some(Point { value, .. }) = *point {
                let ends = [0.08, 0.92].map(|share| at(float(index) + share, value));
                line(&mut svg, ends[0], ends[1], INK, 2);
            }
        }
        let places = (1..=self.series.len()).map(|it| float(it) / float(self.series.len() + 1));
        for ((series, colour), place) in self.series.iter().zip(COLOURS.iter().cycle()).zip(places)
        {
            let points = series.points.iter().enumerate();
            for (index, point) in points.filter_map(|(index, point)| Some((index, (*point)?))) {
                let x = float(index) + place;
                if let Some((lower, upper)) = point.interval {
                    line(&mut svg, at(x, lower), at(x, upper), colour, 2);
                }
                dot(&mut svg, at(x, point.value), colour);
            }
        }
        svg.push_str("</svg>\n");
        svg
    }

    /// Draws title and legend.
    fn draw_head(&self, svg: &mut String) {
        text(svg, (16.0, 26.0), 16, "start", &self.title);
        let mut x = 20.0;
        for (series, colour) in self.series.iter().zip(COLOURS.iter().cycle()) {
            dot(svg, (x, 48.0), colour);
            text(svg, (x + 10.0, 52.0), 13, "start", &series.name);
            x += 10.0 + name_width(&series.name);
        }
        if let Some(reference) = &self.reference {
            line(svg, (x - 4.0, 48.0), (x + 14.0, 48.0), INK, 2);
            text(svg, (x + 20.0, 52.0), 13, "start", &reference.name);
        }
    }

    /// Returns the width of title and legend.
    fn head_width(&self) -> f64 {
        let series = self.series.iter().map(|it| 10.0 + name_width(&it.name));
        let reference = self.reference.iter().map(|it| 20.0 + name_width(&it.name));
        let legend = 20.0 + series.chain(reference).sum::<f64>();
        legend.max(16.0 + name_width(&self.title))
    }

    /// Returns a round number above all values.
    fn top(&self) -> f64 {
        let series = self.series.iter().chain(&self.reference);
        let points = series.flat_map(|series| series.points.iter().flatten());
        let ends = points.map(|point| point.interval.map_or(point.value, |(_, upper)| upper));
        let most = ends.fold(0.0, f64::max);
        if most <= 0.0 {
            return 1.0;
        }
        let step = 10_f64.powf(most.log10().floor()) / 2.0;
        (most * 1.02 / step).ceil() * step
    }
}

/// Returns the estimated width of a name and the space after it. Letters 13 pixels high are on
/// average at most about 8 pixels wide.
fn name_width(name: &str) -> f64 {
    8.0 * float(name.chars().count()) + 22.0
}

fn line(svg: &mut String, from: (f64, f64), to: (f64, f64), colour: &str, width: u32) {
    let _ = writeln!(
        svg,
        "<line x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" stroke=\"{colour}\" \
         stroke-width=\"{width}\"/>",
        from.0, from.1, to.0, to.1
    );
}

fn dot(svg: &mut String, (x, y): (f64, f64), colour: &str) {
    let _ = writeln!(
        svg,
        "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"{colour}\"/>"
    );
}

#[cfg(test)]
mod tests {
    use super::{IntervalPlot, Point, Series};

    #[test]
    fn each_value_is_dot_and_each_interval_is_line() {
        let point = |value: f64| {
            Some(Point {
                value,
                interval: Some((value - 1.0, value + 1.0)),
            })
        };
        let plot = IntervalPlot {
            title: "Success <by> executor".to_owned(),
            axis: "%".to_owned(),
            groups: vec!["p1".to_owned(), "p2".to_owned()],
            series: vec![Series {
                name: "esterel".to_owned(),
                points: vec![point(10.0), None],
            }],
            reference: Some(Series {
                name: "optimum".to_owned(),
                points: vec![point(12.0), point(13.0)],
            }),
        };
        let svg = plot.svg();
        // One dot in the plot and one in the legend.
        assert_eq!(svg.matches("<circle").count(), 2);
        for word in [
            "p1",
            "p2",
            "esterel",
            "optimum",
            "Success &lt;by&gt; executor",
        ] {
            assert!(svg.contains(word), "{word}: {svg}");
        }
        assert_eq!(svg, plot.svg());
    }

    #[test]
    fn empty_plot_is_drawn() {
        assert!(IntervalPlot::default().svg().ends_with("</svg>\n"));
    }
}
