//! The side of Elbowroom: the world protocol, version 2, on a clock that comes in as an argument.

use std::collections::BTreeMap;
use std::time::Duration;

use serde_json::{Value, json};

use crate::{Action, Seen, Ticket, Told};

/// What Elbowroom wants to be done.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// This action is to begin.
    Begin(Action),
    /// It is to stop.
    Cancel(Ticket),
    /// This is believed: at first all that is so, later what has changed. Names are in brackets.
    Believe {
        /// Facts.
        facts: Vec<(String, bool)>,
        /// Fluents, and their values.
        values: Vec<(String, Option<f64>)>,
    },
    /// The run is over.
    Stop,
}

/// A world on the wall clock. Its time begins with the first thing to do, so that what is prepared before
/// takes none.
#[derive(Debug)]
pub struct World {
    name: String,
    /// How many of its seconds pass in one real second.
    speed: f64,
    zero: Option<Duration>,
    speaks: u64,
    begun: BTreeMap<Ticket, Begun>,
    news: Vec<Value>,
    question: Option<Question>,
    /// Whether it wants to hear what is believed.
    is_following: bool,
}

#[derive(Debug)]
struct Begun {
    is_instantaneous: bool,
    has_started: bool,
    has_ended: bool,
}

#[derive(Debug)]
struct Question {
    number: Value,
    /// In seconds of the world; `None` where the answer is due at once.
    until: Option<f64>,
}

impl World {
    /// A world of that name, `speed` of whose seconds pass in one real second; more than 0, and finite.
    pub fn new(name: &str, speed: f64) -> Self {
        Self {
            name: name.to_owned(),
            speed,
            zero: None,
            speaks: 1,
            begun: BTreeMap::new(),
            news: Vec::new(),
            question: None,
            is_following: false,
        }
    }

    /// The same, which is told what is believed, and sees things by itself.
    #[must_use]
    pub fn following(self) -> Self {
        Self {
            is_following: true,
            ..self
        }
    }

    /// Takes a line that Elbowroom has said. What is to be done comes back; what is to be said is appended to
    /// `said`. What is not known is passed over, as the protocol has it.
    ///
    /// # Errors
    /// The line is not a JSON object.
    pub fn hear(
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
            Some("believed") => Some(believed(&message)),
            Some("start") => self
                .begin_time(now)
                .start(ticket, &message)
                .map(Command::Begin),
            Some("cancel") => {
                self.begin_time(now);
                let runs = |ticket: &Ticket| self.begun.get(ticket).is_some_and(|it| !it.has_ended);
                ticket.filter(runs).map(Command::Cancel)
            }
            Some(what @ ("wait" | "look")) => {
                self.begin_time(now);
                let until = message
                    .get("until")
                    .and_then(number)
                    .filter(|_| what == "wait");
                let number = message.get("question").cloned().unwrap_or(Value::Null);
                self.question = Some(Question { number, until });
                None
            }
            _ => None,
        })
    }

    fn greet(&mut self, message: &serde_json::Map<String, Value>, said: &mut Vec<String>) {
        let versions = message.get("versions").and_then(Value::as_array);
        if versions.is_some_and(|all| all.iter().any(|it| it.as_u64() == Some(2))) {
            self.speaks = 2;
            let mut can = vec!["cancel", "feedback"];
            if self.is_following {
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

    /// What is said twice is done once.
    fn start(
        &mut self,
        ticket: Option<u64>,
        message: &serde_json::Map<String, Value>,
    ) -> Option<Action> {
        let ticket = ticket.filter(|it| !self.begun.contains_key(it))?;
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
        let begun = Begun {
            is_instantaneous: action.is_instantaneous,
            has_started: false,
            has_ended: false,
        };
        self.begun.insert(ticket, begun);
        Some(action)
    }

    /// Notes what has become of an action; each start and each end once, and in this order.
    pub fn tell(&mut self, ticket: Ticket, told: &Told, now: Duration) {
        let time = self.time(now);
        let speaks = self.speaks;
        let Some(begun) = self.begun.get_mut(&ticket).filter(|it| !it.has_ended) else {
            return;
        };
        let ended = |outcome: &str| json!({"type": "ended", "ticket": ticket, "time": time, "outcome": outcome});
        let started = json!({"type": "started", "ticket": ticket, "time": time});
        match told {
            Told::Started => {
                if !begun.has_started {
                    begun.has_started = true;
                    begun.has_ended = begun.is_instantaneous;
                    self.news.push(started);
                }
                return;
            }
            Told::Feedback { completion, note } => {
                // Version 1 has no word for it.
                if speaks >= 2 {
                    let part = completion
                        .is_finite()
                        .then(|| f64::from(*completion).clamp(0.0, 1.0));
                    self.news.push(json!({"type": "feedback", "ticket": ticket, "time": time, "completion": part, "note": note}));
                }
                return;
            }
            Told::Succeeded => {
                if !begun.has_started {
                    self.news.push(started);
                }
                self.news.push(ended("succeeded"));
            }
            Told::Cancelled => self.news.push(ended("cancelled")),
            Told::Failed(why) => {
                let mut report = ended("failed");
                report["why"] = json!(why);
                self.news.push(report);
            }
        }
        begun.has_ended = true;
    }

    /// Something was seen that others have changed.
    pub fn see(&mut self, seen: &Seen, now: Duration) {
        let time = self.time(now);
        self.news.push(match seen {
            Seen::Fact(fact, becomes) => {
                json!({"type": "fact", "fact": fact, "becomes": becomes, "time": time})
            }
            Seen::Value(fluent, value) => {
                json!({"type": "value", "fluent": fluent, "value": value, "time": time})
            }
        });
    }

    /// The answer to the open question, line by line, if it is due.
    pub fn answer(&mut self, now: Duration) -> Vec<String> {
        if self.due_in(now) != Some(Duration::ZERO) {
            return Vec::new();
        }
        let Some(question) = self.question.take() else {
            return Vec::new();
        };
        let mut lines: Vec<_> = self.news.drain(..).map(|it| it.to_string()).collect();
        let mut time = json!({"type": "time", "now": self.time(now)});
        if self.speaks >= 2 && !question.number.is_null() {
            time["question"] = question.number;
        }
        lines.push(time.to_string());
        lines
    }

    /// In how much real time the answer to the open question is due if nothing happens; `None` where no
    /// question is open.
    pub fn due_in(&self, now: Duration) -> Option<Duration> {
        let question = self.question.as_ref()?;
        let left = question
            .until
            .map_or(0.0, |until| (until - self.time(now)) / self.speed);
        Some(if !self.news.is_empty() || left <= 0.0 {
            Duration::ZERO
        } else {
            // Rounded up, so that the time has really come. A year stands for whatever is longer.
            Duration::from_secs_f64(left.min(3.2e7)) + Duration::from_nanos(1)
        })
    }

    /// The tickets of what has been begun and has not ended.
    pub fn running(&self) -> Vec<Ticket> {
        let open = self.begun.iter().filter(|(_, it)| !it.has_ended);
        open.map(|(ticket, _)| *ticket).collect()
    }

    /// What time it is, in seconds.
    fn time(&self, now: Duration) -> f64 {
        self.zero.map_or(0.0, |zero| {
            now.saturating_sub(zero).as_secs_f64() * self.speed
        })
    }
}

fn believed(message: &serde_json::Map<String, Value>) -> Command {
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

/// A number as Elbowroom writes it; what decides is exact on its side.
fn number(value: &Value) -> Option<f64> {
    value.get("decimal").unwrap_or(value).as_f64()
}

#[cfg(test)]
mod tests;
