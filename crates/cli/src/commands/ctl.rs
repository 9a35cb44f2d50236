//! `elbowroom ctl`: client of an executive, `docs/reference/serve.md`.

mod words;

use std::fmt::Write as _;
use std::io::{self, ErrorKind};
use std::time::Duration;

use elbowroom::num::Rational;
use elbowroom::num::work::Stop;
use elbowroom::report::exact::Exact;
use elbowroom_executive::http::{self, AccessControl};
use elbowroom_executive::interface::documents::{
    GivenNumber, GoalNow, GoalsNow, NewFact, NewGoal, NewNumber, NewOutcome, NewProblem, Refusal,
    State, Taken, WhatIf,
};
use elbowroom_executive::messages::{escape_control, io_error_message};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::args::{CtlArgs, CtlCommand, GoalTerms};
use crate::exit::{Answer, Exit, Failure};
use crate::output::{self, Output};
use words::{goals, guarantee, history, next, plan, state, what_if};

/// Sends the request and prints the answer.
pub(crate) fn run(arguments: &CtlArgs, output: &mut Output) -> Answer {
    let client = Client { arguments };
    match &arguments.what {
        CtlCommand::State => client.show(output, "/v1/state", state),
        CtlCommand::Goals => client.show(output, "/v1/goals", goals),
        CtlCommand::Plan => client.show(output, "/v1/plan", plan),
        CtlCommand::Guarantee => client.show(output, "/v1/guarantee", guarantee),
        CtlCommand::Next => client.show(output, "/v1/next", next),
        CtlCommand::History { before, limit } => {
            let mut path = format!("/v1/history?limit={limit}");
            if let Some(before) = before {
                let _ = write!(path, "&before={before}");
            }
            client.show(output, &path, history)
        }
        CtlCommand::Events { after } => client.events(*after),
        CtlCommand::Openapi => {
            let (document, _) = client.request::<Value>(("GET", "/v1/openapi.json"), None)?;
            output.json(&document)?;
            Ok(Exit::Yes)
        }
        CtlCommand::Goal {
            goal,
            name,
            terms,
            keep,
            by,
            wait,
        } => {
            let new = NewGoal {
                name: name.clone(),
                keep: *keep,
                by: by.clone(),
                ..new_goal(goal, terms)
            };
            if *wait {
                return client.submit_goal_and_wait(output, &new);
            }
            client.change(output, ("POST", "/v1/goals"), Some(&new))
        }
        CtlCommand::WhatIf { goal, terms } => client.what_if(output, &new_goal(goal, terms)),
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

/// Returns the document of a goal without a name.
fn new_goal(goal: &str, terms: &GoalTerms) -> NewGoal {
    let number = |number: &Option<Rational>| number.clone().map(GivenNumber);
    NewGoal {
        name: None,
        goal: goal.to_owned(),
        value: number(&terms.value),
        deadline: number(&terms.deadline),
        within: number(&terms.within),
        release: number(&terms.release),
        after: number(&terms.after),
        keep: false,
        by: None,
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

    /// Prints the predicted outcome of a goal.
    fn what_if(&self, output: &mut Output, new: &NewGoal) -> Answer {
        let body = serde_json::to_string(new).ok();
        let what = ("POST", "/v1/what-if");
        let (answer, value) = self.request::<WhatIf>(what, body.as_deref())?;
        if self.arguments.json {
            output.json(&value)?;
        } else {
            output::print(&what_if(&answer))?;
        }
        Ok(match answer.verdict.as_str() {
            "achieved" => Exit::Yes,
            "undecided" => Exit::Limit,
            _ => Exit::No,
        })
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
