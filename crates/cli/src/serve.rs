//! The page of a run while it runs: a server for browsers.
//!
//! The run hands over its trace line by line ([`Board`]) and never waits: pages are made, and sent,
//! by threads of the server, each of which serves one client.

use std::fmt;
use std::io::{self, Read as _};
use std::net::{IpAddr, SocketAddr, TcpListener, ToSocketAddrs as _};
use std::path::Path;
use std::sync::Arc;

use elbowroom::execution::run::FIRST_GOAL;

pub(crate) use crate::board::{Board, NAME};
use crate::desk::{Ask, Desk};
use crate::exit::Failure;
use crate::http::{self, Listener, Misunderstood, Request, Stream, respond, respond_with_events};
use crate::interrupt::Interrupt;
use crate::output;
use crate::words::plain;

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
        let read = std::fs::File::open(path).and_then(|file| {
            let is_shared = is_shared(&file);
            file.take(4096).read_to_string(&mut text)?;
            Ok(is_shared)
        });
        let is_shared = read.map_err(|error| {
            Failure::new(
                format!("cannot read the token in {name}: {}", plain(&error)),
                format!(
                    "the option names a file with a token in it; {}",
                    making(path)
                ),
            )
        })?;
        if is_shared {
            return Err(Failure::new(
                format!("other users can read or change the token in {name}"),
                format!(
                    "`chmod 600 {name}`, and make a new token if others may have seen this one"
                ),
            ));
        }
        let token = text.trim().to_owned();
        let is_safe = token.bytes().all(|byte| byte.is_ascii_graphic());
        if token.len() < LEAST_TOKEN || !is_safe {
            return Err(Failure::new(
                format!(
                    "the token in {name} is not one word of {LEAST_TOKEN} or more printable ASCII characters"
                ),
                making(path),
            ));
        }
        Ok(Self { token, interrupt })
    }

    fn allows(&self, request: &Request) -> bool {
        let given = request.header("authorization");
        given.is_some_and(|given| self.is_known_to(given))
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

/// Returns the advice how to make a file with a token that only its owner can read.
fn making(path: &Path) -> String {
    let name = path.display();
    format!("make one, for example with `(umask 077; openssl rand -hex 16 > {name})`")
}

/// Returns `true` for a file that users other than its owner can read or write.
fn is_shared(file: &std::fs::File) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        let metadata = file.metadata();
        metadata.is_ok_and(|it| it.is_file() && it.permissions().mode() & 0o077 != 0)
    }
    #[cfg(not(unix))]
    {
        let _ = file;
        false
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
    let listener = TcpListener::bind(address.0).map_err(|error| failure(&plain(&error)))?;
    let own = listener.local_addr().unwrap_or(address.0);
    let with_token = if control.is_some() {
        "; with #token=TOKEN at its end, the run can be paused, cancelled and stopped there"
    } else {
        ""
    };
    output::tell(&format!("the run is shown at http://{own}/{with_token}"));
    let shown = Arc::new(Shown {
        board,
        control,
        desk,
        own,
    });
    let known = Arc::clone(&shown);
    let is_known = move |request: &Request| {
        let control = known.control.as_ref();
        control.is_some_and(|control| control.allows(request))
    };
    http::serve(Listener::Tcp(listener), is_known, move |request, stream| {
        shown.serve(request, stream)
    });
    Ok(())
}

/// A run, with its page for clients.
struct Shown {
    board: Board,
    control: Option<Control>,
    desk: Option<Desk>,
    own: SocketAddr,
}

impl Shown {
    fn serve(
        &self,
        request: Result<Request, Misunderstood>,
        stream: &mut Stream,
    ) -> io::Result<()> {
        let mut plain = |status, text: &str| respond(stream, status, TEXT, text);
        let request = match request {
            Ok(request) => request,
            Err(Misunderstood(status, why)) => return plain(status, &format!("{why}\n")),
        };
        let host = request.header("host");
        if self.own.ip().is_loopback() && !host.is_some_and(is_local_name) {
            return plain(403, "this is not the page of that host\n");
        }
        match (request.verb.as_str(), request.path.as_str()) {
            ("GET", "/") => match self.board.page() {
                Ok(page) => respond(stream, 200, "text/html; charset=utf-8", &page),
                Err(why) => plain(500, &format!("{why}\n")),
            },
            ("GET", "/document") => match self.board.document() {
                Ok(document) => respond(stream, 200, "application/json", &document),
                Err(why) => plain(500, &format!("{why}\n")),
            },
            ("GET", "/events") => {
                respond_with_events(stream)?;
                self.board.tell_changes(stream)
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
            control.interrupt.request();
            return (202, "The run is being stopped.\n");
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
            Some(Some(_)) => (202, words),
            Some(None) => (503, "too many requests wait for the run\n"),
            None => (409, "this run takes no requests but /stop\n"),
        }
    }
}

const TEXT: &str = "text/plain; charset=utf-8";
