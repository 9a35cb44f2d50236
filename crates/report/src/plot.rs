//! Plots of results, as SVG.
//!
//! An [`IntervalPlot`] shows, for each group, one value of each series, with its interval. With the
//! feature `plots` it is drawn by the SVG backend of `plotters`: no fonts are read, and the same
//! plot gives the same bytes.

#[cfg(feature = "plots")]
mod drawing;

#[cfg(feature = "plots")]
pub use drawing::PlotError;

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
