//! Protocol client for the world under test: sends messages and records violations.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Child;
use std::sync::Arc;
use std::time::Duration;

use elbowroom::execution::{Ending, Event, Observation};
use elbowroom::model::Task;
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;
use elbowroom::report::wire;
use serde_json::{Value, json};

use super::table::{Check, Findings};
use elbowroom_executive::clock::Clock;
use elbowroom_executive::messages::excerpt;
use elbowroom_executive::world_protocol::{
    Capability, Greeting, LONGEST_ANSWER, LineReader, LineWriter, Message, MessageParser,
    ReadResult, WriteResult, belief_message, hello, wait_for_exit,
};

/// Maximum time from `stop` to the exit of the world.
const FAREWELL: Duration = Duration::from_secs(1);

/// Error: the conversation with the world cannot continue.
pub(super) struct Gone;

/// A world that is being checked.
pub(super) struct Player {
    child: Child,
    writer: LineWriter,
    reader: LineReader,
    parser: MessageParser,
    patience: Duration,
    pub(super) findings: Findings,
    /// Time of the world, according to its last answer.
    pub(super) now: Rational,
    actions: BTreeMap<u64, Begun>,
    /// Starts that the world does not know, according to its reports.
    unknown: BTreeSet<u64>,
    /// `true` during the request for events from before the restart. Reports then refer to that
    /// time.
    recalls: bool,
}

/// State that outlives a killed world.
pub(super) struct Rest {
    pub(super) findings: Findings,
    /// The last time of the killed world.
    pub(super) now: Rational,
    patience: Duration,
}

/// State of a started action.
#[derive(Clone, Debug, Default)]
struct Begun {
    name: String,
    is_instantaneous: bool,
    started: Option<Rational>,
    ending: Option<Ending>,
}

impl Player {
    /// Greets a program that has just been started.
    pub(super) fn new(
        program: (Child, LineWriter, LineReader),
        task: &Arc<Task>,
        patience: Duration,
    ) -> Result<Self, (Gone, Findings)> {
        let nothing = Rest {
            findings: Findings::default(),
            now: Rational::ZERO,
            patience,
        };
        Self::greeted(program, task, nothing, &hello(task))
    }

    /// Greets a restarted program. `open` lists the starts from before the restart: ticket, action,
    /// and `true` if the start was reported.
    pub(super) fn resumed(
        program: (Child, LineWriter, LineReader),
        task: &Arc<Task>,
        rest: Rest,
        open: &[(u64, &str, bool)],
    ) -> Result<Self, (Gone, Findings)> {
        let mut hello = hello(task);
        let starts = open.iter().map(|(ticket, action, started)| {
            json!({ "ticket": ticket, "action": action, "started": started })
        });
        let starts: Vec<Value> = starts.collect();
        hello["resumed"] = json!({ "now": wire::number(&rest.now), "open": starts });
        let mut player = Self::greeted(program, task, rest, &hello)?;
        for (ticket, action, _) in open {
            player.note_start(*ticket, action, false);
        }
        Ok(player)
    }

    fn greeted(
        (child, writer, reader): (Child, LineWriter, LineReader),
        task: &Arc<Task>,
        rest: Rest,
        hello: &Value,
    ) -> Result<Self, (Gone, Findings)> {
        let mut player = Self {
            child,
            writer,
            reader,
            parser: MessageParser::new(task),
            patience: rest.patience,
            findings: rest.findings,
            now: rest.now,
            actions: BTreeMap::new(),
            unknown: BTreeSet::new(),
            recalls: false,
        };
        match player.tell(hello) {
            Ok(()) => Ok(player),
            Err(gone) => {
                let _ = player.child.kill();
                let _ = player.child.wait();
                Err((gone, player.findings))
            }
        }
    }

    /// Returns the program's greeting, if it has sent one.
    pub(super) fn greeting(&self) -> Option<&Greeting> {
        self.parser.greeting()
    }

    /// Returns `true` if the greeting claims this capability.
    pub(super) fn can(&self, ability: Capability) -> bool {
        self.parser.greeting().is_some() && self.parser.can(ability)
    }

