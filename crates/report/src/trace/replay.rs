//! Replay of a stored trace.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use elbowroom_execution::{
    Command, Entry, Observation, PlanAnswer, PlanForm, Planner, PlannerAnswer, PreparationRequest,
    PreparationResult, PrepareError, Preparer, Recorder, TimeAdvance, World, WorldError,
};
use elbowroom_model::ground::{FactId, FluentId};
use elbowroom_model::{Situation, Step, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use super::schema::{
    GoalLookLine, Line, ObservationLine, PlannedLine, ShortfallLine, StepLine, TimeAdvanceLine,
};
use super::{FORMAT, SNAPSHOT, SnapshotLine, VERSION};
use crate::wire::read_observation;

/// Error: a trace cannot be replayed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {message}")]
pub struct TraceError {
    /// The line number, from 1.
    pub line: usize,
    /// The error.
    pub message: String,
}

/// A parsed trace.
#[derive(Clone, Debug, PartialEq)]
pub struct Stored {
    /// The first line.
    header: Map<String, Value>,
    /// State of the run at the start of the record, if that is not the start of the run.
    snapshot: Option<Map<String, Value>>,
    /// The other lines, except a truncated last one.
    pub lines: Vec<Line>,
    /// `true` if the last line was truncated.
    pub is_cut_off: bool,
}

/// The error for another kind of file.
const NO_TRACE: &str = "this is not the trace of a run, as `--trace` writes it";

impl Stored {
    /// Reads a trace.
    ///
    /// # Errors
    /// If the text is not a trace, or damaged elsewhere than at its very end.
    pub fn read(text: &str) -> Result<Self, TraceError> {
        let wrong = |line: usize, message: String| TraceError {
            line: line + 1,
            message,
        };
        let lines: Vec<&str> = text.lines().collect();
        let Some((first, rest)) = lines.split_first() else {
            return Err(wrong(0, "the trace is empty".to_owned()));
        };
        let no_trace = |_| wrong(0, NO_TRACE.to_owned());
        let header: Value = serde_json::from_str(first).map_err(no_trace)?;
        let (format, version) = (header.get("format"), header.get("version"));
        if format.and_then(Value::as_str) != Some(FORMAT) {
            return Err(wrong(0, NO_TRACE.to_owned()));
        }
        if version.and_then(Value::as_u64) != Some(VERSION) {
            return Err(wrong(0, format!("this program reads version {VERSION}")));
        }
        let Value::Object(mut header) = header else {
            return Err(wrong(0, "this is not the trace of a run".to_owned()));
        };
        for own in ["event", "format", "version"] {
            header.shift_remove(own);
        }
        let is_snapshot = |line: &&&str| {
            let value: Option<Value> = serde_json::from_str(line).ok();
            value.is_some_and(|value| value.get("event").is_some_and(|it| it == SNAPSHOT))
        };
        let mut snapshot = None;
        let mut rest = rest;
        if let Some(line) = rest.first().filter(is_snapshot) {
            let mut value: Map<String, Value> =
                serde_json::from_str(line).map_err(|error| wrong(1, error.to_string()))?;
            value.shift_remove("event");
            snapshot = Some(value);
            rest = &rest[1..];
        }
        let before = lines.len() - rest.len();
        let mut read = Vec::with_capacity(rest.len());
        let mut is_cut_off = false;
        for (index, line) in rest.iter().enumerate() {
            match serde_json::from_str(line) {
                Ok(line) => read.push(line),
                // A truncated line ends in the middle of its JSON.
                Err(error) if error.is_eof() && index + 1 == rest.len() => is_cut_off = true,
                Err(error) => {
                    let what = if error.is_data() {
                        "this is not a line of a trace"
                    } else {
                        "this is not JSON"
                    };
                    return Err(wrong(index + before, format!("{what}: {error}")));
                }
            }
        }
        Ok(Self {
            header,
            snapshot,
            lines: read,
            is_cut_off,
        })
    }

    /// Returns the specification of the run: the first line, without the members about the trace
    /// itself.
    ///
    /// # Errors
    /// If the specification has another format, for example that of another version of this
    /// program.
    pub fn header<T: DeserializeOwned>(&self) -> Result<T, TraceError> {
        let header = Value::Object(self.header.clone());
        serde_json::from_value(header).map_err(|error| TraceError {
            line: 1,
            message: error.to_string(),
        })
    }

    /// Returns `true` if the trace contains the end of the run.
    pub fn is_complete(&self) -> bool {
        matches!(self.lines.last(), Some(Line::Over(_)))
    }

    /// Returns the number in the file of the first of the [lines](Stored::lines).
    pub fn first_number(&self) -> usize {
        2 + usize::from(self.snapshot.is_some())
    }

    /// Returns how many times the run was resumed after its end.
    pub fn restart_count(&self) -> usize {
        let is_over = |line: &&Line| matches!(line, Line::Over(_));
        let over = self.lines.iter().filter(is_over).count();
        over - usize::from(self.is_complete())
    }

    /// Returns `true` if the world failed, but could still receive commands.
    fn has_reachable_failure(&self) -> bool {
        let is_failure = |line: &Line| matches!(line, Line::WorldFailed(_));
        self.lines.iter().any(is_failure)
    }

    /// Returns the lines with their numbers in the file.
    fn numbered_lines(&self) -> impl Iterator<Item = (usize, &Line)> {
        (self.first_number()..).zip(&self.lines)
    }

    /// Returns `true` if the record begins with a snapshot instead of the start of the run.
    pub fn has_snapshot(&self) -> bool {
        self.snapshot.is_some()
    }

    /// Returns the snapshot at the start of the record, if there is one.
    ///
    /// # Errors
    /// If the snapshot has another format.
    pub fn snapshot(&self) -> Result<Option<SnapshotLine>, TraceError> {
        let line = self.snapshot.clone().map(Value::Object);
        let read = line.map(serde_json::from_value).transpose();
        read.map_err(|error| TraceError {
            line: 2,
            message: error.to_string(),
        })
    }

    /// Returns `true` if the run ended before it began, because its given plan was refused. The
    /// trace does not contain that plan.
    pub fn has_refused_plan(&self) -> bool {
        self.snapshot.is_none() && matches!(self.lines.first(), Some(Line::Over(_)))
    }

    /// Returns the plan that was given to the run at its start, if any.
    ///
    /// # Errors
    /// If an action does not exist in the task.
    pub fn first_plan(&self, task: &Task) -> Result<Option<TimeTriggeredPlan>, TraceError> {
        match self.lines.first() {
            Some(Line::Plan(plan)) if self.snapshot.is_none() => {
                read_plan(&plan.steps, task, None, 2).map(Some)
            }
            _ => Ok(None),
        }
    }
}

/// World that repeats the reports and failures of the world in a trace.
pub struct ReplayWorld {
    task: Arc<Task>,
    answers: VecDeque<RecordedAnswer>,
}

/// Answer of a world in a trace.
enum RecordedAnswer {
    /// Reports up to a time, with the number of the line.
    Passage(usize, Rational, Vec<ObservationLine>),
    /// A failure.
    Failure {
        error: WorldError,
        /// Number of commands from the last answer to the one that fails; 0 if a wait fails.
        commands: usize,
    },
}

impl ReplayWorld {
    /// Creates the world of a trace.
    pub fn new(stored: &Stored, task: &Arc<Task>) -> Self {
        let mut answers = VecDeque::new();
        for (index, (number, line)) in stored.numbered_lines().enumerate() {
            let failure = match line {
                Line::Passed(TimeAdvanceLine {
                    now, observations, ..
                })
                | Line::Looked(GoalLookLine { now, observations }) => {
                    let passage =
                        RecordedAnswer::Passage(number, now.0.clone(), observations.clone());
                    answers.push_back(passage);
                    continue;
                }
                Line::WorldFailed(failed) => WorldError::new(&failed.why).reachable(),
                Line::Over(report)
                    if report.verdict == WORLD_FAILED
                        && index + 1 == stored.lines.len()
                        && !stored.has_reachable_failure() =>
                {
                    WorldError::new(report.why.as_deref().unwrap_or(END))
                }
                _ => continue,
            };
            answers.push_back(RecordedAnswer::Failure {
                error: failure,
                commands: failed_command(&stored.lines[..index]),
            });
        }
        Self {
            task: Arc::clone(task),
            answers,
        }
    }

    fn next(&mut self) -> Result<TimeAdvance, WorldError> {
        let (line, now, reported) = match self.answers.pop_front() {
            Some(RecordedAnswer::Passage(line, now, reported)) => (line, now, reported),
            Some(RecordedAnswer::Failure { error, .. }) => return Err(error),
            None => return Err(WorldError::new(END)),
        };
        let mut observations = Vec::with_capacity(reported.len());
        for observation in &reported {
            if let Some((event, time)) = observation.run_event() {
                let time = time.clone();
                observations.push(Observation { time, event });
                continue;
            }
            let read = read_observation(&message(observation), &self.task);
            observations.push(read.map_err(|wrong| {
                WorldError::new(format!("line {line} of the trace: {}", wrong.message))
            })?);
        }
        Ok(TimeAdvance { now, observations })
    }
}

const END: &str = "the trace ends here";

/// The verdict of a run whose world has failed.
const WORLD_FAILED: &str = "world-failed";

/// Returns the number of commands since the last answer of the world if these lines end with a command, and 0 otherwise.
/// Nothing was decided after that command, so it failed, or the wait for its outcome.
fn failed_command(lines: &[Line]) -> usize {
    let Some(Line::Command(_)) = lines.last() else {
        return 0;
    };
    let is_answer = |line: &&Line| matches!(line, Line::Passed(_) | Line::Looked(_));
    let since = lines.iter().rev().take_while(|line| !is_answer(line));
    since
        .filter(|line| matches!(line, Line::Command(_)))
        .count()
}

impl World for ReplayWorld {
    fn command(&mut self, _now: &Rational, _command: &Command) -> Result<(), WorldError> {
        if let Some(RecordedAnswer::Failure { commands, .. }) = self.answers.front_mut()
            && *commands > 0
        {
            *commands -= 1;
            if *commands == 0 {
                return self.next().map(|_| ());
            }
        }
        Ok(())
    }

    fn wait(&mut self, _until: &Rational) -> Result<TimeAdvance, WorldError> {
        self.next()
    }

    fn look(
        &mut self,
        _facts: &[FactId],
        _fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        self.next().map(|passage| passage.observations)
    }
}

/// Planner that returns the plans in a trace.
pub struct ReplayPlanner {
    /// For each request in the trace, in order: its line, and the answer if it was accepted.
    requests: VecDeque<(usize, Option<PlannedLine>)>,
    /// The request that is answered in the background.
    open: Option<(usize, Option<PlannedLine>)>,
}

impl ReplayPlanner {
    /// Creates the planner of a trace.
    pub fn new(stored: &Stored) -> Self {
        let mut requests = VecDeque::new();
        for (number, line) in stored.numbered_lines() {
            match line {
                Line::Planning(_) => requests.push_back((number, None)),
                Line::Planned(planned) => {
                    if let Some(last) = requests.back_mut() {
                        *last = (number, Some(planned.clone()));
                    }
                }
                _ => {}
            }
        }
        Self {
            requests,
            open: None,
        }
    }

    /// Returns the answer to a request of the trace.
    fn answer(
        request: Option<(usize, Option<PlannedLine>)>,
        task: &Task,
        situation: &Situation,
    ) -> PlannerAnswer {
        let Some((line, Some(planned))) = request else {
            return PlannerAnswer::from(PlanAnswer::NotFound {
                why: END.to_owned(),
            });
        };
        let answer = match &planned.plan {
            Some(steps) => match read_plan(steps, task, Some(situation), line) {
                Ok(plan) => PlanAnswer::Plan(plan),
                Err(error) => PlanAnswer::NotFound {
                    why: error.to_string(),
                },
            },
            None if planned.is_unsolvable => PlanAnswer::Unsolvable,
            None => {
                let why = planned.why_not.clone().unwrap_or_default();
                if planned.has_failed {
                    PlanAnswer::Failed { why }
                } else {
                    PlanAnswer::NotFound { why }
                }
            }
        };
        PlannerAnswer {
            answer,
            seconds: Some(planned.took.0),
            remark: planned.remark,
            shortfall: planned
                .shortfall
                .map(ShortfallLine::read)
                .unwrap_or_default(),
        }
    }
}

impl Planner for ReplayPlanner {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        Self::answer(self.requests.pop_front(), task, situation)
    }

    fn begin(&mut self, _task: &Task, _situation: &Situation) -> bool {
        self.open = self.requests.pop_front();
        true
    }

    fn collect(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        Self::answer(self.open.take(), task, situation)
    }

    fn is_recorded(&self) -> bool {
        !self.requests.is_empty()
    }
}

