//! Router of the HTTP interface of an executive: paths, access, responses.

use std::io;
use std::net::SocketAddr;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

use elbowroom::execute::{NamedText, RunInputs};
use elbowroom::model::Task;
use elbowroom::report::trace::TraceWriter;
use serde::Serialize;

use super::initial_problem::InitialProblem;
use super::state_stream::DocumentCache;
use crate::error::Error;
use crate::goal_request::GoalNames;
use crate::history::HistoryFiles;
use crate::http::{
    AccessControl, Request, RequestError, Stream, is_local_name, respond, respond_with_events,
};
use crate::interface::documents::Refusal;
use crate::interface::{METHODS, Status, openapi};
use crate::operator::OperatorInterface;
use crate::request_queue::RequestQueue;
use crate::trace_buffer::TraceBuffer;

const JSON: &str = "application/json";
const TEXT: &str = "text/plain; charset=utf-8";
const HTML: &str = "text/html; charset=utf-8";
const METRICS: &str = "text/plain; version=0.0.4; charset=utf-8";

/// Time limit for clients to receive pending responses at the end of the program.
const DRAIN_TIMEOUT: Duration = Duration::from_secs(1);

/// Rejection of a request.
#[derive(Clone, Debug)]
pub struct ApiError {
    /// Status code of the response.
    pub status: u16,
    /// Error message, in lower case.
    pub error: String,
    /// Advice for the user.
    pub help: String,
}

impl ApiError {
    /// Creates an error.
    pub fn new(status: u16, error: impl Into<String>, help: impl Into<String>) -> Self {
        Self {
            status,
            error: error.into(),
            help: help.into(),
        }
    }
}

/// Requests that a run accepts in addition to a stop request, from the smallest to the largest set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Accepted {
    /// None.
    Nothing,
    /// Pauses, and the cancellation of its only goal.
    PausesOnly,
    /// Goals, facts, numbers, problems and pauses.
    Everything,
}

/// Run whose interface is served.
pub(super) struct ServedRun {
    pub(super) status: Status,
    /// The problem, with its own table of facts, so that requests do not change the numbers of the run.
    pub(super) task: Task,
    accepted: Accepted,
    pub(super) inputs: RunInputs,
}

/// HTTP interface of an executive, or of a run that ends with its goal.
pub struct ApiRouter {
    control: Option<AccessControl>,
    own: SocketAddr,
    /// Domain of the problems that clients may submit.
    domain: Option<NamedText>,
    queue: RequestQueue,
    pub(super) buffer: TraceBuffer,
    pub(super) documents: DocumentCache,
    /// The run, once there is a problem.
    run: OnceLock<ServedRun>,
    initial: InitialProblem,
    /// Number of mutations in progress.
    changing: Mutex<usize>,
    answered: Condvar,
    /// Names of goals that are submitted without a name.
    pub(super) names: GoalNames,
    /// Held while a hypothetical goal is simulated.
    pub(super) simulation: Mutex<()>,
    /// Files of the history, if the run has a journal.
    pub(super) history_files: OnceLock<HistoryFiles>,
    /// Held while these files are read.
    pub(super) history: Mutex<()>,
}

impl ApiRouter {
    /// Creates the interface of an executive for problems of `domain`. Without a domain, it is that of a run that ends
    /// with its goal, whose whole trace is kept.
    pub(super) fn new(
        control: Option<AccessControl>,
        own: SocketAddr,
        domain: Option<NamedText>,
    ) -> Self {
        let buffer = match domain {
            Some(_) => TraceBuffer::bounded(),
            None => TraceBuffer::default(),
        };
        Self {
            control,
            own,
            domain,
            queue: RequestQueue::default(),
            buffer,
            documents: DocumentCache::default(),
            run: OnceLock::new(),
            initial: InitialProblem::default(),
            changing: Mutex::new(0),
            answered: Condvar::new(),
            names: GoalNames::default(),
            simulation: Mutex::default(),
            history_files: OnceLock::new(),
            history: Mutex::default(),
        }
    }

    /// Sets the files with the segments of the run.
    pub fn set_history_files(&self, files: HistoryFiles) {
        let _ = self.history_files.set(files);
    }

