//! Subset of HTTP/1.1 for an executive and its client, over TCP and Unix sockets: one request per connection,
//! bodies of known length, limits on time, size and number of clients.

mod access;
mod admission;
mod client;
mod stream;

use std::collections::BTreeMap;
use std::io::{self, Read as _, Write as _};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

pub use access::{AccessControl, Address, is_local_name};
pub use client::{Response, Target, send};
pub use stream::{Listener, Stream};

use crate::clock::Clock;
use admission::Admission;

/// Time limit for a client to send its request.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(5);

/// Time limit for a client to read a part of its response.
const WRITE_TIMEOUT: Duration = Duration::from_secs(10);

/// Limit on the request line and the headers, in bytes.
const LONGEST_HEAD: usize = 16 << 10;

/// Limit on a body, in bytes.
pub const LONGEST_BODY: usize = 4 << 20;

/// Headers that must not be repeated, because readers disagree about their meaning then.
const SINGLE: [&str; 4] = ["host", "content-length", "authorization", "origin"];

/// Request of a client.
#[derive(Debug, Default)]
pub struct Request {
    /// Method, such as `GET`.
    pub method: String,
    /// Path without the query.
    pub path: String,
    /// Query without the question mark; may be empty.
    pub query: String,
    /// Headers by name, in lower case.
    headers: BTreeMap<String, String>,
    /// Body; may be empty.
    pub body: Vec<u8>,
}

impl Request {
    /// Returns the value of a header. `name` is in lower case.
    pub fn header(&self, name: &str) -> Option<&str> {
        self.headers.get(name).map(String::as_str)
    }
}

/// Rejection of a request that is malformed or not admitted.
#[derive(Clone, Copy, Debug)]
pub struct RequestError {
    /// Status code of the response.
    pub status: u16,
    /// Reason, in lower case.
    pub reason: &'static str,
}

impl RequestError {
    const fn new(status: u16, reason: &'static str) -> Self {
        Self { status, reason }
    }
}

/// Serves clients, each in a thread of its own, until the program ends. Returns at once. `is_known` returns `true` for
/// requests with the token; clients without it cannot exhaust their limits. `handler` writes the response.
pub fn serve(
    listener: Listener,
    is_known: impl Fn(&Request) -> bool + Send + Sync + 'static,
    handler: impl Fn(Result<Request, RequestError>, &mut Stream) -> io::Result<()>
    + Send
    + Sync
    + 'static,
) {
    let (admission, is_known, handler) =
        (Admission::default(), Arc::new(is_known), Arc::new(handler));
    thread::spawn(move || {
        loop {
            let Ok(mut stream) = listener.accept() else {
                // Possibly out of file descriptors; others will be closed.
                thread::sleep(Duration::from_millis(50));
                continue;
            };
            let (admission, is_known) = (admission.clone(), Arc::clone(&is_known));
            let handler = Arc::clone(&handler);
            // Without a thread, the client is disconnected.
            let _ = thread::Builder::new().spawn(move || {
                let _ = stream.set_write_timeout(WRITE_TIMEOUT);
                let reading = admission.read(&stream);
                let request = read(&mut stream);
                drop(reading);
                let admitted = request.and_then(|request| {
                    reject_foreign(&request)?;
                    let served = admission.serve(&request, stream.peer(), is_known(&request));
                    served.map(|served| (request, served))
                });
                // Disconnected clients need no response.
                let _ = match admitted {
                    Ok((request, _served)) => handler(Ok(request), &mut stream),
                    Err(why) => handler(Err(why), &mut stream),
                };
                stream.close();
            });
        }
    });
}

/// Rejects requests that a browser sends for a page of another origin, and requests for another protocol.
fn reject_foreign(request: &Request) -> Result<(), RequestError> {
    if request.header("upgrade").is_some() {
        return Err(RequestError::new(
            400,
            "this is HTTP/1.1 alone; ask without the header `Upgrade`",
        ));
    }
    let host = request.header("host").unwrap_or_default();
    let is_own = |origin: &str| {
        let own = origin.strip_prefix("http://");
        let own = own.or_else(|| origin.strip_prefix("https://"));
        own.is_some_and(|own| own.eq_ignore_ascii_case(host))
    };
    let is_foreign = !request.header("origin").is_none_or(is_own);
    let site = request.header("sec-fetch-site");
    let is_elsewhere = matches!(site, Some("cross-site" | "same-site"));
    let is_visit = request.header("sec-fetch-mode") == Some("navigate") && request.method == "GET";
    if is_foreign || is_elsewhere && !is_visit {
        return Err(RequestError::new(
            403,
            "a page from elsewhere may not ask this",
        ));
    }
    Ok(())
}

const CUT_OFF: RequestError = RequestError::new(400, "the request ends in the middle");