/// Preparer of a replayed run. If plans were prepared in the background, the trace contains the
/// times of their completion.
#[derive(Clone, Debug)]
pub struct ReplayPreparer<P>(pub P);

impl<P: Preparer> Preparer for ReplayPreparer<P> {
    fn prepare(
        &mut self,
        task: &Arc<Task>,
        plan: &TimeTriggeredPlan,
        need: PlanForm,
    ) -> Result<PreparationResult, PrepareError> {
        self.0.prepare(task, plan, need)
    }

    fn begin(&mut self, _wanted: &PreparationRequest<'_>) -> bool {
        true
    }
}

pub(super) fn read_plan(
    steps: &[StepLine],
    task: &Task,
    situation: Option<&Situation>,
    line: usize,
) -> Result<TimeTriggeredPlan, TraceError> {
    let mut plan = TimeTriggeredPlan::default();
    let running = situation.map_or(&[][..], |situation| &situation.running);
    for (index, step) in steps.iter().enumerate() {
        let action = if let Some(running) = running.get(index) {
            Arc::clone(&running.action)
        } else {
            let action = action_named(&step.action, task);
            Arc::new(action.map_err(|message| TraceError { line, message })?)
        };
        plan.steps.push(Step {
            start: step.start.0.clone(),
            duration: step.duration.as_ref().map(|duration| duration.0.clone()),
            action,
        });
    }
    Ok(plan)
}

