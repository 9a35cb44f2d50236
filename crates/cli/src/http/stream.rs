//! Connections, whatever they go through.

use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
#[cfg(unix)]
use std::os::unix::net::{UnixListener, UnixStream};
use std::time::Duration;

/// Where clients are awaited.
pub(crate) enum Listener {
    Tcp(TcpListener),
    #[cfg(unix)]
    Unix(UnixListener),
}

impl Listener {
    /// The next client.
    pub(super) fn accept(&self) -> io::Result<Stream> {
        match self {
            Self::Tcp(listener) => listener.accept().map(|(stream, _)| Stream::Tcp(stream)),
            #[cfg(unix)]
            Self::Unix(listener) => listener.accept().map(|(stream, _)| Stream::Unix(stream)),
        }
    }
}

/// A connection.
pub(crate) enum Stream {
    Tcp(TcpStream),
    #[cfg(unix)]
    Unix(UnixStream),
}

/// Does the same with either.
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

    /// Ends the connection. What the client still says is read for a moment, so that it gets the
    /// answer before it hears that nobody listens.
    pub(super) fn close(mut self) {
        let _ = either!(&self, it => it.shutdown(Shutdown::Write));
        let _ = self.set_read_timeout(Duration::from_millis(200));
        let mut bytes = [0; 8192];
        for _ in 0..64 {
            match self.read(&mut bytes) {
                Ok(0) | Err(_) => break,
                Ok(_) => {}
            }
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
