//! The row for the best of all executors: see [`timed`](crate::timed).

use elbowroom::execute::{Candidate, Candidates, Limits};
use elbowroom_model::{Situation, Task};
use elbowroom_sim::WorldModel;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::trials::Setting;
use super::{Column, Experiment, ExperimentError};
use crate::timed::{Settings, optimum};

/// The name of the row.
pub(super) const ROW: &str = "optimum without foresight";

/// A summary of the row, in one sentence.
pub(super) const SUMMARY: &str = "Bounds, in percent, for what the best of all executors reaches that knows \
    the world's distributions but not what will happen; it replans at any time and in no time.";

/// The optimum of a column: the mean over its problems.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColumnOptimum {
    /// At least this.
    pub lower: f64,
    /// And at most this.
    pub upper: f64,
    /// Why the bounds say nothing, if they do not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unknown: Option<String>,
}

/// For each column. Problems are looked at in parallel, which changes nothing.
pub(super) fn of(
    experiment: &Experiment,
    fillings: &[Vec<(String, String)>],
    goes_on: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<ColumnOptimum>, ExperimentError> {
    let columns = experiment.columns.iter();
    columns
        .map(|column| {
            let bounds: Result<Vec<_>, ExperimentError> = fillings
                .par_iter()
                .enumerate()
                .map(|(problem, filling)| bounds(experiment, column, problem, filling, goes_on))
                .collect();
            Ok(mean(&bounds?))
        })
        .collect()
}

fn bounds(
    experiment: &Experiment,
    column: &Column,
    problem: usize,
    filling: &[(String, String)],
    goes_on: &(dyn Fn() -> bool + Sync),
) -> Result<Result<(f64, f64), String>, ExperimentError> {
    let setting = Setting {
        experiment,
        problem,
        filling,
        piece: 0,
        pieces: 1,
    };
    let (task, world) = setting.scene(column)?;
    let settings = Settings {
        plans: plans(&setting, &task, &world, goes_on),
        ..Settings::default()
    };
    let found = optimum(&task, &world, &settings, goes_on);
    Ok(found
        .map(|found| (found.lower, found.upper))
        .map_err(|why| why.to_string()))
}

/// How many plans the best is sought within.
const MOST_PLANS: usize = 8;

/// How many variants of the problem they are made for at most, and how many states may be looked at for
/// all but the first.
const MOST_SEARCHES: usize = 8;
const OTHER_STATES: u64 = 10_000;

/// The actions of plans that differ.
fn plans(
    setting: &Setting<'_>,
    task: &Task,
    world: &WorldModel,
    goes_on: &(dyn Fn() -> bool + Sync),
) -> Vec<Vec<String>> {
    let embedded = setting.embedded();
    let limits = Limits {
        most_states: embedded.most_states,
        improve_states: embedded.improve_states,
        other_states: OTHER_STATES,
        searches: MOST_SEARCHES,
    };
    // What is only thought of gets no numbers.
    let thought = task.with_own_table();
    let situation = Situation::initial(&thought);
    let mut source = Candidates::new(&thought, &situation, Some(world), embedded.settings, limits);
    let plans = std::iter::from_fn(|| source.next(&mut |_| goes_on()));
    let names = |plan: Candidate| {
        let steps = plan.plan.steps.into_iter();
        steps.map(|step| step.action.name.clone()).collect()
    };
    plans.take(MOST_PLANS).map(names).collect()
}

fn mean(bounds: &[Result<(f64, f64), String>]) -> ColumnOptimum {
    let (mut lower, mut upper, mut unknown) = (0.0, 0.0, None);
    for found in bounds {
        match found {
            Ok((least, most)) => {
                lower += least;
                upper += most;
            }
            Err(why) => {
                upper += 1.0;
                unknown.get_or_insert(why);
            }
        }
    }
    #[allow(
        clippy::cast_precision_loss,
        reason = "an experiment has far fewer problems than 2^52"
    )]
    let count = bounds.len().max(1) as f64;
    ColumnOptimum {
        lower: lower / count,
        upper: upper / count,
        unknown: unknown.cloned(),
    }
}

impl ColumnOptimum {
    /// In percent, rounded outwards.
    pub(super) fn words(&self) -> String {
        if self.unknown.is_some() {
            return "-".to_owned();
        }
        let tenths = |value: f64| value / 10.0;
        let lower = tenths((self.lower * 1000.0).floor());
        let upper = tenths((self.upper * 1000.0).ceil());
        format!("{lower:.1} to {upper:.1}")
    }
}
