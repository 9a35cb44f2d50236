//! Subset of HTTP/1.1 for an executive and its client, over TCP and Unix sockets: one request per connection,
//! bodies of known length, limits on time, size and number of clients.

mod access;
mod admission;
mod client;
mod request;
mod stream;

use std::io::{self, Write as _};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

pub use access::{AccessControl, Address, is_local_name};
pub use client::{Response, Target, send};
pub use request::{Request, RequestError};
pub use stream::{Listener, Stream};

use admission::Admission;
use request::read;

/// Time limit for a client to read a part of its response.
const WRITE_TIMEOUT: Duration = Duration::from_secs(10);

/// Serves clients, each in a separate thread, until the program ends. Returns at once. `is_known`
/// returns `true` for requests with the token; clients without it cannot exhaust their limits.
/// `handler` writes the response.
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
            "only HTTP/1.1 is supported; send the request without the header `Upgrade`",
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
            "requests from pages of other origins are not accepted",
        ));
    }
    Ok(())
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
