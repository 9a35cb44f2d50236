//! Plots of results, as SVG.
//!
//! One kind is there: an [`IntervalPlot`] shows, for each of several groups, one value of each of
//! several series, with its interval. With the feature `plots` it is drawn by `plotters`, with its
//! SVG backend alone: no fonts are read, and the same plot gives the same bytes.

#[cfg(feature = "plots")]
mod drawn;

#[cfg(feature = "plots")]
pub use drawn::PlotError;

/// Values side by side, group by group.
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
    /// A line across each group, with its name: what could be reached, say.
    pub reference: Option<Series>,
}

/// Values, one for each group.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// The name.
    pub name: String,
    /// In the order of the groups; `None` where there is no value.
    pub points: Vec<Option<Point>>,
}

/// A value, and where it may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// The value.
    pub value: f64,
    /// The lower and the upper end of its interval.
    pub interval: Option<(f64, f64)>,
}