    /// Returns `true` if actions may be cancelled. This is assumed of programs without a greeting.
    pub(super) fn can_cancel(&self) -> bool {
        self.parser.can(Capability::Cancel)
    }

    /// Marks the checks of capabilities that the program does not claim as skipped.
    pub(super) fn note_what_it_cannot(&mut self) {
        for (check, can) in [
            (Check::Cancels, self.can_cancel()),
            (Check::HearsBeliefs, self.can(Capability::Beliefs)),
            (Check::Resumes, self.can(Capability::Resume)),
        ] {
            if !can {
                self.findings.leave_out(check);
            }
        }
    }

    /// Returns the reported start time of the action.
    pub(super) fn started(&self, ticket: u64) -> Option<&Rational> {
        self.actions.get(&ticket)?.started.as_ref()
    }

    /// Returns the name of the action with this ticket.
    pub(super) fn name_of(&self, ticket: u64) -> &str {
        self.actions.get(&ticket).map_or("", |it| &it.name)
    }

    /// Returns `true` if the world has reported that it does not know this start.
    pub(super) fn is_unknown(&self, ticket: u64) -> bool {
        self.unknown.contains(&ticket)
    }

    /// Returns `true` if the action has started and not ended.
    pub(super) fn is_running(&self, ticket: u64) -> bool {
        let action = self.actions.get(&ticket);
        action.is_some_and(|it| it.started.is_some() && it.ending.is_none())
    }

    /// Returns `true` if the action has ended or was refused.
    pub(super) fn has_ended(&self, ticket: u64) -> bool {
        let action = self.actions.get(&ticket);
        action.is_some_and(|it| it.ending.is_some())
    }

    /// Returns the reported reason if the action has failed.
    pub(super) fn failure(&self, ticket: u64) -> Option<&str> {
        match &self.actions.get(&ticket)?.ending {
            Some(Ending::Failed { why }) => Some(why),
            _ => None,
        }
    }

    /// Returns `true` if the start or an end (also a refusal) was reported.
    pub(super) fn has_begun(&self, ticket: u64) -> bool {
        let action = self.actions.get(&ticket);
        action.is_some_and(|it| it.started.is_some() || it.ending.is_some())
    }

    pub(super) fn start(
        &mut self,
        ticket: u64,
        name: &str,
        duration: Option<&Rational>,
    ) -> Result<(), Gone> {
        self.note_start(ticket, name, duration.is_none());
        self.tell(&json!({
            "type": "start", "ticket": ticket, "action": name,
            "duration": duration.map(wire::number), "now": wire::number(&self.now),
        }))
    }

    fn note_start(&mut self, ticket: u64, name: &str, is_instantaneous: bool) {
        self.parser.note_start(ticket);
        let action = Begun {
            name: name.to_owned(),
            is_instantaneous,
            ..Begun::default()
        };
        self.actions.insert(ticket, action);
    }

    /// Records that this action has started.
    pub(super) fn note_begun(&mut self, ticket: u64) {
        if let Some(action) = self.actions.get_mut(&ticket) {
            action.started = Some(Rational::ZERO);
        }
    }

    /// Sends beliefs: `facts` are true, and the fluents have these values.
    pub(super) fn believe<'a>(
        &mut self,
        task: &Task,
        facts: impl Iterator<Item = FactId>,
        values: impl Iterator<Item = (FluentId, Option<&'a Rational>)>,
    ) -> Result<(), Gone> {
        let facts = facts.map(|fact| (fact, true));
        let message = belief_message(task, &self.now, facts, values);
        self.tell(&message)
    }

    pub(super) fn cancel(&mut self, ticket: u64) -> Result<(), Gone> {
        self.tell(&json!({ "type": "cancel", "ticket": ticket, "now": wire::number(&self.now) }))
    }

    /// Sends a message of an unknown type.
    pub(super) fn mumble(&mut self) -> Result<(), Gone> {
        self.tell(&json!({ "type": "from-a-later-version", "now": wire::number(&self.now) }))
    }

    pub(super) fn look(&mut self) -> Result<(), Gone> {
        let number = self.parser.next_question();
        let question = json!({ "type": "look", "facts": [], "fluents": [], "question": number });
        self.ask(&question, None)
    }

