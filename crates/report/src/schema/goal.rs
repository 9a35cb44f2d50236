//! Lines about single goals.

use elbowroom_execution::GoalTerms;
use elbowroom_num::Rational;
use serde::{Deserialize, Serialize};

use crate::exact::Exact;

/// Members of a line for the terms of its goal. Each is `None` if it has its default.
#[derive(Clone, Debug, Default)]
pub struct TermsLine {
    /// The value.
    pub value: Option<Exact>,
    /// The deadline.
    pub deadline: Option<Exact>,
    /// The release time.
    pub release: Option<Exact>,
    /// `true` for a goal to keep.
    pub keep: bool,
    /// The author.
    pub by: Option<String>,
}

impl TermsLine {
    /// Returns the members for these terms.
    pub fn of(terms: &GoalTerms) -> Self {
        Self {
            value: (terms.value != Rational::ONE).then(|| Exact(terms.value.clone())),
            deadline: terms.deadline.clone().map(Exact),
            release: terms.release.clone().map(Exact),
            keep: terms.keep,
            by: terms.by.clone(),
        }
    }

    /// Returns the terms.
    pub fn terms(self) -> GoalTerms {
        GoalTerms {
            value: self.value.map_or(Rational::ONE, |it| it.0),
            deadline: self.deadline.map(|it| it.0),
            release: self.release.map(|it| it.0),
            keep: self.keep,
            by: self.by,
        }
    }
}

/// A goal of a lasting run is released, closed, set aside, or pursued again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GoalChangeLine {
    /// The time.
    pub now: Exact,
    /// The name of the goal.
    pub name: String,
    /// The change.
    pub becomes: GoalState,
    /// The reason for which it is set aside or queued, or has failed.
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
    /// The release time of the goal has come, and it is pursued.
    Released,
    /// The goal is to be kept, and holds.
    Kept,
    /// The goal is to be kept, does not hold, and is not pursued now.
    Queued,
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
            Self::Released => "released",
            Self::Kept => "kept",
            Self::Queued => "queued",
            Self::Failed => "failed",
        }
    }
}
