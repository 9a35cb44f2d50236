//! Playing a stored trace back.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use elbowroom_execution::{
    Command, Entry, Passage, PlanAnswer, Planner, PlannerAnswer, Recorder, World, WorldError,
};
use elbowroom_model::ground::{FactId, FluentId};
use elbowroom_model::{Situation, Step, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use serde_json::Value;

use super::{FORMAT, VERSION};
use crate::Names;
use crate::wire::{field_number, mention, read_number, read_observation};

/// A trace that cannot be played back.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {message}")]
pub struct TraceError {
    /// The line, from 1 on.
    pub line: usize,
    /// What is wrong with it.
    pub message: String,
}

/// A trace that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Stored {
    /// The first line.
    pub header: Value,
    /// The other lines. A last one that was cut off is left out.
    pub entries: Vec<Value>,
    /// Whether the last line was cut off.
    pub is_cut_off: bool,
}

impl Stored {
    /// Reads a trace.
    ///
    /// # Errors
    /// When it is none, or damaged elsewhere than at its very end.
    pub fn read(text: &str) -> Result<Self, TraceError> {
        let wrong = |line: usize, message: String| TraceError {
            line: line + 1,
            message,
        };
        let lines: Vec<&str> = text.lines().collect();
        let mut values = Vec::with_capacity(lines.len());
        let mut is_cut_off = false;
        for (index, line) in lines.iter().enumerate() {
            match serde_json::from_str::<Value>(line) {
                Ok(value) => values.push(value),
                Err(_) if index > 0 && index + 1 == lines.len() => is_cut_off = true,
                Err(error) => return Err(wrong(index, format!("this is not JSON: {error}"))),
            }
        }
        let mut values = values.into_iter();
        let header = values
            .next()
            .ok_or_else(|| wrong(0, "the trace is empty".to_owned()))?;
        if header.get("format").and_then(Value::as_str) != Some(FORMAT) {
            return Err(wrong(0, "this is no trace of a run".to_owned()));
        }
        if header.get("version").and_then(Value::as_u64) != Some(VERSION) {
            return Err(wrong(0, format!("this program reads version {VERSION}")));
        }
        Ok(Self {
            header,
            entries: values.collect(),
            is_cut_off,
        })
    }

    fn of_kind(&self, kinds: &'static [&'static str]) -> VecDeque<(usize, Value)> {
        let numbered = self.entries.iter().enumerate();
        let is_it = |entry: &Value| {
            let kind = entry.get("event").and_then(Value::as_str);
            kind.is_some_and(|kind| kinds.contains(&kind))
        };
        numbered
            .filter(|(_, entry)| is_it(entry))
            .map(|(index, entry)| (index + 2, entry.clone()))
            .collect()
    }

    /// The plan that the run began with, if it was given one: `start`, `(action …)`, duration.
    ///
    /// # Errors
    /// When its actions are none of the task.
    pub fn first_plan(&self, task: &mut Task) -> Result<Option<TimeTriggeredPlan>, TraceError> {
        match self.entries.first() {
            Some(entry) if entry.get("event").and_then(Value::as_str) == Some("plan") => {
                let steps = entry.get("steps").unwrap_or(&Value::Null);
                read_plan(steps, task, None, 2).map(Some)
            }
            _ => Ok(None),
        }
    }
}

/// A world that reports what a trace says it reported.
pub struct ReplayWorld {
    names: Names,
    task: Arc<Task>,
    has_grown: bool,
    passages: VecDeque<(usize, Value)>,
}

impl ReplayWorld {
    /// The world of a trace.
    pub fn new(stored: &Stored, task: &Task) -> Self {
        Self {
            names: Names::of(task),
            task: Arc::new(task.clone()),
            has_grown: false,
            passages: stored.of_kind(&["passed", "looked"]),
        }
    }

    fn next(&mut self) -> Result<Passage, WorldError> {
        let (line, entry) = self
            .passages
            .pop_front()
            .ok_or_else(|| WorldError::new(END))?;
        let error =
            |message: String| WorldError::new(format!("line {line} of the trace: {message}"));
        let now = field_number(&entry, "now").map_err(|wrong| error(wrong.message))?;
        let reported = entry.get("observations").and_then(Value::as_array);
        let observations = reported.map(Vec::as_slice).unwrap_or_default().iter();
        for observation in observations.clone() {
            self.has_grown |= mention(observation, &mut self.names, &mut self.task);
        }
        let observations = observations
            .map(|it| read_observation(it, &self.names).map_err(|wrong| error(wrong.message)));
        Ok(Passage {
            now,
            observations: observations.collect::<Result<_, _>>()?,
        })
    }
}

const END: &str = "the trace ends here";

impl World for ReplayWorld {
    fn command(&mut self, _now: &Rational, _command: &Command) -> Result<(), WorldError> {
        Ok(())
    }

    fn wait(&mut self, _until: &Rational) -> Result<Passage, WorldError> {
        self.next()
    }

    fn look(
        &mut self,
        _facts: &[FactId],
        _fluents: &[FluentId],
    ) -> Result<Vec<elbowroom_execution::Observation>, WorldError> {
        self.next().map(|passage| passage.observations)
    }

    fn know(&mut self, task: &Arc<Task>) {
        self.names.learn(task);
        self.task = Arc::clone(task);
    }

