//! Requests that change the run. They are checked in the thread of the client, and processed by the run when it drains
//! its queue.

use std::collections::BTreeSet;
use std::sync::TryLockError;
use std::time::Duration;

use elbowroom::execution::run::PROBLEM_GOAL_NAME;
use elbowroom::execution::{ActionHandle, GoalTerms, Request};
use elbowroom::model::ground::{Change, FactId};
use elbowroom::model::{Problem, Task};
use elbowroom::pddl::{self, Source};
use serde::de::DeserializeOwned;

use super::router::{Accepted, ApiError, ApiRouter, ServedRun};
use crate::error::Error;
use crate::interface::documents::{
    Activity, NewFact, NewGoal, NewNumber, NewOutcome, NewProblem, State, Taken, WhatIf,
};
use crate::interface::goal_text;
use crate::messages::count_with_noun;
use crate::request_check::{check, check_target};
use crate::request_queue::{ExternalRequest, RequestStatus};
use crate::what_if::what_if;

/// Time limit for a client to wait until the run accepts its request.
const ACCEPT_TIMEOUT: Duration = Duration::from_secs(2);

impl ApiRouter {
    /// Processes a request.
    pub(super) fn change(&self, method: &str, path: &str, body: &[u8]) -> Result<Taken, ApiError> {
        let kind = match (method, path) {
            ("PUT", _) | ("POST", "/v1/goals" | "/v1/facts" | "/v1/numbers") => {
                Accepted::Everything
            }
            ("DELETE", _) | ("POST", "/v1/actions" | "/v1/pause" | "/v1/resume") => {
                Accepted::PausesOnly
            }
            _ => Accepted::Nothing,
        };
        if let Ok(run) = self.run() {
            run.check_accepts(kind)?;
        }
        match (method, path) {
            ("PUT", "/v1/problem") => self.problem(read(body)?),
            ("POST", "/v1/goals") => self.goal(read(body)?),
            ("DELETE", path) => self.abandon(path.trim_start_matches("/v1/goals/")),
            ("POST", "/v1/actions") => self.action(&read(body)?),
            ("POST", "/v1/facts") => self.fact(read(body)?),
            ("POST", "/v1/numbers") => self.number(read(body)?),
            ("POST", "/v1/pause") => {
                self.submit(vec![ExternalRequest::Request(Request::Pause)], None)
            }
            ("POST", "/v1/resume") => {
                self.submit(vec![ExternalRequest::Request(Request::Resume)], None)
            }
            _ => {
                self.stop();
                Ok(Taken {
                    taken: true,
                    until: None,
                    name: None,
                })
            }
        }
    }

    /// Submits a request of a client if it is valid.
    fn submit_checked(
        &self,
        request: ExternalRequest,
        name: Option<String>,
    ) -> Result<Taken, ApiError> {
        let invalid = |error: Error| ApiError::new(422, error.message(), error.advice());
        check(&request, &self.run()?.task).map_err(invalid)?;
        self.submit(vec![request], name)
    }

    /// Submits requests in this order, and waits up to two seconds until the run accepts them.
    fn submit(
        &self,
        requests: Vec<ExternalRequest>,
        name: Option<String>,
    ) -> Result<Taken, ApiError> {
        let status = &self.run()?.status;
        if self.queue().has_journal_failed() {
            return Err(journal_failed());
        }
        if status.state().activity == Activity::Over {
            return Err(ApiError::new(
                409,
                "the executive has ended",
                "start another executive",
            ));
        }
        let full = || {
            let help = "repeat the request later; `elbowroom ctl state` shows its state";
            ApiError::new(503, "too many requests are pending", help)
        };
        let number = self.queue().submit(requests).ok_or_else(full)?;
        let until = match self.queue().wait_until_accepted(number, ACCEPT_TIMEOUT) {
            RequestStatus::Accepted => None,
            RequestStatus::Pending => Some(self.obstacle()),
            RequestStatus::JournalFailed => return Err(journal_failed()),
            RequestStatus::RunEnded => {
                let error = "the executive has ended before it accepted the request";
                return Err(ApiError::new(409, error, "start another executive"));
            }
        };
        Ok(Taken {
            taken: until.is_none(),
            until,
            name,
        })
    }

