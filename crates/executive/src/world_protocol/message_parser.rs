//! Parser of the messages that a world sends, line by line.

use std::sync::Arc;

use elbowroom::execution::{Event, Observation};
use elbowroom::model::Task;
use elbowroom::num::Rational;
use elbowroom::report::wire;
use serde_json::{Value, json};

use super::clock_sync::Clocks;

/// Supported versions of the protocol. A program without a greeting uses version 1.
const VERSIONS: [u64; 2] = [1, 2];

/// Returns the first message to a program: the names of the actions of the problem.
pub fn hello(task: &Task) -> Value {
    let schemas = task.problem().schemas.iter();
    let actions: Vec<&str> = schemas.map(|schema| schema.name.as_str()).collect();
    json!({
        "type": "hello", "protocol": "elbowroom-world", "version": VERSIONS[0], "versions": VERSIONS,
        "actions": actions,
    })
}

/// Greeting of a program, from version 2 on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Greeting {
    /// Version of the protocol.
    pub version: u64,
    /// Name of the program; may be empty.
    pub name: String,
    /// Capabilities that the program states, including unknown ones.
    pub can: Vec<String>,
}

/// Optional capability of a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Capability {
    /// Report facts and values on the question `look`.
    Look,
    /// Cancel an action.
    Cancel,
    /// Resume after a restart, and report the outcome of actions that were running.
    Resume,
    /// Process belief messages.
    Beliefs,
}

impl Capability {
    fn name(self) -> &'static str {
        match self {
            Self::Look => "look",
            Self::Cancel => "cancel",
            Self::Resume => "resume",
            Self::Beliefs => "beliefs",
        }
    }
}

/// Parsed message of a program.
#[derive(Debug)]
pub enum Message {
    /// The greeting; [`MessageParser::greeting`] returns it.
    Greeting,
    /// A reading of a clock. Later time stamps are converted with it.
    Clock,
    /// The program has no record of an action that it was asked about.
    Unknown,
    /// The end of an answer: the time of the world in seconds.
    Time(Rational),
    /// An observation.
    Observation(Observation),
}

/// Parser of a program's messages, in their order.
pub struct MessageParser {
    task: Arc<Task>,
    clocks: Clocks,
    greeting: Option<Greeting>,
    /// `true` after the first valid message.
    has_spoken: bool,
    /// Tickets below this one were issued.
    next_ticket: u64,
    /// Number of the last question.
    question: u64,
}

impl MessageParser {
    /// Creates a parser for the messages of a new program.
    pub fn new(task: &Arc<Task>) -> Self {
        Self {
            task: Arc::clone(task),
            clocks: Clocks::default(),
            greeting: None,
            has_spoken: false,
            next_ticket: 0,
            question: 0,
        }
    }

    /// Records that the ticket was issued to the program.
    pub fn note_start(&mut self, ticket: u64) {
        self.next_ticket = self.next_ticket.max(ticket.saturating_add(1));
    }

    /// Returns the number of a new question.
    pub fn next_question(&mut self) -> u64 {
        self.question += 1;
        self.question
    }

    /// Returns the greeting, or `None` if there was none yet.
    pub fn greeting(&self) -> Option<&Greeting> {
        self.greeting.as_ref()
    }

    /// Returns `true` if the program states the capability. Programs of version 1 have all of them.
    pub fn can(&self, capability: Capability) -> bool {
        self.greeting
            .as_ref()
            .is_none_or(|greeting| greeting.can.iter().any(|word| word == capability.name()))
    }

    /// Returns `true` if the program processes belief messages, or `None` before its first message.
    pub fn wants_beliefs(&self) -> Option<bool> {
        self.has_spoken
            .then(|| self.greeting.is_some() && self.can(Capability::Beliefs))
    }

    /// Parses a line.
    ///
    /// # Errors
    /// When the line is not a message, or an unknown or misplaced one; the error is a message for
    /// the user.
    pub fn parse(&mut self, line: &str) -> Result<Message, String> {
        let message = self.parse_line(line)?;
        self.has_spoken = true;
        Ok(message)
    }