/// Reads a request.
fn read(stream: &mut Stream) -> Result<Request, RequestError> {
    let clock = Clock::start();
    let mut text = Vec::new();
    let end = loop {
        if let Some(end) = text.windows(4).position(|bytes| bytes == b"\r\n\r\n") {
            break end;
        }
        if text.len() > LONGEST_HEAD {
            return Err(RequestError::new(431, "the headers are longer than 16 KB"));
        }
        if read_more(stream, &mut text, &clock)? == 0 {
            return Err(CUT_OFF);
        }
    };
    let body = text.split_off(end + 4);
    let head = String::from_utf8(text);
    let head = head.map_err(|_| RequestError::new(400, "the headers are not UTF-8"))?;
    let mut request = parse_head(&head)?;
    request.body = body;
    if request.header("transfer-encoding").is_some() {
        return Err(RequestError::new(
            411,
            "a body needs a Content-Length; it cannot come in chunks",
        ));
    }
    let length = match request.header("content-length") {
        None => 0,
        Some(length) => {
            let length = length.parse::<usize>();
            length.map_err(|_| RequestError::new(400, "the Content-Length is no number"))?
        }
    };
    if length > LONGEST_BODY {
        return Err(RequestError::new(413, "the body is longer than 4 MB"));
    }
    if request.header("expect").is_some() {
        let _ = stream.write_all(b"HTTP/1.1 100 Continue\r\n\r\n");
    }
    while request.body.len() < length {
        if read_more(stream, &mut request.body, &clock)? == 0 {
            return Err(CUT_OFF);
        }
    }
    request.body.truncate(length);
    Ok(request)
}

/// Appends the bytes that have arrived to `text`, within the client's time limit. Returns their number.
fn read_more(
    stream: &mut Stream,
    text: &mut Vec<u8>,
    clock: &Clock,
) -> Result<usize, RequestError> {
    let late = RequestError::new(408, "the request was not complete after 5 seconds");
    let left = REQUEST_TIMEOUT.saturating_sub(clock.elapsed());
    if left.is_zero() || stream.set_read_timeout(left).is_err() {
        return Err(late);
    }
    let mut bytes = [0; 8192];
    let count = stream.read(&mut bytes).map_err(|_| late)?;
    text.extend_from_slice(&bytes[..count]);
    Ok(count)
}

/// Parses the request line and the headers.
fn parse_head(head: &str) -> Result<Request, RequestError> {
    let nonsense = || RequestError::new(400, "this is not HTTP");
    let mut lines = head.split("\r\n");
    let mut words = lines.next().unwrap_or_default().split(' ');
    let (Some(method), Some(target), Some(version), None) =
        (words.next(), words.next(), words.next(), words.next())
    else {
        return Err(nonsense());
    };
    if !version.starts_with("HTTP/1.") || !target.starts_with('/') {
        return Err(nonsense());
    }
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    let mut request = Request {
        method: method.to_owned(),
        path: path.to_owned(),
        query: query.to_owned(),
        ..Request::default()
    };
    for line in lines.filter(|line| !line.is_empty()) {
        let (name, value) = line.split_once(':').ok_or_else(nonsense)?;
        let (name, value) = (name.to_ascii_lowercase(), value.trim().to_owned());
        let is_single = SINGLE.contains(&name.as_str());
        if request.headers.insert(name, value).is_some() && is_single {
            return Err(RequestError::new(
                400,
                "a header that may be there once is there twice",
            ));
        }
    }
    Ok(request)
}

/// Sends a complete response. `kind` is the content type.
///
/// # Errors
/// When the client cannot be written to.
pub fn respond(stream: &mut Stream, status: u16, kind: &str, text: &str) -> io::Result<()> {
    let head = format!(
        "HTTP/1.1 {status} {}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\n\
         Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\nConnection: close\r\n\r\n",
        phrase(status),
        text.len()
    );
    stream.write_all(head.as_bytes())?;
    stream.write_all(text.as_bytes())?;
    stream.flush()
}

/// Sends the head of a response that is a stream of events.
///
/// # Errors
/// When the client cannot be written to.
pub fn respond_with_events(stream: &mut Stream) -> io::Result<()> {
    stream.write_all(
        b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nCache-Control: no-store\r\n\
          X-Content-Type-Options: nosniff\r\nConnection: close\r\n\r\n",
    )?;
    stream.flush()
}

/// Returns the reason phrase of a status code.
fn phrase(status: u16) -> &'static str {
    match status {
        200 => "OK",
        202 => "Accepted",
        400 => "Bad Request",
        401 => "Unauthorized",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        408 => "Request Timeout",
        409 => "Conflict",
        411 => "Length Required",
        413 => "Content Too Large",
        422 => "Unprocessable Content",
        431 => "Request Header Fields Too Large",
        503 => "Service Unavailable",
        _ => "Internal Server Error",
    }
}