    /// Returns the reason why a request is still pending.
    fn obstacle(&self) -> String {
        match self.queue().silence() {
            Some(seconds) => format!(
                "the world answers, which it has not done for {}",
                count_with_noun(usize::try_from(seconds).unwrap_or(usize::MAX), "second")
            ),
            None => "a plan is made".to_owned(),
        }
    }

    fn goal(&self, given: NewGoal) -> Result<Taken, ApiError> {
        let invalid = |error: Error| ApiError::new(422, error.message(), error.advice());
        let request = self.names.request(given, &self.run()?.status);
        let (name, request) = request.map_err(invalid)?;
        self.submit_checked(request, Some(name))
    }

    /// Simulates the run with another goal, in the thread of the client. One simulation runs at a time.
    pub(super) fn what_if(&self, body: &[u8]) -> Result<WhatIf, ApiError> {
        let run = self.run()?;
        run.check_accepts(Accepted::Everything)?;
        let given = read(body)?;
        let busy = |_| {
            let help = "repeat the request when the other one has its answer";
            ApiError::new(503, "another hypothetical goal is being simulated", help)
        };
        let _held = match self.simulation.try_lock() {
            Err(TryLockError::Poisoned(held)) => held.into_inner(),
            held => held.map_err(busy)?,
        };
        what_if(&run.inputs, &run.status, given)
            .map_err(|error| ApiError::new(422, error.message(), error.advice()))
    }

    /// Submits a request about an open goal or a running action if the run knows it.
    fn submit_for_target(
        &self,
        request: ExternalRequest,
        name: Option<String>,
    ) -> Result<Taken, ApiError> {
        let unknown = |error: Error| ApiError::new(404, error.message(), error.advice());
        check_target(&request, &self.run()?.status, self.queue()).map_err(unknown)?;
        self.submit(vec![request], name)
    }

    fn abandon(&self, name: &str) -> Result<Taken, ApiError> {
        let name = name.to_owned();
        let request = Request::Abandon { name: name.clone() };
        self.submit_for_target(ExternalRequest::Request(request), Some(name))
    }

    fn action(&self, given: &NewOutcome) -> Result<Taken, ApiError> {
        let ticket = ActionHandle(given.ticket);
        let outcome = |succeeded| ExternalRequest::Outcome { ticket, succeeded };
        let request = match given.becomes.as_str() {
            "done" => outcome(true),
            "failed" => outcome(false),
            "cancelled" => ExternalRequest::Request(Request::CancelAction { ticket }),
            other => {
                let error = format!("`{}` is not an outcome of an action", other.escape_debug());
                let help = "write `done`, `failed` or `cancelled`";
                return Err(ApiError::new(422, error, help));
            }
        };
        self.submit_for_target(request, None)
    }

    fn fact(&self, given: NewFact) -> Result<Taken, ApiError> {
        let (fact, becomes) = (given.fact, given.becomes);
        self.submit_checked(ExternalRequest::Fact { fact, becomes }, None)
    }

    fn number(&self, given: NewNumber) -> Result<Taken, ApiError> {
        let (fluent, value) = (given.fluent, given.value.0);
        self.submit_checked(ExternalRequest::Number { fluent, value }, None)
    }

    /// Starts the run with the initial problem, or changes the situation to that of a later problem with the same
    /// objects.
    fn problem(&self, given: NewProblem) -> Result<Taken, ApiError> {
        let fixed = || {
            let error = "this run has a fixed problem";
            ApiError::new(409, error, "`elbowroom serve` accepts problems")
        };
        let domain = self.domain().ok_or_else(fixed)?.source();
        let read = pddl::read_problem(&domain, &Source::new("the problem", given.problem.as_str()));
        let (problem, _) = read.map_err(|mistakes| {
            let first = mistakes.errors().next().map(ToString::to_string);
            let help = "`elbowroom check DOMAIN PROBLEM` lists all mistakes";
            ApiError::new(422, first.unwrap_or_default(), help)
        })?;
        let Ok(ServedRun { status, task, .. }) = self.run() else {
            let taken = self.initial_problem().submit_and_wait(given.problem)?;
            let until = (!taken).then(|| "it is read".to_owned());
            let name = None;
            return Ok(Taken { taken, until, name });
        };
        let state = status.state();
        check_further(&problem, task, &state)?;
        self.submit(requests_for(&Task::new(problem), task, &state), None)
    }
}

