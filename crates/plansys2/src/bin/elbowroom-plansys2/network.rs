//! DDS as ROS 2 uses it: names and types of topics and services, and a thread that receives
//! messages.
//!
//! The program is a DDS participant, but no node of ROS: it does not publish `ros_discovery_info`.
//! The layout of that message changed between Humble and Iron, and nodes of one side abort when
//! they read that of the other. Topics, services and actions work without nodes.

mod answers;
mod raw;

use std::collections::BTreeSet;
use std::io;
use std::marker::PhantomData;
use std::sync::mpsc::Sender;
use std::thread;

use rustdds::mio1::event::Source;
use rustdds::mio1::{Events, Interest, Poll, Registry, Token};
use rustdds::no_key::{DataWriterCdr, DeserializerAdapter as _, SimpleDataReader};
use rustdds::policy::{Durability, History, Reliability};
use rustdds::rpc::SampleIdentity;
use rustdds::{
    CDRDeserializerAdapter, DataWriterStatus, DomainParticipant, DomainParticipantBuilder,
    Duration, GUID, Publisher, QosPolicies, QosPolicyBuilder, RTPSEntity as _, SequenceNumber,
    StatusEvented as _, Subscriber, Timestamp, Topic, TopicKind, WriteOptionsBuilder,
};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::Input;
use super::options::Settings;
pub(super) use answers::ServiceReplies;
use raw::{Raw, RawAdapter};

/// Identity of a request, for matching it with its answer.
#[derive(Clone, Copy, Debug)]
pub(super) struct RequestId {
    pub(super) identity: SampleIdentity,
    /// Prefix of each request and each answer, if ROS runs on Cyclone DDS.
    header: Option<Header>,
}

/// Client and sequence number, as in `rmw_cyclonedds`.
type Header = (u64, i64);

impl RequestId {
    /// Returns `true` if an answer to `other` is an answer to this request.
    pub(super) fn matches(&self, other: &Self) -> bool {
        match (self.header, other.header) {
            (None, None) => self.identity == other.identity,
            (header, other) => header == other,
        }
    }
}

/// Connection to a DDS domain.
pub(super) struct Network {
    participant: DomainParticipant,
    publisher: Publisher,
    subscriber: Subscriber,
    namespace: String,
    sources: Vec<Box<dyn MessageSource>>,
}

impl Network {
    /// Joins the domain.
    ///
    /// # Errors
    /// The network is not available; the text says why.
    pub(super) fn join(settings: &Settings) -> Result<Self, String> {
        let mut builder = DomainParticipantBuilder::new(settings.domain_id);
        if !settings.interfaces.is_empty() {
            builder = builder.with_only_networks(settings.interfaces.iter().copied());
        }
        let failed = |e: rustdds::dds::CreateError| {
            let domain = settings.domain_id;
            format!(
                "cannot join the DDS domain {domain}: {e}; check that a network interface with \
                 multicast is up"
            )
        };
        let participant = builder.build().map_err(failed)?;
        Ok(Self {
            publisher: participant
                .create_publisher(&reliable(100))
                .map_err(failed)?,
            subscriber: participant
                .create_subscriber(&reliable(100))
                .map_err(failed)?,
            participant,
            namespace: settings.namespace.clone(),
            sources: Vec::new(),
        })
    }

    /// Returns the GUID of the participant, which is unique in the domain, as hexadecimal digits.
    pub(super) fn id(&self) -> String {
        let guid = u128::from_be_bytes(self.participant.guid().to_bytes());
        format!("{guid:032x}")
    }

    /// Creates the topic of that name in the namespace. `kind` is its type, as in
    /// `plansys2_msgs::msg::dds_::Plan_`.
    fn topic(
        &self,
        prefix: &str,
        name: &str,
        kind: &str,
        qos: &QosPolicies,
    ) -> Result<Topic, String> {
        let full = format!("{prefix}{}{name}", self.namespace);
        let topic = self
            .participant
            .create_topic(full, kind.to_owned(), qos, TopicKind::NoKey);
        topic.map_err(|e| format!("cannot use the topic {name}: {e}"))
    }

