//! World that is a process: `docs/reference/formats/world-protocol.md`.

use std::process::Child;
use std::sync::Arc;
use std::time::Duration;

use elbowroom::execution::{Command, Event, Observation, TimeAdvance, World, WorldError};
use elbowroom::model::Task;
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;
use elbowroom::num::work::Stop;
use elbowroom::report::wire;
use serde_json::{Value, json};

use crate::belief_updates::BeliefUpdates;
use crate::clock::Clock;
use crate::error::Error;
use crate::messages::excerpt;
use crate::world_protocol::{
    Capability, LineReader, LineWriter, MAX_ANSWER, MAX_LINE, Message, MessageParser, ReadResult,
    WriteResult, find_program, hello, is_time, launch, wait_for_exit,
};

/// Time limit for a program to exit after the run.
const EXIT_TIMEOUT: Duration = Duration::from_secs(1);

/// Time limit for a program to complete its answers after a request to stop the run.
const STOP_TIMEOUT: Duration = Duration::from_secs(5);

/// Interval between two checks for a request to stop the run.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// Limits on the behaviour of a world process.
#[derive(Clone, Debug)]
pub struct ProcessLimits {
    /// Time limit for each answer, in seconds.
    pub answer_timeout: Rational,
    /// `true` if an invalid message ends the run. Otherwise it is recorded and ignored.
    pub is_strict: bool,
    /// Number of times that the program is started again after it has ended or failed.
    pub restarts: u32,
}

/// Child process that receives commands and reports observations.
///
/// A request to stop the run ends a pending wait at once. Its answer is still outstanding, and becomes the answer
/// to the next wait.
pub struct ProcessWorld {
    child: Child,
    writer: LineWriter,
    reader: LineReader,
    answer_timeout: Duration,
    limits: ProcessLimits,
    stop: Stop,
    /// Runs since a wait was ended by a request to stop the run.
    since_stop_request: Option<Clock>,
    /// `true` while an answer is outstanding.
    has_open_question: bool,
    /// Last reported time.
    now: Rational,
    /// `true` if the program cannot receive further messages.
    is_input_closed: bool,
    task: Arc<Task>,
    parser: MessageParser,
    /// Changes of the belief state, if they are sent.
    beliefs: Option<BeliefUpdates>,
}

impl ProcessWorld {
    /// Starts the program. The words of `command` are the program and its arguments. `stop` is the stop request of the
    /// run.
    ///
    /// # Errors
    /// When the program cannot be started, or does not read the first message.
    pub fn start(
        command: &str,
        task: &Arc<Task>,
        limits: ProcessLimits,
        stop: Stop,
    ) -> Result<Self, Error> {
        Self::greeted(command, task, limits, stop, &hello(task))
    }

    /// Starts the program for a resumed run. `resumed` lists the actions that were running, for the first message;
    /// tickets below `given` were issued before.
    ///
    /// # Errors
    /// As [`ProcessWorld::start`].
    pub fn resume(
        command: &str,
        task: &Arc<Task>,
        limits: ProcessLimits,
        stop: Stop,
        (resumed, given): (&Value, u64),
    ) -> Result<Self, Error> {
        let mut hello = hello(task);
        hello["resumed"] = resumed.clone();
        let mut world = Self::greeted(command, task, limits, stop, &hello)?;
        if let Some(last) = given.checked_sub(1) {
            world.parser.note_start(last);
        }
        Ok(world)
    }

    /// Requests the outcome of these starts. Returns the answer, and `true` if the program resumes runs.
    ///
    /// # Errors
    /// When the program does not answer.
    pub fn recall(&mut self, tickets: &[u64]) -> Result<(TimeAdvance, bool), WorldError> {
        let question = json!({ "type": "look", "facts": [], "fluents": [], "tickets": tickets });
        let passage = self.ask(question)?;
        let knows = self.parser.greeting().is_some() && self.parser.can(Capability::Resume);
        Ok((passage, knows))
    }

