//! `elbowroom ctl`: client of an executive, `docs/serve.md`.

use std::fmt::Write as _;
use std::io::{self, ErrorKind};
use std::time::Duration;

use elbowroom::answers::exact::{INFINITY, MINUS_INFINITY};
use elbowroom::execution::GuaranteeLevel;
use elbowroom::num::work::Stop;
use elbowroom::num::{End, Rational};
use elbowroom::report::exact::Exact;
use elbowroom_executive::http::{self, AccessControl};
use elbowroom_executive::interface::documents::{
    GivenNumber, GoalNow, GoalsNow, GuaranteeNow, NewFact, NewGoal, NewNumber, NewOutcome,
    NewProblem, NextNow, PlanNow, Refusal, State, StepNow, Taken,
};
use elbowroom_executive::messages::{count_with_noun, escape_control, io_error_message};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::args::{CtlArgs, CtlCommand};
use crate::exit::{Answer, Exit, Failure};
use crate::number::nearest;
use crate::output::{self, Output};
use crate::terminal::{EMPHASIS, stdout_layout, styled};
use elbowroom::report::console::wrap;

/// Sends the request and prints the answer.
pub(crate) fn run(arguments: &CtlArgs, output: &mut Output) -> Answer {
    let client = Client { arguments };
    match &arguments.what {
        CtlCommand::State => client.show(output, "/v1/state", state),
        CtlCommand::Goals => client.show(output, "/v1/goals", goals),
        CtlCommand::Plan => client.show(output, "/v1/plan", plan),
        CtlCommand::Guarantee => client.show(output, "/v1/guarantee", guarantee),
        CtlCommand::Next => client.show(output, "/v1/next", next),
        CtlCommand::Events { after } => client.events(*after),
        CtlCommand::Openapi => {
            let (document, _) = client.request::<Value>(("GET", "/v1/openapi.json"), None)?;
            output.json(&document)?;
            Ok(Exit::Yes)
        }
        CtlCommand::Goal {
            goal,
            name,
            value,
            deadline,
            within,
            release,
            after,
            keep,
            by,
            wait,
        } => {
            let new = NewGoal {
                name: name.clone(),
                goal: goal.clone(),
                value: value.clone().map(GivenNumber),
                deadline: deadline.clone().map(GivenNumber),
                within: within.clone().map(GivenNumber),
                release: release.clone().map(GivenNumber),
                after: after.clone().map(GivenNumber),
                keep: *keep,
                by: by.clone(),
            };
            if *wait {
                return client.submit_goal_and_wait(output, &new);
            }
            client.change(output, ("POST", "/v1/goals"), Some(&new))
        }
        CtlCommand::Cancel { name } => {
            let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte);
            if name.is_empty() || !name.bytes().all(is_plain) {
                return Err(Failure::new(
                    "this is no name of a goal",
                    "`elbowroom ctl state` lists the goals with their names",
                ));
            }
            client.change(output, ("DELETE", &format!("/v1/goals/{name}")), NO_BODY)
        }
        CtlCommand::Action { ticket, becomes } => {
            let (ticket, becomes) = (*ticket, becomes.clone());
            client.change(
                output,
                ("POST", "/v1/actions"),
                Some(&NewOutcome { ticket, becomes }),
            )
        }
        CtlCommand::Fact { fact, becomes } => {
            let (fact, becomes) = (fact.clone(), *becomes);
            client.change(
                output,
                ("POST", "/v1/facts"),
                Some(&NewFact { fact, becomes }),
            )
        }
        CtlCommand::Number { fluent, value } => {
            let (fluent, value) = (fluent.clone(), GivenNumber(value.clone()));
            client.change(
                output,
                ("POST", "/v1/numbers"),
                Some(&NewNumber { fluent, value }),
            )
        }
        CtlCommand::Problem { file } => {
            let problem = crate::input::source(file, "problem")?.text().to_owned();
            client.change(
                output,
                ("PUT", "/v1/problem"),
                Some(&NewProblem { problem }),
            )
        }
        CtlCommand::Pause => client.change(output, ("POST", "/v1/pause"), NO_BODY),
        CtlCommand::Resume => client.change(output, ("POST", "/v1/resume"), NO_BODY),
        CtlCommand::Stop => client.change(output, ("POST", "/v1/stop"), NO_BODY),
    }
}

/// Interval between queries for the goal of `ctl goal --wait`.
const GOAL_POLL_INTERVAL: Duration = Duration::from_millis(200);

