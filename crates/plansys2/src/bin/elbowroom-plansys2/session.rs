//! One run: waits for the performers, then connects the two conversations until Elbowroom says stop.

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

/// How often the hub looks whether somebody is lost.
const TICK: Duration = Duration::from_millis(200);
/// What was told to stop is to hear of it before this program ends.
const FAREWELL: Duration = Duration::from_millis(300);
/// The problem expert may take so long to take in what was changed last. Elbowroom waits no longer than a second.
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
            // The text of the problem is not known here: words are spelled as the problem expert has them.
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

    /// Until Elbowroom says stop or is gone.
    ///
    /// # Errors
    /// A performer is missing; it is named.
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

    /// What is asked for before nodes have found each other is lost, so that time begins when they are there.
    /// What Elbowroom has said meanwhile comes back.
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
                // Nobody serves here.
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

    /// Takes what has come; `true` when the run is over.
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
            // Nobody serves here.
            _ => {}
        }
        false
    }

    fn hear(&mut self, heard: Heard) {
        if let Some(expert) = &mut self.expert {
            expert.hear(heard);
        }
    }

    /// Does what the hub has decided, and answers if that is due.
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

    /// The run is over, or Elbowroom is gone: what runs is to stop.
    fn leave(mut self) {
        for ticket in self.world.running() {
            self.hub.cancel(ticket);
        }
        self.settle();
        if let Some(expert) = &mut self.expert {
            expert.end();
        }
        // What the run has changed last is to be told.
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

/// Says it to Elbowroom. That nobody listens any more is said by the end of the input, too.
fn say(lines: &[String]) {
    let mut out = io::stdout().lock();
    for line in lines {
        let _ = writeln!(out, "{line}");
    }
    let _ = out.flush();
}

/// The actions of the domain, if this is the greeting that has them.
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
