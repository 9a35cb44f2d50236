//! Deserialized experiment files.

use elbowroom::envelope::{Method, Objective};
use elbowroom::execute::{EMBEDDED, FirstPlan};
use elbowroom_execution::run::{PlanningTime, RunSettings, RunningRule};
use elbowroom_num::Rational;
use elbowroom_text::Span;
use indexmap::IndexMap;
use serde::Deserialize;
use toml::Spanned;

use super::{LinkedParameters, Planning, Published};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub(super) format: Spanned<String>,
    pub(super) version: Spanned<i64>,
    pub(super) title: Option<String>,
    pub(super) domain: Spanned<String>,
    pub(super) problem: Spanned<String>,
    pub(super) plan: Option<Spanned<String>>,
    pub(super) trials: Spanned<u64>,
    #[serde(default)]
    pub(super) seed: u64,
    pub(super) executors: Spanned<Vec<Spanned<String>>>,
    #[serde(default)]
    pub(super) clairvoyant: bool,
    #[serde(default)]
    pub(super) optimum: bool,
    pub(super) running: Option<Spanned<String>>,
    pub(super) planning_time: Option<Spanned<toml::Value>>,
    pub(super) max_replans: Option<usize>,
    pub(super) precision: Option<Spanned<f64>>,
    /// Algorithm for envelopes.
    pub(super) method: Option<Spanned<Method>>,
    pub(super) objective: Option<Objective>,
    pub(super) first_plan: Option<Spanned<FirstPlan>>,
    pub(super) planner: Option<Spanned<String>>,
    pub(super) planner_time: Option<Spanned<f64>>,
    pub(super) planner_states: Option<u64>,
    pub(super) improve_states: Option<u64>,
    pub(super) planning_budget: Option<Spanned<f64>>,
    #[serde(default)]
    pub(super) blanks: IndexMap<String, Spanned<Vec<toml::Value>>>,
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
    pub(super) believed: Option<Spanned<String>>,
    pub(super) likelihoods: Option<Spanned<String>>,
    #[serde(default)]
    pub(super) vary: Vec<Spanned<String>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TogetherFile {
    pub(super) names: Vec<String>,
    pub(super) rows: Spanned<Vec<Spanned<Vec<toml::Value>>>>,
}

impl File {
    /// Checks that there is at least one trial, executor and column. The error says what to do.
    pub(super) fn check_size(&self) -> Result<(), (Span, String)> {
        let wrong = |span: Span, message: &str| Err((span, message.to_owned()));
        if *self.trials.get_ref() == 0 {
            return wrong(self.trials.span(), "expected at least one trial");
        }
        if self.executors.get_ref().is_empty() {
            return wrong(self.executors.span(), "expected at least one executor");
        }
        if self.column.is_empty() {
            return wrong(self.format.span(), "expected at least one [[column]]");
        }
        let blanks = self.blanks.values();
        if let Some(empty) = blanks.into_iter().find(|it| it.get_ref().is_empty()) {
            return wrong(empty.span(), "expected at least one value for the blank");
        }
        let mut groups = self.together.iter().map(|group| &group.rows);
        if let Some(empty) = groups.find(|rows| rows.get_ref().is_empty()) {
            return wrong(empty.span(), "expected at least one row for the blanks");
        }
        Ok(())
    }

    /// Returns the groups of blanks that are filled in together.
    pub(super) fn linked_parameters(&self) -> Result<Vec<LinkedParameters>, (Span, String)> {
        let mut together = Vec::new();
        for group in &self.together {
            let width = group.names.len();
            let mut rows = group.rows.get_ref().iter();
            if let Some(row) = rows.find(|row| row.get_ref().len() != width) {
                return Err((
                    row.span(),
                    format!("expected {width} values, one for each name"),
                ));
            }
            let rows = group.rows.get_ref().iter();
            together.push(LinkedParameters {
                names: group.names.clone(),
                rows: rows
                    .map(|row| row.get_ref().iter().map(text_of).collect())
                    .collect(),
            });
        }
        Ok(together)
    }

