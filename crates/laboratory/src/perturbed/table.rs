//! Results of perturbed experiments as a table and as plots.

use elbowroom_report::plot::{IntervalPlot, Point, Series};
use elbowroom_report::statistics::{Mean, Proportion};
use elbowroom_report::table::Table;

use super::{OptimumRules, Row, UntimedCounts, WorldKind};
use crate::results::Results;
use crate::untimed::ExecutorName;

impl Results<UntimedCounts> {
    /// Returns the results as a table.
    pub fn table(&self) -> Table {
        let mut title = self.origin.title.clone();
        let made = self.origin.describe_trials("each row");
        if self.origin.is_interrupted {
            title = format!("{title} (interrupted; of {made})");
        } else if made.starts_with("incomplete") {
            title = format!("{title} ({made})");
        }
        let rows = &self.counts.rows;
        let caption = [title].into_iter();
        let caption = caption
            .chain(describe_agreement(rows))
            .chain(describe_ratio_to_optimum(rows));
        let interval = |row: &Row| {
            let interval = row.success.wilson();
            let interval =
                interval.map(|(lower, upper)| format!("{:.1}–{:.1}", 100.0 * lower, 100.0 * upper));
            vec![interval.unwrap_or_default()]
        };
        Table {
            caption: caption.collect::<Vec<_>>().join("\n"),
            ..of_rows(rows, &["95 % interval"], interval)
        }
    }

    /// Returns the results for programs: a number in each cell.
    pub fn records(&self) -> Table {
        let ends = |row: &Row| {
            let interval = row.success.wilson();
            let (lower, upper) = interval.unzip();
            vec![percent(lower), percent(upper)]
        };
        Table {
            caption: self.origin.title.clone(),
            ..of_rows(&self.counts.rows, &["lower 95 %", "upper 95 %"], ends)
        }
    }

    /// Returns the figures of the paper for each world, with file names: success with the optimum (its
    /// Table 1), replans (Figure 4), and actions, as the paper counts them, in trials that succeeded
    /// and that failed (Figures 5 and 6).
    pub fn plots(&self) -> Vec<(String, IntervalPlot)> {
        let mut worlds: Vec<WorldKind> = self.counts.rows.iter().map(|row| row.world).collect();
        worlds.sort_unstable();
        worlds.dedup();
        let of_world = |world: WorldKind| {
            let success = |row: &Row| Point::share(row.success);
            let actions = |work: super::Work| {
                // Messages and failed starts are counted in the same trials.
                let mut both = work.messages;
                both.sum += work.failed_starts.sum;
                Point::mean(both)
            };
            let plot = |what: &str, axis: &str, value: &dyn Fn(&Row) -> Option<Point>| {
                picture(self, world, (what, axis), value)
            };
            let mut successes = plot(
                "success, with 95 % intervals",
                "successful trials, %",
                &success,
            );
            successes.reference = reference(self, world);
            successes.series.extend(published(self, world));
            [
                ("success", successes),
                (
                    "replans",
                    plot("replans of successful trials", "mean", &|row| {
                        Point::mean(row.replans)
                    }),
                ),
                (
                    "actions-success",
                    plot("actions of successful trials", "mean", &|row| {
                        actions(row.succeeded)
                    }),
                ),
                (
                    "actions-failure",
                    plot("actions of failed trials", "mean", &|row| {
                        actions(row.failed)
                    }),
                ),
            ]
            .map(|(name, plot)| (format!("{}-{name}", world.name()), plot))
        };
        worlds.into_iter().flat_map(of_world).collect()
    }
}

fn percent(share: Option<f64>) -> String {
    share.map_or_else(String::new, |share| format!("{:.1}", 100.0 * share))
}

/// Returns the table without a caption; `interval` has the cells under `interval_headings`.
fn of_rows(
    rows: &[Row],
    interval_headings: &[&str],
    interval: impl Fn(&Row) -> Vec<String>,
) -> Table {
    let before = ["case", "world", "executor", "success %"];
    let mut rules: Vec<OptimumRules> = Vec::new();
    for row in rows {
        for &own in row.other_optima.keys() {
            if !rules.contains(&own) {
                rules.push(own);
            }
        }
    }
    let optima = rules
        .iter()
        .map(|rules| format!("optimum % ({})", rules.name()));
    let work = [
        "replans",
        "messages (success)",
        "failed starts (success)",
        "actions (success)",
        "messages (failure)",
        "failed starts (failure)",
        "actions (failure)",
    ];
    let mean = |mean: Mean| mean.value().map_or_else(String::new, |m| format!("{m:.2}"));
    let row = |row: &Row| {
        let z = row.distance().map(|z| format!("{z:+.1}"));
        let mut cells = vec![
            row.case.clone(),
            row.world.name().to_owned(),
            row.executor.name().to_owned(),
            percent(row.success.share()),
        ];
        cells.extend(interval(row));
        cells.extend([
            percent(row.published.and_then(Proportion::share)),
            z.unwrap_or_default(),
            percent(row.optimum),
        ]);
        let others = rules
            .iter()
            .map(|rules| row.other_optima.get(rules).copied());
        cells.extend(others.map(percent));
        cells.extend([
            mean(row.replans),
            mean(row.succeeded.messages),
            mean(row.succeeded.failed_starts),
            mean(row.succeeded.actions),
            mean(row.failed.messages),
            mean(row.failed.failed_starts),
            mean(row.failed.actions),
        ]);
        cells
    };
    let after = ["published %", "z", "optimum %"];
    let headings = before.iter().chain(interval_headings).chain(&after);
    let headings = headings.map(|heading| (*heading).to_owned());
    let headings = headings.chain(optima).chain(work.map(str::to_owned));
    Table {
        caption: String::new(),
        headings: headings.collect(),
        keys: 3,
        rows: rows.iter().map(row).collect(),
        notes: Vec::new(),
    }
}

