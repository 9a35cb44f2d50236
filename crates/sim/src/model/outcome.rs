//! What a failure leaves behind, and how long it holds things up.

use elbowroom_num::Rational;
use rand::Rng;

use super::Failing;

/// One of the ways in which things may stand when an action has failed.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// How likely it is, given that the action fails.
    pub probability: f64,
    /// What changes, in this order, when the action is told to have failed.
    pub changes: Vec<OutcomeChange>,
    /// For how many seconds more the action is under way: it fails that much later, and until then
    /// nobody can start it again or cancel it.
    pub delay: Rational,
    /// Whether the world reports the changes.
    pub is_reported: bool,
}

/// A fact or a fluent that a failure changes.
#[derive(Clone, Debug, PartialEq)]
pub struct OutcomeChange {
    /// Which one.
    pub what: Template,
    /// What becomes of it.
    pub becomes: Becoming,
}

/// What becomes of a fact or a fluent.
#[derive(Clone, Debug, PartialEq)]
pub enum Becoming {
    /// The fact becomes true or false.
    Truth(bool),
    /// The fluent gets a value.
    Value(Rational),
    /// The fluent grows by this, or shrinks if it is negative; one without a value stays without.
    Grown(Rational),
}

/// A fact or a fluent, some of whose objects may be those of an action.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Template {
    pub(super) name: String,
    pub(super) objects: Vec<Word>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Word {
    Object(String),
    /// The object that the action has at this place.
    Argument(usize),
}

impl Template {
    /// What is meant when the action is `(name object …)`: `(predicate object …)`, or
    /// `(function object …)`.
    pub fn of(&self, action: &str) -> String {
        let action: Vec<&str> = action
            .trim_matches(['(', ')'])
            .split_whitespace()
            .skip(1)
            .collect();
        let mut name = format!("({}", self.name);
        for word in &self.objects {
            name.push(' ');
            name.push_str(match word {
                Word::Object(object) => object,
                Word::Argument(place) => action.get(*place).copied().unwrap_or_default(),
            });
        }
        name.push(')');
        name
    }
}

impl Failing {
    /// Which of its outcomes a failure has; `None`: none of them.
    pub fn outcome(&self, rng: &mut impl Rng) -> Option<&Outcome> {
        let mut left = rng.random::<f64>();
        self.outcomes.iter().find(|outcome| {
            left -= outcome.probability;
            left < 0.0
        })
    }
}
