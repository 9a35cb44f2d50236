//! Answers to clients whose readers may not have been discovered.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use rustdds::no_key::DataWriterCdr;
use rustdds::{GUID, Timestamp, WriteOptionsBuilder};
use serde::Serialize;

use super::super::clock::now;
use super::{Framed, RequestId, note_readers};

/// Delay of an answer to a reader that has not been discovered. Then it is sent without waiting any longer.
const DISCOVERY_TIMEOUT: Duration = Duration::from_secs(2);

/// Period for which an answer is kept and sent again once its reader is discovered, because the first one did not reach
/// it. Fast DDS repeats a lost announcement after three seconds, and a repetition can be lost as well.
const RETENTION: Duration = Duration::from_secs(30);

/// Answer to a client whose reader may not have been discovered.
struct Waiting<T> {
    asker: RequestId,
    response: T,
    since: Instant,
    is_sent: bool,
}

/// Answers of a service.
pub(crate) struct ServiceReplies<T: Serialize> {
    writer: DataWriterCdr<Framed<T>>,
    /// Discovered readers. An answer to another one is lost.
    readers: BTreeSet<GUID>,
    waiting: Vec<Waiting<T>>,
}

impl<T: Serialize> ServiceReplies<T> {
    pub(super) fn new(writer: DataWriterCdr<Framed<T>>) -> Self {
        Self {
            writer,
            readers: BTreeSet::new(),
            waiting: Vec::new(),
        }
    }
}

impl<T: Serialize + Clone> ServiceReplies<T> {
    /// Answers a request, at once or when the reader of the client is discovered.
    ///
    /// # Errors
    /// It could not be sent.
    pub(crate) fn answer(&mut self, asker: RequestId, response: T) -> Result<(), String> {
        self.waiting.push(Waiting {
            asker,
            response,
            since: now(),
            is_sent: false,
        });
        self.flush()
    }

    /// Sends the answers that are due. To be called a few times a second.
    ///
    /// # Errors
    /// One could not be sent.
    pub(crate) fn flush(&mut self) -> Result<(), String> {
        note_readers(&self.writer, &mut self.readers);
        let clock = now();
        let mut outcome = Ok(());
        let (writer, found) = (&self.writer, &self.readers);
        self.waiting.retain_mut(|it| {
            let age = clock.saturating_duration_since(it.since);
            let is_found = is_found(&it.asker, found);
            if is_found || (!it.is_sent && age >= DISCOVERY_TIMEOUT) {
                it.is_sent = true;
                let sent = send(writer, &it.asker, it.response.clone());
                if sent.is_err() {
                    outcome = sent;
                }
            }
            !is_found && age < RETENTION
        });
        outcome
    }
}

/// Returns `true` if the reader of a client is discovered.
fn is_found(asker: &RequestId, found: &BTreeSet<GUID>) -> bool {
    let who = asker.identity.writer_guid;
    if who.entity_id.entity_kind.is_reader() {
        return found.contains(&who);
    }
    // A request without a reader comes from a participant that has one, but another reader of it may be discovered first.
    asker.header.is_none() || found.iter().any(|it| it.prefix == who.prefix)
}

fn send<T: Serialize>(
    writer: &DataWriterCdr<Framed<T>>,
    asker: &RequestId,
    response: T,
) -> Result<(), String> {
    let options = WriteOptionsBuilder::new()
        .source_timestamp(Timestamp::now())
        .related_sample_identity(asker.identity);
    let answer = match asker.header {
        Some(header) => Framed::Headed(header, response),
        None => Framed::Plain(response),
    };
    let written = writer.write_with_options(answer, options.build());
    written
        .map(drop)
        .map_err(|e| format!("an answer was not sent: {e}"))
}
