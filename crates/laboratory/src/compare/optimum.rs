//! Row of the optimal policy: see [`mdp`](elbowroom::mdp).

use elbowroom::execute::ActionSets;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::trials::Setting;
use super::{Column, Experiment, ExperimentError, Part, threads_per_piece};
use elbowroom::mdp::{Settings, optimum};

/// Name of the row.
pub(super) const ROW: &str = "optimum without foresight";

/// Summary of the row, in one sentence.
pub(super) const SUMMARY: &str = "Bounds, in percent, for the best executor that knows the world's \
                                  distributions but not the outcomes, and replans at any time \
                                  without delay.";

/// Optimum of a column: the mean over its problems, or over those of a part of an experiment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColumnOptimum {
    /// Lower bound: a multiple of 1e-9 divided by `problems`, so that parts add up exactly.
    pub lower: f64,
    /// Upper bound, of the same form.
    pub upper: f64,
    /// Number of problems.
    pub problems: u64,
    /// Reason why the bounds are trivial, if they are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unknown: Option<String>,
}

/// Computes the optimum of each column over the problems of a part: every Nth one. Problems are
/// solved in parallel, and the result does not depend on that.
pub(super) fn of(
    experiment: &Experiment,
    part: Part,
    may_continue: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<ColumnOptimum>, ExperimentError> {
    let fillings = experiment.fillings();
    let is_of_part = |(problem, _): &(usize, &Vec<(String, String)>)| {
        *problem as u64 % part.shards.max(1) == part.shard
    };
    let problems = fillings.iter().enumerate().filter(is_of_part).count();
    let threads = threads_per_piece(rayon::current_num_threads(), problems);
    let columns = experiment.columns.iter();
    columns
        .map(|column| {
            let bounds: Result<Vec<_>, ExperimentError> = fillings
                .par_iter()
                .enumerate()
                .filter(is_of_part)
                .map(|(problem, filling)| {
                    bounds(
                        experiment,
                        column,
                        (problem, filling.clone(), threads),
                        may_continue,
                    )
                })
                .collect();
            Ok(mean(&bounds?))
        })
        .collect()
}

fn bounds(
    experiment: &Experiment,
    column: &Column,
    (problem, filling, threads): (usize, Vec<(String, String)>, usize),
    may_continue: &(dyn Fn() -> bool + Sync),
) -> Result<Result<(f64, f64), String>, ExperimentError> {
    let setting = Setting {
        experiment,
        problem,
        filling,
        piece: 0,
        pieces: 1,
        threads,
    };
    let (task, world) = setting.problem_and_world(column)?;
    let sets = ActionSets::new(&task, &world, setting.embedded(), may_continue);
    let settings = Settings {
        plans: sets.plans,
        fallbacks: sets.fallbacks,
        ..Settings::default()
    };
    let found = optimum(&task, &world, &settings, may_continue);
    Ok(found
        .map(|found| (found.lower, found.upper))
        .map_err(|why| why.to_string()))
}

/// Bounds are added up as whole numbers of units; a probability of 1 is this number of units.
const UNITS: f64 = 1e9;

fn mean(bounds: &[Result<(f64, f64), String>]) -> ColumnOptimum {
    let mut sum = Sum::default();
    let mut unknown = None;
    for found in bounds {
        sum.problems += 1;
        match found {
            Ok((least, most)) => {
                sum.lower += (least * UNITS).floor();
                sum.upper += (most * UNITS).ceil();
            }
            Err(why) => {
                sum.upper += UNITS;
                unknown.get_or_insert(why);
            }
        }
    }
    sum.mean(unknown.cloned())
}

/// Bounds of several problems, in whole units of 1 / [`UNITS`], far below 2^52.
#[derive(Default)]
struct Sum {
    lower: f64,
    upper: f64,
    problems: u64,
}

impl Sum {
    fn of(column: &ColumnOptimum) -> Self {
        let whole = |mean: f64| (mean * count(column.problems) * UNITS).round();
        Self {
            lower: whole(column.lower),
            upper: whole(column.upper),
            problems: column.problems,
        }
    }

    fn mean(&self, unknown: Option<String>) -> ColumnOptimum {
        let mean = |sum: f64| sum / UNITS / count(self.problems.max(1));
        ColumnOptimum {
            lower: mean(self.lower),
            upper: mean(self.upper),
            problems: self.problems,
            unknown,
        }
    }
}

#[allow(
    clippy::cast_precision_loss,
    reason = "an experiment has far fewer problems than 2^52"
)]
fn count(problems: u64) -> f64 {
    problems as f64
}

impl ColumnOptimum {
    /// Adds the problems of another part.
    pub(super) fn add(&mut self, other: &Self) {
        let (mine, theirs) = (Sum::of(self), Sum::of(other));
        let sum = Sum {
            lower: mine.lower + theirs.lower,
            upper: mine.upper + theirs.upper,
            problems: mine.problems + theirs.problems,
        };
        let unknown = self.unknown.take().or_else(|| other.unknown.clone());
        *self = sum.mean(unknown);
    }

    /// Returns `true` if the bounds are known.
    pub fn is_known(&self) -> bool {
        self.unknown.is_none() && self.problems > 0
    }

    /// Returns the bounds in percent, rounded outwards.
    pub(super) fn describe(&self) -> String {
        if !self.is_known() {
            return "-".to_owned();
        }
        let tenths = |value: f64| value / 10.0;
        // The rounding and floating-point errors of a bound are not shown.
        let lower = tenths((self.lower * 1000.0 + ROUNDING).floor());
        let upper = tenths((self.upper * 1000.0 - ROUNDING).ceil());
        format!("{lower:.1} to {upper:.1}")
    }
}

/// Tolerance in tenths of a percentage point.
const ROUNDING: f64 = 1e-5;

#[cfg(test)]
mod tests {
    use super::*;

    /// Parts add up exactly to the whole, in any order, and also with a part without problems.
    #[test]
    fn parts_merge_to_the_whole() {
        let bounds: Vec<Result<(f64, f64), String>> = (0..97)
            .map(|number: u32| {
                let lower = (f64::from(number) * 0.618_034).fract();
                Ok((lower, lower + (1.0 - lower) / 3.0))
            })
            .collect();
        let whole = mean(&bounds);
        for shards in [1, 2, 3, 10, 100] {
            let mut parts = (0..shards).map(|shard| {
                let part = bounds.iter().skip(shard).step_by(shards).cloned();
                mean(&part.collect::<Vec<_>>())
            });
            let first = parts.next().expect("one");
            let sum = parts.fold(first, |mut sum, part| {
                sum.add(&part);
                sum
            });
            assert_eq!(sum, whole, "{shards} parts");
        }
        assert_eq!(whole.problems, 97);
    }

    #[test]
    fn unknown_optimum_of_problem_makes_column_unknown() {
        let mut column = mean(&[Ok((1.0, 1.0))]);
        assert_eq!(column.describe(), "100.0 to 100.0");
        column.add(&mean(&[Err("numbers that change".to_owned())]));
        assert_eq!((column.lower, column.upper, column.problems), (0.5, 1.0, 2));
        assert_eq!(column.describe(), "-");
    }
}