    fn add_source<T>(
        &mut self,
        topic: &Topic,
        is_service: bool,
        input: impl Fn(RequestId, T) -> Input + Send + 'static,
    ) -> Result<(), String>
    where
        T: DeserializeOwned + Send + 'static,
    {
        let reader = self.subscriber.create_simple_datareader_no_key(topic, None);
        let reader = reader.map_err(|e| format!("cannot listen: {e}"))?;
        self.sources.push(Box::new(TopicReader {
            reader,
            is_service,
            input,
            message: PhantomData,
        }));
        Ok(())
    }

    /// Creates a publisher of a topic.
    ///
    /// # Errors
    /// When DDS reports an error, which the text describes.
    pub(super) fn publish<T>(
        &self,
        name: &str,
        kind: &str,
        qos: &QosPolicies,
    ) -> Result<TopicPublisher<T>, String>
    where
        T: Serialize,
    {
        let topic = self.topic("rt", name, kind, qos)?;
        let writer = self.publisher.create_datawriter_no_key_cdr(&topic, None);
        Ok(TopicPublisher(
            writer.map_err(|e| format!("cannot publish {name}: {e}"))?,
        ))
    }

    /// Subscribes to a topic. Messages arrive once [`Self::listen`] is called.
    ///
    /// # Errors
    /// When DDS reports an error, which the text describes.
    pub(super) fn subscribe<T>(
        &mut self,
        name: &str,
        kind: &str,
        qos: &QosPolicies,
        input: impl Fn(T) -> Input + Send + 'static,
    ) -> Result<(), String>
    where
        T: DeserializeOwned + Send + 'static,
    {
        let topic = self.topic("rt", name, kind, qos)?;
        self.add_source(&topic, false, move |_, message| input(message))
    }

    /// Offers a service. `kind` is its type, as in `plansys2_msgs::srv::dds_::GetPlan`.
    ///
    /// # Errors
    /// When DDS reports an error, which the text describes.
    pub(super) fn serve<Request, Response>(
        &mut self,
        name: &str,
        kind: &str,
        input: impl Fn(RequestId, Request) -> Input + Send + 'static,
    ) -> Result<ServiceReplies<Response>, String>
    where
        Request: DeserializeOwned + Send + 'static,
        Response: Serialize,
    {
        let qos = reliable(10);
        let requests = self.topic(
            "rq",
            &format!("{name}Request"),
            &format!("{kind}_Request_"),
            &qos,
        )?;
        self.add_source(&requests, true, input)?;
        let replies = self.topic(
            "rr",
            &format!("{name}Reply"),
            &format!("{kind}_Response_"),
            &qos,
        )?;
        let writer = self.publisher.create_datawriter_no_key_cdr(&replies, None);
        let writer = writer.map_err(|e| format!("cannot serve {name}: {e}"))?;
        Ok(ServiceReplies::new(writer))
    }

    /// Creates a client of a service. `kind` is its type. All answers become inputs, those to other
    /// clients included.
    ///
    /// # Errors
    /// When DDS reports an error, which the text describes.
    pub(super) fn ask<Request, Response>(
        &mut self,
        name: &str,
        kind: &str,
        input: impl Fn(RequestId, Response) -> Input + Send + 'static,
    ) -> Result<ServiceClient<Request>, String>
    where
        Request: Serialize,
        Response: DeserializeOwned + Send + 'static,
    {
        let qos = reliable(10);
        let (reply, request) = (format!("{name}Reply"), format!("{name}Request"));
        let replies = self.topic("rr", &reply, &format!("{kind}_Response_"), &qos)?;
        self.add_source(&replies, true, input)?;
        let requests = self.topic("rq", &request, &format!("{kind}_Request_"), &qos)?;
        let writer = self.publisher.create_datawriter_no_key_cdr(&requests, None);
        let writer: DataWriterCdr<Framed<Request>> =
            writer.map_err(|e| format!("cannot call {name}: {e}"))?;
        let own = u128::from_le_bytes(writer.guid().to_bytes());
        let half = |it: u128| u64::try_from(it & u128::from(u64::MAX)).unwrap_or_default();
        Ok(ServiceClient {
            // Client identifier of 64 bits, derived from the GUID of the writer.
            last: (half(own) ^ half(own >> 64), 0),
            writer,
            servers: BTreeSet::new(),
        })
    }

