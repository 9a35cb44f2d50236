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
use crate::clock::Clock;
use crate::messages::excerpt;
use crate::world_protocol::{
    Capability, Greeting, LineReader, LineWriter, MAX_ANSWER, Message, MessageParser, ReadResult,
    WriteResult, belief_message, hello, wait_for_exit,
};

/// Maximum time from `stop` to the exit of the world.
const EXIT_TIMEOUT: Duration = Duration::from_secs(1);

/// Error: the conversation with the world cannot continue.
pub(super) struct WorldLost;

/// A world that is being checked.
pub(super) struct ProtocolDriver {
    child: Child,
    writer: LineWriter,
    reader: LineReader,
    parser: MessageParser,
    answer_timeout: Duration,
    pub(super) findings: Findings,
    /// Time of the world, according to its last answer.
    pub(super) now: Rational,
    actions: BTreeMap<u64, StartedAction>,
    /// Starts that the world does not know, according to its reports.
    unknown: BTreeSet<u64>,
    /// `true` during the request for events from before the restart. Reports then refer to that
    /// time.
    is_recalling: bool,
}

/// State that outlives a killed world.
pub(super) struct CheckState {
    pub(super) findings: Findings,
    /// The last time of the killed world.
    pub(super) now: Rational,
    answer_timeout: Duration,
}

/// State of a started action.
#[derive(Clone, Debug, Default)]
struct StartedAction {
    name: String,
    is_instantaneous: bool,
    started: Option<Rational>,
    ending: Option<Ending>,
}

impl ProtocolDriver {
    /// Greets a program that has just been started.
    pub(super) fn new(
        program: (Child, LineWriter, LineReader),
        task: &Arc<Task>,
        patience: Duration,
    ) -> Result<Self, (WorldLost, Findings)> {
        let nothing = CheckState {
            findings: Findings::default(),
            now: Rational::ZERO,
            answer_timeout: patience,
        };
        Self::complete_greeting(program, task, nothing, &hello(task))
    }

    /// Greets a restarted program. `open` lists the starts from before the restart: ticket, action,
    /// and `true` if the start was reported.
    pub(super) fn resumed(
        program: (Child, LineWriter, LineReader),
        task: &Arc<Task>,
        rest: CheckState,
        open: &[(u64, &str, bool)],
    ) -> Result<Self, (WorldLost, Findings)> {
        let mut hello = hello(task);
        let starts = open.iter().map(|(ticket, action, started)| {
            json!({ "ticket": ticket, "action": action, "started": started })
        });
        let starts: Vec<Value> = starts.collect();
        hello["resumed"] = json!({ "now": wire::number(&rest.now), "open": starts });
        let mut player = Self::complete_greeting(program, task, rest, &hello)?;
        for (ticket, action, _) in open {
            player.note_start(*ticket, action, false);
        }
        Ok(player)
    }