    /// Returns the request queue.
    pub fn queue(&self) -> &RequestQueue {
        &self.queue
    }

    /// Returns the slot for the initial problem.
    pub fn initial_problem(&self) -> &InitialProblem {
        &self.initial
    }

    /// Returns the TCP address of the server.
    pub fn address(&self) -> SocketAddr {
        self.own
    }

    /// Returns the domain of the problems that clients may submit.
    pub(super) fn domain(&self) -> Option<&NamedText> {
        self.domain.as_ref()
    }

    /// Connects the interface to a run, and writes the header of its trace.
    ///
    /// # Errors
    /// When the specification cannot be written.
    pub fn begin_run(&self, inputs: &RunInputs) -> Result<OperatorInterface, Error> {
        let (spec, task) = (inputs.spec(), inputs.task());
        let status = Status::new(task, spec.timeout.clone());
        let mut header = |line: &str| self.buffer.add(line);
        let written = TraceWriter::new(Arc::clone(task), &mut header).header(spec);
        written.map_err(|error| Error::new(format!("cannot show the run: {error}"), ""))?;
        let accepted = match () {
            () if spec.is_persistent => Accepted::Everything,
            () if spec.is_interactive => Accepted::PausesOnly,
            () => Accepted::Nothing,
        };
        let _ = self.run.set(ServedRun {
            status: status.clone(),
            task: task.with_own_table(),
            accepted,
            inputs: inputs.clone(),
        });
        let buffer = self.buffer.clone();
        Ok(match accepted {
            Accepted::Nothing => OperatorInterface::read_only(status, buffer),
            _ => OperatorInterface::new(self.queue.clone(), status, buffer),
        })
    }

    /// Returns the run.
    ///
    /// # Errors
    /// When there is no problem yet.
    pub(super) fn run(&self) -> Result<&ServedRun, ApiError> {
        let waiting = "the executive has no problem yet";
        let help = "send one: `elbowroom ctl problem FILE`, or PUT /v1/problem";
        self.run
            .get()
            .ok_or_else(|| ApiError::new(409, waiting, help))
    }

    /// Ends the interface with its run. Waits up to three seconds for clients to read the end of the trace and pending
    /// responses.
    pub fn close(&self) {
        self.queue.close();
        self.initial.close();
        self.buffer.close();
        let waits = |changing: &mut usize| *changing > 0;
        let waited = self
            .answered
            .wait_timeout_while(self.changing(), DRAIN_TIMEOUT, waits);
        drop(waited.unwrap_or_else(PoisonError::into_inner));
    }

    fn changing(&self) -> MutexGuard<'_, usize> {
        // The counter changes in one statement.
        self.changing.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Serves a client. With `is_local_only`, requests must name this machine as their host.
    pub(super) fn serve(
        &self,
        request: Result<Request, RequestError>,
        is_local_only: bool,
        stream: &mut Stream,
    ) -> io::Result<()> {
        let request = match request {
            Ok(request) => request,
            Err(RequestError { status, reason }) => {
                let help = "docs/reference/serve.md documents the requests";
                return refuse(stream, &ApiError::new(status, reason, help));
            }
        };
        let is_own = |host: &str| is_local_name(host);
        if is_local_only && !request.header("host").is_some_and(is_own) {
            let error = format!(
                "this host name is not accepted; the page is at {}",
                self.own
            );
            return refuse(stream, &ApiError::new(403, error, "use that address"));
        }
        let _counted = (request.method != "GET").then(|| Changing::begin(self));
        match self.respond(&request, stream) {
            Ok(sent) => sent,
            Err(refused) => refuse(stream, &refused),
        }
    }

