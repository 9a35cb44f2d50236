//! Lines about single goals.

use elbowroom_execution::GoalTerms;
use elbowroom_num::Rational;
use serde::{Deserialize, Serialize};

use crate::exact::Exact;

/// Returns the terms of a goal from the members of its line.
pub fn terms(value: Option<&Exact>, deadline: Option<&Exact>) -> GoalTerms {
    GoalTerms {
        value: value.map_or(Rational::ONE, |it| it.0.clone()),
        deadline: deadline.map(|it| it.0.clone()),
    }
}

/// Returns the members of a line for the terms of its goal: value and deadline.
pub(crate) fn members(terms: &GoalTerms) -> (Option<Exact>, Option<Exact>) {
    let value = (terms.value != Rational::ONE).then(|| Exact(terms.value.clone()));
    (value, terms.deadline.clone().map(Exact))
}

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
