//! `elbowroom run --replay`: does a stored run come to the same decisions?

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use elbowroom::envelope::Guarantee;
use elbowroom::execution::Odds;
use elbowroom::execution::run::{PlanningTime, RunSettings, RunningRule};
use elbowroom::model::Task;
use elbowroom::num::Rational;
use elbowroom::pddl::Source;
use elbowroom::report::trace::{Replay, ReplayPlanner, ReplayWorld, Stored};
use elbowroom::sim::WorldModel;
use serde_json::{Value, json};

use super::planner::odds;
use super::{Choices, Planning, Texts, planning_time};
use crate::exit::{Answer, Exit, Failure};
use crate::look::{BAD, GOOD, styled};
use crate::{input, output};

pub(super) fn run(path: &Path, as_json: bool) -> Answer {
    let name = path.display().to_string();
    let text = input::source(path, "trace")?;
    let unreadable = |message: String| Failure::new(format!("{name}, {message}"), "");
    let stored = Stored::read(text.text()).map_err(|error| unreadable(error.to_string()))?;
    let header = Header(&stored.header);
    let texts = Texts {
        domain: header
            .source("domain")
            .ok_or_else(|| unreadable(NO_PROBLEM.to_owned()))?,
        problem: header
            .source("problem")
            .ok_or_else(|| unreadable(NO_PROBLEM.to_owned()))?,
    };
    let mut task = texts.task()?;
    let first = if header.0.get("has_plan").and_then(Value::as_bool) == Some(true) {
        let first = stored.first_plan(&mut task);
        first.map_err(|error| unreadable(error.to_string()))?
    } else {
        None
    };
    let choices = match header.source("likelihoods") {
        Some(text) => header.choices()?.with_likelihoods(&text, &task)?,
        None => header.choices()?,
    };
    let task = Arc::new(task);
    let mut world = ReplayWorld::new(&stored, &task);
    let mut planner = ReplayPlanner::new(&stored);
    let mut replay = Replay::new(&stored, Arc::clone(&task));
    let odds = header.odds(&choices, &task).map_err(unreadable)?;
    let planning = Planning {
        planner: &mut planner,
        odds,
    };
    let interruption = replay.interruption();
    let is_to_end = || interruption.load(Ordering::SeqCst);
    let (task, first) = (&task, first.as_ref());
    choices.run_with(task, first, &mut world, planning, &mut replay, &is_to_end);
    let (agreed, difference) = replay.outcome();
    if as_json {
        output::print_json(&json!({
            "format": "elbowroom-replay",
            "version": 1,
            "trace": name,
            "agrees": difference.is_none(),
            "entries": agreed,
            "complete": !stored.is_cut_off && ends(&stored),
            "difference": difference.as_ref().map(|it| json!({
                "line": it.line,
                "stored": it.stored,
                "replayed": it.replayed,
            })),
        }))?;
    } else {
        output::print(&match &difference {
            None => format!(
                "{}: {name} comes to the same decisions ({agreed} entries{})\n",
                styled(GOOD, "agrees"),
                if ends(&stored) {
                    ""
                } else {
                    "; the run was cut short"
                }
            ),
            Some(difference) => format!(
                "{}: {name} differs at line {}\n  stored    {}\n  replayed  {}\n",
                styled(BAD, "differs"),
                difference.line,
                difference.stored,
                difference.replayed
            ),
        })?;
    }
    Ok(match difference {
        None => Exit::Yes,
        Some(_) => Exit::No,
    })
}

const NO_PROBLEM: &str = "line 1: domain or problem is missing";

fn ends(stored: &Stored) -> bool {
    let last = stored.entries.last();
    last.and_then(|entry| entry.get("event"))
        .and_then(Value::as_str)
        == Some("over")
}

/// The first line of a trace.
struct Header<'a>(&'a Value);

impl Header<'_> {
    fn text(&self, name: &str) -> &str {
        self.0.get(name).and_then(Value::as_str).unwrap_or_default()
    }

    fn source(&self, name: &str) -> Option<Source> {
        let source = self.0.get(name)?;
        let text = source.get("text")?.as_str()?;
        Some(Source::new(source.get("name")?.as_str()?, text))
    }

    fn number(&self, name: &str, otherwise: Rational) -> Rational {
        self.text(name).parse().unwrap_or(otherwise)
    }

    /// What was taken for likely, if the executor asked for that.
    fn odds(&self, choices: &Choices, task: &Task) -> Result<Option<Box<dyn Odds>>, String> {
        if !choices.executor.asks_odds() {
            return Ok(None);
        }
        let model = WorldModel::read(self.text("world"), task.problem());
        let model = model.map_err(|error| format!("line 1: the world: {error}"))?;
        let count = |name: &str| self.0.get(name).and_then(Value::as_u64).unwrap_or_default();
        let states = (count("planner_states"), count("improve_states"));
        Ok(Some(odds(&model, states, choices)))
    }

    fn choices(&self) -> Result<Choices, Failure> {
        let plain = RunSettings::default();
        let vary = self.0.get("vary").and_then(Value::as_array);
        let vary: Vec<String> = vary
            .into_iter()
            .flatten()
            .filter_map(|spec| spec.as_str().map(str::to_owned))
            .collect();
        // Traces from before there were guarantees do not say which.
        let named = Guarantee::ALL
            .into_iter()
            .find(|it| it.name() == self.text("guarantee"));
        let guarantee = named.unwrap_or_default();
        let replans = self.0.get("max_replans").and_then(Value::as_u64);
        let running = RunningRule::NAMES
            .iter()
            .find(|(_, name)| *name == self.text("running"));
        Choices::new(
            self.text("executor"),
            &vary,
            guarantee,
            &self.number("precision", Rational::ONE),
            RunSettings {
                epsilon: self.number("epsilon", plain.epsilon.clone()),
                running: running.map_or(plain.running, |(rule, _)| *rule),
                planning_time: planning_time(self.text("planning_time"))
                    .unwrap_or(PlanningTime::Measured),
                most_replans: replans
                    .and_then(|count| usize::try_from(count).ok())
                    .unwrap_or(plain.most_replans),
                time_limit: self.number("time_limit", plain.time_limit.clone()),
                ..plain
            },
        )
    }
}
