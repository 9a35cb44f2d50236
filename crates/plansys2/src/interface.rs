//! Messages of `PlanSys2`'s planner and executor, and those of ROS actions and managed nodes.
//! Fields are in the order of the wire format.

use serde::{Deserialize, Serialize};

use crate::message::Stamp;

/// `plansys2_msgs/msg/Plan`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Its steps.
    pub items: Vec<PlanItem>,
}

/// `plansys2_msgs/msg/PlanItem`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlanItem {
    /// Start time, in seconds.
    pub time: f32,
    /// `(move r a b)`.
    pub action: String,
    /// Duration, in seconds.
    pub duration: f32,
}

/// `plansys2_msgs/msg/ActionExecutionInfo`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ActionExecutionInfo {
    /// One of [`execution`].
    pub status: i8,
    /// Start time.
    pub start_stamp: Stamp,
    /// Time of the last change.
    pub status_stamp: Stamp,
    /// `(move r a b):2001`: with the planned start, in milliseconds.
    pub action_full_name: String,
    /// `move`.
    pub action: String,
    /// `r`, `a`, `b`.
    pub arguments: Vec<String>,
    /// Planned duration.
    pub duration: Stamp,
    /// Completed share, from 0 to 1.
    pub completion: f32,
    /// Text of the performer, or the reason of a failure.
    pub message_status: String,
}

/// Values of [`ActionExecutionInfo::status`].
pub mod execution {
    /// It has not started.
    pub const NOT_EXECUTED: i8 = 1;
    /// It is running.
    pub const EXECUTING: i8 = 2;
    /// It has failed.
    pub const FAILED: i8 = 3;
    /// It has succeeded.
    pub const SUCCEEDED: i8 = 4;
    /// It was cancelled.
    pub const CANCELLED: i8 = 5;
}

/// Request without fields.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Empty {
    /// Without meaning.
    pub structure_needs_at_least_one_member: u8,
}

/// The request of `plansys2_msgs/srv/GetPlan`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlanRequest {
    /// The domain, in PDDL.
    pub domain: String,
    /// The problem, in PDDL.
    pub problem: String,
}

/// The answer of `plansys2_msgs/srv/GetPlan`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlanResponse {
    /// `true` if there is a plan.
    pub success: bool,
    /// The plan.
    pub plan: Plan,
    /// Reason of a failure.
    pub error_info: String,
}

/// The request of `plansys2_msgs/srv/ValidateDomain`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ValidateRequest {
    /// The domain, in PDDL.
    pub domain: String,
}

/// The answer of `plansys2_msgs/srv/ValidateDomain`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ValidateResponse {
    /// `true` if the domain is valid.
    pub success: bool,
    /// Messages about an invalid domain.
    pub error_info: String,
}

/// Number of a goal. Zeros mean all goals.
pub type GoalId = [u8; 16];

/// The request of `execute_plan/_action/send_goal`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GoalRequest {
    /// Number of the new goal.
    pub goal_id: GoalId,
    /// The plan to be executed.
    pub plan: Plan,
}

/// Answer to a [`GoalRequest`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GoalResponse {
    /// `true` if the plan will be executed.
    pub accepted: bool,
    /// Time of acceptance.
    pub stamp: Stamp,
}

/// The request of `execute_plan/_action/get_result`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ResultRequest {
    /// The goal.
    pub goal_id: GoalId,
}

/// Answer to a [`ResultRequest`], once the goal has ended.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ResultResponse {
    /// One of [`goal`].
    pub status: i8,
    /// `true` if the plan has reached its goal.
    pub success: bool,
    /// Status of each action.
    pub action_execution_status: Vec<ActionExecutionInfo>,
}

/// The message of `execute_plan/_action/feedback`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Feedback {
    /// The goal.
    pub goal_id: GoalId,
    /// Status of each action.
    pub action_execution_status: Vec<ActionExecutionInfo>,
}

/// Status of a goal.
pub mod goal {
    /// No goal has this number.
    pub const UNKNOWN: i8 = 0;
    /// Its plan is being executed.
    pub const EXECUTING: i8 = 2;
    /// It is being cancelled.
    pub const CANCELING: i8 = 3;
    /// It was reached.
    pub const SUCCEEDED: i8 = 4;
    /// It was cancelled.
    pub const CANCELED: i8 = 5;
    /// Its plan has failed.
    pub const ABORTED: i8 = 6;
}

/// `action_msgs/msg/GoalInfo`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GoalInfo {
    /// Its number.
    pub goal_id: GoalId,
    /// Time of acceptance.
    pub stamp: Stamp,
}

/// The request of `execute_plan/_action/cancel_goal`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CancelRequest {
    /// Selected goals, as in `action_msgs/srv/CancelGoal`.
    pub goal_info: GoalInfo,
}

/// Answer to a [`CancelRequest`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CancelResponse {
    /// 0: accepted; 2: unknown goal; 3: the goal has already ended.
    pub return_code: i8,
    /// Goals that are being cancelled.
    pub goals_canceling: Vec<GoalInfo>,
}

/// `action_msgs/msg/GoalStatusArray`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GoalStatuses {
    /// Known goals.
    pub status_list: Vec<GoalStatus>,
}

/// `action_msgs/msg/GoalStatus`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GoalStatus {
    /// The goal.
    pub goal_info: GoalInfo,
    /// One of [`goal`].
    pub status: i8,
}

/// `lifecycle_msgs/msg/State` and `lifecycle_msgs/msg/Transition`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Named {
    /// Its number.
    pub id: u8,
    /// Its name.
    pub label: String,
}

/// The answer of `lifecycle_msgs/srv/GetState`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StateResponse {
    /// State of the node.
    pub current_state: Named,
}

/// The request of `lifecycle_msgs/srv/ChangeState`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChangeRequest {
    /// The transition, by its number, or, if that is 0, by its name.
    pub transition: Named,
}

/// Answer with a Boolean result.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Success {
    /// `true` if the request succeeded.
    pub success: bool,
}
