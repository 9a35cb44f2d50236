//! The two topics of `PlanSys2`'s performers.

use elbowroom_plansys2::message::ActionExecution;

use super::Input;
use super::network::{Network, TopicPublisher, reliable};

/// Publisher of messages to the performers. Their messages arrive as inputs.
pub(super) struct Topics {
    hub: TopicPublisher<ActionExecution>,
}

impl Topics {
    /// Joins both topics.
    ///
    /// # Errors
    /// DDS refuses; the text says what.
    pub(super) fn join(network: &mut Network) -> Result<Self, String> {
        let execution = "plansys2_msgs::msg::dds_::ActionExecution_";
        network.subscribe("actions_hub", execution, &reliable(100), Input::Hub)?;
        let status = "plansys2_msgs::msg::dds_::ActionPerformerStatus_";
        network.subscribe("performers_status", status, &reliable(100), Input::Status)?;
        let hub = network.publish("actions_hub", execution, &reliable(100))?;
        Ok(Self { hub })
    }

    /// Publishes on `actions_hub`.
    ///
    /// # Errors
    /// It could not be sent.
    pub(super) fn send(&self, message: ActionExecution) -> Result<(), String> {
        self.hub.publish_message(message)
    }
}
