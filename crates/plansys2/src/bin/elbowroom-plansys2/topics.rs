//! `PlanSys2`'s two topics, over DDS.
//!
//! The program takes part in DDS, and is no node of ROS: it does not publish `ros_discovery_info`. Its layout
//! changed between Humble and Iron, and nodes of one side abort when they read that of the other. Who does not
//! speak of nodes can do no harm to either, and topics need no nodes.

use std::sync::mpsc::Sender;
use std::thread;

use elbowroom_plansys2::message::{ActionExecution, ActionPerformerStatus};
use rustdds::mio1::{Events, Interest, Poll, Token};
use rustdds::no_key::{DataWriterCdr, SimpleDataReaderCdr};
use rustdds::policy::{Durability, History, Reliability};
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, Duration, QosPolicies, QosPolicyBuilder, Topic,
    TopicKind,
};
use serde::de::DeserializeOwned;

use super::Input;
use super::options::Settings;

/// A connection to the performers.
pub(super) struct Topics {
    hub: DataWriterCdr<ActionExecution>,
    // The connection lives as long as this.
    _participant: DomainParticipant,
}

impl Topics {
    /// Joins the domain; what is heard goes to `inputs`, from a thread of its own.
    ///
    /// # Errors
    /// The network does not let it; the text says what.
    pub(super) fn join(settings: &Settings, inputs: Sender<Input>) -> Result<Self, String> {
        let mut builder = DomainParticipantBuilder::new(settings.domain_id);
        if !settings.interfaces.is_empty() {
            builder = builder.with_only_networks(settings.interfaces.iter().copied());
        }
        let participant = builder.build().map_err(|e| {
            let domain = settings.domain_id;
            format!("cannot join the DDS domain {domain}: {e}; is a network interface up, with multicast?")
        })?;
        let failed =
            |e: rustdds::dds::CreateError| format!("cannot use the topics of PlanSys2: {e}");
        let topic = |name: &str, kind: &str| {
            let name = format!("rt{}{name}", settings.namespace);
            let kind = format!("plansys2_msgs::msg::dds_::{kind}_");
            participant
                .create_topic(name, kind, &qos(), TopicKind::NoKey)
                .map_err(failed)
        };
        let hub = topic("actions_hub", "ActionExecution")?;
        let status = topic("performers_status", "ActionPerformerStatus")?;
        let subscriber = participant.create_subscriber(&qos()).map_err(failed)?;
        let read = |topic: &Topic| subscriber.create_simple_datareader_no_key(topic, None);
        let readers = Readers {
            hub: read(&hub).map_err(failed)?,
            status: subscriber
                .create_simple_datareader_no_key(&status, None)
                .map_err(failed)?,
        };
        readers.listen(inputs)?;
        let publisher = participant.create_publisher(&qos()).map_err(failed)?;
        let hub = publisher
            .create_datawriter_no_key_cdr(&hub, None)
            .map_err(failed)?;
        Ok(Self {
            hub,
            _participant: participant,
        })
    }

    /// Publishes on `actions_hub`.
    ///
    /// # Errors
    /// It could not be sent.
    pub(super) fn send(&self, message: ActionExecution) -> Result<(), String> {
        self.hub
            .write(message, None)
            .map_err(|e| format!("a message to the performers was not sent: {e}"))
    }
}

/// As the executor and the performers of `PlanSys2` have it.
fn qos() -> QosPolicies {
    QosPolicyBuilder::new()
        .reliability(Reliability::Reliable {
            max_blocking_time: Duration::from_millis(100),
        })
        .durability(Durability::Volatile)
        .history(History::KeepLast { depth: 100 })
        .build()
}

struct Readers {
    hub: SimpleDataReaderCdr<ActionExecution>,
    status: SimpleDataReaderCdr<ActionPerformerStatus>,
}

impl Readers {
    fn listen(mut self, inputs: Sender<Input>) -> Result<(), String> {
        let failed = |e: std::io::Error| format!("cannot listen to the performers: {e}");
        let mut poll = Poll::new().map_err(failed)?;
        let registry = poll.registry();
        registry
            .register(&mut self.hub, Token(0), Interest::READABLE)
            .map_err(failed)?;
        registry
            .register(&mut self.status, Token(1), Interest::READABLE)
            .map_err(failed)?;
        thread::spawn(move || {
            let mut events = Events::with_capacity(8);
            // Whoever receives is gone when the program ends.
            let mut is_heard = true;
            while is_heard {
                if let Err(error) = poll.poll(&mut events, None)
                    && error.kind() != std::io::ErrorKind::Interrupted
                {
                    let _ = inputs.send(Input::Trouble(format!(
                        "cannot listen to the performers: {error}"
                    )));
                    return;
                }
                is_heard = forward(&self.hub, &inputs, Input::Hub)
                    && forward(&self.status, &inputs, Input::Status);
            }
        });
        Ok(())
    }
}

/// Passes on all that has come; `false` when nobody takes it any more.
fn forward<T>(
    reader: &SimpleDataReaderCdr<T>,
    inputs: &Sender<Input>,
    input: fn(T) -> Input,
) -> bool
where
    T: DeserializeOwned + 'static,
{
    reader.drain_read_notifications();
    loop {
        let sent = match reader.try_take_one() {
            Ok(Some(sample)) => inputs.send(input(sample.into_value())),
            Ok(None) => return true,
            Err(error) => inputs.send(Input::Trouble(format!(
                "a message was not understood: {error}"
            ))),
        };
        if sent.is_err() {
            return false;
        }
    }
}
