//! Messages of `PlanSys2`'s problem expert, and its trees of conditions. Fields are in the order of
//! the wire format.

use serde::{Deserialize, Serialize};

/// `plansys2_msgs/msg/Param`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Param {
    /// Its name.
    pub name: String,
    /// Its type.
    #[serde(rename = "type")]
    pub kind: String,
    /// Subtypes of that type.
    pub sub_types: Vec<String>,
}

/// `plansys2_msgs/msg/Node`: a fact, a number, or a part of a condition.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Node {
    /// One of [`node`].
    pub node_type: u8,
    /// Operator of an expression.
    pub expression_type: u8,
    /// Operator of a numeric effect.
    pub modifier_type: u8,
    /// Position in its tree.
    pub node_id: u32,
    /// Positions of its parts.
    pub children: Vec<u32>,
    /// Name of a fact or a fluent.
    pub name: String,
    /// Arguments of a fact or a fluent.
    pub parameters: Vec<Param>,
    /// Value of a fluent or a number.
    pub value: f64,
    /// `true` if an odd number of negations encloses it.
    pub negate: bool,
}

/// Types of a [`Node`]. These numbers are the same in all versions.
pub mod node {
    /// Conjunction.
    pub const AND: u8 = 1;
    /// Disjunction.
    pub const OR: u8 = 2;
    /// Negation.
    pub const NOT: u8 = 3;
    /// A fact.
    pub const PREDICATE: u8 = 5;
    /// A fluent.
    pub const FUNCTION: u8 = 6;
    /// A comparison, or an arithmetic expression.
    pub const EXPRESSION: u8 = 7;
    /// A number.
    pub const NUMBER: u8 = 9;
}

/// `plansys2_msgs/msg/Tree`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Tree {
    /// The nodes, root first.
    pub nodes: Vec<Node>,
}

/// The answer of `plansys2_msgs/srv/GetOrderedSubGoals`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SubGoalsResponse {
    /// `true` if the subgoals are known.
    pub success: bool,
    /// Subgoals, sorted by the time at which the plan reaches them.
    pub sub_goals: Vec<Tree>,
    /// Reason of a failure.
    pub error_info: String,
}

/// The request of `plansys2_msgs/srv/AffectNode`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AffectRequest {
    /// Fact or fluent to add, remove or change.
    pub node: Node,
}

/// The answer of `plansys2_msgs/srv/AffectNode`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AffectResponse {
    /// `true` if the change was made.
    pub success: bool,
    /// Reason of a failure.
    pub error_info: String,
}

/// The answer of `plansys2_msgs/srv/GetStates`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StatesResponse {
    /// `true` if the state was returned.
    pub success: bool,
    /// All true facts, or all fluents with their values.
    pub states: Vec<Node>,
    /// Reason of a failure.
    pub error_info: String,
}
