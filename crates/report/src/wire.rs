//! Commands and observations as JSON.
//!
//! Numbers are written as `{"exact": "1393/2", "decimal": 696.5}`, and read as that, as a number,
//! or as a text.

use elbowroom_execution::{ActionHandle, Command, Ending, Event, Measured, Observation};
use elbowroom_model::Task;
use elbowroom_num::Rational;
use serde::Serialize;
use serde_json::{Value, json};

use crate::schema::{IssuedCommandLine, ObservationLine};

/// Error: a message is invalid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct WireError {
    /// The error.
    pub message: String,
}

pub(crate) fn invalid_message(message: impl Into<String>) -> WireError {
    WireError {
        message: message.into(),
    }
}

/// Writes a number.
pub fn number(value: &Rational) -> Value {
    json!({ "exact": value.to_string(), "decimal": value.to_f64() })
}

/// Reads a number in any of its forms.
pub fn read_number(value: &Value) -> Option<Rational> {
    match value {
        Value::Object(fields) => fields.get("exact")?.as_str()?.parse().ok(),
        Value::String(text) => text.parse().ok(),
        Value::Number(number) => number
            .as_i64()
            .map(Rational::from)
            .or_else(|| Rational::from_f64_as_written(number.as_f64()?)),
        _ => None,
    }
}

/// Returns the field `name` as a number.
///
/// # Errors
/// If it is missing or not a number.
pub fn field_number(message: &Value, name: &str) -> Result<Rational, WireError> {
    let value = message
        .get(name)
        .ok_or_else(|| invalid_message(format!("`{name}` is missing")))?;
    read_number(value).ok_or_else(|| invalid_message(format!("`{name}` must be a number")))
}

/// Returns the field `name` as a text.
///
/// # Errors
/// If it is missing or not a text.
pub fn field_text<'a>(message: &'a Value, name: &str) -> Result<&'a str, WireError> {
    let value = message
        .get(name)
        .ok_or_else(|| invalid_message(format!("`{name}` is missing")))?;
    value
        .as_str()
        .ok_or_else(|| invalid_message(format!("`{name}` must be a string")))
}

/// Writes a command.
pub fn command(command: &Command) -> Value {
    value(&IssuedCommandLine::of(command))
}

/// Writes an observation.
pub fn observation(task: &Task, observation: &Observation) -> Value {
    value(&ObservationLine::of(task, observation))
}

fn value(line: &impl Serialize) -> Value {
    serde_json::to_value(line).unwrap_or(Value::Null)
}

/// Reads an observation. Its facts and fluents need not have been mentioned before.
///
/// # Errors
/// If it is not an observation, or refers to objects that the problem does not have.
pub fn read_observation(message: &Value, task: &Task) -> Result<Observation, WireError> {
    let ticket = || {
        let ticket = message.get("ticket").and_then(Value::as_u64);
        let ticket =
            ticket.ok_or_else(|| invalid_message("`ticket` must be the number of a start"));
        ticket.map(ActionHandle)
    };
    let event = match field_text(message, "type")? {
        "started" => Event::Started {
            ticket: ticket()?,
            measured: read_amounts(message, task)?,
        },
        "ended" => Event::Ended {
            ticket: ticket()?,
            ending: ending(message)?,
            measured: read_amounts(message, task)?,
        },
        "feedback" => Event::Feedback {
            ticket: ticket()?,
            completion: completion(message)?,
            note: match message.get("note") {
                None | Some(Value::Null) => String::new(),
                Some(_) => field_text(message, "note")?.to_owned(),
            },
        },
        "fact" => {
            let name = field_text(message, "fact")?;
            let fact = task.fact_named(name);
            Event::Fact {
                fact: fact
                    .ok_or_else(|| invalid_message(format!("the problem has no fact `{name}`")))?,
                truth: message
                    .get("becomes")
                    .and_then(Value::as_bool)
                    .ok_or_else(|| invalid_message("`becomes` must be true or false"))?,
            }
        }
        "value" => {
            let name = field_text(message, "fluent")?;
            let fluent = task.fluent_named(name);
            Event::Value {
                fluent: fluent.ok_or_else(|| {
                    invalid_message(format!("the problem has no fluent `{name}`"))
                })?,
                value: field_number(message, "value")?,
            }
        }
        // Record of an invalid message.
        "unintelligible" => Event::Unintelligible {
            said: field_text(message, "said")?.to_owned(),
            why: field_text(message, "why")?.to_owned(),
        },
        other => {
            return Err(invalid_message(format!(
                "unknown type of observation `{other}`; expected started, ended, feedback, fact or \
                 value"
            )));
        }
    };
    Ok(Observation {
        time: field_number(message, "time")?,
        event,
    })
}

fn completion(message: &Value) -> Result<Option<Rational>, WireError> {
    let Some(value) = message.get("completion").filter(|value| !value.is_null()) else {
        return Ok(None);
    };
    let completion = read_number(value);
    let completion = completion.filter(|part| !part.is_negative() && *part <= Rational::ONE);
    match completion {
        Some(part) => Ok(Some(part)),
        None => Err(invalid_message("`completion` must be a number from 0 to 1")),
    }
}

fn ending(message: &Value) -> Result<Ending, WireError> {
    Ok(match field_text(message, "outcome")? {
        "succeeded" => Ending::Succeeded,
        "failed" => Ending::Failed {
            why: field_text(message, "why").unwrap_or_default().to_owned(),
        },
        "cancelled" => Ending::Cancelled,
        other => {
            return Err(invalid_message(format!(
                "unknown outcome `{other}`; expected succeeded, failed or cancelled"
            )));
        }
    })
}

fn read_amounts(message: &Value, task: &Task) -> Result<Vec<Measured>, WireError> {
    let Some(measured) = message.get("measured") else {
        return Ok(Vec::new());
    };
    let entries = measured
        .as_object()
        .ok_or_else(|| invalid_message("`measured` must be an object from fluents to amounts"))?;
    let read = |(name, value): (&String, &Value)| {
        let fluent = task.fluent_named(name);
        Ok(Measured {
            fluent: fluent
                .ok_or_else(|| invalid_message(format!("the problem has no fluent `{name}`")))?,
            amount: read_number(value).ok_or_else(|| {
                invalid_message(format!("the amount of `{name}` must be a number"))
            })?,
        })
    };
    entries.iter().map(read).collect()
}
