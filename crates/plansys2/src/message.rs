//! Messages of `PlanSys2`'s performers. Fields are in the order of the wire format.

use serde::{Deserialize, Serialize};

/// `plansys2_msgs/msg/ActionExecution`, on the topic `actions_hub`: reliable, the last 100 kept.
/// Both sides publish and subscribe.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ActionExecution {
    /// Type of the message, one of [`kind`].
    #[serde(rename = "type")]
    pub kind: i16,
    /// Sender of the message, or its receiver.
    pub node_id: String,
    /// The name of the action.
    pub action: String,
    /// Its arguments.
    pub arguments: Vec<String>,
    /// `true` if the action has succeeded, in [`kind::FINISH`].
    pub success: bool,
    /// Completed share, from 0 to 1.
    pub completion: f32,
    /// Text for the user.
    pub status: String,
}

/// Types of an [`ActionExecution`].
pub mod kind {
    /// The executor requests a performer of an action.
    pub const REQUEST: i16 = 1;
    /// A performer offers to execute it.
    pub const RESPONSE: i16 = 2;
    /// The executor chooses this performer, which answered first.
    pub const CONFIRM: i16 = 3;
    /// The executor rejects this performer.
    pub const REJECT: i16 = 4;
    /// A performer reports its progress.
    pub const FEEDBACK: i16 = 5;
    /// A performer reports its result.
    pub const FINISH: i16 = 6;
    /// The executor cancels the action; there is no answer.
    pub const CANCEL: i16 = 7;
}

/// `plansys2_msgs/msg/ActionPerformerStatus`, on the topic `performers_status`. Each performer
/// publishes it once a second.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ActionPerformerStatus {
    /// Time of the status, by the performer's clock.
    pub status_stamp: Stamp,
    /// One of [`state`].
    pub state: i8,
    /// The action that it performs.
    pub action: String,
    /// Arguments to which the performer is restricted. An empty argument matches any object.
    pub specialized_arguments: Vec<String>,
    /// Its name.
    pub node_name: String,
}

/// `std_msgs/msg/String`, on the topic `elbowroom/claims`: reliable, the last one is kept for late
/// subscribers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Text {
    /// The text of a [`Claim`](crate::Claim).
    pub data: String,
}

/// `builtin_interfaces/msg/Time`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Stamp {
    /// Seconds.
    pub sec: i32,
    /// Nanoseconds within the second.
    pub nanosec: u32,
}

/// States of a performer.
pub mod state {
    /// It is not configured.
    pub const NOT_READY: i8 = 0;
    /// It is ready to begin.
    pub const READY: i8 = 1;
    /// It performs an action.
    pub const RUNNING: i8 = 2;
    /// It has failed.
    pub const FAILURE: i8 = 4;
}
