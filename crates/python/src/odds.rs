//! Success probability of a plan.

use std::sync::Arc;

use elbowroom::answers;
use elbowroom::answers::odds::{
    LatticeFinding, OddsFinding, OddsRequest, OddsSemantics, OddsSettings,
};
use elbowroom::execution::executors::ExecutorSpec;
use elbowroom::probability::likelihoods;
use elbowroom::sim::WorldModel;
use elbowroom::text::Source;
use pyo3::prelude::*;
use serde::Deserialize;

use crate::errors::{CallError, json, run_without_gil};
use crate::progress_observer::ProgressObserver;
use crate::task::{Task, read_options};

/// The options of the success probability, as JSON.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
struct OddsOptions {
    semantics: OddsSemantics,
    best: bool,
    most_sequences: usize,
    lattice: bool,
    self_overlap: bool,
    executors: Option<Vec<String>>,
    samples: u64,
    seed: u64,
}

impl Default for OddsOptions {
    fn default() -> Self {
        let settings = OddsSettings::default();
        Self {
            semantics: settings.semantics,
            best: settings.takes_best_order,
            most_sequences: settings.most_sequences,
            lattice: settings.with_lattice,
            self_overlap: settings.self_overlap,
            executors: None,
            samples: settings.samples,
            seed: settings.seed,
        }
    }
}

impl OddsOptions {
    fn settings(self) -> Result<OddsSettings, CallError> {
        let default = OddsSettings::default();
        let executors = match &self.executors {
            Some(names) => executors(names)?,
            None => default.executors,
        };
        Ok(OddsSettings {
            semantics: self.semantics,
            takes_best_order: self.best,
            most_sequences: self.most_sequences,
            with_lattice: self.lattice,
            self_overlap: self.self_overlap,
            executors,
            samples: self.samples,
            seed: self.seed,
        })
    }
}

/// Parses the names of executors.
fn executors(names: &[String]) -> Result<Vec<ExecutorSpec>, CallError> {
    let read = names.iter().map(|name| name.parse::<ExecutorSpec>());
    read.collect::<Result<_, _>>().map_err(CallError::request)
}

/// The success probability of a plan: a document, the picture of all orders if it was requested,
/// and `True` if Ctrl-C ended the search.
#[pyfunction]
#[expect(
    clippy::too_many_arguments,
    reason = "each is a keyword argument in Python"
)]
#[pyo3(signature = (problem, plan, likely, world, options, time_limit, progress))]
pub(crate) fn odds(
    py: Python<'_>,
    problem: &Task,
    plan: Option<(String, String)>,
    likely: (String, String),
    world: Option<(String, String)>,
    options: &str,
    time_limit: Option<f64>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, Option<String>, bool)> {
    run_without_gil(py, || {
        let settings = read_options::<OddsOptions>(options)?.settings()?;
        let mut watch = ProgressObserver::start(time_limit, progress);
        let plan = plan.map(|plan| problem.time_triggered(plan)).transpose()?;
        let likely = likelihoods::read(Source::new(likely.0, likely.1), &problem.task)?;
        let world = match world {
            Some((name, text)) => {
                let text = Source::new(name, text);
                Some(WorldModel::read(text, problem.task.problem())?)
            }
            None => None,
        };
        let request = OddsRequest {
            task: &problem.task,
            plan,
            likelihoods: &Arc::new(likely),
            world: world.as_ref(),
            settings,
        };
        let answer = answers::odds::odds(&request, &mut watch)?;
        let svg = match &answer.finding {
            OddsFinding::Odds(odds) => match &odds.lattice {
                Some(LatticeFinding::Lattice(lattice)) => {
                    let title = format!("{}: the orders of its plan", answer.problem);
                    Some(lattice.picture(&title).svg())
                }
                _ => None,
            },
            _ => None,
        };
        Ok((json(&answer), svg, watch.ended()?))
    })
}