/// A request without a body.
const NO_BODY: Option<&NewFact> = None;

/// A client of an executive.
struct Client<'a> {
    arguments: &'a CtlArgs,
}

impl Client<'_> {
    fn unreachable(&self, error: &io::Error) -> Failure {
        if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) {
            return Failure::new(
                format!(
                    "the executive at {} accepts connections, but does not answer",
                    self.arguments.to
                ),
                "check whether its process is stopped (state T in `ps`) or its machine is \
                 overloaded, and try again",
            );
        }
        Failure::new(
            format!(
                "cannot reach the executive at {}: {}",
                self.arguments.to,
                io_error_message(error)
            ),
            "`elbowroom serve` prints its address; give it with --to",
        )
    }

    fn send(&self, what: (&str, &str), body: Option<&str>) -> Result<http::Response, Failure> {
        let control = match &self.arguments.token {
            Some(path) => Some(AccessControl::read(path, Stop::default())?),
            None => None,
        };
        let token = control.as_ref().map(AccessControl::token);
        let answer = http::send(&self.arguments.to, what, token, body);
        answer.map_err(|error| self.unreachable(&error))
    }

    /// Sends a request. Returns the answer, parsed and as received.
    fn request<T: DeserializeOwned>(
        &self,
        what: (&str, &str),
        body: Option<&str>,
    ) -> Result<(T, Value), Failure> {
        let answer = self.send(what, body)?;
        let status = answer.status;
        let text = answer.text().map_err(|error| self.unreachable(&error))?;
        if status >= 300 {
            return Err(self.refused(status, &text));
        }
        let unlike = |error: serde_json::Error| self.invalid_answer(&error.to_string());
        let value: Value = serde_json::from_str(&text).map_err(unlike)?;
        let document = T::deserialize(&value).map_err(unlike)?;
        Ok((document, value))
    }

    /// Converts the executive's refusal to a failure with the same message and advice.
    fn refused(&self, status: u16, text: &str) -> Failure {
        match serde_json::from_str::<Refusal>(text) {
            Ok(refusal) => Failure::new(
                escape_control(&refusal.error),
                escape_control(&refusal.help),
            ),
            Err(_) => self.invalid_answer(&format!("unexpected HTTP status {status}")),
        }
    }

    fn invalid_answer(&self, why: &str) -> Failure {
        Failure::new(
            format!(
                "the server at {} is not an executive: {}",
                self.arguments.to,
                escape_control(why)
            ),
            "`elbowroom serve` prints its address; give it with --to",
        )
    }

    fn show<T: DeserializeOwned>(
        &self,
        output: &mut Output,
        path: &str,
        words: fn(&T) -> String,
    ) -> Answer {
        let (document, value) = self.request::<T>(("GET", path), None)?;
        if self.arguments.json {
            output.json(&value)?;
        } else {
            output::print(&words(&document))?;
        }
        Ok(Exit::Yes)
    }

    fn change(
        &self,
        output: &mut Output,
        what: (&str, &str),
        body: Option<&impl Serialize>,
    ) -> Answer {
        let body = body.and_then(|body| serde_json::to_string(body).ok());
        let (taken, value) = self.request::<Taken>(what, body.as_deref())?;
        if self.arguments.json {
            output.json(&value)?;
            return Ok(Exit::Yes);
        }
        let name = taken.name.map_or(String::new(), |name| format!("{name}: "));
        output::print(&if taken.taken {
            format!("{name}done\n")
        } else {
            let until = taken.until.as_deref().unwrap_or("possible");
            format!(
                "{name}pending: it is processed as soon as {}\n",
                escape_control(until)
            )
        })?;
        Ok(Exit::Yes)
    }

    /// Submits a goal, and waits until it is closed or the executive is idle without a plan for it.
    fn submit_goal_and_wait(&self, output: &mut Output, new: &NewGoal) -> Answer {
        let (before, _) = self.request::<State>(("GET", "/v1/state"), None)?;
        let body = serde_json::to_string(new).ok();
        let (taken, _) = self.request::<Taken>(("POST", "/v1/goals"), body.as_deref())?;
        let name = taken.name.unwrap_or_default();
        loop {
            let (all, _) = self.request::<GoalsNow>(("GET", "/v1/goals"), None)?;
            let is_it = |goal: &GoalNow| {
                let is_later = |given: &Exact| given.0 >= before.now.0;
                goal.name == name && goal.given.as_ref().is_some_and(is_later)
            };
            // Of several goals with this name, the last one is the newest.
            let Some(goal) = all.goals.into_iter().rev().find(is_it) else {
                std::thread::sleep(GOAL_POLL_INTERVAL);
                continue;
            };
            let exit = match goal.state.as_str() {
                "achieved" | "kept" => Exit::Yes,
                "cancelled" | "failed" | "impossible" => Exit::No,
                "unplanned" => Exit::Limit,
                _ => {
                    std::thread::sleep(GOAL_POLL_INTERVAL);
                    continue;
                }
            };
            if self.arguments.json {
                output.json(&serde_json::to_value(&goal).unwrap_or_default())?;
            } else {
                output::print(&goals(&GoalsNow { goals: vec![goal] }))?;
            }
            return Ok(exit);
        }
    }

    /// Prints each line of the trace as it is received.
    fn events(&self, after: Option<usize>) -> Answer {
        let path = after.map_or("/v1/events".to_owned(), |after| {
            format!("/v1/events?after={after}")
        });
        let answer = self.send(("GET", &path), None)?;
        let status = answer.status;
        if status != 200 {
            let text = answer.text().map_err(|error| self.unreachable(&error))?;
            return Err(self.refused(status, &text));
        }
        let mut is_over = false;
        for line in answer.lines() {
            let line = line.map_err(|error| self.unreachable(&error))?;
            is_over |= line == "event: over";
            if let Some(data) = line.strip_prefix("data: ")
                && !is_over
            {
                output::print(&format!("{data}\n"))?;
            }
        }
        if is_over {
            return Ok(Exit::Yes);
        }
        Err(Failure::new(
            format!(
                "lost the connection to the executive at {}",
                self.arguments.to
            ),
            "if it has a journal, `elbowroom serve --resume` continues it",
        ))
    }
}