    fn respond(&self, request: &Request, stream: &mut Stream) -> Result<io::Result<()>, ApiError> {
        let broken = |why: String| ApiError::new(500, why, "this is a bug; please report it");
        Ok(match (request.method.as_str(), request.path.as_str()) {
            ("GET", "/") if self.domain.is_some() => {
                respond(stream, 200, HTML, &elbowroom_page::operator_page())
            }
            ("GET", "/" | "/run") => {
                self.run()?;
                respond(stream, 200, HTML, &self.buffer.page().map_err(broken)?)
            }
            ("GET", "/document") => {
                self.run()?;
                respond(stream, 200, JSON, &self.buffer.document().map_err(broken)?)
            }
            ("GET", "/events") => {
                let begun = respond_with_events(stream);
                begun.and_then(|()| self.buffer.stream_changes(stream))
            }
            ("GET", "/v1/state/events") => {
                let begun = respond_with_events(stream);
                begun.and_then(|()| {
                    self.buffer
                        .with_listener_count(|| self.stream_state(stream))
                })
            }
            ("GET", "/v1/events") => {
                let after = first_line(request)?;
                if let (Some(after), Some(until)) = (after, self.buffer.last_omitted_line())
                    && after < until
                {
                    let error = format!("the lines up to {until} are no longer in memory");
                    let help = format!(
                        "/v1/events?after={until} returns the later ones; the files of --journal and --trace have all"
                    );
                    return Err(ApiError::new(410, error, help));
                }
                let begun = respond_with_events(stream);
                begun.and_then(|()| self.buffer.stream_lines(after, stream))
            }
            ("POST", "/stop") => {
                self.allow(request)?;
                self.stop();
                respond(stream, 202, TEXT, "The executive is being stopped.\n")
            }
            // Paths of the requests that the buttons on the page send.
            ("POST", path @ ("/pause" | "/resume")) => {
                self.allow(request)?;
                self.change("POST", &format!("/v1{path}"), b"")?;
                let words = match path {
                    "/pause" => "No further actions are started; running actions continue.\n",
                    _ => "The executive continues.\n",
                };
                respond(stream, 202, TEXT, words)
            }
            ("POST", "/v1/what-if") => {
                self.allow(request)?;
                let answer = self.what_if(&request.body)?;
                respond(stream, 200, JSON, &text(&answer))
            }
            ("POST", "/cancel") => {
                self.allow(request)?;
                for name in self.run()?.status.goals() {
                    self.change("DELETE", &format!("/v1/goals/{name}"), b"")?;
                }
                respond(
                    stream,
                    202,
                    TEXT,
                    "All goals are abandoned; nothing more is started.\n",
                )
            }
            ("GET", "/v1/health") => respond(stream, 200, TEXT, "ok\n"),
            ("GET", "/v1/ready") => match self.obstacle_to_readiness() {
                None => respond(stream, 200, TEXT, "ready\n"),
                Some(why) => respond(stream, 503, TEXT, &format!("{why}\n")),
            },
            ("GET", "/metrics") => respond(stream, 200, METRICS, &self.metrics()),
            ("GET", _) => respond(stream, 200, JSON, &self.json_document(request)?),
            (method, path) => {
                if !methods(path).any(|verb| verb == method) {
                    return Err(unknown_path_error(path, method));
                }
                self.allow(request)?;
                let taken = self.change(method, path, &request.body)?;
                let status = if taken.taken { 200 } else { 202 };
                respond(stream, status, JSON, &text(&taken))
            }
        })
    }

    /// Returns the JSON document at the path of a request.
    fn json_document(&self, request: &Request) -> Result<String, ApiError> {
        Ok(match request.path.as_str() {
            "/v1/openapi.json" => text(&openapi()),
            "/v1/state" => text(&self.state()),
            "/v1/goals" => text(&self.run()?.status.all_goals()),
            "/v1/plan" => text(&self.run()?.status.plan()),
            "/v1/guarantee" => text(&self.run()?.status.guarantee()),
            "/v1/history" => text(&self.history_page(&request.query)?),
            "/v1/next" => text(&self.run()?.status.next()),
            path => {
                let name = path.strip_prefix("/v1/goals/");
                let name = name.ok_or_else(|| unknown_path_error(path, "GET"))?;
                let goal = self.run()?.status.goal(name);
                text(&goal.ok_or_else(|| no_goal(name))?)
            }
        })
    }

    /// Returns `true` if the request has the token.
    pub(super) fn is_known(&self, request: &Request) -> bool {
        self.control.is_some() && self.allow(request).is_ok()
    }

