//! Elbowroom's side: version 2 of the world protocol, with the time as an argument.

use std::collections::BTreeMap;
use std::time::Duration;

use serde_json::{Value, json};

use crate::{Action, ActionHandle, ActionUpdate, ExternalChange};

/// Command of Elbowroom.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Start this action.
    Begin(Action),
    /// Cancel this action.
    Cancel(ActionHandle),
    /// Beliefs: all of them at first, changes later. Names are in brackets.
    Believe {
        /// Facts.
        facts: Vec<(String, bool)>,
        /// Fluents, and their values.
        values: Vec<(String, Option<f64>)>,
    },
    /// The run is over.
    Stop,
}

/// World on the wall clock. Its time begins with the first command or question, so preparation
/// takes no time.
#[derive(Debug)]
pub struct World {
    name: String,
    /// Seconds of the world per real second.
    speed: f64,
    zero: Option<Duration>,
    protocol_version: u64,
    started: BTreeMap<ActionHandle, StartedAction>,
    pending_reports: Vec<Value>,
    pending_wait: Option<PendingWait>,
    /// `true` if beliefs are requested and changes by others reported.
    reports_beliefs: bool,
}

#[derive(Debug)]
struct StartedAction {
    is_instantaneous: bool,
    has_started: bool,
    has_ended: bool,
}

#[derive(Debug)]
struct PendingWait {
    number: Value,
    /// Time limit in seconds of the world; `None` if the answer is due at once.
    until: Option<f64>,
}

impl World {
    /// Creates a world of that name. `speed` is the number of its seconds per real second, positive
    /// and finite.
    pub fn new(name: &str, speed: f64) -> Self {
        Self {
            name: name.to_owned(),
            speed,
            zero: None,
            protocol_version: 1,
            started: BTreeMap::new(),
            pending_reports: Vec::new(),
            pending_wait: None,
            reports_beliefs: false,
        }
    }

    /// Requests the beliefs of the run, and announces that facts may change by themselves.
    #[must_use]
    pub fn with_beliefs(self) -> Self {
        Self {
            reports_beliefs: true,
            ..self
        }
    }

    /// Takes a line of Elbowroom. Returns the command, and appends answers to `said`. Unknown
    /// messages are ignored, as the protocol requires.
    ///
    /// # Errors
    /// The line is not a JSON object.
    pub fn handle_line(
        &mut self,
        line: &str,
        now: Duration,
        said: &mut Vec<String>,
    ) -> Result<Option<Command>, serde_json::Error> {
        let message: serde_json::Map<String, Value> = serde_json::from_str(line)?;
        let what = message.get("type").and_then(Value::as_str);
        let ticket = message.get("ticket").and_then(Value::as_u64);
        Ok(match what {
            Some("hello") => {
                self.greet(&message, said);
                None
            }
            Some("stop") => Some(Command::Stop),
            Some("believed") => Some(belief_command(&message)),
            Some("start") => self
                .begin_time(now)
                .start(ticket, &message)
                .map(Command::Begin),
            Some("cancel") => {
                self.begin_time(now);
                let runs = |ticket: &ActionHandle| {
                    self.started.get(ticket).is_some_and(|it| !it.has_ended)
                };
                ticket.filter(runs).map(Command::Cancel)
            }
            Some(what @ ("wait" | "look")) => {
                self.begin_time(now);
                let until = message
                    .get("until")
                    .and_then(number)
                    .filter(|_| what == "wait");
                let number = message.get("question").cloned().unwrap_or(Value::Null);
                self.pending_wait = Some(PendingWait { number, until });
                None
            }
            _ => None,
        })
    }

    fn greet(&mut self, message: &serde_json::Map<String, Value>, said: &mut Vec<String>) {
        let versions = message.get("versions").and_then(Value::as_array);
        if versions.is_some_and(|all| all.iter().any(|it| it.as_u64() == Some(2))) {
            self.protocol_version = 2;
            let mut can = vec!["cancel", "feedback"];
            if self.reports_beliefs {
                can.extend(["facts", "beliefs"]);
            }
            said.push(
                json!({"type": "hello", "version": 2, "name": self.name, "can": can}).to_string(),
            );
        }
    }

    fn begin_time(&mut self, now: Duration) -> &mut Self {
        self.zero.get_or_insert(now);
        self
    }

    /// Returns the action to start, or `None` if its ticket was used before.
    fn start(
        &mut self,
        ticket: Option<u64>,
        message: &serde_json::Map<String, Value>,
    ) -> Option<Action> {
        let ticket = ticket.filter(|it| !self.started.contains_key(it))?;
        let text = message.get("action").and_then(Value::as_str)?;
        let mut words = text
            .trim_matches(|it: char| it == '(' || it == ')' || it.is_whitespace())
            .split_whitespace()
            .map(str::to_owned);
        let action = Action {
            ticket,
            name: words.next()?,
            arguments: words.collect(),
            is_instantaneous: message.get("duration").is_none_or(Value::is_null),
        };
        let begun = StartedAction {
            is_instantaneous: action.is_instantaneous,
            has_started: false,
            has_ended: false,
        };
        self.started.insert(ticket, begun);
        Some(action)
    }

