//! Requests, answers and messages of `PlanSys2`'s planner and executor, and those of actions and managed nodes that
//! come with them, field by field in the order of the wire.

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
    /// When it starts, in seconds.
    pub time: f32,
    /// `(move r a b)`.
    pub action: String,
    /// How long it takes, in seconds.
    pub duration: f32,
}

/// `plansys2_msgs/msg/ActionExecutionInfo`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ActionExecutionInfo {
    /// One of [`execution`].
    pub status: i8,
    /// When it was begun.
    pub start_stamp: Stamp,
    /// When this became so.
    pub status_stamp: Stamp,
    /// `(move r a b):2001`: with the start in the plan, in milliseconds.
    pub action_full_name: String,
    /// `move`.
    pub action: String,
    /// `r`, `a`, `b`.
    pub arguments: Vec<String>,
    /// How long the plan has it take.
    pub duration: Stamp,
    /// How far it has come, from 0 to 1.
    pub completion: f32,
    /// What there is to say about it.
    pub message_status: String,
}

/// How an action stands, in [`ActionExecutionInfo::status`].
pub mod execution {
    /// It has not begun.
    pub const NOT_EXECUTED: i8 = 1;
    /// It is under way.
    pub const EXECUTING: i8 = 2;
    /// It has failed.
    pub const FAILED: i8 = 3;
    /// It has ended as it should.
    pub const SUCCEEDED: i8 = 4;
    /// It was stopped.
    pub const CANCELLED: i8 = 5;
}

/// A request without fields has this one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Empty {
    /// Of no meaning.
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
    /// Whether there is a plan.
    pub success: bool,
    /// The plan.
    pub plan: Plan,
    /// Why there is none.
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
    /// Whether it can be read.
    pub success: bool,
    /// What is wrong with it.
    pub error_info: String,
}

/// The number of a goal; zeros stand for all of them.
pub type GoalId = [u8; 16];

/// The request of `execute_plan/_action/send_goal`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GoalRequest {
    /// Which goal it shall be.
    pub goal_id: GoalId,
    /// The plan to be executed.
    pub plan: Plan,
}

/// The answer to it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GoalResponse {
    /// Whether it will be pursued.
    pub accepted: bool,
    /// Since when.
    pub stamp: Stamp,
}

/// The request of `execute_plan/_action/get_result`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ResultRequest {
    /// Of which goal.
    pub goal_id: GoalId,
}

/// The answer to it, when the goal has ended.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ResultResponse {
    /// One of [`goal`].
    pub status: i8,
    /// Whether the plan has reached its goal.
    pub success: bool,
    /// How each action stands.
    pub action_execution_status: Vec<ActionExecutionInfo>,
}

/// The message of `execute_plan/_action/feedback`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Feedback {
    /// About which goal.
    pub goal_id: GoalId,
    /// How each action stands.
    pub action_execution_status: Vec<ActionExecutionInfo>,
}

/// How a goal stands.
pub mod goal {
    /// There is none of that number.
    pub const UNKNOWN: i8 = 0;
    /// It is pursued.
    pub const EXECUTING: i8 = 2;
    /// It is being given up.
    pub const CANCELING: i8 = 3;
    /// It was reached.
    pub const SUCCEEDED: i8 = 4;
    /// It was given up on request.
    pub const CANCELED: i8 = 5;
    /// It cannot be reached any more.
    pub const ABORTED: i8 = 6;
}

/// `action_msgs/msg/GoalInfo`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GoalInfo {
    /// Its number.
    pub goal_id: GoalId,
    /// When it was accepted.
    pub stamp: Stamp,
}

/// The request of `execute_plan/_action/cancel_goal`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CancelRequest {
    /// Which goals, as `action_msgs/srv/CancelGoal` has it.
    pub goal_info: GoalInfo,
}

/// The answer to it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CancelResponse {
    /// 0: done; 2: there is no such goal; 3: it has ended.
    pub return_code: i8,
    /// Those that are being given up.
    pub goals_canceling: Vec<GoalInfo>,
}

/// `action_msgs/msg/GoalStatusArray`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GoalStatuses {
    /// Each goal that is known.
    pub status_list: Vec<GoalStatus>,
}

/// `action_msgs/msg/GoalStatus`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GoalStatus {
    /// Which goal.
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
    /// In which state the node is.
    pub current_state: Named,
}

/// The request of `lifecycle_msgs/srv/ChangeState`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChangeRequest {
    /// By its number, or, where that is 0, by its name.
    pub transition: Named,
}

/// An answer that says yes or no.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Success {
    /// Yes or no.
    pub success: bool,
}
