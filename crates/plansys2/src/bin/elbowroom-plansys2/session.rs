//! One run: waits for the performers, then connects Elbowroom with them until it says stop.

use std::io::{self, Write as _};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

use elbowroom_plansys2::{Command, Effect, Hub, PerformerDiscovery, World};
use serde_json::Value;

use super::clock::now;
use super::expert::{Expert, ExpertMessage};
use super::options::Settings;
use super::topics::Topics;
use super::{Input, warn};

/// Interval at which the hub checks for lost performers.
const TICK: Duration = Duration::from_millis(200);
/// Time for the delivery of cancel messages before the program ends.
const SHUTDOWN_TIMEOUT: Duration = Duration::from_millis(300);
/// Time limit for writing the last changes to the problem expert. Elbowroom waits at most a second.
const FLUSH_TIMEOUT: Duration = Duration::from_millis(600);

pub(super) struct Session {
    topics: Topics,
    expert: Option<Expert>,
    inputs: Receiver<Input>,
    hub: Hub,
    world: World,
    census: PerformerDiscovery,
    /// Reason to end, if another executor uses the performers.
    refusal: Option<String>,
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
            world = world.with_beliefs();
        }
        Self {
            topics,
            expert,
            inputs,
            hub: Hub::new("elbowroom"),
            world,
            census: PerformerDiscovery::new(settings.needs.clone(), settings.within),
            refusal: None,
            zero: now(),
        }
    }

    /// Runs until Elbowroom says stop or closes the connection.
    ///
    /// # Errors
    /// A performer is missing, or another executor uses the performers; the text names it.
    pub(super) fn run(mut self) -> Result<(), String> {
        let said = self.wait_for_performers()?;
        warn(&format!("performers: {}", self.hub.listed(self.now())));
        self.topics.hold_claim(self.now());
        if !said.into_iter().any(|input| self.handle_input(input)) {
            self.run_loop();
        }
        let refusal = self.refusal.take();
        self.shut_down();
        refusal.map_or(Ok(()), Err)
    }

    fn run_loop(&mut self) {
        loop {
            self.settle();
            let left = self.world.due_in(self.now());
            match self
                .inputs
                .recv_timeout(left.map_or(TICK, |it| it.min(TICK)))
            {
                Ok(input) => {
                    if self.handle_input(input) {
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
                Ok(Input::Claim(text)) => self.topics.check_claim(&text, self.now())?,
                Ok(Input::Warning(text)) => warn(&text),
                Ok(Input::Closed) => {
                    said.push(Input::Closed);
                    break;
                }
                Ok(Input::Expert(heard)) => self.handle_expert_message(heard),
                Ok(Input::Line(line)) => {
                    if let Some(actions) = actions_of(&line) {
                        self.census.set_domain_actions(actions);
                    }
                    said.push(Input::Line(line));
                }
                // The other inputs belong to `serve`.
                Ok(_) | Err(_) => {}
            }
            self.settle();
        }
        let unattended = self.census.actions_without_performer(&self.hub, self.now());
        if !unattended.is_empty() {
            warn(&format!(
                "no performer of {} was discovered: these actions will fail",
                unattended.join(", ")
            ));
        }
        Ok(said)
    }

    /// Handles an input. Returns `true` if the run is over.
    fn handle_input(&mut self, input: Input) -> bool {
        let now = self.now();
        match input {
            Input::Line(line) => {
                let mut said = Vec::new();
                let command = self.world.handle_line(&line, now, &mut said);
                print_lines(&said);
                match command {
                    Ok(Some(Command::Begin(action))) => self.hub.begin(action, now),
                    Ok(Some(Command::Cancel(ticket))) => self.hub.cancel(ticket),
                    Ok(Some(Command::Believe { facts, values })) => {
                        if let Some(expert) = &mut self.expert {
                            expert.set_beliefs(&facts, &values);
                        }
                    }
                    Ok(Some(Command::Stop)) => return true,
                    Ok(None) => {}
                    Err(error) => warn(&format!("cannot parse: {line}: {error}")),
                }
            }
            Input::Closed => return true,
            Input::Hub(message) => self.hub.message(&message, now),
            Input::Status(status) => self.hub.status(&status, now),
            Input::Expert(heard) => self.handle_expert_message(heard),
            Input::Claim(text) => {
                self.refusal = self.topics.check_claim(&text, now).err();
                return self.refusal.is_some();
            }
            Input::Warning(text) => warn(&text),
            // The other inputs belong to `serve`.
            _ => {}
        }
        false
    }

    fn handle_expert_message(&mut self, heard: ExpertMessage) {
        if let Some(expert) = &mut self.expert {
            expert.handle(heard);
        }
    }

    /// Applies the effects of the hub, and answers if an answer is due.
    fn settle(&mut self) {
        let now = self.now();
        self.topics.publish_claim(now);
        for effect in self.hub.effects() {
            match effect {
                Effect::Send(message) => {
                    if let Err(why) = self.topics.send(message) {
                        warn(&why);
                    }
                }
                Effect::Report(ticket, told) => self.world.report(ticket, &told, now),
                Effect::Remark(text) => warn(&text),
            }
        }
        for seen in self.expert.iter_mut().flat_map(|it| it.settle(now)) {
            self.world.report_change(&seen, now);
        }
        print_lines(&self.world.answer(now));
    }

    /// Cancels running actions, after the end of the run or the loss of Elbowroom.
    fn shut_down(mut self) {
        self.topics.release_claim();
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
            && self.now().saturating_sub(left) < FLUSH_TIMEOUT
        {
            if let Ok(Input::Expert(heard)) = self.inputs.recv_timeout(SHUTDOWN_TIMEOUT) {
                self.handle_expert_message(heard);
            }
            self.settle();
        }
        thread::sleep(SHUTDOWN_TIMEOUT);
    }

    fn now(&self) -> Duration {
        now().saturating_duration_since(self.zero)
    }
}

/// Writes lines to Elbowroom. Errors are ignored, because the end of the input reports a closed
/// connection.
fn print_lines(lines: &[String]) {
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
