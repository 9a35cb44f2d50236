//! Commands and observations as JSON.
//!
//! Numbers are written as `{"exact": "1393/2", "decimal": 696.5}`, and read as that, as a number,
//! or as a text.

use std::sync::Arc;

use elbowroom_execution::{Command, Ending, Event, Measured, Observation, Ticket};
use elbowroom_model::Task;
use elbowroom_num::Rational;
use serde_json::{Value, json};

use crate::Names;

/// A message that cannot be understood.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct WireError {
    /// What is wrong with it.
    pub message: String,
}

pub(crate) fn wrong(message: impl Into<String>) -> WireError {
    WireError {
        message: message.into(),
    }
}

/// A number.
pub fn number(value: &Rational) -> Value {
    json!({ "exact": value.to_string(), "decimal": value.to_f64() })
}

/// A number or `null`.
pub fn optional(value: Option<&Rational>) -> Value {
    value.map_or(Value::Null, number)
}

/// Reads a number in any of its forms.
pub fn read_number(value: &Value) -> Option<Rational> {
    match value {
        Value::Object(fields) => fields.get("exact")?.as_str()?.parse().ok(),
        Value::String(text) => text.parse().ok(),
        // The shortest text that gives the float back is what somebody wrote.
        Value::Number(number) => number
            .as_i64()
            .map(Rational::from)
            .or_else(|| number.as_f64()?.to_string().parse().ok()),
        _ => None,
    }
}

/// The field `name` as a number.
///
/// # Errors
/// When it is missing, or no number.
pub fn field_number(message: &Value, name: &str) -> Result<Rational, WireError> {
    let value = message
        .get(name)
        .ok_or_else(|| wrong(format!("`{name}` is missing")))?;
    read_number(value).ok_or_else(|| wrong(format!("`{name}` must be a number")))
}

/// The field `name` as a text.
///
/// # Errors
/// When it is missing, or no text.
pub fn field_text<'a>(message: &'a Value, name: &str) -> Result<&'a str, WireError> {
    let value = message
        .get(name)
        .ok_or_else(|| wrong(format!("`{name}` is missing")))?;
    value
        .as_str()
        .ok_or_else(|| wrong(format!("`{name}` must be a text")))
}

/// A command.
pub fn command(command: &Command) -> Value {
    match command {
        Command::Start {
            ticket,
            action,
            duration,
        } => json!({
            "type": "start",
            "ticket": ticket.0,
            "action": action.name,
            "duration": optional(duration.as_ref()),
        }),
        Command::Cancel { ticket } => json!({ "type": "cancel", "ticket": ticket.0 }),
    }
}

/// An observation.
pub fn observation(task: &Task, observation: &Observation) -> Value {
    let mut message = match &observation.event {
        Event::Started { ticket, measured } => json!({
            "type": "started",
            "ticket": ticket.0,
            "measured": amounts(task, measured),
        }),
        Event::Ended {
            ticket,
            ending,
            measured,
        } => {
            let mut message = json!({
                "type": "ended",
                "ticket": ticket.0,
                "outcome": ending.name(),
                "measured": amounts(task, measured),
            });
            if let Ending::Failed { why } = ending {
                message["why"] = json!(why);
            }
            message
        }
        Event::Fact { fact, truth } => json!({
            "type": "fact",
            "fact": task.fact_name(*fact),
            "becomes": truth,
        }),
        Event::Value { fluent, value } => json!({
            "type": "value",
            "fluent": task.fluent_name(*fluent),
            "value": number(value),
        }),
        Event::Unintelligible { said, why } => json!({
            "type": "unintelligible",
            "said": said,
            "why": why,
        }),
    };
    message["time"] = number(&observation.time);
    message
}