fn message(line: &ObservationLine) -> Value {
    serde_json::to_value(line).unwrap_or(Value::Null)
}

/// Returns the action of a task with this name, `(drive a b)`.
///
/// # Errors
/// The mistake, in words.
pub fn action_named(name: &str, task: &Task) -> Result<elbowroom_model::ground::Action, String> {
    let mut words = name.trim_matches(['(', ')']).split_whitespace();
    let problem = task.problem();
    let schema = words.next().and_then(|word| problem.schema(word));
    let schema = schema.ok_or_else(|| format!("unknown action `{name}`"))?;
    let objects: Option<Vec<_>> = words.map(|word| problem.object(word)).collect();
    let objects = objects.ok_or_else(|| format!("`{name}` has an unknown object"))?;
    task.instantiate(schema, &objects)
        .map_err(|error| error.to_string())
}

/// The first difference between a replay and its trace.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// The line number in the trace, from 1.
    pub line: usize,
    /// The line of the trace.
    pub stored: Line,
    /// The line of the replay.
    pub replayed: Line,
}

/// Compares a run, entry by entry, with a stored trace.
pub struct Replay {
    task: Arc<Task>,
    stored: VecDeque<Line>,
    /// The number in the file of the next line.
    line: usize,
    first: usize,
    difference: Option<Difference>,
    is_interrupted: bool,
    must_end: Arc<AtomicBool>,
}