    /// Checks that the request has the token.
    fn allow(&self, request: &Request) -> Result<(), ApiError> {
        match (&self.control, request.header("authorization")) {
            (None, _) => Err(ApiError::new(
                403,
                "this executive is read-only",
                "start it with --token FILE",
            )),
            (Some(control), Some(given)) if control.accepts(given) => Ok(()),
            (Some(_), given) => Err(ApiError::new(
                401,
                match given {
                    Some(_) => "wrong token",
                    None => "this request needs the executive's token",
                },
                "`elbowroom ctl --token FILE`, or the header `Authorization: Bearer TOKEN`",
            )),
        }
    }

    /// Requests an orderly shutdown of the run.
    pub(super) fn stop(&self) {
        if let Some(control) = &self.control {
            control.stop();
        }
    }
}

impl ServedRun {
    /// Checks that the run accepts a kind of requests.
    pub(super) fn check_accepts(&self, kind: Accepted) -> Result<(), ApiError> {
        if kind <= self.accepted {
            return Ok(());
        }
        let error = match self.accepted {
            Accepted::PausesOnly => {
                "this run has one goal, and accepts no other goals, problems, facts or numbers"
            }
            _ => "this run accepts only requests to stop",
        };
        let help = "`elbowroom serve` accepts goals, problems, facts, numbers and pauses";
        Err(ApiError::new(409, error, help))
    }
}

/// Guard of a mutation in progress.
struct Changing<'a>(&'a ApiRouter);

impl<'a> Changing<'a> {
    fn begin(front: &'a ApiRouter) -> Self {
        *front.changing() += 1;
        Self(front)
    }
}

impl Drop for Changing<'_> {
    fn drop(&mut self) {
        *self.0.changing() -= 1;
        self.0.answered.notify_all();
    }
}

/// Returns the line of the trace after which a client wants events: the one that it names or received last.
fn first_line(request: &Request) -> Result<Option<usize>, ApiError> {
    let mut members = request.query.split('&');
    let asked = members.find_map(|member| member.strip_prefix("after="));
    let number = asked.or_else(|| request.header("last-event-id"));
    let number = number.map(str::parse::<usize>).transpose();
    number.map_err(|_| {
        let help = "for example /v1/events?after=0 for all lines";
        ApiError::new(422, "expected a line number in `after`", help)
    })
}

/// Methods and paths of the pages. They are not part of the `OpenAPI` document.
const PAGE: [(&str, &str); 8] = [
    ("GET", "/"),
    ("GET", "/run"),
    ("GET", "/document"),
    ("GET", "/events"),
    ("POST", "/pause"),
    ("POST", "/resume"),
    ("POST", "/cancel"),
    ("POST", "/stop"),
];

/// Returns the methods of a path.
fn methods(path: &str) -> impl Iterator<Item = &'static str> {
    let api = METHODS.iter().map(|method| (method.verb, method.path));
    let known = PAGE.into_iter().chain(api);
    known.filter_map(move |(verb, pattern)| is_path(path, pattern).then_some(verb))
}

fn is_path(path: &str, pattern: &str) -> bool {
    match pattern.strip_suffix("{name}") {
        Some(head) => path.strip_prefix(head).is_some_and(|name| !name.is_empty()),
        None => path == pattern,
    }
}

/// Returns the error for a path without this method.
fn unknown_path_error(path: &str, method_name: &str) -> ApiError {
    let help = "GET /v1/openapi.json lists all requests";
    match methods(path).next() {
        Some(verb) => {
            let error = format!("{path} does not support {method_name}, but {verb}");
            ApiError::new(405, error, help)
        }
        None => ApiError::new(404, "unknown path", help),
    }
}

/// Returns the error for an unknown goal.
fn no_goal(name: &str) -> ApiError {
    let error = format!("there is no goal `{}`", name.escape_debug());
    ApiError::new(404, error, "GET /v1/goals lists the goals")
}

/// Sends an error as a JSON document.
fn refuse(stream: &mut Stream, refused: &ApiError) -> io::Result<()> {
    let (error, help) = (refused.error.clone(), refused.help.clone());
    respond(
        stream,
        refused.status,
        JSON,
        &text(&Refusal { error, help }),
    )
}

/// Returns a document as a line of JSON.
fn text(document: &impl Serialize) -> String {
    let mut text = serde_json::to_string(document).unwrap_or_else(|_| "null".to_owned());
    text.push('\n');
    text
}