    fn greeted(
        command: &str,
        task: &Arc<Task>,
        limits: ProcessLimits,
        stop: Stop,
        hello: &Value,
    ) -> Result<Self, Error> {
        let cannot = |why: String| cannot_start(command, &why);
        let (child, writer, reader) = launch(command).map_err(cannot)?;
        let mut world = Self {
            child,
            writer,
            reader,
            answer_timeout: Duration::try_from_secs_f64(limits.answer_timeout.to_f64())
                .unwrap_or(Duration::MAX),
            limits,
            stop,
            since_stop_request: None,
            has_open_question: false,
            now: Rational::ZERO,
            is_input_closed: false,
            task: Arc::clone(task),
            parser: MessageParser::new(task),
            beliefs: None,
        };
        match world.send(hello) {
            Ok(()) => Ok(world),
            Err(error) => {
                world.stop();
                Err(cannot(error.message))
            }
        }
    }

    /// Sends changes of the belief state to the program, if it processes them.
    #[must_use]
    pub fn with_beliefs(self, beliefs: BeliefUpdates) -> Self {
        let beliefs = Some(beliefs);
        Self { beliefs, ..self }
    }

    /// Sends pending changes of the belief state.
    fn send_beliefs(&mut self) -> Result<(), WorldError> {
        let (Some(beliefs), Some(is_wanted)) = (&self.beliefs, self.parser.wants_beliefs()) else {
            return Ok(());
        };
        for message in beliefs.take_messages(is_wanted, &self.task) {
            self.send(&message)?;
        }
        Ok(())
    }

