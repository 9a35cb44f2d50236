//! Picture of two quantities: areas, boxes and a point, as SVG.
//!
//! No fonts are read, and the same picture gives the same bytes.

use std::fmt::Write as _;

use crate::svg::{self, INK, escaped, number, text, ticks};

/// The picture of a plane.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlanePicture {
    /// The title.
    pub title: String,
    /// The text below the title.
    pub subtitle: String,
    /// Names of the horizontal and of the vertical axis.
    pub axes: [String; 2],
    /// Lower left and upper right corner of the visible window.
    pub window: [[f64; 2]; 2],
    /// Convex polygons, by their corners.
    pub areas: Vec<Vec<[f64; 2]>>,
    /// Name of the areas in the legend.
    pub areas_name: String,
    /// Names with lower left and upper right corners. Parts outside the window are clipped.
    pub boxes: Vec<(String, [[f64; 2]; 2])>,
    /// A point, and its name.
    pub point: Option<(String, [f64; 2])>,
}

/// The size of the plane in pixels.
const SIDE: f64 = 400.0;
const LEFT_MARGIN: f64 = 76.0;
const TOP_MARGIN: f64 = 70.0;
/// Width of the legend.
const LEGEND_WIDTH: f64 = 210.0;
const BOTTOM_MARGIN: f64 = 60.0;
/// Colours of Okabe & Ito, which colour-blind readers can distinguish, each with its own dash
/// pattern.
const LEGEND_ENTRIES: [(&str, &str); 4] = [
    ("#d55e00", ""),
    ("#009e73", "8 4"),
    ("#cc79a7", "3 3"),
    ("#e69f00", "10 3 2 3"),
];
impl PlanePicture {
    /// Renders the picture as an SVG document.
    pub fn svg(&self) -> String {
        let (width, height) = (
            LEFT_MARGIN + SIDE + LEGEND_WIDTH,
            TOP_MARGIN + SIDE + BOTTOM_MARGIN,
        );
        let mut svg = svg::begin(width, height);
        text(&mut svg, (12.0, 26.0), 16, "start", &self.title);
        text(&mut svg, (12.0, 46.0), 12, "start", &self.subtitle);
        self.ticks(&mut svg);
        for area in &self.areas {
            let corners: Vec<String> = area.iter().map(|corner| self.pixels(corner)).collect();
            let _ = writeln!(
                svg,
                "<polygon points=\"{}\" fill=\"#56b4e9\" fill-opacity=\"0.45\" stroke=\"#0072b2\" \
                 stroke-width=\"1\"/>",
                corners.join(" ")
            );
        }
        let mut entry = TOP_MARGIN + 8.0;
        let _ = writeln!(
            svg,
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"26\" height=\"12\" fill=\"#56b4e9\" \
             fill-opacity=\"0.45\" stroke=\"#0072b2\"/>",
            LEFT_MARGIN + SIDE + 18.0,
            entry - 4.0
        );
        legend(&mut svg, entry, &self.areas_name);
        for (index, (name, corners)) in self.boxes.iter().enumerate() {
            entry += 24.0;
            let (colour, dashes) = LEGEND_ENTRIES[index % LEGEND_ENTRIES.len()];
            let style = format!(
                "fill=\"none\" stroke=\"{colour}\" stroke-width=\"2.5\" stroke-dasharray=\"{dashes}\""
            );
            self.outline(&mut svg, corners, &style);
            let from = LEFT_MARGIN + SIDE + 18.0;
            let _ = writeln!(
                svg,
                "<line x1=\"{from:.1}\" y1=\"{0:.1}\" x2=\"{1:.1}\" y2=\"{0:.1}\" {style}/>",
                entry + 2.0,
                from + 26.0
            );
            legend(&mut svg, entry, name);
        }
        if let Some((name, place)) = &self.point {
            entry += 24.0;
            cross(&mut svg, self.place(place));
            cross(&mut svg, (LEFT_MARGIN + SIDE + 31.0, entry + 2.0));
            legend(&mut svg, entry, name);
        }
        let _ = writeln!(
            svg,
            "<rect x=\"{LEFT_MARGIN}\" y=\"{TOP_MARGIN}\" width=\"{SIDE}\" height=\"{SIDE}\" fill=\"none\" \
             stroke=\"{INK}\"/>"
        );
        let middle = LEFT_MARGIN + SIDE / 2.0;
        text(
            &mut svg,
            (middle, TOP_MARGIN + SIDE + 44.0),
            13,
            "middle",
            &self.axes[0],
        );
        let (x, y) = (20.0, TOP_MARGIN + SIDE / 2.0);
        let _ = writeln!(
            svg,
            "<text x=\"{x}\" y=\"{y}\" font-size=\"13\" text-anchor=\"middle\" fill=\"{INK}\" \
             transform=\"rotate(-90 {x} {y})\">{}</text>",
            escaped(&self.axes[1])
        );
        svg.push_str("</svg>\n");
        svg
    }