    /// Returns the rule that chooses first plans, by default their probability. If the experiment
    /// names a plan, or another planner with its own plan, there is no choice.
    pub(super) fn first_plan(&self) -> Result<FirstPlan, (Span, String)> {
        let is_embedded = self
            .planner
            .as_ref()
            .is_none_or(|name| name.get_ref() == EMBEDDED);
        if let (Some(_), Some(first_plan)) = (&self.plan, &self.first_plan) {
            let message = "`plan` and `first_plan` exclude each other: leave out one of them";
            return Err((first_plan.span(), message.to_owned()));
        }
        let Some(given) = &self.first_plan else {
            return Ok(if is_embedded && self.plan.is_none() {
                FirstPlan::Likeliest
            } else {
                FirstPlan::Shortest
            });
        };
        if is_embedded || given.get_ref().is_shortest() {
            return Ok(*given.get_ref());
        }
        let message =
            "`first_plan` needs the embedded planner: leave out `planner`, or `first_plan`";
        Err((given.span(), message.to_owned()))
    }

    /// Checks that published figures belong to rows and columns of the table.
    pub(super) fn check_published(&self, rows: &[String]) -> Result<(), (Span, String)> {
        for published in &self.published {
            let wrong = |message: String| Err((published.span(), message));
            let figures = published.get_ref();
            if !rows.contains(&figures.executor) {
                let name = &figures.executor;
                let rows = rows.join(", ");
                return wrong(format!("unknown row `{name}`; the table has {rows}"));
            }
            let count = figures.replans.len();
            if figures.coverage.len() != self.column.len()
                || (count != 0 && count != self.column.len())
            {
                return wrong(format!(
                    "expected one figure for each of the {} columns, or nan",
                    self.column.len()
                ));
            }
        }
        Ok(())
    }

    pub(super) fn planning(&self) -> Result<Planning, (Span, String)> {
        let seconds = match &self.planner_time {
            None => None,
            Some(given) => {
                let seconds = exact(*given.get_ref()).filter(Rational::is_positive);
                let wrong = || (given.span(), "it must be positive".to_owned());
                Some(seconds.ok_or_else(wrong)?)
            }
        };
        match &self.planner {
            Some(name) if name.get_ref() != EMBEDDED => {
                check_planner(name.get_ref()).map_err(|message| (name.span(), message))?;
                Ok(Planning::External {
                    name: name.get_ref().clone(),
                    seconds,
                })
            }
            _ => match &self.planner_time {
                None => Ok(Planning::Embedded),
                Some(time) => Err((
                    time.span(),
                    "`planner_time` needs an external planner: name one with `planner`, or limit \
                     the embedded planner with `planning_budget`"
                        .to_owned(),
                )),
            },
        }
    }

    pub(super) fn settings(&self) -> Result<RunSettings, (Span, String)> {
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
            // Measured times would make results depend on the machine.
            let number = number.filter(|number| !number.is_negative());
            settings.planning_time = PlanningTime::Seconds(number.ok_or_else(|| {
                (
                    time.span(),
                    "expected a number of seconds, so that results can be reproduced".to_owned(),
                )
            })?);
        } else {
            settings.planning_time = PlanningTime::Seconds(Rational::ZERO);
        }
        if let Some(most) = self.max_replans {
            settings.max_replans = most;
        }
        Ok(settings)
    }
}

/// Checks that there is a planner of that name. The error lists the known ones.
fn check_planner(name: &str) -> Result<(), String> {
    let found = elbowroom_external::Planner::named(name);
    found.map(|_| ()).map_err(|error| error.to_string())
}

/// Returns the value of that name. The error holds the place of the name and the choices.
fn one_of<T: Copy>(
    given: &Spanned<String>,
    names: &[(T, &'static str)],
) -> Result<T, (Span, String)> {
    let found = names.iter().find(|(_, name)| name == given.get_ref());
    found.map(|(value, _)| *value).ok_or_else(|| {
        let known: Vec<&str> = names.iter().map(|(_, name)| *name).collect();
        let message = format!("choose one of {}", known.join(", "));
        (given.span(), message)
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
