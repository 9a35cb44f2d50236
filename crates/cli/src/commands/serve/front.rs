//! Where clients are received: what they want, and whether they may.

use std::io;
use std::net::SocketAddr;
use std::sync::atomic::AtomicU64;
use std::sync::{Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

use elbowroom::execute::NamedText;
use elbowroom::executive::documents::Refusal;
use elbowroom::executive::{METHODS, Status, openapi};
use elbowroom::model::Task;
use serde::Serialize;

use elbowroom_executive::http::{
    AccessControl, Request, RequestError, Stream, is_local_name, respond, respond_with_events,
};
use elbowroom_executive::request_queue::RequestQueue;
use elbowroom_executive::trace_buffer::TraceBuffer;

use super::first::First;

const JSON: &str = "application/json";
const TEXT: &str = "text/plain; charset=utf-8";
const HTML: &str = "text/html; charset=utf-8";

/// The page while there is no problem, or it is not taken up yet: it asks again by itself.
const WAITING: &str = "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n\
    <meta http-equiv=\"refresh\" content=\"1\">\n<title>Elbowroom</title>\n\
    <h1>Waiting for a problem</h1>\n\
    <p>The executive has no problem yet. Give it one with <code>elbowroom ctl problem FILE</code>; \
    this page shows the run as soon as there is one.</p>\n</html>\n";

/// How long the end of the program waits for clients that are told what became of their requests.
const FAREWELL: Duration = Duration::from_secs(1);

/// Why a request is refused: a status, what is wrong, and what to do.
pub(super) struct Refused(pub(super) u16, pub(super) String, pub(super) String);

impl Refused {
    pub(super) fn new(status: u16, error: impl Into<String>, help: impl Into<String>) -> Self {
        Self(status, error.into(), help.into())
    }
}

/// Everything that clients can reach.
pub(super) struct Front {
    control: Option<AccessControl>,
    own: SocketAddr,
    pub(super) domain: NamedText,
    queue: RequestQueue,
    buffer: TraceBuffer,
    /// The run, once there is a problem; its task has a table of its own, so that what clients
    /// mention is not what the run does.
    run: OnceLock<(Status, Task)>,
    pub(super) first: First,
    /// How many requests that change something are being answered.
    changing: Mutex<usize>,
    answered: Condvar,
    /// How many goals were named here.
    pub(super) named: AtomicU64,
}

impl Front {
    pub(super) fn new(control: Option<AccessControl>, own: SocketAddr, domain: &NamedText) -> Self {
        Self {
            control,
            own,
            domain: domain.clone(),
            queue: RequestQueue::default(),
            buffer: TraceBuffer::bounded(),
            run: OnceLock::new(),
            first: First::default(),
            changing: Mutex::new(0),
            answered: Condvar::new(),
            named: AtomicU64::new(0),
        }
    }

    pub(super) fn queue(&self) -> &RequestQueue {
        &self.queue
    }

    pub(super) fn buffer(&self) -> &TraceBuffer {
        &self.buffer
    }

    /// From now on there is a run.
    pub(super) fn begin(&self, status: Status, task: &Task) {
        let _ = self.run.set((status, task.with_own_table()));
    }

    /// The run and its task, if there is one already.
    pub(super) fn run(&self) -> Result<&(Status, Task), Refused> {
        let waiting = "the executive has no problem yet";
        let help = "give it one: `elbowroom ctl problem FILE`, or PUT /v1/problem";
        self.run
            .get()
            .ok_or_else(|| Refused::new(409, waiting, help))
    }

    /// The run is over: clients have a moment to hear of it, and what became of their requests.
    pub(super) fn close(&self) {
        self.queue.close();
        self.first.close();
        self.buffer.close();
        let waits = |changing: &mut usize| *changing > 0;
        let waited = self
            .answered
            .wait_timeout_while(self.changing(), FAREWELL, waits);
        drop(waited.unwrap_or_else(PoisonError::into_inner));
    }

    fn changing(&self) -> MutexGuard<'_, usize> {
        // It is counted in one statement.
        self.changing.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Serves a client. `is_local_only` is whether only this machine should reach it.
    pub(super) fn serve(
        &self,
        request: Result<Request, RequestError>,
        is_local_only: bool,
        stream: &mut Stream,
    ) -> io::Result<()> {
        let request = match request {
            Ok(request) => request,
            Err(RequestError { status, reason }) => {
                let help = "docs/serve.md says what an executive understands";
                return refuse(stream, &Refused::new(status, reason, help));
            }
        };
        let is_own = |host: &str| is_local_name(host);
        if is_local_only && !request.header("host").is_some_and(is_own) {
            let error = format!("this is not the page of that host; {} is", self.own);
            return refuse(stream, &Refused::new(403, error, "use the address itself"));
        }
        let _counted = (request.method != "GET").then(|| Changing::begin(self));
        match self.answer(&request, stream) {
            Ok(told) => told,
            Err(refused) => refuse(stream, &refused),
        }
    }

    fn answer(&self, request: &Request, stream: &mut Stream) -> Result<io::Result<()>, Refused> {
        let broken = |why: String| Refused::new(500, why, "this is a bug; please report it");
        Ok(match (request.method.as_str(), request.path.as_str()) {
            ("GET", "/") if self.run().is_err() => respond(stream, 409, HTML, WAITING),
            ("GET", "/") => respond(stream, 200, HTML, &self.buffer.page().map_err(broken)?),
            ("GET", "/document") => {
                self.run()?;
                respond(stream, 200, JSON, &self.buffer.document().map_err(broken)?)
            }
            ("GET", "/events") => {
                let begun = respond_with_events(stream);
                begun.and_then(|()| self.buffer.stream_changes(stream))
            }
            ("GET", "/v1/events") => {
                let after = first_line(request)?;
                if let (Some(after), Some(until)) = (after, self.buffer.last_omitted_line())
                    && after < until
                {
                    let error = format!("the lines up to {until} are no longer kept here");
                    let help = format!(
                        "/v1/events?after={until} has the others; the files of --journal and --trace \
                         have all of them"
                    );
                    return Err(Refused::new(410, error, help));
                }
                let begun = respond_with_events(stream);
                begun.and_then(|()| self.buffer.stream_lines(after, stream))
            }
            ("POST", "/stop") => {
                self.allow(request)?;
                self.stop();
                respond(stream, 202, TEXT, "The executive is being stopped.\n")
            }
            // What the page's other buttons ask.
            ("POST", path @ ("/pause" | "/resume")) => {
                self.allow(request)?;
                self.change("POST", &format!("/v1{path}"), b"")?;
                let words = match path {
                    "/pause" => "Nothing more is started; what is under way goes on.\n",
                    _ => "It goes on.\n",
                };
                respond(stream, 202, TEXT, words)
            }
            ("POST", "/cancel") => {
                self.allow(request)?;
                for name in self.run()?.0.goals() {
                    self.change("DELETE", &format!("/v1/goals/{name}"), b"")?;
                }
                respond(
                    stream,
                    202,
                    TEXT,
                    "All goals are abandoned; nothing more is started.\n",
                )
            }
            ("GET", "/v1/openapi.json") => respond(stream, 200, JSON, &text(&openapi())),
            ("GET", "/v1/state") => respond(stream, 200, JSON, &text(&self.state())),
            ("GET", "/v1/plan") => respond(stream, 200, JSON, &text(&self.run()?.0.plan())),
            ("GET", "/v1/guarantee") => {
                respond(stream, 200, JSON, &text(&self.run()?.0.guarantee()))
            }
            ("GET", "/v1/next") => respond(stream, 200, JSON, &text(&self.run()?.0.next())),
            ("GET", path) => return Err(no_such(path, "GET")),
            (verb, path) => {
                if !is_known(verb, path) {
                    return Err(no_such(path, verb));
                }
                self.allow(request)?;
                let taken = self.change(verb, path, &request.body)?;
                let status = if taken.taken { 200 } else { 202 };
                respond(stream, status, JSON, &text(&taken))
            }
        })
    }

    /// Returns `true` if the request has the token.
    pub(super) fn is_known(&self, request: &Request) -> bool {
        self.control.is_some() && self.allow(request).is_ok()
    }

    /// Whether the client may change something.
    fn allow(&self, request: &Request) -> Result<(), Refused> {
        match (&self.control, request.header("authorization")) {
            (None, _) => Err(Refused::new(
                403,
                "this executive can only be looked at",
                "start it with --token FILE",
            )),
            (Some(control), Some(given)) if control.accepts(given) => Ok(()),
            (Some(_), given) => Err(Refused::new(
                401,
                match given {
                    Some(_) => "this is not the token",
                    None => "this takes the executive's token",
                },
                "`elbowroom ctl --token FILE`, or the header `Authorization: Bearer TOKEN`",
            )),
        }
    }

    pub(super) fn stop(&self) {
        if let Some(control) = &self.control {
            control.stop();
        }
    }
}

/// A request that changes something, until it is answered.
struct Changing<'a>(&'a Front);

