//! Limits on the clients of a listener. Clients without the token cannot exhaust the limits of clients with it.

use std::collections::{BTreeMap, VecDeque};
use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::{Request, RequestError, Stream};

/// Limit on clients whose requests are being read. Beyond it, the oldest of these connections is closed. A
/// request usually arrives at once, so idle connections are closed first.
const MAX_READING: usize = 64;

/// Limit on concurrent clients with the token, and on those without.
const MAX_SERVED: usize = 64;

/// Limit on concurrent event streams without the token.
const MAX_STREAMS: usize = 32;

/// Limit on concurrent clients without the token from one address of another machine.
const MAX_PER_PEER: usize = 16;

/// Clients of a listener.
#[derive(Clone, Default)]
pub(super) struct Admission(Arc<Mutex<Clients>>);

#[derive(Default)]
struct Clients {
    /// Number of connections so far.
    connections: u64,
    /// Connections whose requests are being read, oldest first.
    reading: VecDeque<(u64, Stream)>,
    /// Number of clients with the token.
    known: usize,
    /// Number of clients without the token.
    others: usize,
    /// Number of event streams among the latter.
    streams: usize,
    /// Number of clients without the token by address.
    of_peer: BTreeMap<IpAddr, usize>,
}

/// Guard of a client whose request is being read.
pub(super) struct Reading {
    admission: Admission,
    connection: u64,
}

/// Guard of a client that is being served.
pub(super) struct Served {
    admission: Admission,
    class: Class,
}

/// Class of a client.
#[derive(Clone, Copy)]
enum Class {
    /// Client with the token.
    Known,
    /// Client without the token, with its address unless it is on this machine.
    Other {
        peer: Option<IpAddr>,
        is_stream: bool,
    },
}

impl Admission {
    fn clients(&self) -> MutexGuard<'_, Clients> {
        // No change of the counters can panic.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Registers a client whose request is read.
    pub(super) fn read(&self, stream: &Stream) -> Reading {
        let mut clients = self.clients();
        clients.connections += 1;
        let connection = clients.connections;
        if clients.reading.len() >= MAX_READING
            && let Some((_, oldest)) = clients.reading.pop_front()
        {
            oldest.shut_down();
        }
        if let Ok(stream) = stream.try_clone() {
            clients.reading.push_back((connection, stream));
        }
        let admission = self.clone();
        Reading {
            admission,
            connection,
        }
    }

    /// Registers a client that is served; `is_known` if it has the token.
    ///
    /// # Errors
    /// When the limit of its class is reached.
    pub(super) fn serve(
        &self,
        request: &Request,
        peer: Option<IpAddr>,
        is_known: bool,
    ) -> Result<Served, RequestError> {
        let class = if is_known {
            Class::Known
        } else {
            let is_stream = request.path.ends_with("/events");
            let peer = peer.filter(|peer| !peer.is_loopback());
            Class::Other { peer, is_stream }
        };
        let mut clients = self.clients();
        match class {
            Class::Known if clients.known >= MAX_SERVED => {
                return Err(RequestError::new(
                    503,
                    "too many clients with the token; try again later",
                ));
            }
            Class::Known => clients.known += 1,
            Class::Other { peer, is_stream } => {
                let of_peer = peer.and_then(|peer| clients.of_peer.get(&peer).copied());
                let is_too_many = clients.others >= MAX_SERVED
                    || of_peer.unwrap_or(0) >= MAX_PER_PEER
                    || is_stream && clients.streams >= MAX_STREAMS;
                if is_too_many {
                    return Err(RequestError::new(
                        503,
                        "too many clients without the token; try again later",
                    ));
                }
                clients.others += 1;
                clients.streams += usize::from(is_stream);
                if let Some(peer) = peer {
                    *clients.of_peer.entry(peer).or_default() += 1;
                }
            }
        }
        let admission = self.clone();
        Ok(Served { admission, class })
    }
}

impl Drop for Reading {
    fn drop(&mut self) {
        let mut clients = self.admission.clients();
        clients.reading.retain(|(own, _)| *own != self.connection);
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let mut clients = self.admission.clients();
        match self.class {
            Class::Known => clients.known -= 1,
            Class::Other { peer, is_stream } => {
                clients.others -= 1;
                clients.streams -= usize::from(is_stream);
                let count = peer.and_then(|peer| clients.of_peer.get_mut(&peer));
                if let Some(count) = count {
                    *count -= 1;
                }
                clients.of_peer.retain(|_, count| *count > 0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(path: &str) -> Request {
        Request {
            path: path.to_owned(),
            ..Request::default()
        }
    }

    #[test]
    fn unauthenticated_clients_leave_capacity_for_authenticated_ones() {
        let admission = Admission::default();
        let (state, events) = (request("/v1/state"), request("/v1/events"));
        let serve = |request, peer: Option<&str>, is_known| {
            let peer = peer.map(|peer| peer.parse().expect("an address"));
            admission.serve(request, peer, is_known).ok()
        };
        let local = Some("127.0.0.1");
        let streams: Vec<_> = std::iter::from_fn(|| serve(&events, local, false)).collect();
        assert_eq!(streams.len(), MAX_STREAMS);
        let far: Vec<_> = std::iter::from_fn(|| serve(&state, Some("192.0.2.1"), false)).collect();
        assert_eq!(far.len(), MAX_PER_PEER);
        let others: Vec<_> = std::iter::from_fn(|| serve(&state, None, false)).collect();
        assert_eq!(streams.len() + far.len() + others.len(), MAX_SERVED);
        let known: Vec<_> = std::iter::from_fn(|| serve(&events, local, true)).collect();
        assert_eq!(known.len(), MAX_SERVED);
        drop((streams, far, others, known));
        let clients = admission.clients();
        assert_eq!((clients.known, clients.others, clients.streams), (0, 0, 0));
        assert!(clients.of_peer.is_empty());
    }
}
