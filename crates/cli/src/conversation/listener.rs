//! What a program says, line by line, understood.

use std::sync::Arc;

use elbowroom::execution::{Event, Observation};
use elbowroom::model::Task;
use elbowroom::num::Rational;
use elbowroom::report::wire;
use serde_json::{Value, json};

use super::clocks::Clocks;

/// The versions of the protocol that are spoken here. A program that does not greet speaks the
/// first.
const VERSIONS: [u64; 2] = [1, 2];

/// The first message to a program.
pub(crate) fn hello(task: &Task) -> Value {
    let schemas = task.problem().schemas.iter();
    let actions: Vec<&str> = schemas.map(|schema| schema.name.as_str()).collect();
    json!({
        "type": "hello", "protocol": "elbowroom-world", "version": VERSIONS[0], "versions": VERSIONS,
        "actions": actions,
    })
}

/// How a program introduces itself, from version 2 on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Greeting {
    /// The version that it speaks.
    pub(crate) version: u64,
    /// Its name; may be empty.
    pub(crate) name: String,
    /// What it says it can do, unknown words included.
    pub(crate) can: Vec<String>,
}

/// What a program may be able to do, or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ability {
    /// To say what is so when it is asked to look.
    Look,
    /// To stop an action.
    Cancel,
    /// To go on after it was started again, and to say what became of what was under way.
    Resume,
    /// To make something of what is believed.
    Beliefs,
}

impl Ability {
    fn name(self) -> &'static str {
        match self {
            Self::Look => "look",
            Self::Cancel => "cancel",
            Self::Resume => "resume",
            Self::Beliefs => "beliefs",
        }
    }
}

/// One line, understood.
#[derive(Debug)]
pub(crate) enum Said {
    Greeting,
    /// One of its clocks was read, of which nothing follows yet.
    Clock,
    /// It knows nothing of a start that it was asked about.
    Unknown,
    Time(Rational),
    Observation(Observation),
}

/// Understands a program's lines, in their order.
pub(crate) struct Listener {
    task: Arc<Task>,
    clocks: Clocks,
    greeting: Option<Greeting>,
    /// Whether anything was understood.
    has_spoken: bool,
    /// The tickets below this one were given.
    given: u64,
    /// The number of the last question.
    question: u64,
}

impl Listener {
    /// Nothing was said.
    pub(crate) fn new(task: &Arc<Task>) -> Self {
        Self {
            task: Arc::clone(task),
            clocks: Clocks::default(),
            greeting: None,
            has_spoken: false,
            given: 0,
            question: 0,
        }
    }

    /// The program is told to start something with this ticket.
    pub(crate) fn note_start(&mut self, ticket: u64) {
        self.given = self.given.max(ticket.saturating_add(1));
    }

    /// The number of a new question.
    pub(crate) fn next_question(&mut self) -> u64 {
        self.question += 1;
        self.question
    }

    /// How the program has introduced itself.
    pub(crate) fn greeting(&self) -> Option<&Greeting> {
        self.greeting.as_ref()
    }

    /// Whether the program can do that, as far as it says: one of the first version can do
    /// everything.
    pub(crate) fn can(&self, ability: Ability) -> bool {
        self.greeting
            .as_ref()
            .is_none_or(|greeting| greeting.can.iter().any(|word| word == ability.name()))
    }

    /// Whether the program wants to hear what is believed; not known before it has said anything.
    pub(crate) fn wants_beliefs(&self) -> Option<bool> {
        self.has_spoken
            .then(|| self.greeting.is_some() && self.can(Ability::Beliefs))
    }

    /// Reads a line.
    ///
    /// # Errors
    /// In words, when it is no message, or one that means nothing here.
    pub(crate) fn read(&mut self, line: &str) -> Result<Said, String> {
        let said = self.understood(line)?;
        self.has_spoken = true;
        Ok(said)
    }

    fn understood(&mut self, line: &str) -> Result<Said, String> {
        let mut message: Value =
            serde_json::from_str(line).map_err(|error| format!("not JSON: {error}"))?;
        let what = message.get("type").and_then(Value::as_str);
        match what {
            Some("hello") => return self.greeted(&message).map(|()| Said::Greeting),
            Some("time") => return self.time(&message).map(Said::Time),
            Some(word @ ("clock" | "feedback")) if self.greeting.is_none() => {
                return Err(format!(
                    "`{word}` belongs to version 2 of the protocol; greet first, with \
                     {{\"type\":\"hello\",\"version\":2,\"can\":[…]}}"
                ));
            }
            Some("unknown") if self.greeting.is_some() => return Ok(Said::Unknown),
            Some("clock") => return self.clock(&message).map(|()| Said::Clock),
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
                if ticket.0 >= self.given =>
            {
                Err(format!("ticket {} was never given", ticket.0))
            }
            _ => Ok(Said::Observation(observation)),
        }
    }

    fn greeted(&mut self, message: &Value) -> Result<(), String> {
        if self.greeting.is_some() || self.has_spoken {
            return Err("`hello` comes once, and before anything else".to_owned());
        }
        let version = message.get("version").and_then(Value::as_u64);
        let version = version.filter(|version| VERSIONS.contains(version));
        let Some(version) = version else {
            return Err("`version` must be 1 or 2: no others are spoken here".to_owned());
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
        // Who says that it speaks the first version has said nothing else about itself.
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
                "it answers question {question}, but number {} is open",
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

/// Whether a line is a message that ends an answer to this question, right or wrong.
pub(crate) fn is_time(line: &str) -> bool {
    let message = serde_json::from_str::<Value>(line).unwrap_or_default();
    message.get("type").and_then(Value::as_str) == Some("time")
        && wire::field_number(&message, "now").is_err()
}
