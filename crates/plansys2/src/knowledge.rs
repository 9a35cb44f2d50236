//! Requests and answers of `PlanSys2`'s problem expert, and the trees in which it has conditions, field by field in the
//! order of the wire.

use serde::{Deserialize, Serialize};

/// `plansys2_msgs/msg/Param`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Param {
    /// Its name.
    pub name: String,
    /// Its type.
    #[serde(rename = "type")]
    pub kind: String,
    /// The types below that.
    pub sub_types: Vec<String>,
}

/// `plansys2_msgs/msg/Node`: a fact, a number, or a part of a condition.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Node {
    /// One of [`node`].
    pub node_type: u8,
    /// Of expressions: which one.
    pub expression_type: u8,
    /// Of effects: which one.
    pub modifier_type: u8,
    /// Its place in its tree.
    pub node_id: u32,
    /// The places of its parts.
    pub children: Vec<u32>,
    /// Of facts and functions.
    pub name: String,
    /// Of facts and functions.
    pub parameters: Vec<Param>,
    /// Of functions and numbers.
    pub value: f64,
    /// Whether an odd number of negations is around it.
    pub negate: bool,
}

/// What a [`Node`] is. These numbers are the same in all versions.
pub mod node {
    /// All of its parts.
    pub const AND: u8 = 1;
    /// One of its parts.
    pub const OR: u8 = 2;
    /// Not its part.
    pub const NOT: u8 = 3;
    /// A fact.
    pub const PREDICATE: u8 = 5;
    /// A fluent.
    pub const FUNCTION: u8 = 6;
    /// A comparison, or a sum.
    pub const EXPRESSION: u8 = 7;
    /// A number.
    pub const NUMBER: u8 = 9;
}

/// `plansys2_msgs/msg/Tree`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Tree {
    /// The root comes first.
    pub nodes: Vec<Node>,
}

/// The answer of `plansys2_msgs/srv/GetOrderedSubGoals`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SubGoalsResponse {
    /// Whether there are any to be told.
    pub success: bool,
    /// In the order in which they are reached.
    pub sub_goals: Vec<Tree>,
    /// Why there are none.
    pub error_info: String,
}

/// The request of `plansys2_msgs/srv/AffectNode`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AffectRequest {
    /// What to add, to remove, or to change.
    pub node: Node,
}

/// The answer of `plansys2_msgs/srv/AffectNode`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AffectResponse {
    /// Whether that was done.
    pub success: bool,
    /// Why it was not.
    pub error_info: String,
}

/// The answer of `plansys2_msgs/srv/GetStates`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StatesResponse {
    /// Whether they are told.
    pub success: bool,
    /// All facts that are true, or all fluents with their values.
    pub states: Vec<Node>,
    /// Why they are not.
    pub error_info: String,
}