    /// Sends `stop`, and kills the program if it does not exit within one second.
    pub fn stop(mut self) {
        if !self.is_input_closed {
            let _ = self.send_beliefs();
        }
        if !self.is_input_closed {
            let _ = self.send_within(&json!({ "type": "stop" }), EXIT_TIMEOUT);
        }
        // Closes its standard input.
        drop(self.writer);
        if wait_for_exit(&mut self.child, EXIT_TIMEOUT).is_none() {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }

    fn send(&mut self, message: &Value) -> Result<(), WorldError> {
        match self.send_within(message, self.time_limit()) {
            WriteResult::Written => Ok(()),
            WriteResult::Timeout => Err(WorldError::new(format!(
                "it has not read its input within {} s; --answer-within sets the time limit",
                self.answer_timeout.as_secs_f64()
            ))),
            WriteResult::Closed => Err(self.closed_pipe_error()),
        }
    }

    fn send_within(&mut self, message: &Value, timeout: Duration) -> WriteResult {
        let result = self.writer.write(format!("{message}\n"), timeout);
        self.is_input_closed = !matches!(result, WriteResult::Written);
        result
    }

    /// Returns the time limit for a step that begins now.
    fn time_limit(&self) -> Duration {
        match self.since_stop_request {
            Some(since) => self
                .answer_timeout
                .min(STOP_TIMEOUT.saturating_sub(since.elapsed())),
            None => self.answer_timeout,
        }
    }

    /// Sends a question, unless one is pending, and reads the answer.
    fn ask(&mut self, mut question: Value) -> Result<TimeAdvance, WorldError> {
        if !self.has_open_question {
            self.send_beliefs()?;
            question["question"] = self.parser.next_question().into();
            self.send(&question)?;
            self.has_open_question = true;
        }
        self.read_answer()
    }

    /// Reads observations up to the message `time`.
    fn read_answer(&mut self) -> Result<TimeAdvance, WorldError> {
        let (clock, timeout) = (Clock::start(), self.time_limit());
        let mut observations = Vec::new();
        let mut said = 0;
        // The last invalid message.
        let mut invalid = None;
        loop {
            let left = timeout.saturating_sub(clock.elapsed());
            let line = match self.reader.read(left.min(POLL_INTERVAL)) {
                ReadResult::Line(line) => line,
                ReadResult::LineTooLong => return Err(endless_line()),
                ReadResult::AnswerTooLong => return Err(too_long(invalid.as_deref())),
                ReadResult::Timeout
                    if self.since_stop_request.is_none() && self.stop.is_requested() =>
                {
                    self.since_stop_request = Some(Clock::start());
                    let now = self.now.clone();
                    return Ok(TimeAdvance { now, observations });
                }
                ReadResult::Timeout if left > POLL_INTERVAL => continue,
                ReadResult::Timeout => {
                    return Err(WorldError::new(format!(
                        "it has not ended its answer with `time` within {} s; --answer-within sets the time limit{}",
                        timeout.as_secs_f64(),
                        invalid.unwrap_or_default()
                    )));
                }
                ReadResult::Closed => return Err(self.closed_pipe_error()),
            };
            said += line.len();
            if said > MAX_ANSWER {
                return Err(too_long(invalid.as_deref()));
            }
            let line = line.trim();
            if line.is_empty() {
                continue;
            }
            match self.parser.parse(line) {
                Ok(Message::Greeting | Message::Clock | Message::Unknown) => {}
                Ok(Message::Time(now)) => {
                    self.has_open_question = false;
                    self.now.clone_from(&now);
                    return Ok(TimeAdvance { now, observations });
                }
                Ok(Message::Observation(observation)) => observations.push(observation),
                Err(why) => {
                    let said = excerpt(line);
                    if self.limits.is_strict {
                        return Err(WorldError::new(format!("invalid message `{said}`: {why}")));
                    }
                    invalid = Some(format!("; invalid message `{said}`: {why}"));
                    observations.push(Observation {
                        time: self.now.clone(),
                        event: Event::Unintelligible { said, why },
                    });
                    if is_time(line) {
                        // The malformed message still ends the answer.
                        self.has_open_question = false;
                        let now = self.now.clone();
                        return Ok(TimeAdvance { now, observations });
                    }
                }
            }
        }
    }

    /// Returns the error for a program that has closed a pipe.
    fn closed_pipe_error(&mut self) -> WorldError {
        self.is_input_closed = true;
        let ending = wait_for_exit(&mut self.child, EXIT_TIMEOUT);
        // A program that exceeds a limit is no longer read, which ends most programs.
        loop {
            match self.reader.read(Duration::ZERO) {
                ReadResult::Line(_) => {}
                ReadResult::LineTooLong => return endless_line(),
                ReadResult::AnswerTooLong => return too_long(None),
                ReadResult::Timeout | ReadResult::Closed => break,
            }
        }
        let why = match ending {
            Some(status) => format!(
                "the program has ended ({status}) before the run was over; its standard error may contain the reason"
            ),
            None => "the program has closed its standard input or output before the run was over"
                .to_owned(),
        };
        WorldError::new(why)
    }
}

/// Checks that the program of a world exists, without starting it.
///
/// # Errors
/// When it does not exist, or may not be executed.
pub fn check_program(command: &str) -> Result<(), Error> {
    find_program(command).map_err(|why| cannot_start(command, &why))
}

fn cannot_start(command: &str, why: &str) -> Error {
    Error::new(
        format!("cannot start the world `{command}`: {why}"),
        "give a program and its arguments, separated by spaces; docs/reference/formats/world-protocol.md documents the protocol",
    )
}

fn endless_line() -> WorldError {
    WorldError::new(format!(
        "it wrote more than {} MB without a line feed; expected one message per line",
        MAX_LINE >> 20
    ))
}

/// `last` is the last invalid message of the answer.
fn too_long(last: Option<&str>) -> WorldError {
    WorldError::new(format!(
        "it wrote more than {} MB without ending its answer with `time`{}",
        MAX_ANSWER >> 20,
        last.unwrap_or_default()
    ))
}

impl World for ProcessWorld {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        match command {
            Command::Start { ticket, .. } => self.parser.note_start(ticket.0),
            // The action runs until it ends or times out.
            Command::Cancel { .. } if !self.parser.can(Capability::Cancel) => return Ok(()),
            Command::Cancel { .. } => {}
        }
        let mut message = wire::command(command);
        message["now"] = wire::number(now);
        self.send(&message)
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        let mut passage = self.ask(json!({ "type": "wait", "until": wire::number(until) }))?;
        // The program may use floating-point numbers.
        if passage.now.to_f64().total_cmp(&until.to_f64()).is_eq() {
            passage.now.clone_from(until);
        }
        Ok(passage)
    }

    fn look(
        &mut self,
        facts: &[FactId],
        fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        if !self.parser.can(Capability::Look) {
            return Ok(Vec::new());
        }
        let facts = facts.iter().map(|fact| self.task.fact_name(*fact));
        let fluents = fluents.iter().map(|fluent| self.task.fluent_name(*fluent));
        let message = json!({
            "type": "look",
            "facts": facts.collect::<Vec<_>>(),
            "fluents": fluents.collect::<Vec<_>>(),
        });
        Ok(self.ask(message)?.observations)
    }
}