/// Describes the agreement of the published success rates with ours.
fn describe_agreement(rows: &[Row]) -> Option<String> {
    let compared = rows.iter().filter(|row| row.published.is_some()).count();
    let inside = rows.iter().filter(|row| row.is_inside() == Some(true));
    let agreeing = rows.iter().filter(|row| row.agrees() == Some(true));
    let squares: f64 = rows.iter().filter_map(Row::distance).map(|z| z * z).sum();
    (compared > 0).then(|| {
        format!(
            "The 95 % intervals of {} of {compared} published success rates contain ours; {} do \
             not differ from ours at the 5 % level. The squared distances z add up to \
             {squares:.0}; {compared} are expected.",
            inside.count(),
            agreeing.count(),
        )
    })
}

/// Describes the ratio of the best executor's success rate to the optimum.
fn describe_ratio_to_optimum(rows: &[Row]) -> Option<String> {
    let cases = cases(rows);
    let best = cases.iter().filter_map(|case| {
        let of_case = rows.iter().filter(|row| row.case == *case);
        let shares = of_case.filter_map(|row| {
            let optimum = row.optimum.filter(|optimum| *optimum > 0.0)?;
            Some((row.success.share()? / optimum, case, row.executor))
        });
        shares.max_by(|a, b| a.0.total_cmp(&b.0))
    });
    let (ratio, case, executor) = best.min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(format!(
        "In the sound world the best executor reaches at least {:.1} % of the optimum ({}, {case}).",
        100.0 * ratio,
        executor.name()
    ))
}

fn cases(rows: &[Row]) -> Vec<String> {
    let mut cases: Vec<String> = rows.iter().map(|row| row.case.clone()).collect();
    cases.dedup();
    cases
}

fn picture(
    results: &Results<UntimedCounts>,
    world: WorldKind,
    (what, axis): (&str, &str),
    value: &dyn Fn(&Row) -> Option<Point>,
) -> IntervalPlot {
    let groups = cases(&results.counts.rows);
    let rows = || results.counts.rows.iter().filter(|row| row.world == world);
    let mut executors: Vec<ExecutorName> = Vec::new();
    for row in rows() {
        if !executors.contains(&row.executor) {
            executors.push(row.executor);
        }
    }
    let series = executors.into_iter().map(|executor| {
        let point = |case: &String| {
            let mut found = rows().filter(|row| row.case == *case && row.executor == executor);
            found.next().and_then(value)
        };
        Series {
            name: executor.name().to_owned(),
            points: groups.iter().map(point).collect(),
        }
    });
    IntervalPlot {
        title: format!("{} ({}): {what}", results.origin.title, world.name()),
        axis: axis.to_owned(),
        series: series.collect(),
        groups,
        reference: None,
    }
}

/// Returns the published results of each executor.
fn published(results: &Results<UntimedCounts>, world: WorldKind) -> Vec<Series> {
    let published = |row: &Row| row.published.and_then(Point::share);
    let mut series = picture(results, world, ("", ""), &published).series;
    series.retain(|series| series.points.iter().any(Option::is_some));
    for series in &mut series {
        series.name += ", published";
    }
    series
}

/// Returns the optimum, where it is known.
fn reference(results: &Results<UntimedCounts>, world: WorldKind) -> Option<Series> {
    let point = |case: String| {
        let mut rows = results.counts.rows.iter();
        let is_it = |row: &&Row| row.case == case && row.world == world && row.optimum.is_some();
        let value = 100.0 * rows.find(is_it)?.optimum?;
        Some(Point::exact(value))
    };
    let points: Vec<_> = cases(&results.counts.rows).into_iter().map(point).collect();
    points.iter().any(Option::is_some).then(|| Series {
        name: "optimum".to_owned(),
        points,
    })
}
