//! Listeners and connections over TCP or a Unix socket.

use std::io::{self, Read, Write};
use std::net::{IpAddr, Shutdown, TcpListener, TcpStream};
#[cfg(unix)]
use std::os::unix::net::{UnixListener, UnixStream};
use std::time::Duration;

use crate::clock::Clock;
use crate::trace_buffer::Subscriber;

/// Listening socket.
pub enum Listener {
    /// TCP.
    Tcp(TcpListener),
    /// Unix socket.
    #[cfg(unix)]
    Unix(UnixListener),
}

impl Listener {
    /// Waits for the next client.
    pub(super) fn accept(&self) -> io::Result<Stream> {
        match self {
            Self::Tcp(listener) => listener.accept().map(|(stream, _)| Stream::Tcp(stream)),
            #[cfg(unix)]
            Self::Unix(listener) => listener.accept().map(|(stream, _)| Stream::Unix(stream)),
        }
    }
}

/// Connection to a client or to a server.
pub enum Stream {
    /// TCP.
    Tcp(TcpStream),
    /// Unix socket.
    #[cfg(unix)]
    Unix(UnixStream),
}

/// Evaluates an expression with the inner stream.
macro_rules! either {
    ($stream:expr, $it:ident => $what:expr) => {
        match $stream {
            Stream::Tcp($it) => $what,
            #[cfg(unix)]
            Stream::Unix($it) => $what,
        }
    };
}

impl Stream {
    pub(super) fn set_read_timeout(&self, limit: Duration) -> io::Result<()> {
        either!(self, it => it.set_read_timeout(Some(limit)))
    }

    pub(super) fn set_write_timeout(&self, limit: Duration) -> io::Result<()> {
        either!(self, it => it.set_write_timeout(Some(limit)))
    }

    /// Returns another handle of the same connection.
    pub(super) fn try_clone(&self) -> io::Result<Self> {
        match self {
            Self::Tcp(stream) => stream.try_clone().map(Self::Tcp),
            #[cfg(unix)]
            Self::Unix(stream) => stream.try_clone().map(Self::Unix),
        }
    }

    /// Returns the address of the client, if it has one.
    pub(super) fn peer(&self) -> Option<IpAddr> {
        match self {
            Self::Tcp(stream) => Some(stream.peer_addr().ok()?.ip()),
            #[cfg(unix)]
            Self::Unix(_) => None,
        }
    }

    /// Ends the connection at once. Reads and writes through other handles fail then.
    pub(super) fn shut_down(&self) {
        let _ = either!(self, it => it.shutdown(Shutdown::Both));
    }

    /// Closes the connection. Remaining bytes of the client are read for 200 ms: a reset could discard the response
    /// before the client reads it.
    pub(super) fn close(mut self) {
        const LINGER: Duration = Duration::from_millis(200);
        let _ = either!(&self, it => it.shutdown(Shutdown::Write));
        let _ = self.set_read_timeout(LINGER);
        let (clock, mut bytes) = (Clock::start(), [0; 8192]);
        while clock.elapsed() < LINGER {
            match self.read(&mut bytes) {
                Ok(0) | Err(_) => break,
                Ok(_) => {}
            }
        }
    }
}

impl Subscriber for Stream {
    /// Reads without waiting, and drops the bytes that the client has sent.
    fn has_disconnected(&mut self) -> bool {
        let _ = either!(self, it => it.set_nonblocking(true));
        let read = self.read(&mut [0; 1024]);
        let _ = either!(self, it => it.set_nonblocking(false));
        match read {
            Ok(count) => count == 0,
            Err(error) => !matches!(
                error.kind(),
                io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted
            ),
        }
    }
}

impl Read for Stream {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        either!(self, it => it.read(bytes))
    }
}

impl Write for Stream {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        either!(self, it => it.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        either!(self, it => it.flush())
    }
}
