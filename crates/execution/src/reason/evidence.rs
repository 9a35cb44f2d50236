//! The explanation of a reason: [`Evidence`], and its text.

use std::fmt;

use elbowroom_model::Task;
use elbowroom_model::ground::Change;
use elbowroom_num::Rational;

use crate::event::Ending;

/// A constraint of the plan, a condition or an event that explains a [`Reason`](super::Reason).
///
/// Only its [`Display`](fmt::Display) turns it into text. Times are on the world's clock.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Evidence {
    /// The plan's bounds on the duration of this action.
    Duration(String),
    /// One time point of the plan comes before another, both as the plan describes them.
    Order {
        /// The earlier one.
        first: String,
        /// The later one.
        second: String,
    },
    /// Coming timed initials.
    Timed {
        /// The changes.
        changes: Vec<TimedChange>,
        /// The time, if it is given.
        at: Option<Rational>,
    },
    /// Further constraints, between the previous one and the next one.
    Others,
    /// A condition that would not hold, in the language of the problem.
    Condition(String),
    /// Timed initials that have happened.
    Past(Vec<TimedChange>),
    /// The effects of this action at its start.
    Start(String),
    /// The effects of this action at its end.
    End(String),
    /// This action has failed.
    Failed {
        /// The action.
        action: String,
        /// The world's explanation; empty if there is none.
        why: String,
    },
    /// This action was cancelled.
    Cancelled(String),
    /// This action has started.
    Started {
        /// The action.
        action: String,
        /// The time.
        at: Rational,
    },
    /// This action has ended.
    Ended {
        /// The action.
        action: String,
        /// The outcome.
        ending: Ending,
        /// The time.
        at: Rational,
    },
    /// A fact was observed.
    Fact {
        /// The fact.
        fact: String,
        /// Its truth.
        truth: bool,
    },
    /// A fluent was observed.
    Value {
        /// The fluent.
        fluent: String,
        /// Its value, if it has one.
        value: Option<Rational>,
    },
}

/// The change of a fact or a fluent by a timed initial.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TimedChange {
    /// This fact becomes true.
    True(String),
    /// This fact becomes false.
    False(String),
    /// This fluent gets another value.
    Value(String),
}

impl TimedChange {
    /// Returns the changes by name.
    pub(crate) fn all(task: &Task, changes: &[Change]) -> Vec<Self> {
        let named = changes.iter().map(|change| match change {
            Change::Add(fact) => Self::True(task.fact_name(*fact)),
            Change::Delete(fact) => Self::False(task.fact_name(*fact)),
            Change::Update { fluent, .. } => Self::Value(task.fluent_name(*fluent)),
        });
        named.collect()
    }

    fn describe(&self, is_past: bool) -> String {
        let becomes = if is_past { "became" } else { "becomes" };
        match self {
            Self::True(fact) => format!("{fact} {becomes} true"),
            Self::False(fact) => format!("{fact} {becomes} false"),
            Self::Value(fluent) if is_past => format!("{fluent} changed"),
            Self::Value(fluent) => format!("{fluent} changes"),
        }
    }
}

fn list_changes(changes: &[TimedChange], is_past: bool) -> String {
    let words = changes.iter().map(|change| change.describe(is_past));
    words.collect::<Vec<_>>().join(", ")
}

impl fmt::Display for Evidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Duration(action) => write!(f, "the duration of {action}"),
            Self::Order { first, second } => write!(f, "{first} before {second}"),
            Self::Timed { changes, at } => {
                f.write_str(&list_changes(changes, false))?;
                match at {
                    Some(time) => write!(f, " at {}", time.to_decimal(3)),
                    None => Ok(()),
                }
            }
            Self::Others => f.write_str("…"),
            Self::Condition(condition) => f.write_str(condition),
            Self::Past(changes) => f.write_str(&list_changes(changes, true)),
            Self::Start(action) => write!(f, "the start of {action}"),
            Self::End(action) => write!(f, "the end of {action}"),
            Self::Failed { action, why } if why.is_empty() => write!(f, "{action} failed"),
            Self::Failed { action, why } => write!(f, "{action} failed: {why}"),
            Self::Cancelled(action) => write!(f, "{action} was cancelled"),
            Self::Started { action, at } => write!(f, "{action} started at {}", at.to_decimal(3)),
            Self::Ended { action, ending, at } => {
                write!(f, "{action} {} at {}", ending.name(), at.to_decimal(3))
            }
            Self::Fact { fact, truth } => write!(f, "{fact} was seen to be {truth}"),
            Self::Value {
                fluent,
                value: Some(value),
            } => write!(f, "{fluent} was seen to be {}", value.to_decimal(3)),
            Self::Value {
                fluent,
                value: None,
            } => write!(f, "{fluent} was seen to have no value"),
        }
    }
}
