//! Server for the page of a run during the run.
//!
//! The run appends its trace to a [`TraceBuffer`] and never waits. The threads of the server make pages and send
//! them.

use std::fmt;
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;

use elbowroom::execution::run::FIRST_GOAL;

use super::{
    AccessControl, Address, Listener, Request, RequestError, Stream, is_local_name, respond,
    respond_with_events,
};
use crate::error::Error;
use crate::messages::plain;
use crate::request_queue::{ExternalRequest, RequestQueue};
use crate::trace_buffer::TraceBuffer;

/// Page of a run for browsers.
pub struct PageServer {
    buffer: TraceBuffer,
    control: Option<AccessControl>,
    queue: Option<RequestQueue>,
    own: SocketAddr,
}

impl PageServer {
    /// Serves the page of a run until the program ends. Returns the address. With `control`, holders of the token may
    /// stop the run, and submit requests if there is a queue.
    ///
    /// # Errors
    /// When the address is not available.
    pub fn start(
        address: Address,
        buffer: TraceBuffer,
        control: Option<AccessControl>,
        queue: Option<RequestQueue>,
    ) -> Result<SocketAddr, Error> {
        let failure = |why: &dyn fmt::Display| {
            Error::new(
                format!("cannot serve the page at {}: {why}", address.0),
                "choose another port; with port 0, a free one is taken",
            )
        };
        let listener = TcpListener::bind(address.0).map_err(|error| failure(&plain(&error)))?;
        let own = listener.local_addr().unwrap_or(address.0);
        let server = Arc::new(Self {
            buffer,
            control,
            queue,
            own,
        });
        let known = Arc::clone(&server);
        let is_known = move |request: &Request| {
            let control = known.control.as_ref();
            control.is_some_and(|control| control.allows(request))
        };
        super::serve(Listener::Tcp(listener), is_known, move |request, stream| {
            server.serve(request, stream)
        });
        Ok(own)
    }

    fn serve(&self, request: Result<Request, RequestError>, stream: &mut Stream) -> io::Result<()> {
        let mut plain = |status, text: &str| respond(stream, status, TEXT, text);
        let request = match request {
            Ok(request) => request,
            Err(RequestError { status, reason }) => {
                return plain(status, &format!("{reason}\n"));
            }
        };
        let host = request.header("host");
        if self.own.ip().is_loopback() && !host.is_some_and(is_local_name) {
            return plain(403, "this is not the page of that host\n");
        }
        match (request.method.as_str(), request.path.as_str()) {
            ("GET", "/") => match self.buffer.page() {
                Ok(page) => respond(stream, 200, "text/html; charset=utf-8", &page),
                Err(why) => plain(500, &format!("{why}\n")),
            },
            ("GET", "/document") => match self.buffer.document() {
                Ok(document) => respond(stream, 200, "application/json", &document),
                Err(why) => plain(500, &format!("{why}\n")),
            },
            ("GET", "/events") => {
                respond_with_events(stream)?;
                self.buffer.stream_changes(stream)
            }
            ("POST", path @ ("/stop" | "/pause" | "/resume" | "/cancel")) => {
                let (status, text) = self.change(path, &request);
                plain(status, text)
            }
            (_, "/" | "/document" | "/events" | "/stop" | "/pause" | "/resume" | "/cancel") => {
                plain(405, "not this way\n")
            }
            _ => plain(404, "there is only one page here: /\n"),
        }
    }

    fn change(&self, path: &str, request: &Request) -> (u16, &'static str) {
        let control = match &self.control {
            None => {
                return (
                    403,
                    "this page is for looking only: run it with --control FILE\n",
                );
            }
            Some(control) if !control.allows(request) => {
                return (401, "this is not the token\n");
            }
            Some(control) => control,
        };
        if path == "/stop" {
            control.stop();
            return (202, "The run is being stopped.\n");
        }
        let (request, words) = match path {
            "/pause" => (
                elbowroom::execution::Request::Pause,
                "Nothing more is started; what is under way goes on.\n",
            ),
            "/resume" => (elbowroom::execution::Request::Resume, "The run goes on.\n"),
            _ => (
                elbowroom::execution::Request::Abandon {
                    name: FIRST_GOAL.to_owned(),
                },
                "Nothing more is started; the run is over when what is under way has ended.\n",
            ),
        };
        let submitted = self
            .queue
            .as_ref()
            .map(|queue| queue.submit(vec![ExternalRequest::Request(request)]));
        match submitted {
            Some(Some(_)) => (202, words),
            Some(None) => (503, "too many requests wait for the run\n"),
            None => (409, "this run takes no requests but /stop\n"),
        }
    }
}

const TEXT: &str = "text/plain; charset=utf-8";
