//! A world that is a process: `docs/formats/world-protocol.md`.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, Command as Program, Stdio};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use elbowroom::execution::{Command, Observation, Passage, World, WorldError};
use elbowroom::model::Task;
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;
use elbowroom::report::{Names, wire};
use serde_json::{Value, json};

use crate::exit::Failure;
use crate::output::plain;

/// A line longer than this is no message.
const LONGEST_LINE: usize = 1 << 20;

/// A child process that is told what to start, and reports what happens.
pub(super) struct ProcessWorld {
    child: Child,
    stdin: ChildStdin,
    lines: Receiver<String>,
    patience: Duration,
    names: Names,
    task: Arc<Task>,
}

impl ProcessWorld {
    /// Starts the program, with the words of `command` as its arguments.
    pub(super) fn start(
        command: &str,
        task: &Arc<Task>,
        patience: &Rational,
    ) -> Result<Self, Failure> {
        let cannot = |why: String| {
            Failure::new(
                format!("cannot start the world `{command}`: {why}"),
                "give a program and its arguments, separated by spaces",
            )
        };
        let mut words = command.split_whitespace();
        let program = words
            .next()
            .ok_or_else(|| cannot("it is empty".to_owned()))?;
        let mut child = Program::new(program)
            .args(words)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| cannot(plain(&error)))?;
        let (Some(stdin), Some(stdout)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(cannot(
                "its standard input and output are not there".to_owned(),
            ));
        };
        let (sender, lines) = channel();
        // Reading blocks; a thread of its own lets us stop waiting.
        std::thread::spawn(move || {
            for line in BufReader::new(stdout).lines() {
                let Ok(line) = line else { break };
                if line.len() > LONGEST_LINE || sender.send(line).is_err() {
                    break;
                }
            }
        });
        let mut world = Self {
            child,
            stdin,
            lines,
            patience: Duration::try_from_secs_f64(patience.to_f64()).unwrap_or(Duration::MAX),
            names: Names::of(task),
            task: Arc::clone(task),
        };
        world
            .tell(&json!({ "type": "hello", "protocol": "elbowroom-world", "version": 1 }))
            .map_err(|error| cannot(error.message))?;
        Ok(world)
    }

    /// Says good-bye, and ends the program if it does not end by itself.
    pub(super) fn stop(mut self) {
        let _ = self.tell(&json!({ "type": "stop" }));
        drop(self.stdin);
        for _ in 0..20 {
            if !matches!(self.child.try_wait(), Ok(None)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    fn tell(&mut self, message: &Value) -> Result<(), WorldError> {
        let line = format!("{message}\n");
        let told = self.stdin.write_all(line.as_bytes());
        told.and_then(|()| self.stdin.flush()).map_err(|error| {
            WorldError::new(format!("the world no longer listens: {}", plain(&error)))
        })
    }

    /// Everything up to the message that says what time it is.
    fn hear(&mut self) -> Result<Passage, WorldError> {
        let mut observations = Vec::new();
        loop {
            let line = self
                .lines
                .recv_timeout(self.patience)
                .map_err(|error| match error {
                    RecvTimeoutError::Timeout => WorldError::new(
                        "the world has not answered in time; --answer-within says how long to wait",
                    ),
                    RecvTimeoutError::Disconnected => WorldError::new("the world has ended"),
                })?;
            if line.trim().is_empty() {
                continue;
            }
            let wrong = |why: String| WorldError::new(format!("the world said `{line}`: {why}"));
            let message: Value =
                serde_json::from_str(&line).map_err(|error| wrong(format!("not JSON: {error}")))?;
            if message.get("type").and_then(Value::as_str) == Some("time") {
                let now =
                    wire::field_number(&message, "now").map_err(|error| wrong(error.message))?;
                return Ok(Passage { now, observations });
            }
            let observation = wire::read_observation(&message, &self.names);
            observations.push(observation.map_err(|error| wrong(error.message))?);
        }
    }
}

impl World for ProcessWorld {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        let mut message = wire::command(command);
        message["now"] = wire::number(now);
        self.tell(&message)
    }

    fn wait(&mut self, until: &Rational) -> Result<Passage, WorldError> {
        self.tell(&json!({ "type": "wait", "until": wire::number(until) }))?;
        self.hear()
    }

    fn look(
        &mut self,
        facts: &[FactId],
        fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        let facts = facts.iter().map(|fact| self.task.fact_name(*fact));
        let fluents = fluents.iter().map(|fluent| self.task.fluent_name(*fluent));
        let message = json!({
            "type": "look",
            "facts": facts.collect::<Vec<_>>(),
            "fluents": fluents.collect::<Vec<_>>(),
        });
        self.tell(&message)?;
        Ok(self.hear()?.observations)
    }

    fn know(&mut self, task: &Arc<Task>) {
        self.names.learn(task);
        self.task = Arc::clone(task);
    }
}