    /// Returns the position of a point, in pixels.
    fn place(&self, point: &[f64; 2]) -> (f64, f64) {
        let share = |axis: usize| {
            let (from, to) = (self.window[0][axis], self.window[1][axis]);
            let span = to - from;
            let share = if span > 0.0 {
                (point[axis] - from) / span
            } else {
                0.5
            };
            share.clamp(0.0, 1.0)
        };
        (
            LEFT_MARGIN + SIDE * share(0),
            TOP_MARGIN + SIDE * (1.0 - share(1)),
        )
    }

    fn pixels(&self, point: &[f64; 2]) -> String {
        let (x, y) = self.place(point);
        format!("{x:.2},{y:.2}")
    }

    /// Draws a box. Only sides inside the window have lines.
    fn outline(&self, svg: &mut String, corners: &[[f64; 2]; 2], style: &str) {
        let [low, high] = corners;
        let is_shown = |axis: usize, value: f64| {
            self.window[0][axis] <= value && value <= self.window[1][axis]
        };
        for (axis, value) in [(0, low[0]), (0, high[0]), (1, low[1]), (1, high[1])] {
            if !is_shown(axis, value) {
                continue;
            }
            let ends = [low, high].map(|corner| {
                let mut end = *corner;
                end[axis] = value;
                self.place(&end)
            });
            let [(x1, y1), (x2, y2)] = ends;
            let _ = writeln!(
                svg,
                "<line x1=\"{x1:.2}\" y1=\"{y1:.2}\" x2=\"{x2:.2}\" y2=\"{y2:.2}\" {style}/>"
            );
        }
    }

    fn ticks(&self, svg: &mut String) {
        for axis in 0..2 {
            let (from, to) = (self.window[0][axis], self.window[1][axis]);
            for value in ticks(from, to) {
                let mut at = self.window[0];
                at[axis] = value;
                let (x, y) = self.place(&at);
                let label = number(value);
                if axis == 0 {
                    let _ = writeln!(
                        svg,
                        "<line x1=\"{x:.2}\" y1=\"{TOP_MARGIN}\" x2=\"{x:.2}\" y2=\"{y:.2}\" stroke=\"#e4e4e4\"/>"
                    );
                    text(svg, (x, y + 18.0), 11, "middle", &label);
                } else {
                    let end = LEFT_MARGIN + SIDE;
                    let _ = writeln!(
                        svg,
                        "<line x1=\"{x:.2}\" y1=\"{y:.2}\" x2=\"{end:.2}\" y2=\"{y:.2}\" stroke=\"#e4e4e4\"/>"
                    );
                    text(svg, (x - 6.0, y + 4.0), 11, "end", &label);
                }
            }
        }
    }
}

fn cross(svg: &mut String, (x, y): (f64, f64)) {
    let _ = writeln!(
        svg,
        "<path d=\"M {:.2} {y:.2} h 12 M {x:.2} {:.2} v 12\" stroke=\"black\" stroke-width=\"2.5\"/>",
        x - 6.0,
        y - 6.0
    );
}

fn legend(svg: &mut String, y: f64, words: &str) {
    text(
        svg,
        (LEFT_MARGIN + SIDE + 52.0, y + 6.0),
        12,
        "start",
        words,
    );
}

#[cfg(test)]
mod tests {
    use super::PlanePicture;

    #[test]
    fn shapes_outside_window_are_not_drawn() {
        let picture = PlanePicture {
            axes: ["a < b".to_owned(), String::new()],
            window: [[0.0, 0.0], [10.0, 10.0]],
            areas: vec![vec![[0.0, 0.0], [10.0, 0.0], [0.0, 10.0]]],
            boxes: vec![("box".to_owned(), [[2.0, -1.0], [3.0, 4.0]])],
            point: Some(("nominal".to_owned(), [1.0, 1.0])),
            ..PlanePicture::default()
        };
        let svg = picture.svg();
        // Three sides of the box, and its line in the legend.
        assert_eq!(svg.matches("stroke=\"#d55e00\"").count(), 4, "{svg}");
        assert_eq!(svg.matches("<polygon").count(), 1);
        assert!(svg.contains("a &lt; b") && svg.ends_with("</svg>\n"));
        assert_eq!(svg, picture.svg());
    }
}
