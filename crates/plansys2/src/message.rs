//! The messages of `PlanSys2` that are spoken here, field by field in the order of the wire.

use serde::{Deserialize, Serialize};

/// `plansys2_msgs/msg/ActionExecution`, on the topic `actions_hub`: reliable, the last 100 kept, both
/// sides publish and hear.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ActionExecution {
    /// What is said, one of [`kind`].
    #[serde(rename = "type")]
    pub kind: i16,
    /// Whose message it is, or to whom it is said.
    pub node_id: String,
    /// The name of the action.
    pub action: String,
    /// Its objects.
    pub arguments: Vec<String>,
    /// Whether it has succeeded, in [`kind::FINISH`].
    pub success: bool,
    /// How far it has come, from 0 to 1.
    pub completion: f32,
    /// A text for people.
    pub status: String,
}

/// What an [`ActionExecution`] says.
pub mod kind {
    /// The executor asks who can do an action.
    pub const REQUEST: i16 = 1;
    /// A performer can.
    pub const RESPONSE: i16 = 2;
    /// The executor chooses the performer that answered first.
    pub const CONFIRM: i16 = 3;
    /// The executor does not need this performer.
    pub const REJECT: i16 = 4;
    /// A performer says how far it has come.
    pub const FEEDBACK: i16 = 5;
    /// A performer has ended.
    pub const FINISH: i16 = 6;
    /// The executor tells a performer to stop; there is no answer.
    pub const CANCEL: i16 = 7;
}

/// `plansys2_msgs/msg/ActionPerformerStatus`, on the topic `performers_status`: each performer says it
/// once a second.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ActionPerformerStatus {
    /// When, by the performer's clock.
    pub status_stamp: Stamp,
    /// One of [`state`].
    pub state: i8,
    /// The action that it performs.
    pub action: String,
    /// Arguments for which alone it does so; empty ones stand for any.
    pub specialized_arguments: Vec<String>,
    /// Its name.
    pub node_name: String,
}

/// `builtin_interfaces/msg/Time`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Stamp {
    /// Seconds.
    pub sec: i32,
    /// Nanoseconds after them.
    pub nanosec: u32,
}

/// What a performer is doing.
pub mod state {
    /// It is not configured.
    pub const NOT_READY: i8 = 0;
    /// It could begin.
    pub const READY: i8 = 1;
    /// It performs an action.
    pub const RUNNING: i8 = 2;
    /// It has failed.
    pub const FAILURE: i8 = 4;
}
