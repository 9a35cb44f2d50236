//! The page of a run while it runs: a server for browsers.
//!
//! The run hands over its trace line by line ([`Board`]) and never waits: pages are made, and sent,
//! by threads of the server, each of which serves one client.

use std::fmt;
use std::io::{self, Read as _, Write};
use std::net::{IpAddr, SocketAddr, ToSocketAddrs as _};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use elbowroom::execution::run::FIRST_GOAL;
use tiny_http::{Header, Method, Request, Response, Server};

pub(crate) use crate::board::{Board, NAME};
use crate::desk::{Ask, Desk};
use crate::exit::Failure;
use crate::interrupt::Interrupt;
use crate::output;
use crate::words::plain;

/// The limit on clients that are served at once; others are asked to come back.
const MOST_CLIENTS: usize = 64;

/// The least length of a token, in bytes.
const LEAST_TOKEN: usize = 16;

/// The right to stop the run.
pub(crate) struct Control {
    token: String,
    interrupt: Interrupt,
}

impl Control {
    /// Whoever knows the token in this file may stop the run.
    pub(crate) fn read(path: &Path, interrupt: Interrupt) -> Result<Self, Failure> {
        let name = path.display();
        let mut text = String::new();
        std::fs::File::open(path)
            .and_then(|file| file.take(4096).read_to_string(&mut text))
            .map_err(|error| {
                Failure::new(
                    format!("cannot read the token in {name}: {}", plain(&error)),
                    "the option names a file with a token in it, for example one that `openssl rand -hex 16` has made",
                )
            })?;
        let token = text.trim().to_owned();
        let is_safe = token.bytes().all(|byte| byte.is_ascii_graphic());
        if token.len() < LEAST_TOKEN || !is_safe {
            return Err(Failure::new(
                format!(
                    "the token in {name} is not one word of {LEAST_TOKEN} or more printable ASCII characters"
                ),
                "make one, for example with `openssl rand -hex 16`",
            ));
        }
        Ok(Self { token, interrupt })
    }

    fn allows(&self, request: &Request) -> bool {
        let headers = request.headers().iter();
        let mut given = headers.filter(|header| header.field.equiv("Authorization"));
        given
            .next()
            .is_some_and(|header| self.is_known_to(header.value.as_str()))
    }

    /// Whether this is the header of somebody who knows the token. Compares all bytes, so that the
    /// time it takes does not tell how many are right.
    pub(crate) fn is_known_to(&self, authorization: &str) -> bool {
        let expected = format!("Bearer {}", self.token);
        let given = authorization.as_bytes();
        let pairs = given.iter().zip(expected.as_bytes());
        let differences = pairs.fold(0, |differences, (a, b)| differences | (a ^ b));
        given.len() == expected.len() && differences == 0
    }

    /// The token itself, for those who ask in its name.
    pub(crate) fn token(&self) -> &str {
        &self.token
    }

    /// Has the run end in order.
    pub(crate) fn stop(&self) {
        self.interrupt.request();
    }
}

/// Whether a client asks for a server of this machine by one of its names: a page of somebody
/// else's, whose name leads here, may not read what is local.
pub(crate) fn is_local_name(host: &str) -> bool {
    let name = host.rsplit_once(':').map_or(host, |(name, _)| name);
    let ip = name.trim_matches(['[', ']']).parse::<IpAddr>();
    name.eq_ignore_ascii_case("localhost") || ip.is_ok_and(|ip| ip.is_loopback())
}

/// An address that the page is served at.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Address(pub(crate) SocketAddr);

impl Address {
    /// Reads `PORT`, `HOST:PORT` or `HOST`; without a host, the page is for this machine only.
    pub(crate) fn read(text: &str) -> Result<Self, String> {
        let local = IpAddr::from([127, 0, 0, 1]);
        if let Ok(port) = text.parse() {
            return Ok(Self(SocketAddr::new(local, port)));
        }
        if let Ok(host) = text.parse::<IpAddr>() {
            return Ok(Self(SocketAddr::new(host, 0)));
        }
        let found = text
            .to_socket_addrs()
            .or_else(|_| (text, 0).to_socket_addrs());
        // A number alone is meant as a port; as a name it would be an address in one number.
        let is_number = text.bytes().all(|byte| byte.is_ascii_digit());
        let found = found.ok().filter(|_| !is_number);
        let found = found.and_then(|mut all| all.next());
        found.map(Self).ok_or_else(|| {
            "it is no address; write a port such as 8080, or host and port such as 0.0.0.0:8080"
                .to_owned()
        })
    }
}

