//! Facts and fluents, by the names on both sides.

use std::collections::BTreeMap;

use super::Call;
use crate::knowledge::{Node, Param, node};

/// Value of a fluent, or 1 for a true fact; `None` for a false fact or an undefined fluent.
pub(super) type Value = Option<f64>;

/// Known state of one side.
pub(super) type State = BTreeMap<Key, Value>;

/// Fact or fluent, as its words in lower case.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Key {
    /// A fact.
    Fact(Vec<String>),
    /// A fluent.
    Number(Vec<String>),
}

/// Change made by others.
#[derive(Clone, Debug, PartialEq)]
pub enum ExternalChange {
    /// New truth value of a fact.
    Fact(String, bool),
    /// New value of a fluent.
    Value(String, f64),
}

impl Key {
    pub(super) fn fact(name: &str) -> Self {
        Self::Fact(words(name))
    }

    pub(super) fn number(name: &str) -> Self {
        Self::Number(words(name))
    }

    /// Returns the key of a fact of the problem expert, and records the spelling of its words.
    pub(super) fn of_fact(node: &Node, spelling: &mut BTreeMap<String, String>) -> Self {
        Self::Fact(note_spelling(node, spelling))
    }

    pub(super) fn of_number(node: &Node, spelling: &mut BTreeMap<String, String>) -> Self {
        Self::Number(note_spelling(node, spelling))
    }

    fn words(&self) -> &[String] {
        let (Self::Fact(words) | Self::Number(words)) = self;
        words
    }

    /// Returns the fact or fluent as PDDL, such as `(at r1 gate)`.
    fn name(&self) -> String {
        format!("({})", self.words().join(" "))
    }

    /// Returns the fact or fluent with its value, as PDDL.
    pub(super) fn to_pddl(&self, value: Value) -> String {
        match (self, value) {
            (Self::Fact(_), Some(_)) => self.name(),
            (Self::Fact(_), None) => format!("(not {})", self.name()),
            (Self::Number(_), Some(value)) => format!("(= {} {value})", self.name()),
            (Self::Number(_), None) => format!("{} without a value", self.name()),
        }
    }
}

impl ExternalChange {
    /// Returns the change. A fluent that has lost its value cannot be reported to a run.
    pub(super) fn of(key: &Key, value: Value) -> Option<Self> {
        match key {
            Key::Fact(_) => Some(Self::Fact(key.name(), value.is_some())),
            Key::Number(_) => value.map(|value| Self::Value(key.name(), value)),
        }
    }
}

/// Returns the call that makes the change in the problem expert.
pub(super) fn change_of(
    key: &Key,
    value: Value,
    is_defined: bool,
    spelling: &BTreeMap<String, String>,
) -> Call {
    let spelled = |word: &String| spelling.get(word).unwrap_or(word).clone();
    let mut words = key.words().iter().map(spelled);
    let name = words.next().unwrap_or_default();
    let parameter = |name| Param {
        name,
        ..Param::default()
    };
    let node = Node {
        node_type: match key {
            Key::Fact(_) => node::PREDICATE,
            Key::Number(_) => node::FUNCTION,
        },
        name,
        parameters: words.map(parameter).collect(),
        value: match key {
            Key::Fact(_) => 0.0,
            Key::Number(_) => value.unwrap_or_default(),
        },
        ..Node::default()
    };
    match (key, value.is_some()) {
        (Key::Fact(_), true) => Call::Add(node),
        (Key::Fact(_), false) => Call::Remove(node),
        (Key::Number(_), true) if is_defined => Call::Update(node),
        (Key::Number(_), true) => Call::Define(node),
        (Key::Number(_), false) => Call::Forget(node),
    }
}

fn words(name: &str) -> Vec<String> {
    let inner = name.trim_matches(|it: char| it == '(' || it == ')' || it.is_whitespace());
    inner.split_whitespace().map(str::to_lowercase).collect()
}

fn note_spelling(node: &Node, spelling: &mut BTreeMap<String, String>) -> Vec<String> {
    let objects = node.parameters.iter().map(|it| &it.name);
    let written = std::iter::once(&node.name).chain(objects);
    let noted = written.map(|word| {
        let lower = word.to_lowercase();
        if lower != *word {
            spelling.insert(lower.clone(), word.clone());
        }
        lower
    });
    noted.collect()
}