    /// Requests the outcomes of these starts.
    pub(super) fn recall(&mut self, tickets: &[u64]) -> Result<(), Gone> {
        let number = self.parser.next_question();
        let question = json!({
            "type": "look", "facts": [], "fluents": [], "tickets": tickets, "question": number,
        });
        self.recalls = true;
        let answered = self.ask(&question, None);
        self.recalls = false;
        answered
    }

    /// Lets time pass until `until`, or until something is observed.
    pub(super) fn wait(&mut self, until: &Rational) -> Result<(), Gone> {
        let number = self.parser.next_question();
        let question = json!({ "type": "wait", "until": wire::number(until), "question": number });
        self.ask(&question, Some(until))
    }

    fn tell(&mut self, message: &Value) -> Result<(), Gone> {
        match self.writer.write(format!("{message}\n"), self.patience) {
            WriteResult::Written => Ok(()),
            WriteResult::Timeout => {
                let what = message["type"].as_str().unwrap_or_default();
                let why = format!("it has not read `{what}` within {} s", self.seconds());
                self.findings.wrong(Check::Answers, why);
                Err(Gone)
            }
            WriteResult::Closed => Err(self.dead()),
        }
    }

    fn seconds(&self) -> f64 {
        self.patience.as_secs_f64()
    }

    fn dead(&mut self) -> Gone {
        let why = match wait_for_exit(&mut self.child, FAREWELL) {
            Some(status) => format!("it has ended by itself ({status})"),
            None => "it has closed its standard input or output".to_owned(),
        };
        self.findings.wrong(Check::Lives, why);
        Gone
    }

    fn ask(&mut self, question: &Value, until: Option<&Rational>) -> Result<(), Gone> {
        self.tell(question)?;
        self.findings.look_at(Check::Answers);
        let what = question["type"].as_str().unwrap_or_default().to_owned();
        let before = self.now.clone();
        let (clock, mut said, mut observations) = (Clock::start(), 0, Vec::new());
        loop {
            let left = self.patience.saturating_sub(clock.elapsed());
            let line = match self.reader.read(left) {
                ReadResult::Line(line) => line,
                ReadResult::EndlessLine => {
                    let why = "a line has more than a megabyte; one message a line";
                    self.findings.wrong(Check::Speaks, why);
                    return Err(Gone);
                }
                ReadResult::TooMuch => {
                    let why = "it says more than 16 MB without being asked";
                    self.findings.wrong(Check::Answers, why);
                    return Err(Gone);
                }
                ReadResult::Timeout => {
                    let why = format!("no `time` within {} s after `{what}`", self.seconds());
                    self.findings.wrong(Check::Answers, why);
                    return Err(Gone);
                }
                ReadResult::Closed => return Err(self.dead()),
            };
            said += line.len();
            if said > LONGEST_ANSWER {
                let why = format!("more than 16 MB in answer to `{what}`");
                self.findings.wrong(Check::Answers, why);
                return Err(Gone);
            }
            let line = line.trim();
            if line.is_empty() {
                continue;
            }
            match self.parser.parse(line) {
                Ok(Message::Greeting | Message::Clock) => {}
                Ok(Message::Unknown) => self.unknown.extend(ticket_of(line)),
                Ok(Message::Observation(observation)) => observations.push(observation),
                Ok(Message::Time(now)) => {
                    self.findings.look_at(Check::Speaks);
                    self.note_time(now, until, observations.is_empty());
                    self.take(&observations, &before);
                    return Ok(());
                }
                Err(why) => self.misunderstood(line, &why),
            }
        }
    }

    fn misunderstood(&mut self, line: &str, why: &str) {
        let check = if why.contains("was never given") {
            Check::KnowsItsTickets
        } else if why.contains("answers question") {
            Check::Answers
        } else {
            Check::Speaks
        };
        self.findings
            .wrong(check, format!("{}: {why}", excerpt(line)));
    }

