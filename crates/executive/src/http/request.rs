//! Requests of clients: reading within limits, and parsing.

use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::time::Duration;

use httparse::Status;

use super::Stream;
use crate::clock::Clock;

/// Time limit for a client to send its request.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(5);

/// Limit on the request line and the headers, in bytes.
const MAX_HEAD: usize = 16 << 10;

/// Limit on the number of headers.
const MAX_HEADERS: usize = 100;

/// Limit on a body, in bytes.
const LONGEST_BODY: usize = 4 << 20;

/// Headers that must not be repeated, because readers disagree about their meaning then.
const SINGLETON_HEADERS: [&str; 4] = ["host", "content-length", "authorization", "origin"];

const HEADERS_TOO_LONG: RequestError = RequestError::new(431, "the headers are longer than 16 KB");

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
    pub(super) headers: BTreeMap<String, String>,
    /// Body; may be empty.
    pub body: Vec<u8>,
}

impl Request {
    /// Returns the value of a header. `name` is in lower case.
    pub fn header(&self, name: &str) -> Option<&str> {
        self.headers.get(name).map(String::as_str)
    }

    /// Returns the length of the body in bytes.
    ///
    /// # Errors
    /// When the length is unknown, invalid, or beyond the limit.
    fn body_length(&self) -> Result<usize, RequestError> {
        if self.header("transfer-encoding").is_some() {
            return Err(RequestError::new(
                411,
                "a body needs a Content-Length; chunked bodies are not supported",
            ));
        }
        let Some(length) = self.header("content-length") else {
            return Ok(0);
        };
        // `parse` alone would accept a sign.
        if length.is_empty() || !length.bytes().all(|byte| byte.is_ascii_digit()) {
            return Err(RequestError::new(400, "the Content-Length is not a number"));
        }
        let length = length.parse().ok();
        length
            .filter(|length| *length <= LONGEST_BODY)
            .ok_or(RequestError::new(413, "the body is longer than 4 MB"))
    }
}

/// Rejection of a request that is malformed or not admitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RequestError {
    /// Status code of the response.
    pub status: u16,
    /// Reason, in lower case.
    pub reason: &'static str,
}

impl RequestError {
    pub(super) const fn new(status: u16, reason: &'static str) -> Self {
        Self { status, reason }
    }
}

/// Reads a request.
pub(super) fn read(stream: &mut Stream) -> Result<Request, RequestError> {
    let clock = Clock::start();
    let mut text = Vec::new();
    let (mut request, length) = loop {
        let known = text.len();
        read_more(stream, &mut text, &clock)?;
        // A head ends with a line feed. Parsing after each byte would take quadratic time.
        let may_be_complete = text[known..].contains(&b'\n') || text.len() > MAX_HEAD;
        if may_be_complete && let Some(parsed) = parse_head(&text)? {
            break parsed;
        }
    };
    request.body = text.split_off(length);
    let length = request.body_length()?;
    if request.header("expect").is_some() {
        let _ = stream.write_all(b"HTTP/1.1 100 Continue\r\n\r\n");
    }
    while request.body.len() < length {
        read_more(stream, &mut request.body, &clock)?;
    }
    request.body.truncate(length);
    Ok(request)
}

/// Appends the bytes that have arrived to `text`, within the client's time limit.
fn read_more(stream: &mut Stream, text: &mut Vec<u8>, clock: &Clock) -> Result<(), RequestError> {
    let late = RequestError::new(408, "the request was not complete after 5 seconds");
    let left = REQUEST_TIMEOUT.saturating_sub(clock.elapsed());
    if left.is_zero() || stream.set_read_timeout(left).is_err() {
        return Err(late);
    }
    let mut bytes = [0; 8192];
    let count = stream.read(&mut bytes).map_err(|_| late)?;
    if count == 0 {
        return Err(RequestError::new(400, "the request is incomplete"));
    }
    text.extend_from_slice(&bytes[..count]);
    Ok(())
}

/// Parses the request line and the headers. Returns the request without its body, and the length of its head; `None`
/// if the head is incomplete.
fn parse_head(text: &[u8]) -> Result<Option<(Request, usize)>, RequestError> {
    let nonsense = RequestError::new(400, "this is not HTTP");
    let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
    let mut head = httparse::Request::new(&mut headers);
    let length = match head.parse(text) {
        Ok(Status::Complete(length)) if length <= MAX_HEAD => length,
        Ok(Status::Partial) if text.len() <= MAX_HEAD => return Ok(None),
        Ok(_) => return Err(HEADERS_TOO_LONG),
        Err(httparse::Error::TooManyHeaders) => {
            return Err(RequestError::new(431, "there are more than 100 headers"));
        }
        Err(_) => return Err(nonsense),
    };
    let (method, target) = head.method.zip(head.path).ok_or(nonsense)?;
    if !target.starts_with('/') {
        return Err(nonsense);
    }
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    let mut request = Request {
        method: method.to_owned(),
        path: path.to_owned(),
        query: query.to_owned(),
        ..Request::default()
    };
    for header in head.headers {
        let value = std::str::from_utf8(header.value);
        let value = value.map_err(|_| RequestError::new(400, "the headers are not UTF-8"))?;
        let name = header.name.to_ascii_lowercase();
        let is_single = SINGLETON_HEADERS.contains(&name.as_str());
        let earlier = request.headers.insert(name, value.trim().to_owned());
        if earlier.is_some() && is_single {
            return Err(RequestError::new(
                400,
                "a header that may occur only once occurs twice",
            ));
        }
    }
    Ok(Some((request, length)))
}