/// Enters what an observation mentions in the table, if the problem has it and nothing has mentioned
/// it before; whether the table has grown. Who watches the world cannot know what plans mention.
pub fn mention(message: &Value, names: &mut Names, task: &mut Arc<Task>) -> bool {
    let text = |name: &str| message.get(name).and_then(Value::as_str);
    let before = (task.fact_count(), task.fluent_count());
    match text("type") {
        Some("fact") => {
            if let Some(name) = text("fact").filter(|name| names.fact(name).is_none()) {
                Arc::make_mut(task).mention_fact(name);
            }
        }
        Some("value") => {
            if let Some(name) = text("fluent").filter(|name| names.fluent(name).is_none()) {
                Arc::make_mut(task).mention_fluent(name);
            }
        }
        _ => {}
    }
    let has_grown = (task.fact_count(), task.fluent_count()) != before;
    if has_grown {
        names.learn(task);
    }
    has_grown
}

/// Reads an observation.
///
/// # Errors
/// When it is none, or names what the problem does not have.
pub fn read_observation(message: &Value, names: &Names) -> Result<Observation, WireError> {
    let ticket = || {
        let ticket = message.get("ticket").and_then(Value::as_u64);
        let ticket = ticket.ok_or_else(|| wrong("`ticket` must be the number of a start"));
        ticket.map(Ticket)
    };
    let event = match field_text(message, "type")? {
        "started" => Event::Started {
            ticket: ticket()?,
            measured: read_amounts(message, names)?,
        },
        "ended" => Event::Ended {
            ticket: ticket()?,
            ending: ending(message)?,
            measured: read_amounts(message, names)?,
        },
        "fact" => {
            let name = field_text(message, "fact")?;
            let fact = names.fact(name);
            Event::Fact {
                fact: fact.ok_or_else(|| wrong(format!("the problem has no fact `{name}`")))?,
                truth: message
                    .get("becomes")
                    .and_then(Value::as_bool)
                    .ok_or_else(|| wrong("`becomes` must be true or false"))?,
            }
        }
        "value" => {
            let name = field_text(message, "fluent")?;
            let fluent = names.fluent(name);
            Event::Value {
                fluent: fluent
                    .ok_or_else(|| wrong(format!("the problem has no fluent `{name}`")))?,
                value: field_number(message, "value")?,
            }
        }
        // What was written down of something that could not be read.
        "unintelligible" => Event::Unintelligible {
            said: field_text(message, "said")?.to_owned(),
            why: field_text(message, "why")?.to_owned(),
        },
        other => {
            return Err(wrong(format!(
                "`{other}` is no type of observation: started, ended, fact, value"
            )));
        }
    };
    Ok(Observation {
        time: field_number(message, "time")?,
        event,
    })
}

fn ending(message: &Value) -> Result<Ending, WireError> {
    Ok(match field_text(message, "outcome")? {
        "succeeded" => Ending::Succeeded,
        "failed" => Ending::Failed {
            why: field_text(message, "why").unwrap_or_default().to_owned(),
        },
        "cancelled" => Ending::Cancelled,
        other => {
            return Err(wrong(format!(
                "`{other}` is no outcome: succeeded, failed, cancelled"
            )));
        }
    })
}

fn amounts(task: &Task, measured: &[Measured]) -> Value {
    let entries = measured
        .iter()
        .map(|measured| (task.fluent_name(measured.fluent), number(&measured.amount)));
    Value::Object(entries.collect())
}

fn read_amounts(message: &Value, names: &Names) -> Result<Vec<Measured>, WireError> {
    let Some(measured) = message.get("measured") else {
        return Ok(Vec::new());
    };
    let entries = measured
        .as_object()
        .ok_or_else(|| wrong("`measured` must be an object: fluent to amount"))?;
    let read = |(name, value): (&String, &Value)| {
        let fluent = names.fluent(name);
        Ok(Measured {
            fluent: fluent.ok_or_else(|| wrong(format!("the problem has no fluent `{name}`")))?,
            amount: read_number(value)
                .ok_or_else(|| wrong(format!("the amount of `{name}` must be a number")))?,
        })
    };
    entries.iter().map(read).collect()
}
