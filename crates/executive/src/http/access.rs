//! Access to an executive over HTTP: the token, and addresses.

use std::io::Read as _;
use std::net::{IpAddr, SocketAddr, ToSocketAddrs as _};
use std::path::Path;

use elbowroom::num::work::Stop;

use super::Request;
use crate::error::Error;
use crate::messages::io_error_message;

/// Minimum length of a token, in bytes.
const MIN_TOKEN_LENGTH: usize = 16;

/// Access token: its holders may change and stop the run.
pub struct AccessControl {
    token: String,
    stop: Stop,
}

impl AccessControl {
    /// Reads the token from a file. `stop` is the stop request of the run.
    ///
    /// # Errors
    /// When the file cannot be read, other users can read it, or it does not contain a token.
    pub fn read(path: &Path, stop: Stop) -> Result<Self, Error> {
        let name = path.display();
        let mut text = String::new();
        let read = std::fs::File::open(path).and_then(|file| {
            let is_shared = is_shared(&file);
            file.take(4096).read_to_string(&mut text)?;
            Ok(is_shared)
        });
        let is_shared = read.map_err(|error| {
            Error::new(
                format!(
                    "cannot read the token in {name}: {}",
                    io_error_message(&error)
                ),
                format!(
                    "the option expects a file that contains a token; {}",
                    token_file_advice(path)
                ),
            )
        })?;
        if is_shared {
            return Err(Error::new(
                format!("other users can read or change the token in {name}"),
                format!(
                    "`chmod 600 {name}`, and make a new token if others may have seen this one"
                ),
            ));
        }
        let token = text.trim().to_owned();
        let is_safe = token.bytes().all(|byte| byte.is_ascii_graphic());
        if token.len() < MIN_TOKEN_LENGTH || !is_safe {
            return Err(Error::new(
                format!(
                    "the token in {name} is not one word of {MIN_TOKEN_LENGTH} or more printable ASCII characters"
                ),
                token_file_advice(path),
            ));
        }
        Ok(Self { token, stop })
    }

    /// Returns `true` if the request has the token.
    pub fn allows(&self, request: &Request) -> bool {
        let given = request.header("authorization");
        given.is_some_and(|given| self.accepts(given))
    }

    /// Returns `true` if this value of the header `Authorization` contains the token. Compares in constant time.
    pub fn accepts(&self, authorization: &str) -> bool {
        let expected = format!("Bearer {}", self.token);
        let given = authorization.as_bytes();
        let pairs = given.iter().zip(expected.as_bytes());
        let differences = pairs.fold(0, |differences, (a, b)| differences | (a ^ b));
        given.len() == expected.len() && differences == 0
    }

    /// Returns the token, for a client that sends it.
    pub fn token(&self) -> &str {
        &self.token
    }

    /// Requests an orderly shutdown of the run.
    pub fn stop(&self) {
        self.stop.request();
    }
}

/// Returns advice on how to make a file with a token that only its owner can read.
fn token_file_advice(path: &Path) -> String {
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

/// Returns `true` for a local name in the header `Host`. A web page whose name resolves to this machine must not read
/// a local server.
pub fn is_local_name(host: &str) -> bool {
    let name = host.rsplit_once(':').map_or(host, |(name, _)| name);
    let ip = name.trim_matches(['[', ']']).parse::<IpAddr>();
    name.eq_ignore_ascii_case("localhost") || ip.is_ok_and(|ip| ip.is_loopback())
}

/// Address of a server.
#[derive(Clone, Copy, Debug)]
pub struct Address(pub SocketAddr);

impl Address {
    /// Reads `PORT`, `HOST:PORT` or `HOST`. The default host is this machine.
    ///
    /// # Errors
    /// When the text is none of these; the error states the expected forms.
    pub fn read(text: &str) -> Result<Self, String> {
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
        // A number is a port out of range here, not an address in one number.
        let is_number = text.bytes().all(|byte| byte.is_ascii_digit());
        let found = found.ok().filter(|_| !is_number);
        let found = found.and_then(|mut all| all.next());
        found.map(Self).ok_or_else(|| {
            "expected an address: a port such as 8080, or host and port such as 0.0.0.0:8080"
                .to_owned()
        })
    }
}