    fn parse_line(&mut self, line: &str) -> Result<Message, String> {
        let mut message: Value =
            serde_json::from_str(line).map_err(|error| format!("not JSON: {error}"))?;
        let what = message.get("type").and_then(Value::as_str);
        match what {
            Some("hello") => return self.greeted(&message).map(|()| Message::Greeting),
            Some("time") => return self.time(&message).map(Message::Time),
            Some(word @ ("clock" | "feedback")) if self.greeting.is_none() => {
                return Err(format!(
                    "`{word}` needs version 2 of the protocol; send {{\"type\":\"hello\",\"version\":2,\"can\":[…]}} \
                     first"
                ));
            }
            Some("unknown") if self.greeting.is_some() => return Ok(Message::Unknown),
            Some("clock") => return self.clock(&message).map(|()| Message::Clock),
            _ => {}
        }
        if self.greeting.is_some() && message.get("clock").is_some() {
            let wrong = |error: wire::WireError| error.message;
            let clock = wire::field_text(&message, "clock").map_err(wrong)?;
            let stamp = wire::field_number(&message, "time").map_err(wrong)?;
            message["time"] = wire::number(&self.clocks.time(clock, &stamp)?);
        }
        let observation = wire::read_observation(&message, &self.task);
        let observation = observation.map_err(|error| error.message)?;
        match &observation.event {
            Event::Started { ticket, .. }
            | Event::Ended { ticket, .. }
            | Event::Feedback { ticket, .. }
                if ticket.0 >= self.next_ticket =>
            {
                Err(format!("unknown ticket {}", ticket.0))
            }
            _ => Ok(Message::Observation(observation)),
        }
    }

    fn greeted(&mut self, message: &Value) -> Result<(), String> {
        if self.greeting.is_some() || self.has_spoken {
            return Err("`hello` must be the first message, and may occur only once".to_owned());
        }
        let version = message.get("version").and_then(Value::as_u64);
        let version = version.filter(|version| VERSIONS.contains(version));
        let Some(version) = version else {
            return Err("`version` must be 1 or 2".to_owned());
        };
        let can = match message.get("can") {
            None => Some(Vec::new()),
            Some(words) => words.as_array().and_then(|words| {
                let words = words.iter().map(|word| word.as_str().map(str::to_owned));
                words.collect::<Option<Vec<_>>>()
            }),
        };
        let can = can.ok_or("`can` must be a list of words: cancel, feedback, facts, look")?;
        let name = message.get("name").and_then(Value::as_str);
        let greeting = Greeting {
            version,
            name: name.unwrap_or_default().to_owned(),
            can,
        };
        // Version 1 has no capabilities.
        if version > VERSIONS[0] {
            self.greeting = Some(greeting);
        }
        Ok(())
    }

    fn time(&self, message: &Value) -> Result<Rational, String> {
        if let Some(question) = message.get("question").filter(|it| !it.is_null())
            && question.as_u64() != Some(self.question)
        {
            return Err(format!(
                "it answers question {question}, but question {} is pending",
                self.question
            ));
        }
        wire::field_number(message, "now").map_err(|error| error.message)
    }

    fn clock(&mut self, message: &Value) -> Result<(), String> {
        let wrong = |error: wire::WireError| error.message;
        let name = wire::field_text(message, "clock").map_err(wrong)?;
        let reads = wire::field_number(message, "reads").map_err(wrong)?;
        let time = wire::field_number(message, "time").map_err(wrong)?;
        let rate = match message.get("rate") {
            None | Some(Value::Null) => None,
            Some(_) => Some(wire::field_number(message, "rate").map_err(wrong)?),
        };
        self.clocks.read(name, reads, time, rate)
    }
}

/// Returns `true` for a malformed message `time`, which still ends an answer.
pub fn is_time(line: &str) -> bool {
    let message = serde_json::from_str::<Value>(line).unwrap_or_default();
    message.get("type").and_then(Value::as_str) == Some("time")
        && wire::field_number(&message, "now").is_err()
}