    fn grown(&mut self) -> Option<Arc<Task>> {
        std::mem::take(&mut self.has_grown).then(|| Arc::clone(&self.task))
    }
}

/// A planner that makes the plans that a trace says it made.
pub struct ReplayPlanner {
    plans: VecDeque<(usize, Value)>,
}

impl ReplayPlanner {
    /// The planner of a trace.
    pub fn new(stored: &Stored) -> Self {
        Self {
            plans: stored.of_kind(&["planned"]),
        }
    }
}

impl Planner for ReplayPlanner {
    fn plan(&mut self, task: &mut Task, situation: &Situation) -> PlannerAnswer {
        let Some((line, entry)) = self.plans.pop_front() else {
            return PlannerAnswer {
                answer: PlanAnswer::NotFound {
                    why: END.to_owned(),
                },
                seconds: None,
            };
        };
        let text = |name: &str| entry.get(name).and_then(Value::as_str).unwrap_or_default();
        let is_unsolvable = entry.get("unsolvable").and_then(Value::as_bool);
        let answer = match entry.get("plan") {
            Some(steps) if !steps.is_null() => {
                match read_plan(steps, task, Some(situation), line) {
                    Ok(plan) => PlanAnswer::Plan(plan),
                    Err(error) => PlanAnswer::NotFound {
                        why: error.to_string(),
                    },
                }
            }
            _ if is_unsolvable == Some(true) => PlanAnswer::Unsolvable,
            _ => PlanAnswer::NotFound {
                why: text("why_not").to_owned(),
            },
        };
        PlannerAnswer {
            answer,
            seconds: entry.get("took").and_then(read_number),
        }
    }
}

fn read_plan(
    steps: &Value,
    task: &mut Task,
    situation: Option<&Situation>,
    line: usize,
) -> Result<TimeTriggeredPlan, TraceError> {
    let wrong = |message: String| TraceError { line, message };
    let mut plan = TimeTriggeredPlan::default();
    let running = situation.map_or(&[][..], |situation| &situation.running);
    for (index, step) in steps.as_array().into_iter().flatten().enumerate() {
        let name = step
            .get("action")
            .and_then(Value::as_str)
            .unwrap_or_default();
        let action = match running.get(index) {
            Some(running) => running.action.clone(),
            None => instantiate(name, task).map_err(wrong)?,
        };
        plan.steps.push(Step {
            start: field_number(step, "start").map_err(|error| wrong(error.message))?,
            duration: step.get("duration").and_then(read_number),
            action,
        });
    }
    Ok(plan)
}

fn instantiate(name: &str, task: &mut Task) -> Result<elbowroom_model::ground::Action, String> {
    let mut words = name.trim_matches(['(', ')']).split_whitespace();
    let problem = task.problem();
    let schema = words.next().and_then(|word| problem.schema(word));
    let schema = schema.ok_or_else(|| format!("there is no action `{name}`"))?;
    let objects: Option<Vec<_>> = words.map(|word| problem.object(word)).collect();
    let objects = objects.ok_or_else(|| format!("`{name}` has an unknown object"))?;
    task.instantiate(schema, &objects)
        .map_err(|error| error.to_string())
}

/// Where a replay differs from its trace.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// The line of the trace, from 1 on.
    pub line: usize,
    /// What the trace has there.
    pub stored: Value,
    /// What the replay came to.
    pub replayed: Value,
}

/// Compares a run, entry by entry, with a stored trace.
pub struct Replay {
    task: Arc<Task>,
    stored: VecDeque<Value>,
    line: usize,
    difference: Option<Difference>,
    is_to_end: Arc<AtomicBool>,
}

impl Replay {
    /// Nothing has been compared.
    pub fn new(stored: &Stored, task: Arc<Task>) -> Self {
        Self {
            task,
            stored: stored.entries.iter().cloned().collect(),
            line: 1,
            difference: None,
            is_to_end: Arc::default(),
        }
        .looking_ahead()
    }

    /// Whether somebody asked the run to end at the point that the replay has reached.
    pub fn interruption(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.is_to_end)
    }

    fn looking_ahead(self) -> Self {
        self.look_ahead();
        self
    }

    fn look_ahead(&self) {
        let next = self.stored.front().and_then(|entry| entry.get("event"));
        let is_to_end = next.and_then(Value::as_str) == Some("interrupted");
        self.is_to_end.store(is_to_end, Ordering::SeqCst);
    }

    /// How many entries agreed, and the first difference, if there is one.
    pub fn outcome(self) -> (usize, Option<Difference>) {
        (self.line - 1, self.difference)
    }
}

impl Recorder for Replay {
    fn record(&mut self, recorded: &Entry<'_>) {
        if self.difference.is_some() {
            return;
        }
        // Beyond the end of a trace that was cut off, there is nothing to compare.
        let Some(stored) = self.stored.pop_front() else {
            return;
        };
        self.look_ahead();
        let replayed = super::entry(&self.task, recorded);
        if stored == replayed {
            self.line += 1;
        } else {
            self.difference = Some(Difference {
                line: self.line + 1,
                stored,
                replayed,
            });
        }
    }

    fn know(&mut self, task: &Arc<Task>) {
        self.task = Arc::clone(task);
    }
}