    /// Starts a thread that sends all received messages to `inputs`.
    ///
    /// # Errors
    /// When the system reports an error, which the text describes.
    pub(super) fn listen(&mut self, inputs: Sender<Input>) -> Result<(), String> {
        let failed = |e: io::Error| format!("cannot listen to the network: {e}");
        let mut poll = Poll::new().map_err(failed)?;
        let mut ears = std::mem::take(&mut self.sources);
        for (number, ear) in ears.iter_mut().enumerate() {
            ear.register(poll.registry(), Token(number))
                .map_err(failed)?;
        }
        thread::spawn(move || {
            let mut events = Events::with_capacity(16);
            // The receiver is dropped when the program ends.
            while ears.iter().all(|ear| ear.forward(&inputs)) {
                if let Err(error) = poll.poll(&mut events, None)
                    && error.kind() != io::ErrorKind::Interrupted
                {
                    let _ = inputs.send(Input::Warning(failed(error)));
                    return;
                }
            }
        });
        Ok(())
    }
}

/// Returns a reliable and volatile quality of service that keeps the last `depth` messages: 100 for
/// the hub of `PlanSys2`, 10 for services.
pub(super) fn reliable(depth: i32) -> QosPolicies {
    let max_blocking_time = Duration::from_millis(100);
    QosPolicyBuilder::new()
        .reliability(Reliability::Reliable { max_blocking_time })
        .durability(Durability::Volatile)
        .history(History::KeepLast { depth })
        .build()
}

/// Returns a quality of service that delivers the last message to late subscribers.
pub(super) fn latched() -> QosPolicies {
    let max_blocking_time = Duration::from_millis(100);
    QosPolicyBuilder::new()
        .reliability(Reliability::Reliable { max_blocking_time })
        .durability(Durability::TransientLocal)
        .history(History::KeepLast { depth: 1 })
        .build()
}

/// Publisher of a topic.
pub(super) struct TopicPublisher<T: Serialize>(DataWriterCdr<T>);

impl<T: Serialize> TopicPublisher<T> {
    /// Publishes a message.
    ///
    /// # Errors
    /// It could not be sent.
    pub(super) fn publish_message(&self, message: T) -> Result<(), String> {
        self.0
            .write(message, None)
            .map_err(|e| format!("a message was not sent: {e}"))
    }
}

/// Client of a service.
pub(super) struct ServiceClient<T: Serialize> {
    writer: DataWriterCdr<Framed<T>>,
    /// Discovered servers.
    servers: BTreeSet<GUID>,
    /// Header of the last request to a server on Cyclone DDS.
    last: Header,
}

impl<T: Serialize> ServiceClient<T> {
    /// Sends a request, and returns its identity.
    ///
    /// # Errors
    /// It could not be sent.
    pub(super) fn send(&mut self, request: T) -> Result<RequestId, String> {
        let options = WriteOptionsBuilder::new().source_timestamp(Timestamp::now());
        // The formats are incompatible. If servers of both kinds exist, the request is for those on
        // Fast DDS.
        let (header, framed) = if self.servers.iter().all(is_cyclone) {
            self.last.1 += 1;
            (Some(self.last), Framed::Headed(self.last, request))
        } else {
            (None, Framed::Plain(request))
        };
        let written = self.writer.write_with_options(framed, options.build());
        written
            .map(|identity| RequestId { identity, header })
            .map_err(|e| format!("a request was not sent: {e}"))
    }

