//! The validator's objection to a plan.

use elbowroom_model::validate::Violation;
use elbowroom_num::Rational;
use serde::{Deserialize, Serialize};

/// The first violation in a plan: its time, its action and a description.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ViolationAnswer {
    /// The time.
    #[serde(with = "super::exact")]
    pub time: Rational,
    /// The action; `None` if the goal does not hold.
    pub action: Option<String>,
    /// The position of that action in the plan, from 0.
    pub step: Option<usize>,
    /// Description of the violation.
    pub message: String,
}

impl From<&Violation> for ViolationAnswer {
    fn from(violation: &Violation) -> Self {
        let action = violation.action.as_ref();
        Self {
            time: violation.time.clone(),
            action: action.map(|action| action.name.clone()),
            step: action.map(|action| action.step),
            message: violation.to_string(),
        }
    }
}
