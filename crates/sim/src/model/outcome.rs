//! Outcomes of failures: changes, and a delay of the failure.

use elbowroom_num::Rational;
use rand::Rng;

use super::FailureRule;

/// A possible outcome of a failure.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// The probability of the outcome, given that the action fails.
    pub probability: f64,
    /// The changes, in this order, at the time at which the failure is reported.
    pub changes: Vec<OutcomeChange>,
    /// The delay of the failure, in seconds. The action is running until then, and can neither be
    /// started again nor be cancelled.
    pub delay: Rational,
    /// `true` if the world reports the changes.
    pub is_reported: bool,
}

/// A fact or a fluent that a failure changes.
#[derive(Clone, Debug, PartialEq)]
pub struct OutcomeChange {
    /// The fact or fluent.
    pub target: Template,
    /// Its change.
    pub change: FactOutcome,
}

/// A change of a fact or a fluent.
#[derive(Clone, Debug, PartialEq)]
pub enum FactOutcome {
    /// The fact becomes true or false.
    Truth(bool),
    /// The fluent gets a value.
    Value(Rational),
    /// The number is added to the fluent's value; a fluent without a value does not get one.
    ChangedBy(Rational),
}

/// A fact or a fluent, with objects and arguments of an action.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Template {
    pub(super) name: String,
    pub(super) objects: Vec<TemplateArgument>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum TemplateArgument {
    Object(String),
    /// The argument of the action at this index.
    Argument(usize),
}

impl Template {
    /// Returns the ground name, `(predicate object …)` or `(function object …)`, for the action
    /// `(name object …)`.
    pub fn instantiate(&self, action: &str) -> String {
        let action: Vec<&str> = action
            .trim_matches(['(', ')'])
            .split_whitespace()
            .skip(1)
            .collect();
        let mut name = format!("({}", self.name);
        for word in &self.objects {
            name.push(' ');
            name.push_str(match word {
                TemplateArgument::Object(object) => object,
                TemplateArgument::Argument(place) => {
                    action.get(*place).copied().unwrap_or_default()
                }
            });
        }
        name.push(')');
        name
    }
}

impl FailureRule {
    /// Draws the outcome of a failure; `None` if none of them applies.
    pub fn outcome(&self, rng: &mut impl Rng) -> Option<&Outcome> {
        let mut left = rng.random::<f64>();
        self.outcomes.iter().find(|outcome| {
            left -= outcome.probability;
            left < 0.0
        })
    }
}
