//! A world that is a process: `docs/formats/world-protocol.md`.

use std::process::Child;
use std::sync::Arc;
use std::time::Duration;

use elbowroom::execution::{Command, Event, Observation, Passage, World, WorldError};
use elbowroom::model::Task;
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;
use elbowroom::report::wire;
use serde_json::{Value, json};

use super::believed::Believed;
use crate::clock::Clock;
use crate::conversation::{
    Ability, Ears, Heard, LONGEST_ANSWER, LONGEST_LINE, Listener, Mouth, Said, Told, ended, find,
    hello, is_time, launch,
};
use crate::exit::Failure;
use crate::interrupt::Interrupt;
use crate::words::excerpt;

/// The time that a program has to end when the run is over.
const FAREWELL: Duration = Duration::from_secs(1);

/// How long a program has, when the user has asked to end, to obey before it is told to stop.
const OBEDIENCE: Duration = Duration::from_secs(5);

/// How often it is looked whether the user has asked to end.
const GLANCE: Duration = Duration::from_millis(50);

/// Limits on the behaviour of the program.
pub(super) struct Manners {
    /// How long it may take over one answer, in seconds.
    pub(super) patience: Rational,
    /// Whether what cannot be understood ends the run.
    pub(super) is_strict: bool,
}

/// A child process that is told what to start, and reports what happens.
///
/// When the user asks to end, a wait ends at once, though its answer is still to come; it is then
/// the answer to the next wait.
pub(super) struct ProcessWorld {
    child: Child,
    mouth: Mouth,
    ears: Ears,
    patience: Duration,
    manners: Manners,
    interrupt: Interrupt,
    /// When a wait was ended because the user has asked to end.
    hurried: Option<Clock>,
    /// Whether a question was asked that has not been answered.
    is_asked: bool,
    /// The last time it said it is.
    now: Rational,
    /// There is no use in telling it anything more.
    is_deaf: bool,
    task: Arc<Task>,
    listener: Listener,
    /// What it is told of what the run believes, if it wants to hear of it.
    believed: Option<Believed>,
}

impl ProcessWorld {
    /// Starts the program, with the words of `command` as its arguments.
    pub(super) fn start(
        command: &str,
        task: &Arc<Task>,
        manners: Manners,
        interrupt: Interrupt,
    ) -> Result<Self, Failure> {
        Self::greeted(command, task, manners, interrupt, &hello(task))
    }

    /// The same for a run that was cut off: the program is told what is known of what was under
    /// way, and that the tickets below `given` were given.
    pub(super) fn resume(
        command: &str,
        task: &Arc<Task>,
        manners: Manners,
        interrupt: Interrupt,
        (resumed, given): (&Value, u64),
    ) -> Result<Self, Failure> {
        let mut hello = hello(task);
        hello["resumed"] = resumed.clone();
        let mut world = Self::greeted(command, task, manners, interrupt, &hello)?;
        if let Some(last) = given.checked_sub(1) {
            world.listener.note_start(last);
        }
        Ok(world)
    }

    /// Asks what became of these starts, and whether the program is one that remembers.
    pub(super) fn recall(&mut self, tickets: &[u64]) -> Result<(Passage, bool), WorldError> {
        let question = json!({ "type": "look", "facts": [], "fluents": [], "tickets": tickets });
        let passage = self.ask(question)?;
        let knows = self.listener.greeting().is_some() && self.listener.can(Ability::Resume);
        Ok((passage, knows))
    }

    fn greeted(
        command: &str,
        task: &Arc<Task>,
        manners: Manners,
        interrupt: Interrupt,
        hello: &Value,
    ) -> Result<Self, Failure> {
        let cannot = |why: String| cannot_start(command, &why);
        let (child, mouth, ears) = launch(command).map_err(cannot)?;
        let mut world = Self {
            child,
            mouth,
            ears,
            patience: Duration::try_from_secs_f64(manners.patience.to_f64())
                .unwrap_or(Duration::MAX),
            manners,
            interrupt,
            hurried: None,
            is_asked: false,
            now: Rational::ZERO,
            is_deaf: false,
            task: Arc::clone(task),
            listener: Listener::new(task),
            believed: None,
        };
        match world.tell(hello) {
            Ok(()) => Ok(world),
            Err(error) => {
                world.stop();
                Err(cannot(error.message))
            }
        }
    }

    /// The same, which tells the program what is believed.
    pub(super) fn telling(self, believed: Believed) -> Self {
        let believed = Some(believed);
        Self { believed, ..self }
    }

    /// Tells the program what is believed, if it wants to hear of it, and nothing else is in its way.
    fn tell_beliefs(&mut self) -> Result<(), WorldError> {
        let (Some(believed), Some(is_wanted)) = (&self.believed, self.listener.wants_beliefs())
        else {
            return Ok(());
        };
        for message in believed.fetch(is_wanted, &self.task) {
            self.tell(&message)?;
        }
        Ok(())
    }