    /// Returns `true` if the service has a server. To be called a few times a second.
    pub(super) fn is_served(&mut self) -> bool {
        note_readers(&self.writer, &mut self.servers);
        !self.servers.is_empty()
    }
}

/// Updates the set of discovered readers.
fn note_readers<T: Serialize>(writer: &DataWriterCdr<T>, found: &mut BTreeSet<GUID>) {
    while let Some(status) = writer.try_recv_status() {
        if let DataWriterStatus::PublicationMatched {
            current, reader, ..
        } = status
        {
            if current.count_change() < 0 {
                found.remove(&reader);
            } else {
                found.insert(reader);
            }
        }
    }
}

/// Source of messages.
trait MessageSource: Send {
    fn register(&mut self, registry: &Registry, token: Token) -> io::Result<()>;
    /// Forwards all pending messages. Returns `false` if the receiver was dropped.
    fn forward(&self, inputs: &Sender<Input>) -> bool;
}

/// Message with or without a header. Its serialized form is that of its parts.
#[derive(Serialize)]
#[serde(untagged)]
enum Framed<T> {
    Plain(T),
    Headed(Header, T),
}

struct TopicReader<T, F> {
    reader: SimpleDataReader<Raw, RawAdapter>,
    /// `true` if messages are requests or answers.
    is_service: bool,
    input: F,
    message: PhantomData<fn() -> T>,
}

impl<T: DeserializeOwned + 'static, F> TopicReader<T, F> {
    /// Decodes the header, if any, and the message.
    fn read(&self, raw: &Raw, writer: GUID) -> Result<(Option<Header>, T), String> {
        let wrong = |e: rustdds::cdr_encoding::Error| e.to_string();
        if self.is_service && is_cyclone(&writer) {
            let read = CDRDeserializerAdapter::<(Header, T)>::from_bytes(&raw.bytes, raw.encoding);
            return read.map(|(header, it)| (Some(header), it)).map_err(wrong);
        }
        let read = CDRDeserializerAdapter::<T>::from_bytes(&raw.bytes, raw.encoding);
        read.map(|it| (None, it)).map_err(wrong)
    }
}

/// Returns `true` if the GUID is one of Cyclone DDS, whose GUIDs all start with these bytes.
fn is_cyclone(guid: &GUID) -> bool {
    guid.to_bytes().starts_with(&[0x01, 0x10])
}

impl<T, F> MessageSource for TopicReader<T, F>
where
    T: DeserializeOwned + Send + 'static,
    F: Fn(RequestId, T) -> Input + Send,
{
    fn register(&mut self, registry: &Registry, token: Token) -> io::Result<()> {
        Source::register(&mut self.reader, registry, token, Interest::READABLE)
    }

    fn forward(&self, inputs: &Sender<Input>) -> bool {
        self.reader.drain_read_notifications();
        loop {
            let input = match self.reader.try_take_one() {
                Ok(Some(sample)) => {
                    // Fast DDS names the reader of the answer and omits the sequence number, which
                    // is that of the request.
                    let own = SampleIdentity {
                        writer_guid: sample.writer_guid(),
                        sequence_number: sample.sequence_number,
                    };
                    let mut identity = sample.related_sample_identity().unwrap_or(own);
                    if identity.sequence_number == SequenceNumber::UNKNOWN {
                        identity.sequence_number = own.sequence_number;
                    }
                    match self.read(&sample.into_value(), own.writer_guid) {
                        Ok((header, message)) => {
                            (self.input)(RequestId { identity, header }, message)
                        }
                        Err(why) => Input::Warning(format!("cannot parse a message: {why}")),
                    }
                }
                Ok(None) => return true,
                Err(error) => Input::Warning(format!("cannot parse a message: {error}")),
            };
            if inputs.send(input).is_err() {
                return false;
            }
        }
    }
}
