//! Plots of results on a clock.

use elbowroom_report::plot::{IntervalPlot, Point, Series};
use elbowroom_report::statistics::{Mean, Proportion};

use super::results::Cell;
use super::{Results, optimum};

impl Results {
    /// Returns the plots, with a file name for each: the coverage of each executor in each column
    /// with its 95 % interval, and the mean number of new plans of successful runs.
    pub fn plots(&self) -> Vec<(String, IntervalPlot)> {
        let mut coverage = self.plot(
            "coverage, with 95 % intervals",
            "runs that reach the goal, %",
            &|cell| share(cell.coverage()),
        );
        coverage.reference = self.reference();
        let replans = self.plot("new plans of successful runs", "mean", &|cell| {
            mean(cell.mean_replans())
        });
        vec![
            ("coverage".to_owned(), coverage),
            ("replans".to_owned(), replans),
        ]
    }

    fn plot(&self, what: &str, axis: &str, value: &dyn Fn(&Cell) -> Option<Point>) -> IntervalPlot {
        let series = self
            .rows
            .iter()
            .zip(&self.cells)
            .map(|(name, cells)| Series {
                name: name.clone(),
                points: cells.iter().map(value).collect(),
            });
        IntervalPlot {
            title: format!("{}: {what}", self.title),
            axis: axis.to_owned(),
            groups: self.columns.clone(),
            series: series.collect(),
            reference: None,
        }
    }

    /// Returns the upper bound of the optimal policy in each column, where it is known.
    fn reference(&self) -> Option<Series> {
        let point = |column: &super::ColumnOptimum| {
            column.is_known().then_some(Point {
                value: 100.0 * column.upper,
                interval: None,
            })
        };
        let points: Vec<Option<Point>> = self.optimum.iter().map(point).collect();
        points.iter().any(Option::is_some).then(|| Series {
            name: format!("{}, at most", optimum::ROW),
            points,
        })
    }
}

/// Returns a share in percent, with Wilson's interval.
pub(crate) fn share(of: Proportion) -> Option<Point> {
    Some(Point {
        value: 100.0 * of.share()?,
        interval: of
            .wilson()
            .map(|(lower, upper)| (100.0 * lower, 100.0 * upper)),
    })
}

/// Returns a mean without an interval.
pub(crate) fn mean(of: Mean) -> Option<Point> {
    of.value().map(|value| Point {
        value,
        interval: None,
    })
}