    fn note_time(&mut self, now: Rational, until: Option<&Rational>, is_silent: bool) {
        self.findings.look_at(Check::KeepsTime);
        let (was, is) = (self.now.to_f64(), now.to_f64());
        if now < self.now {
            let why = format!("after {was} came {is}");
            self.findings.wrong(Check::KeepsTime, why);
            return;
        }
        if let Some(until) = until {
            let allowed = until.clone().max(self.now.clone());
            // A real clock may be slightly late when nothing happens.
            let late = &now - &allowed;
            if is_silent && late > Rational::from(5) {
                let why = format!(
                    "asked to wait until {}, it waited until {is}",
                    until.to_f64()
                );
                self.findings.wrong(Check::KeepsTime, why);
            }
        }
        self.now = now;
    }

    /// Checks and records the reports of an answer. `before` is the time of the previous answer.
    fn take(&mut self, observations: &[Observation], before: &Rational) {
        for Observation { time, event } in observations {
            let (Event::Started { ticket, .. }
            | Event::Ended { ticket, .. }
            | Event::Feedback { ticket, .. }) = event
            else {
                continue;
            };
            self.findings.look_at(Check::KnowsItsTickets);
            let Some(action) = self.actions.get_mut(&ticket.0) else {
                continue;
            };
            let name = excerpt(&action.name);
            let mut wrong = |check, why| self.findings.wrong(check, why);
            let (is, now) = (time.to_f64(), self.now.to_f64());
            let is_old = *time < before - &Rational::ONE;
            if *time > self.now {
                let why = format!("{name}: a report of {is} came at {now}, before its time");
                wrong(Check::ReportsInTime, why);
            } else if is_old && !self.recalls {
                let why = format!("{name}: a report of {is} came at {now}");
                wrong(Check::ReportsInTime, why);
            }
            match event {
                Event::Started { .. } if action.ending.is_some() => {
                    let why = format!("{name}: `started` came after `ended`");
                    wrong(Check::StartsBeforeItEnds, why);
                }
                Event::Started { .. } if action.started.is_some() => {
                    wrong(Check::EndsOnce, format!("{name} started twice"));
                }
                Event::Started { .. } => {
                    action.started = Some(time.clone());
                    if action.is_instantaneous {
                        action.ending = Some(Ending::Succeeded);
                    }
                }
                Event::Ended { ending, .. } => {
                    if action.ending.is_some() {
                        wrong(Check::EndsOnce, format!("{name} ended twice"));
                        continue;
                    }
                    match &action.started {
                        None if *ending == Ending::Succeeded => wrong(
                            Check::StartsBeforeItEnds,
                            format!("{name} succeeded, but never started"),
                        ),
                        Some(start) if start > time => wrong(
                            Check::StartsBeforeItEnds,
                            format!("{name} started at {} and ended at {is}", start.to_f64()),
                        ),
                        _ => {}
                    }
                    action.ending = Some(ending.clone());
                }
                _ => {}
            }
        }
        for check in [Check::ReportsInTime, Check::StartsBeforeItEnds] {
            if !observations.is_empty() {
                self.findings.look_at(check);
            }
        }
    }

    /// Requests the program to stop, and checks that it does.
    pub(super) fn stop(mut self) -> Findings {
        self.findings.look_at(Check::Stops);
        let told = self
            .writer
            .write("{\"type\":\"stop\"}\n".to_owned(), FAREWELL);
        drop(self.writer);
        let ended = wait_for_exit(&mut self.child, FAREWELL).is_some();
        if !ended {
            let _ = self.child.kill();
            let _ = self.child.wait();
            let why = "it was still there a second later, and was killed";
            self.findings.wrong(Check::Stops, why);
        } else if matches!(told, WriteResult::Written) {
            self.findings.look_at(Check::Lives);
        }
        self.findings
    }

    /// Kills the program, like a crash.
    pub(super) fn killed(mut self) -> Rest {
        let _ = self.child.kill();
        let _ = self.child.wait();
        Rest {
            findings: self.findings,
            now: self.now,
            patience: self.patience,
        }
    }

    /// Kills the program after a failed conversation.
    pub(super) fn abandon(mut self) -> Findings {
        let _ = self.child.kill();
        let _ = self.child.wait();
        self.findings
    }
}

/// Returns the ticket in a message.
fn ticket_of(line: &str) -> Option<u64> {
    let message: Value = serde_json::from_str(line).ok()?;
    message["ticket"].as_u64()
}
