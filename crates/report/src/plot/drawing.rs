//! Drawing of plots with `plotters`.

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::IntervalPlot;

/// Error of the drawing library.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the plot cannot be drawn: {0}")]
pub struct PlotError(String);

/// Colours that colour-blind readers can distinguish (Okabe & Ito 2008).
const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
];

const INK: RGBColor = RGBColor(60, 60, 60);
const HEIGHT: u32 = 420;
/// Height of the area for title and legend.
const HEAD: u32 = 64;

impl IntervalPlot {
    /// Renders the plot as an SVG document.
    ///
    /// # Errors
    /// As the drawing library.
    pub fn svg(&self) -> Result<String, PlotError> {
        let mut svg = String::new();
        let columns = u32::try_from(self.groups.len())
            .unwrap_or(u32::MAX)
            .clamp(1, 60);
        let width = (90 + 64 * columns).max(560).max(self.legend_width());
        let root = SVGBackend::with_string(&mut svg, (width, HEIGHT)).into_drawing_area();
        let drawn = self.draw(&root).and_then(|()| root.present().map_err(text));
        drop(root);
        drawn.map(|()| svg).map_err(PlotError)
    }

    fn draw(&self, root: &DrawingArea<SVGBackend<'_>, Shift>) -> Result<(), String> {
        root.fill(&WHITE).map_err(text)?;
        self.draw_head(root)?;
        let (_, below) = root.split_vertically(HEAD);
        let groups = float(self.groups.len().max(1));
        let mut chart = ChartBuilder::on(&below)
            .margin(8)
            .x_label_area_size(26)
            .y_label_area_size(56)
            .build_cartesian_2d(0.0..groups, 0.0..self.top())
            .map_err(text)?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .x_labels(0)
            .y_desc(self.axis.as_str())
            .light_line_style(WHITE)
            .bold_line_style(RGBColor(225, 225, 225))
            .axis_style(INK)
            .label_style(font(12))
            .axis_desc_style(font(13))
            .draw()
            .map_err(text)?;
        for (index, group) in self.groups.iter().enumerate() {
            let at = chart.backend_coord(&(float(index) + 0.5, 0.0));
            let style = font(12).pos(Pos::new(HPos::Center, VPos::Top));
            root.draw(&Text::new(group.clone(), (at.0, at.1 + 6), style))
                .map_err(text)?;
        }
        if let Some(reference) = &self.reference {
            let lines = reference
                .points
                .iter()
                .enumerate()
                .filter_map(|(index, point)| {
                    let (left, value) = (float(index), point.as_ref()?.value);
                    let ends = vec![(left + 0.08, value), (left + 0.92, value)];
                    Some(PathElement::new(ends, INK.stroke_width(2)))
                });
            chart.draw_series(lines).map_err(text)?;
        }
        for (number, series) in self.series.iter().enumerate() {
            let colour = COLOURS[number % COLOURS.len()];
            let place = (float(number) + 1.0) / (float(self.series.len()) + 1.0);
            let points = || {
                let numbered = series.points.iter().enumerate();
                numbered.filter_map(move |(at, point)| Some((float(at) + place, (*point)?)))
            };
            let intervals = points().filter_map(|(x, point)| {
                let (lower, upper) = point.interval?;
                let ends = vec![(x, lower), (x, upper)];
                Some(PathElement::new(ends, colour.stroke_width(2)))
            });
            chart.draw_series(intervals).map_err(text)?;
            let values =
                points().map(|(x, point)| Circle::new((x, point.value), 3, colour.filled()));
            chart.draw_series(values).map_err(text)?;
        }
        Ok(())
    }

    /// Draws title and legend.
    fn draw_head(&self, root: &DrawingArea<SVGBackend<'_>, Shift>) -> Result<(), String> {
        root.draw(&Text::new(self.title.clone(), (16, 12), font(16)))
            .map_err(text)?;
        let mut x = 20;
        for (number, series) in self.series.iter().enumerate() {
            let colour = COLOURS[number % COLOURS.len()];
            root.draw(&Circle::new((x, 48), 3, colour.filled()))
                .map_err(text)?;
            x = legend_name(root, &series.name, x + 10)?;
        }
        if let Some(reference) = &self.reference {
            let line = vec![(x - 4, 48), (x + 14, 48)];
            root.draw(&PathElement::new(line, INK.stroke_width(2)))
                .map_err(text)?;
            legend_name(root, &reference.name, x + 20)?;
        }
        Ok(())
    }

    /// Returns the width of the legend.
    fn legend_width(&self) -> u32 {
        let series = self.series.iter();
        let names = series.map(|series| 10 + name_width(&series.name));
        let reference = self.reference.iter();
        let names = names.chain(reference.map(|reference| 20 + name_width(&reference.name)));
        let legend = names.fold(20, i32::saturating_add);
        let title = name_width(&self.title).saturating_add(16);
        u32::try_from(legend.max(title)).unwrap_or(u32::MAX)
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

/// Writes a name of the legend. Returns the start of the next entry.
fn legend_name(
    root: &DrawingArea<SVGBackend<'_>, Shift>,
    name: &str,
    x: i32,
) -> Result<i32, String> {
    root.draw(&Text::new(name.to_owned(), (x, 42), font(13)))
        .map_err(text)?;
    Ok(x.saturating_add(name_width(name)))
}

/// Returns the estimated width of a name and the space after it. Letters 13 pixels high are on
/// average at most about 8 pixels wide.
fn name_width(name: &str) -> i32 {
    let length = i32::try_from(name.chars().count()).unwrap_or(i32::MAX);
    length.saturating_mul(8).saturating_add(22)
}

fn font(size: i32) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&INK)
}

fn text(error: impl std::fmt::Display) -> String {
    error.to_string()
}

#[allow(
    clippy::cast_precision_loss,
    reason = "there are few groups and series"
)]
fn float(count: usize) -> f64 {
    count as f64
}

#[cfg(test)]
mod tests {
    use super::super::{IntervalPlot, Point, Series};

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
        let svg = plot.svg().unwrap();
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
        assert_eq!(svg, plot.svg().unwrap());
    }

    #[test]
    fn empty_plot_is_drawn() {
        assert!(IntervalPlot::default().svg().is_ok());
    }
}
