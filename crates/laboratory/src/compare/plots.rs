//! Plots of results on a clock.

use elbowroom_report::plot::{IntervalPlot, Point, Series};

use super::optimum;
use super::results::{Cell, TimedCounts};
use crate::results::Results;

impl Results<TimedCounts> {
    /// Returns the plots, with a file name for each: the coverage of each executor in each column
    /// with its 95 % interval, and the mean number of new plans of successful runs.
    pub fn plots(&self) -> Vec<(String, IntervalPlot)> {
        let mut coverage = self.plot(
            "coverage, with 95 % intervals",
            "runs that reach the goal, %",
            &|cell| Point::share(cell.coverage()),
        );
        coverage.reference = self.reference();
        let replans = self.plot("new plans of successful runs", "mean", &|cell| {
            Point::mean(cell.mean_replans())
        });
        vec![
            ("coverage".to_owned(), coverage),
            ("replans".to_owned(), replans),
        ]
    }

    fn plot(&self, what: &str, axis: &str, value: &dyn Fn(&Cell) -> Option<Point>) -> IntervalPlot {
        let series = (self.counts.rows.iter())
            .zip(&self.counts.cells)
            .map(|(name, cells)| Series {
                name: name.clone(),
                points: cells.iter().map(value).collect(),
            });
        IntervalPlot {
            title: format!("{}: {what}", self.origin.title),
            axis: axis.to_owned(),
            groups: self.counts.columns.clone(),
            series: series.collect(),
            reference: None,
        }
    }

    /// Returns the upper bound of the optimal policy in each column, where it is known.
    fn reference(&self) -> Option<Series> {
        let point = |column: &super::ColumnOptimum| {
            column
                .is_known()
                .then_some(Point::exact(100.0 * column.upper))
        };
        let points: Vec<Option<Point>> = self.counts.optimum.iter().map(point).collect();
        points.iter().any(Option::is_some).then(|| Series {
            name: format!("{}, at most", optimum::ROW),
            points,
        })
    }
}
