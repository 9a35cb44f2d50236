//! The message that says what is believed.

use elbowroom::model::Task;
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;
use elbowroom::report::wire;
use serde_json::{Value, json};

/// What a program is told of what is believed: these facts and values, which are new to it. A value that is not known
/// any more is `None`.
pub(crate) fn believed<'a>(
    task: &Task,
    now: &Rational,
    facts: impl Iterator<Item = (FactId, bool)>,
    values: impl Iterator<Item = (FluentId, Option<&'a Rational>)>,
) -> Value {
    // What follows from other facts is nobody's to be told: it is as they are.
    let facts = facts.filter(|(fact, _)| !task.is_derived(*fact));
    let facts = facts.map(|(fact, truth)| (task.fact_name(fact), truth.into()));
    let values = values.map(|(fluent, value)| {
        let value = value.map_or(Value::Null, wire::number);
        (task.fluent_name(fluent), value)
    });
    json!({
        "type": "believed",
        "now": wire::number(now),
        "facts": facts.collect::<serde_json::Map<_, _>>(),
        "values": values.collect::<serde_json::Map<_, _>>(),
    })
}
