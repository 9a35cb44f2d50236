//! Facts and numbers, by the names that both sides have for them.

use std::collections::BTreeMap;

use super::Call;
use crate::knowledge::{Node, Param, node};

/// What is so: of a fluent its value, of a fact 1 where it is true; else nothing.
pub(super) type Value = Option<f64>;

/// All that is known of one side.
pub(super) type State = BTreeMap<Key, Value>;

/// A fact or a fluent: its words, in lower case.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Key {
    /// A fact.
    Fact(Vec<String>),
    /// A fluent.
    Number(Vec<String>),
}

/// Something that others have changed.
#[derive(Clone, Debug, PartialEq)]
pub enum Seen {
    /// This fact is so now.
    Fact(String, bool),
    /// This fluent has this value now.
    Value(String, f64),
}

impl Key {
    pub(super) fn fact(name: &str) -> Self {
        Self::Fact(words(name))
    }

    pub(super) fn number(name: &str) -> Self {
        Self::Number(words(name))
    }

    /// As the problem expert has it, whose spelling is noted.
    pub(super) fn of_fact(node: &Node, spelling: &mut BTreeMap<String, String>) -> Self {
        Self::Fact(noted(node, spelling))
    }

    pub(super) fn of_number(node: &Node, spelling: &mut BTreeMap<String, String>) -> Self {
        Self::Number(noted(node, spelling))
    }

    fn words(&self) -> &[String] {
        let (Self::Fact(words) | Self::Number(words)) = self;
        words
    }

    /// `(at r1 gate)`.
    fn name(&self) -> String {
        format!("({})", self.words().join(" "))
    }

    /// In words.
    pub(super) fn told(&self, value: Value) -> String {
        match (self, value) {
            (Self::Fact(_), Some(_)) => self.name(),
            (Self::Fact(_), None) => format!("(not {})", self.name()),
            (Self::Number(_), Some(value)) => format!("(= {} {value})", self.name()),
            (Self::Number(_), None) => format!("{} without a value", self.name()),
        }
    }
}

impl Seen {
    /// A fluent that has lost its value is none that a run could be told of.
    pub(super) fn of(key: &Key, value: Value) -> Option<Self> {
        match key {
            Key::Fact(_) => Some(Self::Fact(key.name(), value.is_some())),
            Key::Number(_) => value.map(|value| Self::Value(key.name(), value)),
        }
    }
}

/// By which call the problem expert comes to have that.
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

fn noted(node: &Node, spelling: &mut BTreeMap<String, String>) -> Vec<String> {
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