    /// Says good-bye, and ends the program if it does not end by itself.
    pub(super) fn stop(mut self) {
        if !self.is_deaf {
            let _ = self.tell_beliefs();
        }
        if !self.is_deaf {
            let _ = self.tell_within(&json!({ "type": "stop" }), FAREWELL);
        }
        // Closes its standard input.
        drop(self.mouth);
        if ended(&mut self.child, FAREWELL).is_none() {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }

    fn tell(&mut self, message: &Value) -> Result<(), WorldError> {
        match self.tell_within(message, self.left()) {
            Told::Yes => Ok(()),
            Told::NobodyReads => Err(WorldError::new(format!(
                "it has not read what it was told within {} s; --answer-within says how long to \
                 wait",
                self.patience.as_secs_f64()
            ))),
            Told::End => Err(self.gone()),
        }
    }

    fn tell_within(&mut self, message: &Value, patience: Duration) -> Told {
        let told = self.mouth.tell(format!("{message}\n"), patience);
        self.is_deaf = !matches!(told, Told::Yes);
        told
    }

    /// How long it may take over something that begins now.
    fn left(&self) -> Duration {
        match self.hurried {
            Some(since) => self.patience.min(OBEDIENCE.saturating_sub(since.elapsed())),
            None => self.patience,
        }
    }

    /// Asks a question, unless one is open already, and listens.
    fn ask(&mut self, mut question: Value) -> Result<Passage, WorldError> {
        if !self.is_asked {
            self.tell_beliefs()?;
            question["question"] = self.listener.next_question().into();
            self.tell(&question)?;
            self.is_asked = true;
        }
        self.hear()
    }

    /// Everything up to the message that says what time it is.
    fn hear(&mut self) -> Result<Passage, WorldError> {
        let (clock, patience) = (Clock::start(), self.left());
        let mut observations = Vec::new();
        let mut said = 0;
        // What it said last that could not be understood.
        let mut babble = None;
        loop {
            let left = patience.saturating_sub(clock.elapsed());
            let line = match self.ears.hear(left.min(GLANCE)) {
                Heard::Line(line) => line,
                Heard::EndlessLine => return Err(endless_line()),
                Heard::TooMuch => return Err(babbles(babble.as_deref())),
                Heard::Nothing if self.hurried.is_none() && self.interrupt.is_requested() => {
                    self.hurried = Some(Clock::start());
                    let now = self.now.clone();
                    return Ok(Passage { now, observations });
                }
                Heard::Nothing if left > GLANCE => continue,
                Heard::Nothing => {
                    return Err(WorldError::new(format!(
                        "it has not ended its answer with `time` within {} s; --answer-within \
                         says how long to wait{}",
                        patience.as_secs_f64(),
                        babble.unwrap_or_default()
                    )));
                }
                Heard::End => return Err(self.gone()),
            };
            said += line.len();
            if said > LONGEST_ANSWER {
                return Err(babbles(babble.as_deref()));
            }
            let line = line.trim();
            if line.is_empty() {
                continue;
            }
            match self.listener.read(line) {
                Ok(Said::Greeting | Said::Clock | Said::Unknown) => {}
                Ok(Said::Time(now)) => {
                    self.is_asked = false;
                    self.now.clone_from(&now);
                    return Ok(Passage { now, observations });
                }
                Ok(Said::Observation(observation)) => observations.push(observation),
                Err(why) => {
                    let said = excerpt(line);
                    if self.manners.is_strict {
                        return Err(WorldError::new(format!("it said `{said}`: {why}")));
                    }
                    babble = Some(format!("; it said `{said}`: {why}"));
                    observations.push(Observation {
                        time: self.now.clone(),
                        event: Event::Unintelligible { said, why },
                    });
                    if is_time(line) {
                        // It has ended its answer, whatever time it may be.
                        self.is_asked = false;
                        let now = self.now.clone();
                        return Ok(Passage { now, observations });
                    }
                }
            }
        }
    }

    /// The program no longer listens, or has closed its output.
    fn gone(&mut self) -> WorldError {
        self.is_deaf = true;
        let ending = ended(&mut self.child, FAREWELL);
        // Who says too much is no longer listened to, which ends most programs.
        loop {
            match self.ears.hear(Duration::ZERO) {
                Heard::Line(_) => {}
                Heard::EndlessLine => return endless_line(),
                Heard::TooMuch => return babbles(None),
                Heard::Nothing | Heard::End => break,
            }
        }
        let why = match ending {
            Some(status) => format!(
                "the program has ended ({status}) before the run was over; what it printed to \
                 standard error may say why"
            ),
            None => "the program has closed its standard input or output before the run was over"
                .to_owned(),
        };
        WorldError::new(why)
    }
}

/// Whether there is such a program.
///
/// # Errors
/// When it cannot be started because there is none.
pub(super) fn look_for(command: &str) -> Result<(), Failure> {
    find(command).map_err(|why| cannot_start(command, &why))
}

fn cannot_start(command: &str, why: &str) -> Failure {
    Failure::new(
        format!("cannot start the world `{command}`: {why}"),
        "give a program and its arguments, separated by spaces; \
         docs/formats/world-protocol.md says what it must do",
    )
}

fn endless_line() -> WorldError {
    WorldError::new(format!(
        "it said more than {} MB without a line feed; write one message a line",
        LONGEST_LINE >> 20
    ))
}

/// `last` is what could not be understood of that.
fn babbles(last: Option<&str>) -> WorldError {
    WorldError::new(format!(
        "it said more than {} MB without ending its answer with `time`{}",
        LONGEST_ANSWER >> 20,
        last.unwrap_or_default()
    ))
}

impl World for ProcessWorld {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        match command {
            Command::Start { ticket, .. } => self.listener.note_start(ticket.0),
            // It goes on until it ends by itself, or is given up.
            Command::Cancel { .. } if !self.listener.can(Ability::Cancel) => return Ok(()),
            Command::Cancel { .. } => {}
        }
        let mut message = wire::command(command);
        message["now"] = wire::number(now);
        self.tell(&message)
    }

    fn wait(&mut self, until: &Rational) -> Result<Passage, WorldError> {
        let mut passage = self.ask(json!({ "type": "wait", "until": wire::number(until) }))?;
        // Who counts in floats has come as far as a float can.
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
        if !self.listener.can(Ability::Look) {
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