    fn complete_greeting(
        (child, writer, reader): (Child, LineWriter, LineReader),
        task: &Arc<Task>,
        rest: CheckState,
        hello: &Value,
    ) -> Result<Self, (WorldLost, Findings)> {
        let mut player = Self {
            child,
            writer,
            reader,
            parser: MessageParser::new(task),
            answer_timeout: rest.answer_timeout,
            findings: rest.findings,
            now: rest.now,
            actions: BTreeMap::new(),
            unknown: BTreeSet::new(),
            is_recalling: false,
        };
        match player.send(hello) {
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
    pub(super) fn skip_unclaimed_checks(&mut self) {
        for (check, can) in [
            (Check::Cancels, self.can_cancel()),
            (Check::AcceptsBeliefs, self.can(Capability::Beliefs)),
            (Check::Resumes, self.can(Capability::Resume)),
        ] {
            if !can {
                self.findings.mark_unclaimed(check);
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
    ) -> Result<(), WorldLost> {
        self.note_start(ticket, name, duration.is_none());
        self.send(&json!({
            "type": "start", "ticket": ticket, "action": name,
            "duration": duration.map(wire::number), "now": wire::number(&self.now),
        }))
    }

    fn note_start(&mut self, ticket: u64, name: &str, is_instantaneous: bool) {
        self.parser.note_start(ticket);
        let action = StartedAction {
            name: name.to_owned(),
            is_instantaneous,
            ..StartedAction::default()
        };
        self.actions.insert(ticket, action);
    }

    /// Records that this action has started.
    pub(super) fn record_begun(&mut self, ticket: u64) {
        if let Some(action) = self.actions.get_mut(&ticket) {
            action.started = Some(Rational::ZERO);
        }
    }

    /// Sends beliefs: `facts` are true, and the fluents have these values.
    pub(super) fn send_beliefs<'a>(
        &mut self,
        task: &Task,
        facts: impl Iterator<Item = FactId>,
        values: impl Iterator<Item = (FluentId, Option<&'a Rational>)>,
    ) -> Result<(), WorldLost> {
        let facts = facts.map(|fact| (fact, true));
        let message = belief_message(task, &self.now, facts, values);
        self.send(&message)
    }

    pub(super) fn cancel(&mut self, ticket: u64) -> Result<(), WorldLost> {
        self.send(&json!({ "type": "cancel", "ticket": ticket, "now": wire::number(&self.now) }))
    }

    /// Sends a message of an unknown type.
    pub(super) fn send_unknown_message(&mut self) -> Result<(), WorldLost> {
        self.send(&json!({ "type": "from-a-later-version", "now": wire::number(&self.now) }))
    }

    pub(super) fn poll(&mut self) -> Result<(), WorldLost> {
        let number = self.parser.next_question();
        let question = json!({ "type": "look", "facts": [], "fluents": [], "question": number });
        self.request(&question, None)
    }

    /// Requests the outcomes of these starts.
    pub(super) fn recall(&mut self, tickets: &[u64]) -> Result<(), WorldLost> {
        let number = self.parser.next_question();
        let question = json!({
            "type": "look", "facts": [], "fluents": [], "tickets": tickets, "question": number,
        });
        self.is_recalling = true;
        let answered = self.request(&question, None);
        self.is_recalling = false;
        answered
    }

    /// Lets time pass until `until`, or until something is observed.
    pub(super) fn wait(&mut self, until: &Rational) -> Result<(), WorldLost> {
        let number = self.parser.next_question();
        let question = json!({ "type": "wait", "until": wire::number(until), "question": number });
        self.request(&question, Some(until))
    }

    fn send(&mut self, message: &Value) -> Result<(), WorldLost> {
        match self
            .writer
            .write(format!("{message}\n"), self.answer_timeout)
        {
            WriteResult::Written => Ok(()),
            WriteResult::Timeout => {
                let what = message["type"].as_str().unwrap_or_default();
                let why = format!("it has not read `{what}` within {} s", self.seconds());
                self.findings.record_violation(Check::Answers, why);
                Err(WorldLost)
            }
            WriteResult::Closed => Err(self.report_death()),
        }
    }

    fn seconds(&self) -> f64 {
        self.answer_timeout.as_secs_f64()
    }

    fn report_death(&mut self) -> WorldLost {
        let why = match wait_for_exit(&mut self.child, EXIT_TIMEOUT) {
            Some(status) => format!("the process ended unexpectedly ({status})"),
            None => "it has closed its standard input or output".to_owned(),
        };
        self.findings.record_violation(Check::KeepsRunning, why);
        WorldLost
    }

    fn request(&mut self, question: &Value, until: Option<&Rational>) -> Result<(), WorldLost> {
        self.send(question)?;
        self.findings.mark_done(Check::Answers);
        let what = question["type"].as_str().unwrap_or_default().to_owned();
        let before = self.now.clone();
        let (clock, mut said, mut observations) = (Clock::start(), 0, Vec::new());
        loop {
            let left = self.answer_timeout.saturating_sub(clock.elapsed());
            let line = match self.reader.read(left) {
                ReadResult::Line(line) => line,
                ReadResult::LineTooLong => {
                    let why = "a line is longer than 1 MB; expected one message per line";
                    self.findings.record_violation(Check::SpeaksProtocol, why);
                    return Err(WorldLost);
                }
                ReadResult::AnswerTooLong => {
                    let why = "it sent more than 16 MB without a request";
                    self.findings.record_violation(Check::Answers, why);
                    return Err(WorldLost);
                }
                ReadResult::Timeout => {
                    let why = format!("no `time` within {} s after `{what}`", self.seconds());
                    self.findings.record_violation(Check::Answers, why);
                    return Err(WorldLost);
                }
                ReadResult::Closed => return Err(self.report_death()),
            };
            said += line.len();
            if said > MAX_ANSWER {
                let why = format!("more than 16 MB in answer to `{what}`");
                self.findings.record_violation(Check::Answers, why);
                return Err(WorldLost);
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
                    self.findings.mark_done(Check::SpeaksProtocol);
                    self.note_time(now, until, observations.is_empty());
                    self.process_observations(&observations, &before);
                    return Ok(());
                }
                Err(why) => self.report_unparsable(line, &why),
            }
        }
    }

    fn report_unparsable(&mut self, line: &str, why: &str) {
        let check = if why.contains("unknown ticket") {
            Check::KnowsTickets
        } else if why.contains("answers question") {
            Check::Answers
        } else {
            Check::SpeaksProtocol
        };
        self.findings
            .record_violation(check, format!("{}: {why}", excerpt(line)));
    }

    fn note_time(&mut self, mut now: Rational, until: Option<&Rational>, is_silent: bool) {
        self.findings.mark_done(Check::KeepsTime);
        let (was, is) = (self.now.to_f64(), now.to_f64());
        // The program may use floating-point numbers, as in a run.
        for exact in [&self.now].into_iter().chain(until) {
            if exact.to_f64().total_cmp(&is).is_eq() {
                now.clone_from(exact);
            }
        }
        if now < self.now {
            let why = format!("its time went back from {was} to {is}");
            self.findings.record_violation(Check::KeepsTime, why);
            return;
        }
        if let Some(until) = until {
            let allowed = until.clone().max(self.now.clone());
            // A real clock may be slightly late when nothing happens.
            let late = &now - &allowed;
            if is_silent && late > Rational::from(5) {
                let why = format!(
                    "requested to wait until {}, it waited until {is}",
                    until.to_f64()
                );
                self.findings.record_violation(Check::KeepsTime, why);
            }
        }
        self.now = now;
    }

    /// Checks and records the reports of an answer. `before` is the time of the previous answer.
    fn process_observations(&mut self, observations: &[Observation], before: &Rational) {
        for Observation { time, event } in observations {
            let (Event::Started { ticket, .. }
            | Event::Ended { ticket, .. }
            | Event::Feedback { ticket, .. }) = event
            else {
                continue;
            };
            self.findings.mark_done(Check::KnowsTickets);
            let Some(action) = self.actions.get_mut(&ticket.0) else {
                continue;
            };
            let name = excerpt(&action.name);
            let mut wrong = |check, why| self.findings.record_violation(check, why);
            let (is, now) = (time.to_f64(), self.now.to_f64());
            let is_old = *time < before - &Rational::ONE;
            if *time > self.now && is > now {
                let why = format!("{name}: a report with time {is} arrived too early, at {now}");
                wrong(Check::ReportsInTime, why);
            } else if is_old && !self.is_recalling {
                let why = format!("{name}: a report with time {is} arrived too late, at {now}");
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
                self.findings.mark_done(check);
            }
        }
    }

    /// Requests the program to stop, and checks that it does.
    pub(super) fn stop(mut self) -> Findings {
        self.findings.mark_done(Check::Stops);
        let told = self
            .writer
            .write("{\"type\":\"stop\"}\n".to_owned(), EXIT_TIMEOUT);
        drop(self.writer);
        let ended = wait_for_exit(&mut self.child, EXIT_TIMEOUT).is_some();
        if !ended {
            let _ = self.child.kill();
            let _ = self.child.wait();
            let why = "it was still running a second after `stop`, and was killed";
            self.findings.record_violation(Check::Stops, why);
        } else if matches!(told, WriteResult::Written) {
            self.findings.mark_done(Check::KeepsRunning);
        }
        self.findings
    }

    /// Kills the program, like a crash.
    pub(super) fn kill(mut self) -> CheckState {
        let _ = self.child.kill();
        let _ = self.child.wait();
        CheckState {
            findings: self.findings,
            now: self.now,
            answer_timeout: self.answer_timeout,
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
