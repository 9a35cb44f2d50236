//! HTTP client for an executive.

use std::io::{self, BufRead, BufReader, Read as _, Write as _};
use std::net::TcpStream;
#[cfg(unix)]
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::time::Duration;

use super::Stream;

/// Timeout for the response.
const RESPONSE_TIMEOUT: Duration = Duration::from_secs(30);

/// Limit on the status line and the headers of a response, in bytes.
const MAX_HEAD: u64 = 64 << 10;

/// Limit on the number of headers of a response.
const MAX_HEADERS: usize = 100;

/// Limit on a response, in bytes.
const MAX_RESPONSE: u64 = 256 << 20;

/// Address of an executive.
#[derive(Clone, Debug)]
pub enum Target {
    /// `HOST:PORT`.
    Tcp(String),
    /// Path of a Unix socket.
    Socket(PathBuf),
}

impl Target {
    /// Reads `PORT`, `HOST:PORT`, or the path of a socket, which contains a slash.
    ///
    /// # Errors
    /// When the text is none of these; the error states the expected forms.
    pub fn read(text: &str) -> Result<Self, String> {
        let text = text.trim_start_matches("http://").trim_end_matches('/');
        if text.contains('/') {
            return Ok(Self::Socket(PathBuf::from(text)));
        }
        if text.parse::<u16>().is_ok() {
            return Ok(Self::Tcp(format!("127.0.0.1:{text}")));
        }
        match text.rsplit_once(':') {
            Some((host, port)) if !host.is_empty() && port.parse::<u16>().is_ok() => {
                Ok(Self::Tcp(text.to_owned()))
            }
            _ => Err(
                "write a port such as 7316, HOST:PORT, or the path of a socket such as \
                 ./robot.sock"
                    .to_owned(),
            ),
        }
    }

    fn connect(&self) -> io::Result<Stream> {
        match self {
            Self::Tcp(address) => TcpStream::connect(address.as_str()).map(Stream::Tcp),
            #[cfg(unix)]
            Self::Socket(path) => UnixStream::connect(path).map(Stream::Unix),
            #[cfg(not(unix))]
            Self::Socket(_) => Err(io::Error::other("this system has no Unix sockets")),
        }
    }
}

impl std::fmt::Display for Target {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Tcp(address) => f.write_str(address),
            Self::Socket(path) => path.display().fmt(f),
        }
    }
}

/// Response of an executive.
pub struct Response {
    /// Status code.
    pub status: u16,
    body: BufReader<Stream>,
}

impl Response {
    /// Reads the whole body.
    ///
    /// # Errors
    /// When the connection fails, or the body is not UTF-8.
    pub fn text(self) -> io::Result<String> {
        let mut text = String::new();
        self.body.take(MAX_RESPONSE).read_to_string(&mut text)?;
        Ok(text)
    }

    /// Returns the lines of the body as they arrive, without a timeout.
    pub fn lines(self) -> impl Iterator<Item = io::Result<String>> {
        let _ = self
            .body
            .get_ref()
            .set_read_timeout(Duration::from_secs(u64::from(u32::MAX)));
        self.body.lines()
    }
}

/// Sends a request: method, path, access token and JSON body. Returns when the head of the response has arrived.
///
/// # Errors
/// When there is no connection, the response takes more than 30 s, or it is not HTTP.
pub fn send(
    target: &Target,
    (method, path): (&str, &str),
    token: Option<&str>,
    body: Option<&str>,
) -> io::Result<Response> {
    let mut stream = target.connect()?;
    stream.set_read_timeout(RESPONSE_TIMEOUT)?;
    stream.set_write_timeout(RESPONSE_TIMEOUT)?;
    let body = body.unwrap_or_default();
    let token = token.map_or(String::new(), |token| {
        format!("Authorization: Bearer {token}\r\n")
    });
    let request = format!(
        "{method} {path} HTTP/1.1\r\nHost: localhost\r\n{token}Content-Type: application/json\r\n\
         Content-Length: {}\r\nConnection: close\r\n\r\n{body}",
        body.len()
    );
    stream.write_all(request.as_bytes())?;
    stream.flush()?;
    let mut body = BufReader::new(stream);
    let status = read_head(&mut body)?;
    Ok(Response { status, body })
}

/// Reads the status line and the headers of a response. Returns the status code.
fn read_head(response: &mut impl BufRead) -> io::Result<u16> {
    let nonsense = || io::Error::other("the answer is not HTTP");
    let mut limited = response.take(MAX_HEAD);
    let mut head = Vec::new();
    while limited.read_until(b'\n', &mut head)? > 0 {
        let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
        let mut parsed = httparse::Response::new(&mut headers);
        let status = parsed.parse(&head).map_err(|_| nonsense())?;
        if status.is_complete() {
            return parsed.code.ok_or_else(nonsense);
        }
    }
    Err(nonsense())
}