fn goals(goals: &GoalsNow) -> String {
    let mut text = String::new();
    for goal in &goals.goals {
        let name = escape_control(&goal.name);
        let state = styled(EMPHASIS, &goal.state.replace('-', " "));
        let since = nearest(&goal.since.0);
        let value = match &goal.value.0 {
            value if *value == Rational::ONE => String::new(),
            value => format!(", value {}", nearest(value)),
        };
        let time = |word: &str, time: &Option<Exact>| {
            let time = time.as_ref();
            time.map_or(String::new(), |it| format!(", {word} {}", nearest(&it.0)))
        };
        let (from, until) = (time("from", &goal.release), time("by", &goal.deadline));
        let keep = if goal.keep { ", to be kept" } else { "" };
        let author = goal.by.as_ref();
        let author = author.map_or(String::new(), |it| {
            format!(", given by {}", escape_control(it))
        });
        let mut line = format!(
            "{name}{value}{from}{until}{keep}{author}: {state} since {since}: {}",
            escape_control(&goal.goal)
        );
        if let Some(why) = &goal.why {
            let _ = write!(line, "; {}", escape_control(why));
        }
        let _ = writeln!(text, "{}", wrap(&line, stdout_layout().width, 2));
    }
    if text.is_empty() {
        text.push_str("there is no goal\n");
    }
    text
}