impl<'a> Changing<'a> {
    fn begin(front: &'a Front) -> Self {
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

/// Behind which line of the trace a client wants to hear: the one it names, or has heard last.
fn first_line(request: &Request) -> Result<Option<usize>, Refused> {
    let mut members = request.query.split('&');
    let asked = members.find_map(|member| member.strip_prefix("after="));
    let number = asked.or_else(|| request.header("last-event-id"));
    let number = number.map(str::parse::<usize>).transpose();
    number.map_err(|_| {
        let help = "for example /v1/events?after=0 for all lines";
        Refused::new(422, "`after` is no number of a line", help)
    })
}

/// Whether there is such a request.
fn is_known(verb: &str, path: &str) -> bool {
    METHODS
        .iter()
        .any(|method| verb == method.verb && is_path(path, method.path))
}

fn is_path(path: &str, pattern: &str) -> bool {
    match pattern.strip_suffix("{name}") {
        Some(head) => path.strip_prefix(head).is_some_and(|name| !name.is_empty()),
        None => path == pattern,
    }
}

fn no_such(path: &str, verb: &str) -> Refused {
    let mut own = METHODS.iter().filter(|method| is_path(path, method.path));
    let help = "GET /v1/openapi.json lists what can be asked";
    match own.next() {
        Some(method) => {
            let error = format!("{path} is not for {verb}, but for {}", method.verb);
            Refused::new(405, error, help)
        }
        None => Refused::new(404, "there is nothing at this path", help),
    }
}

fn refuse(stream: &mut Stream, Refused(status, error, help): &Refused) -> io::Result<()> {
    let (error, help) = (error.clone(), help.clone());
    respond(stream, *status, JSON, &text(&Refusal { error, help }))
}

/// A document as text, with a line feed.
fn text(document: &impl Serialize) -> String {
    let mut text = serde_json::to_string(document).unwrap_or_else(|_| "null".to_owned());
    text.push('\n');
    text
}
