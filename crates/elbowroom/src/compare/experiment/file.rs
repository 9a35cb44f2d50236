//! Experiment files as they stand.

use elbowroom_execution::run::{PlanningTime, RunSettings, RunningRule};
use elbowroom_num::Rational;
use indexmap::IndexMap;
use serde::Deserialize;
use toml::Spanned;

use super::{Planning, Published};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub(super) format: Spanned<String>,
    pub(super) version: Spanned<i64>,
    pub(super) title: String,
    pub(super) domain: Spanned<String>,
    pub(super) problem: Spanned<String>,
    pub(super) trials: u64,
    #[serde(default)]
    pub(super) seed: u64,
    pub(super) executors: Vec<Spanned<String>>,
    #[serde(default)]
    pub(super) clairvoyant: bool,
    pub(super) running: Option<Spanned<String>>,
    pub(super) planning_time: Option<Spanned<toml::Value>>,
    pub(super) max_replans: Option<usize>,
    pub(super) precision: Option<Spanned<f64>>,
    pub(super) planner: Option<Spanned<String>>,
    pub(super) planner_time: Option<Spanned<f64>>,
    pub(super) planner_states: Option<u64>,
    pub(super) improve_states: Option<u64>,
    #[serde(default)]
    pub(super) blanks: IndexMap<String, Vec<toml::Value>>,
    #[serde(default)]
    pub(super) together: Vec<TogetherFile>,
    pub(super) column: Vec<ColumnFile>,
    #[serde(default)]
    pub(super) published: Vec<Spanned<Published>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ColumnFile {
    pub(super) name: String,
    pub(super) world: Spanned<String>,
    pub(super) likelihoods: Option<Spanned<String>>,
    #[serde(default)]
    pub(super) vary: Vec<Spanned<String>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TogetherFile {
    pub(super) names: Vec<String>,
    pub(super) rows: Vec<Spanned<Vec<toml::Value>>>,
}

impl File {
    pub(super) fn planning(&self) -> Result<Planning, (usize, String)> {
        let seconds = match &self.planner_time {
            None => None,
            Some(given) => {
                let seconds = exact(*given.get_ref()).filter(Rational::is_positive);
                let wrong = || (given.span().start, "it must be positive".to_owned());
                Some(seconds.ok_or_else(wrong)?)
            }
        };
        match &self.planner {
            Some(name) if name.get_ref() != EMBEDDED => {
                known(name.get_ref()).map_err(|message| (name.span().start, message))?;
                Ok(Planning::Another {
                    name: name.get_ref().clone(),
                    seconds,
                })
            }
            _ => Ok(Planning::Embedded),
        }
    }

    pub(super) fn settings(&self) -> Result<RunSettings, (usize, String)> {
        let mut settings = RunSettings::default();
        if let Some(running) = &self.running {
            settings.running = one_of(running, RunningRule::NAMES)?;
        }
        if let Some(time) = &self.planning_time {
            let number = match time.get_ref() {
                toml::Value::Integer(number) => Some(Rational::from(*number)),
                toml::Value::Float(number) => exact(*number),
                _ => None,
            };
            // Measured times would make a result depend on the machine.
            let number = number.filter(|number| !number.is_negative());
            settings.planning_time = PlanningTime::Seconds(number.ok_or_else(|| {
                (
                    time.span().start,
                    "write a number of seconds, so that results can be repeated".to_owned(),
                )
            })?);
        } else {
            settings.planning_time = PlanningTime::Seconds(Rational::ZERO);
        }
        if let Some(most) = self.max_replans {
            settings.most_replans = most;
        }
        Ok(settings)
    }
}

/// The planner that is always there.
const EMBEDDED: &str = "embedded";

/// Whether there is such a planner; if not, which there are.
#[cfg(feature = "external")]
fn known(name: &str) -> Result<(), String> {
    let found = elbowroom_planner::external::Planner::named(name);
    found.map(|_| ()).map_err(|error| error.to_string())
}

/// Whether there is such a planner; if not, which there are.
#[cfg(not(feature = "external"))]
fn known(_name: &str) -> Result<(), String> {
    Err("this program has no planner but `embedded`".to_owned())
}

/// The value of that name; or where the name stands, and what it may be.
fn one_of<T: Copy>(
    given: &Spanned<String>,
    names: &[(T, &'static str)],
) -> Result<T, (usize, String)> {
    let found = names.iter().find(|(_, name)| name == given.get_ref());
    found.map(|(value, _)| *value).ok_or_else(|| {
        let known: Vec<&str> = names.iter().map(|(_, name)| *name).collect();
        let message = format!("choose one of {}", known.join(", "));
        (given.span().start, message)
    })
}

pub(super) fn text_of(value: &toml::Value) -> String {
    match value {
        toml::Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

pub(super) fn exact(value: f64) -> Option<Rational> {
    value.is_finite().then(|| value.to_string().parse().ok())?
}
