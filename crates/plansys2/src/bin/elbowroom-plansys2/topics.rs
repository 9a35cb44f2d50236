//! The two topics of `PlanSys2`'s performers, and that of the claims of executors.

use std::process;
use std::time::Duration;

use elbowroom_plansys2::Claim;
use elbowroom_plansys2::message::{ActionExecution, Text};

use super::network::{Network, TopicPublisher, latched, reliable};
use super::{Input, warn};

/// Publisher of messages to the performers. Their messages arrive as inputs.
pub(super) struct Topics {
    hub: TopicPublisher<ActionExecution>,
    claim: Option<PublishedClaim>,
}

/// Claim of this program, and the publisher of its text.
struct PublishedClaim {
    claim: Claim,
    topic: TopicPublisher<Text>,
    last: String,
}

impl Topics {
    /// Joins all topics. With `is_shared`, other executors may use the performers as well.
    ///
    /// # Errors
    /// When DDS reports an error, which the text describes.
    pub(super) fn join(network: &mut Network, is_shared: bool) -> Result<Self, String> {
        let execution = "plansys2_msgs::msg::dds_::ActionExecution_";
        network.subscribe("actions_hub", execution, &reliable(100), Input::Hub)?;
        let status = "plansys2_msgs::msg::dds_::ActionPerformerStatus_";
        network.subscribe("performers_status", status, &reliable(100), Input::Status)?;
        let hub = network.publish("actions_hub", execution, &reliable(100))?;
        let claim = (!is_shared).then(|| PublishedClaim::join(network));
        Ok(Self {
            hub,
            claim: claim.transpose()?,
        })
    }

    /// Holds the claim from now on.
    pub(super) fn hold_claim(&mut self, now: Duration) {
        if let Some(it) = &mut self.claim {
            it.claim.hold(now);
        }
    }

    /// Releases the claim: another executor may use the performers once the messages of this one
    /// are sent.
    pub(super) fn release_claim(&mut self) {
        if let Some(it) = &mut self.claim {
            it.claim.release();
        }
        self.publish_claim(Duration::MAX);
    }

    /// Publishes the claim if its text has changed. To be called a few times a second.
    pub(super) fn publish_claim(&mut self, now: Duration) {
        let Some(it) = &mut self.claim else { return };
        let data = it.claim.text(now);
        if data != it.last {
            it.last.clone_from(&data);
            if let Err(why) = it.topic.publish_message(Text { data }) {
                warn(&why);
            }
        }
    }

    /// Takes the claim of an executor.
    ///
    /// # Errors
    /// The other executor has priority; the text says who it is and what to do.
    pub(super) fn check_claim(&self, text: &str, now: Duration) -> Result<(), String> {
        let claim = self.claim.as_ref();
        claim.map_or(Ok(()), |it| it.claim.check(text, now))
    }

    /// Publishes on `actions_hub`.
    ///
    /// # Errors
    /// It could not be sent.
    pub(super) fn send(&self, message: ActionExecution) -> Result<(), String> {
        self.hub.publish_message(message)
    }
}

impl PublishedClaim {
    fn join(network: &mut Network) -> Result<Self, String> {
        let (name, kind) = ("elbowroom/claims", "std_msgs::msg::dds_::String_");
        network.subscribe(name, kind, &latched(), |it: Text| Input::Claim(it.data))?;
        let process = process::id();
        let host = std::fs::read_to_string("/proc/sys/kernel/hostname");
        let host = host.as_deref().map_or("an unknown machine", str::trim);
        Ok(Self {
            claim: Claim::new(&network.id(), &format!("process {process} on {host}")),
            topic: network.publish(name, kind, &latched())?,
            last: String::new(),
        })
    }
}