impl Replay {
    /// Creates a comparison with `stored`.
    pub fn new(stored: &Stored, task: Arc<Task>) -> Self {
        Self {
            task,
            stored: stored.lines.iter().cloned().collect(),
            line: stored.first_number(),
            first: stored.first_number(),
            difference: None,
            is_interrupted: false,
            must_end: Arc::default(),
        }
        .with_lookahead()
    }

    /// Returns the flag that is set when the replay reaches the point at which the run was
    /// interrupted.
    pub fn interruption(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.must_end)
    }

    fn with_lookahead(self) -> Self {
        self.look_ahead();
        self
    }

    fn look_ahead(&self) {
        let must_end = matches!(self.stored.front(), Some(Line::Interrupted(_)));
        self.must_end.store(must_end, Ordering::SeqCst);
    }

    /// Returns the number of equal entries, and the first difference, if any.
    pub fn outcome(self) -> (usize, Option<Difference>) {
        (self.line - self.first, self.difference)
    }
}

impl Recorder for Replay {
    fn record(&mut self, recorded: &Entry<'_>) {
        if self.difference.is_some() {
            return;
        }
        // A truncated trace provides nothing more to compare.
        let Some(stored) = self.stored.pop_front() else {
            return;
        };
        self.look_ahead();
        let replayed = Line::of(&self.task, recorded);
        let is_interrupted = self.is_interrupted;
        self.is_interrupted = stored.is_interrupted_after(is_interrupted);
        if stored.agrees_with(&replayed, is_interrupted) {
            self.line += 1;
        } else {
            self.difference = Some(Difference {
                line: self.line,
                stored,
                replayed,
            });
        }
    }
}
