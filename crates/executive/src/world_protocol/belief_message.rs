//! Message that reports the belief state of the run to a world.

use elbowroom::model::Task;
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;
use elbowroom::report::wire;
use serde_json::{Value, json};

/// Returns the message `believed` with changed facts and values of the belief state at `now`, in seconds. A value of
/// `None` is no longer known. Derived facts are omitted.
pub fn belief_message<'a>(
    task: &Task,
    now: &Rational,
    facts: impl Iterator<Item = (FactId, bool)>,
    values: impl Iterator<Item = (FluentId, Option<&'a Rational>)>,
) -> Value {
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
