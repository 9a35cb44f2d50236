//! Lines about single goals.

use serde::{Deserialize, Serialize};

use crate::exact::Exact;

/// One of several goals of a lasting run is closed, set aside, or pursued again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GoalChangeLine {
    /// The time.
    pub now: Exact,
    /// The name of the goal.
    pub name: String,
    /// The change.
    pub becomes: GoalState,
    /// The reason for which it is set aside, or has failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
}

/// The state of a goal after a change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GoalState {
    /// The goal is achieved, and closed.
    Achieved,
    /// The goal is not pursued while others are, because no plan reaches it together with these.
    SetAside,
    /// The goal is pursued again.
    Pursued,
    /// The goal is closed, and was not achieved by its deadline.
    Failed,
}

impl GoalState {
    /// The state in words.
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Achieved => "achieved",
            Self::SetAside => "set aside",
            Self::Pursued => "pursued again",
            Self::Failed => "failed",
        }
    }
}