fn state(state: &State) -> String {
    let mut text = format!(
        "{} at {}, plan {}",
        styled(EMPHASIS, &state.activity.to_string()),
        nearest(&state.now.0),
        state.plans
    );
    if let Some(why) = &state.why {
        let _ = write!(text, ": {}", escape_control(why));
    }
    text.push('\n');
    if let Some(why) = &state.restarting {
        let why = format!("world restarting: {}", escape_control(why));
        let _ = writeln!(text, "{}", wrap(&why, stdout_layout().width, 2));
    }
    if let Some(seconds) = state.unanswered {
        let why = format!(
            "the world has not answered for {seconds} s: until it does, no action is started and \
             no request is processed"
        );
        let _ = writeln!(text, "{}", wrap(&why, stdout_layout().width, 2));
    }
    for goal in &state.goals {
        let (name, pddl) = (escape_control(&goal.name), escape_control(&goal.goal));
        let aside = goal.aside.as_ref();
        let aside = aside.map_or(String::new(), |why| {
            format!("; set aside: {}", escape_control(why))
        });
        let release = goal.release.as_ref();
        let release = release.map_or(String::new(), |it| {
            format!("; queued until {}", nearest(&it.0))
        });
        let keep = goal.keep.as_ref();
        let keep = keep.map_or(String::new(), |state| format!("; to be kept, {state}"));
        let _ = writeln!(text, "  goal {name}: {pddl}{aside}{keep}{release}");
    }
    for running in &state.running {
        let _ = write!(
            text,
            "  running {} (ticket {}) since {}",
            running.action,
            running.ticket,
            nearest(&running.since.0)
        );
        if let Some(planned) = &running.planned {
            let _ = write!(text, ", planned {}", nearest(&planned.0));
        }
        if let Some(times_out) = &running.times_out {
            let times_out = nearest(&times_out.0);
            let _ = write!(text, "; without progress, it times out at {times_out}");
        }
        if let Some(needed) = &running.needed {
            let _ = write!(
                text,
                "; if it continues, a new plan is needed at {}",
                nearest(&needed.0)
            );
        }
        if let Some(note) = &running.note {
            let _ = write!(text, ": {}", escape_control(note));
        }
        text.push('\n');
    }
    for doubt in &state.in_doubt {
        let (name, since) = (escape_control(&doubt.name), nearest(&doubt.since.0));
        let line = format!(
            "{name} is in doubt since {since}: {}",
            escape_control(&doubt.why)
        );
        let _ = writeln!(text, "{}", wrap(&line, stdout_layout().width, 2));
    }
    let _ = writeln!(text, "  {}", count_with_noun(state.facts.len(), "fact"));
    for fact in &state.facts {
        let _ = writeln!(text, "    {fact}");
    }
    for number in &state.numbers {
        let _ = writeln!(text, "    {} = {}", number.fluent, nearest(&number.value.0));
    }
    text
}

fn step(step: &StepNow) -> String {
    let duration = step.duration.as_ref();
    let duration = duration.map_or(String::new(), |it| format!(" [{}]", nearest(&it.0)));
    format!(
        "{:>10}: {}{duration} {}",
        nearest(&step.start.0),
        step.action,
        step.state
    )
}

fn plan(plan: &PlanNow) -> String {
    let mut text = match &plan.since {
        Some(since) => format!("plan {}, since {}\n", plan.plans, nearest(&since.0)),
        None => "there is no plan\n".to_owned(),
    };
    for own in &plan.steps {
        let _ = writeln!(text, "{}", step(own));
    }
    text
}

fn guarantee(guarantee: &GuaranteeNow) -> String {
    let promise = guarantee.promise.as_deref();
    let mut known = GuaranteeLevel::TERMS.iter();
    let level = known.find(|(_, name, _)| Some(*name) == promise);
    let name = match level {
        Some((level, ..)) => level.label(),
        None if promise.is_some() => GuaranteeLevel::Luck.label(),
        None => "none",
    };
    let condition = level.and_then(|(level, ..)| level.condition());
    let mut text = format!("guarantee: {name}");
    if let Some(since) = &guarantee.since {
        let _ = write!(text, ", since {}", nearest(&since.0));
    }
    text.push('\n');
    if let Some(deviation) = &guarantee.deviation {
        let _ = writeln!(text, "  last deviation: {}", escape_control(deviation));
    }
    if let Some(condition) = condition {
        let before = match guarantee.timeout.as_str() {
            "none" => "",
            _ => " and each action ends before its time-out",
        };
        let _ = writeln!(text, "  the plan works as long as {condition}{before}");
    }
    let end = |end: &End, infinity: &str| end.value().map_or(infinity.to_owned(), nearest);
    for room in &guarantee.parameters {
        let nominal = nearest(&room.nominal.0);
        let _ = write!(text, "  {}, {}: planned {nominal}", room.name, room.meaning);
        if let (Some(least), Some(most)) = (&room.least, &room.most) {
            let (least, most) = (end(&least.0, MINUS_INFINITY), end(&most.0, INFINITY));
            let _ = write!(text, ", from {least} to {most}");
        }
        if let Some(timeout) = &room.timeout {
            let _ = write!(text, ", time-out {}", nearest(&timeout.0));
        }
        text.push('\n');
    }
    text
}

fn next(next: &NextNow) -> String {
    let mut text = next
        .decision
        .as_deref()
        .unwrap_or("no decision yet")
        .to_owned();
    if let Some(until) = &next.until {
        let _ = write!(text, " until {}", nearest(&until.0));
    }
    if let Some(why) = &next.why {
        let _ = write!(text, ": {}", escape_control(why));
    }
    text.push('\n');
    if let Some(own) = &next.step {
        let _ = writeln!(text, "{}", step(own));
    }
    text
}
