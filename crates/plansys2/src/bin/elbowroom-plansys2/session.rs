//! One run: waits for the performers, then connects Elbowroom with them until it says stop.

use std::io::{self, Write as _};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

use elbowroom_plansys2::{Census, Command, Effect, Hub, World};
use serde_json::Value;

use super::expert::{Expert, Heard};
use super::options::Settings;
use super::topics::Topics;
use super::{Input, remark};

/// Interval at which the hub checks for lost performers.
const TICK: Duration = Duration::from_millis(200);
/// Time for the delivery of cancel messages before the program ends.
const FAREWELL: Duration = Duration::from_millis(300);
/// Time limit for writing the last changes to the problem expert. Elbowroom waits at most a second.
const TOLD_WITHIN: Duration = Duration::from_millis(600);

pub(super) struct Session {
    topics: Topics,
    expert: Option<Expert>,
    inputs: Receiver<Input>,
    hub: Hub,
    world: World,
    census: Census,
    zero: Instant,
}

impl Session {
    pub(super) fn new(
        settings: &Settings,
        topics: Topics,
        mut expert: Option<Expert>,
        inputs: Receiver<Input>,
    ) -> Self {
        let mut world = World::new("plansys2", settings.speed);
        if let Some(expert) = &mut expert {
            // The text of the problem is unknown here, so the spelling of the problem expert is
            // used.
            expert.begin("");
            world = world.following();
        }
        Self {
            topics,
            expert,
            inputs,
            hub: Hub::new("elbowroom"),
            world,
            census: Census::new(settings.needs.clone(), settings.within),
            zero: now(),
        }
    }

    /// Runs until Elbowroom says stop or closes the connection.
    ///
    /// # Errors
    /// A performer is missing; the text names it.
    pub(super) fn run(mut self) -> Result<(), String> {
        let said = self.wait_for_performers()?;
        remark(&format!("performers: {}", self.hub.listed(self.now())));
        if !said.into_iter().any(|input| self.take(input)) {
            self.converse();
        }
        self.leave();
        Ok(())
    }

    fn converse(&mut self) {
        loop {
            self.settle();
            let left = self.world.due_in(self.now());
            match self
                .inputs
                .recv_timeout(left.map_or(TICK, |it| it.min(TICK)))
            {
                Ok(input) => {
                    if self.take(input) {
                        return;
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            self.hub.tick(self.now());
        }
    }

    /// Waits for the performers before time begins, because requests sent before discovery are
    /// lost. Returns the lines that Elbowroom has sent meanwhile.
    fn wait_for_performers(&mut self) -> Result<Vec<Input>, String> {
        let mut said = Vec::new();
        while !self.census.is_over(&self.hub, self.now())? {
            match self.inputs.recv_timeout(TICK) {
                Ok(Input::Status(status)) => self.hub.status(&status, self.now()),
                Ok(Input::Hub(message)) => self.hub.message(&message, self.now()),
                Ok(Input::Trouble(text)) => remark(&text),
                Ok(Input::Closed) => {
                    said.push(Input::Closed);
                    break;
                }
                Ok(Input::Expert(heard)) => self.hear(heard),
                Ok(Input::Line(line)) => {
                    if let Some(actions) = actions_of(&line) {
                        self.census.know(actions);
                    }
                    said.push(Input::Line(line));
                }
                // The other inputs belong to `serve`.
                Ok(_) | Err(_) => {}
            }
            self.settle();
        }
        let unattended = self.census.unattended(&self.hub, self.now());
        if !unattended.is_empty() {
            remark(&format!(
                "no performer of {} was heard: what a plan starts of it will fail",
                unattended.join(", ")
            ));
        }
        Ok(said)
    }

    /// Handles an input. Returns `true` if the run is over.
    fn take(&mut self, input: Input) -> bool {
        let now = self.now();
        match input {
            Input::Line(line) => {
                let mut said = Vec::new();
                let command = self.world.hear(&line, now, &mut said);
                say(&said);
                match command {
                    Ok(Some(Command::Begin(action))) => self.hub.begin(action, now),
                    Ok(Some(Command::Cancel(ticket))) => self.hub.cancel(ticket),
                    Ok(Some(Command::Believe { facts, values })) => {
                        if let Some(expert) = &mut self.expert {
                            expert.believe(&facts, &values);
                        }
                    }
                    Ok(Some(Command::Stop)) => return true,
                    Ok(None) => {}
                    Err(error) => remark(&format!("not understood: {line}: {error}")),
                }
            }
            Input::Closed => return true,
            Input::Hub(message) => self.hub.message(&message, now),
            Input::Status(status) => self.hub.status(&status, now),
            Input::Expert(heard) => self.hear(heard),
            Input::Trouble(text) => remark(&text),
            // The other inputs belong to `serve`.
            _ => {}
        }
        false
    }

    fn hear(&mut self, heard: Heard) {
        if let Some(expert) = &mut self.expert {
            expert.hear(heard);
        }
    }

    /// Applies the effects of the hub, and answers if an answer is due.
    fn settle(&mut self) {
        let now = self.now();
        for effect in self.hub.effects() {
            match effect {
                Effect::Send(message) => {
                    if let Err(why) = self.topics.send(message) {
                        remark(&why);
                    }
                }
                Effect::Tell(ticket, told) => self.world.tell(ticket, &told, now),
                Effect::Remark(text) => remark(&text),
            }
        }
        for seen in self.expert.iter_mut().flat_map(|it| it.settle(now)) {
            self.world.see(&seen, now);
        }
        say(&self.world.answer(now));
    }

    /// Cancels running actions, after the end of the run or the loss of Elbowroom.
    fn leave(mut self) {
        for ticket in self.world.running() {
            self.hub.cancel(ticket);
        }
        self.settle();
        if let Some(expert) = &mut self.expert {
            expert.end();
        }
        // The last changes of the run are written to the problem expert.
        let left = self.now();
        while self.expert.as_ref().is_some_and(|it| !it.is_idle())
            && self.now().saturating_sub(left) < TOLD_WITHIN
        {
            if let Ok(Input::Expert(heard)) = self.inputs.recv_timeout(FAREWELL) {
                self.hear(heard);
            }
            self.settle();
        }
        thread::sleep(FAREWELL);
    }

    fn now(&self) -> Duration {
        now().saturating_duration_since(self.zero)
    }
}

#[allow(
    clippy::disallowed_methods,
    reason = "robots are on the wall clock; the conversations get it as an argument"
)]
pub(super) fn now() -> Instant {
    Instant::now()
}

/// Writes lines to Elbowroom. Errors are ignored, because the end of the input reports a closed
/// connection.
fn say(lines: &[String]) {
    let mut out = io::stdout().lock();
    for line in lines {
        let _ = writeln!(out, "{line}");
    }
    let _ = out.flush();
}

/// Returns the actions of the domain if the line is the greeting that lists them.
fn actions_of(line: &str) -> Option<Vec<String>> {
    let message: Value = serde_json::from_str(line).ok()?;
    let actions = message
        .get("actions")
        .filter(|_| message["type"] == "hello")?;
    let names = actions.as_array()?.iter();
    Some(
        names
            .filter_map(|it| Some(it.as_str()?.to_lowercase()))
            .collect(),
    )
}