#[cfg(test)]
mod tests {
    use super::{MAX_HEAD, MAX_HEADERS, Request, RequestError, parse_head};

    const GET: &str = "GET /v1/events?after=3 HTTP/1.1\r\nHost: localhost\r\n";

    fn parsed(text: &str) -> Result<Request, RequestError> {
        let (request, length) = parse_head(text.as_bytes())?.expect("a complete head");
        assert!(length <= text.len());
        request.body_length()?;
        Ok(request)
    }

    #[test]
    fn head_is_parsed_and_ends_before_body() {
        let text = format!("{GET}X-A:  b c \r\n\r\n{{}}");
        let (request, length) = parse_head(text.as_bytes()).expect("valid").expect("whole");
        assert_eq!(&text[length..], "{}");
        let line = (request.method.as_str(), request.path.as_str());
        assert_eq!(line, ("GET", "/v1/events"));
        assert_eq!(request.query, "after=3");
        assert_eq!(request.header("host"), Some("localhost"));
        assert_eq!(request.header("x-a"), Some("b c"));
    }

    /// Each prefix of a valid head is incomplete, not wrong.
    #[test]
    fn incomplete_head_is_awaited() {
        let text = format!("{GET}Content-Length: 2\r\n\r\n");
        for end in 0..text.len() {
            let read = parse_head(&text.as_bytes()[..end]);
            assert!(matches!(read, Ok(None)), "{end}: {read:?}");
        }
        assert!(matches!(parse_head(text.as_bytes()), Ok(Some(_))));
    }

    #[test]
    fn malformed_and_ambiguous_heads_are_rejected() {
        let long = format!("{GET}X: {}\r\n\r\n", "y".repeat(MAX_HEAD));
        let many = format!("{GET}{}\r\n", "X: y\r\n".repeat(MAX_HEADERS));
        for (text, status) in [
            ("\0\u{1} nonsense\r\n\r\n".to_owned(), 400),
            ("GET /\r\n\r\n".to_owned(), 400),
            ("GET http://localhost/ HTTP/1.1\r\n\r\n".to_owned(), 400),
            ("PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n".to_owned(), 400),
            ("GET / HTTP/1.1 more\r\n\r\n".to_owned(), 400),
            (format!("{GET}X y\r\n\r\n"), 400),
            (format!("{GET}X : y\r\n\r\n"), 400),
            (format!("{GET}X: y\r\n folded\r\n\r\n"), 400),
            (format!("{GET}Host: localhost\r\n\r\n"), 400),
            (format!("{GET}Origin: a\r\norigin: a\r\n\r\n"), 400),
            (
                format!("{GET}Authorization: a\r\nAUTHORIZATION: a\r\n\r\n"),
                400,
            ),
            (
                format!("{GET}Content-Length: 1\r\nContent-Length: 1\r\n\r\n"),
                400,
            ),
            (format!("{GET}Content-Length: +1\r\n\r\n"), 400),
            (format!("{GET}Content-Length: 1, 1\r\n\r\n"), 400),
            (format!("{GET}Content-Length:\r\n\r\n"), 400),
            (format!("{GET}Content-Length: 4194305\r\n\r\n"), 413),
            (
                format!("{GET}Content-Length: 99999999999999999999\r\n\r\n"),
                413,
            ),
            (
                format!("{GET}Content-Length: 4\r\nTransfer-Encoding: chunked\r\n\r\n"),
                411,
            ),
            (long, 431),
            (many, 431),
        ] {
            let read = parsed(&text).map_err(|error| error.status);
            assert_eq!(read.err(), Some(status), "{}", &text[..text.len().min(99)]);
        }
        let endless = format!("{GET}X: {}", "y".repeat(MAX_HEAD));
        let read = parse_head(endless.as_bytes());
        assert_eq!(read.map(drop).map_err(|it| it.status), Err(431));
        let latin = [GET.as_bytes(), b"X: \xe9\r\n\r\n"].concat();
        let read = parse_head(&latin);
        assert_eq!(read.map(drop).map_err(|it| it.status), Err(400));
    }
}