/// Serves the page of a run, and says where.
pub(crate) fn start(
    address: Address,
    board: Board,
    control: Option<Control>,
    desk: Option<Desk>,
) -> Result<(), Failure> {
    let failure = |why: &dyn fmt::Display| {
        Failure::new(
            format!("cannot serve the page at {}: {why}", address.0),
            "choose another port; with port 0, a free one is taken",
        )
    };
    let server = Server::http(address.0).map_err(|error| failure(&error))?;
    let own = server.server_addr().to_ip().unwrap_or(address.0);
    let with_token = if control.is_some() {
        "; with #token=TOKEN at its end, the run can be paused, cancelled and stopped there"
    } else {
        ""
    };
    output::tell(&format!("the run is shown at http://{own}/{with_token}"));
    let doorman = Arc::new(Doorman {
        clients: AtomicUsize::new(0),
        board,
        control,
        desk,
        own,
    });
    thread::spawn(move || {
        for request in server.incoming_requests() {
            Arc::clone(&doorman).admit(request);
        }
    });
    Ok(())
}

struct Doorman {
    clients: AtomicUsize,
    board: Board,
    control: Option<Control>,
    desk: Option<Desk>,
    own: SocketAddr,
}

impl Doorman {
    /// Serves a client in a thread of its own.
    fn admit(self: Arc<Self>, request: Request) {
        let clients = &self.clients;
        if clients.fetch_add(1, Ordering::SeqCst) >= MOST_CLIENTS {
            clients.fetch_sub(1, Ordering::SeqCst);
            let _ = request.respond(plain_text(503, "too many clients; come back later\n"));
            return;
        }
        thread::spawn(move || {
            // A client that has gone away needs no answer.
            let _ = self.serve(request);
            self.clients.fetch_sub(1, Ordering::SeqCst);
        });
    }

    fn serve(&self, request: Request) -> io::Result<()> {
        if !self.is_asked_for(&request) {
            return request.respond(plain_text(403, "this is not the page of that host\n"));
        }
        let path = request.url().split(['?', '#']).next().unwrap_or_default();
        match (request.method(), path) {
            (Method::Get, "/") => match self.board.page() {
                Ok(page) => request.respond(typed(200, page, "text/html; charset=utf-8")),
                Err(why) => request.respond(plain_text(500, &format!("{why}\n"))),
            },
            (Method::Get, "/document") => match self.board.document() {
                Ok(document) => request.respond(typed(200, document.to_string(), JSON)),
                Err(why) => request.respond(plain_text(500, &format!("{why}\n"))),
            },
            (Method::Get, "/events") => self.tell(request.into_writer()),
            (Method::Post, "/stop" | "/pause" | "/resume" | "/cancel") => {
                let answer = self.change(path, &request);
                request.respond(answer)
            }
            (_, "/" | "/document" | "/events" | "/stop" | "/pause" | "/resume" | "/cancel") => {
                request.respond(plain_text(405, "not this way\n"))
            }
            _ => request.respond(plain_text(404, "there is only one page here: /\n")),
        }
    }

    /// Whether the client wants this server.
    fn is_asked_for(&self, request: &Request) -> bool {
        if !self.own.ip().is_loopback() {
            return true;
        }
        let headers = request.headers().iter();
        let mut hosts = headers.filter(|header| header.field.equiv("Host"));
        hosts
            .next()
            .is_some_and(|header| is_local_name(header.value.as_str()))
    }

    fn change(&self, path: &str, request: &Request) -> Response<io::Cursor<Vec<u8>>> {
        let control = match &self.control {
            None => {
                return plain_text(
                    403,
                    "this page is for looking only: run it with --control FILE\n",
                );
            }
            Some(control) if !control.allows(request) => {
                return plain_text(401, "this is not the token\n");
            }
            Some(control) => control,
        };
        if path == "/stop" {
            control.interrupt.request();
            return plain_text(202, "The run is being stopped.\n");
        }
        let (ask, words) = match path {
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
        let handed = self
            .desk
            .as_ref()
            .map(|desk| desk.hand_in(vec![Ask::Request(ask)]));
        match handed {
            Some(Some(_)) => plain_text(202, words),
            Some(None) => plain_text(503, "too many requests wait for the run\n"),
            None => plain_text(409, "this run takes no requests but /stop\n"),
        }
    }

    fn tell(&self, mut client: Box<dyn Write + Send>) -> io::Result<()> {
        client.write_all(
            b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nCache-Control: no-store\r\n\
              X-Content-Type-Options: nosniff\r\nConnection: close\r\n\r\n",
        )?;
        client.flush()?;
        self.board.tell_changes(client.as_mut())
    }
}

const JSON: &str = "application/json";

fn plain_text(status: u16, text: &str) -> Response<io::Cursor<Vec<u8>>> {
    typed(status, text.to_owned(), "text/plain; charset=utf-8")
}

fn typed(status: u16, text: String, kind: &str) -> Response<io::Cursor<Vec<u8>>> {
    let headers = [
        ("Content-Type", kind),
        ("Cache-Control", "no-store"),
        ("X-Content-Type-Options", "nosniff"),
    ];
    let response = Response::from_string(text).with_status_code(status);
    headers.into_iter().fold(
        response,
        |response, (name, value)| match Header::from_bytes(name, value) {
            Ok(header) => response.with_header(header),
            Err(()) => response,
        },
    )
}