    /// Takes a report about an action. Each start and each end is reported once, in this order.
    pub fn report(&mut self, ticket: ActionHandle, told: &ActionUpdate, now: Duration) {
        let time = self.time(now);
        let speaks = self.protocol_version;
        let Some(begun) = self.started.get_mut(&ticket).filter(|it| !it.has_ended) else {
            return;
        };
        let ended = |outcome: &str| json!({"type": "ended", "ticket": ticket, "time": time, "outcome": outcome});
        let started = json!({"type": "started", "ticket": ticket, "time": time});
        match told {
            ActionUpdate::Started => {
                if !begun.has_started {
                    begun.has_started = true;
                    begun.has_ended = begun.is_instantaneous;
                    self.pending_reports.push(started);
                }
                return;
            }
            ActionUpdate::Feedback { completion, note } => {
                // Version 1 has no feedback.
                if speaks >= 2 {
                    let part = completion
                        .is_finite()
                        .then(|| f64::from(*completion).clamp(0.0, 1.0));
                    self.pending_reports.push(json!({"type": "feedback", "ticket": ticket, "time": time, "completion": part, "note": note}));
                }
                return;
            }
            ActionUpdate::Succeeded => {
                if !begun.has_started {
                    self.pending_reports.push(started);
                }
                self.pending_reports.push(ended("succeeded"));
            }
            ActionUpdate::Cancelled => self.pending_reports.push(ended("cancelled")),
            ActionUpdate::Failed(why) => {
                let mut report = ended("failed");
                report["why"] = json!(why);
                self.pending_reports.push(report);
            }
        }
        begun.has_ended = true;
    }

    /// Takes a change that others have made.
    pub fn report_change(&mut self, seen: &ExternalChange, now: Duration) {
        let time = self.time(now);
        self.pending_reports.push(match seen {
            ExternalChange::Fact(fact, becomes) => {
                json!({"type": "fact", "fact": fact, "becomes": becomes, "time": time})
            }
            ExternalChange::Value(fluent, value) => {
                json!({"type": "value", "fluent": fluent, "value": value, "time": time})
            }
        });
    }

    /// Returns the answer to the open question, line by line, if it is due.
    pub fn answer(&mut self, now: Duration) -> Vec<String> {
        if self.due_in(now) != Some(Duration::ZERO) {
            return Vec::new();
        }
        let Some(question) = self.pending_wait.take() else {
            return Vec::new();
        };
        let mut lines: Vec<_> = self
            .pending_reports
            .drain(..)
            .map(|it| it.to_string())
            .collect();
        let mut time = json!({"type": "time", "now": self.time(now)});
        if self.protocol_version >= 2 && !question.number.is_null() {
            time["question"] = question.number;
        }
        lines.push(time.to_string());
        lines
    }

    /// Returns the real time until the answer to the open question is due if nothing happens, or
    /// `None` if no question is open.
    pub fn due_in(&self, now: Duration) -> Option<Duration> {
        let question = self.pending_wait.as_ref()?;
        let left = question
            .until
            .map_or(0.0, |until| (until - self.time(now)) / self.speed);
        Some(if !self.pending_reports.is_empty() || left <= 0.0 {
            Duration::ZERO
        } else {
            // Rounded up, so that the time limit has passed. At most a year.
            Duration::from_secs_f64(left.min(3.2e7)) + Duration::from_nanos(1)
        })
    }

    /// Returns the tickets of the running actions.
    pub fn running(&self) -> Vec<ActionHandle> {
        let open = self.started.iter().filter(|(_, it)| !it.has_ended);
        open.map(|(ticket, _)| *ticket).collect()
    }

    /// Returns the time of the world, in seconds.
    fn time(&self, now: Duration) -> f64 {
        self.zero.map_or(0.0, |zero| {
            now.saturating_sub(zero).as_secs_f64() * self.speed
        })
    }
}

fn belief_command(message: &serde_json::Map<String, Value>) -> Command {
    let entries = |name: &str| message.get(name).and_then(Value::as_object);
    let facts = entries("facts").into_iter().flatten();
    let values = entries("values").into_iter().flatten();
    Command::Believe {
        facts: facts
            .filter_map(|(fact, truth)| Some((fact.clone(), truth.as_bool()?)))
            .collect(),
        values: values
            .map(|(fluent, value)| (fluent.clone(), number(value)))
            .collect(),
    }
}

/// Returns a number of Elbowroom as a float. Elbowroom itself computes with the exact value.
fn number(value: &Value) -> Option<f64> {
    value.get("decimal").unwrap_or(value).as_f64()
}

#[cfg(test)]
mod tests;