/// Returns the error for requests while the journal cannot be written.
fn journal_failed() -> ApiError {
    let error = "the journal cannot be written; the request is lost, and the executive ends";
    let help =
        "free some disk space, continue with `elbowroom serve --resume`, and repeat the request";
    ApiError::new(503, error, help)
}

/// Checks that a running executive can adopt another problem.
fn check_further(problem: &Problem, task: &Task, state: &State) -> Result<(), ApiError> {
    if problem.objects != task.problem().objects {
        return Err(ApiError::new(
            409,
            "this problem has other objects than the current one",
            "stop the executive, and start one for this problem",
        ));
    }
    if !problem.timed.is_empty() {
        return Err(ApiError::new(
            409,
            "only the first problem may have timed initials",
            "leave them out, or start another executive",
        ));
    }
    if !state.running.is_empty() {
        return Err(ApiError::new(
            409,
            "actions are running, and this problem does not contain their effects",
            "pause, wait until they have ended, and repeat the request; or send goals and facts",
        ));
    }
    Ok(())
}

/// Returns requests that change the situation and the goals to those of the new problem.
fn requests_for(new: &Task, task: &Task, state: &State) -> Vec<ExternalRequest> {
    let mut requests = Vec::new();
    let named = |fact: &_| new.fact_name(*fact);
    let facts: BTreeSet<String> = new.initial().facts.iter().map(named).collect();
    let timed: BTreeSet<FactId> = timed_facts(task).collect();
    // Timed initials, such as those of a calendar, stay in force.
    let is_given = |fact: &str| {
        task.fact_named(fact)
            .is_none_or(|fact| task.is_derived(fact) || timed.contains(&fact))
    };
    let gone = state.facts.iter().filter(|fact| !facts.contains(*fact));
    for fact in gone.filter(|fact| !is_given(fact)) {
        let (fact, becomes) = (fact.clone(), false);
        requests.push(ExternalRequest::Fact { fact, becomes });
    }
    for fact in facts {
        let becomes = true;
        requests.push(ExternalRequest::Fact { fact, becomes });
    }
    for (fluent, value) in &new.initial().values {
        let (fluent, value) = (new.fluent_name(*fluent), value.clone());
        requests.push(ExternalRequest::Number { fluent, value });
    }
    for goal in &state.goals {
        let name = goal.name.clone();
        requests.push(ExternalRequest::Request(Request::Abandon { name }));
    }
    let (name, goal) = (PROBLEM_GOAL_NAME.to_owned(), goal_text(new));
    let terms = GoalTerms::default();
    requests.push(ExternalRequest::Request(Request::Pursue {
        name,
        goal,
        terms,
    }));
    requests
}

/// Returns the facts that timed initials of the running problem change.
fn timed_facts(task: &Task) -> impl Iterator<Item = FactId> {
    let changes = task.timed().iter().flat_map(|happening| &happening.changes);
    changes.filter_map(|change| match change {
        Change::Add(fact) | Change::Delete(fact) => Some(*fact),
        Change::Update { .. } => None,
    })
}

/// Parses a body.
fn read<T: DeserializeOwned>(body: &[u8]) -> Result<T, ApiError> {
    let help = "GET /v1/openapi.json documents the members";
    if body.trim_ascii_start().starts_with(b"[") {
        // Serde would accept a list of the members.
        return Err(ApiError::new(422, "expected an object, found a list", help));
    }
    serde_json::from_slice(body)
        .map_err(|error| ApiError::new(422, format!("cannot parse the body: {error}"), help))
}
