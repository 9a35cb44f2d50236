//! Stream of the state of an executive, as one document and its differences.

use std::collections::BTreeMap;
use std::io::{self, Write as _};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use elbowroom::answers::envelope::timeline;
use elbowroom_page::lanes_of_actions;
use serde_json::{Map, Value, json};

use super::router::{ApiRouter, ServedRun};
use crate::clock::Clock;
use crate::http::Stream;
use crate::interface::documents::PlanNow;
use crate::trace_buffer::Subscriber as _;

/// Least time between two messages.
const MIN_INTERVAL: Duration = Duration::from_millis(200);

/// Longest time between two messages.
const MAX_INTERVAL: Duration = Duration::from_millis(500);

/// Time after which a document is computed again even if the trace has no new lines.
const MAX_AGE: Duration = Duration::from_secs(1);

/// Last document, shared by all clients.
#[derive(Default)]
pub(super) struct DocumentCache(Mutex<Option<(usize, Clock, Value)>>);

impl ApiRouter {
    /// Sends the document, and then a merge patch (RFC 7396) for each change and at least every half second, until the
    /// run ends or the client disconnects.
    ///
    /// # Errors
    /// When the client cannot be written to.
    pub(super) fn stream_state(&self, stream: &mut Stream) -> io::Result<()> {
        let mut sent = Value::Null;
        let (mut lines, mut is_over) = self.buffer.wait_for_lines(0, Duration::ZERO);
        loop {
            let document = self.document(lines);
            if sent.is_null() {
                write!(stream, "event: document\ndata: {document}\n\n")?;
            } else {
                let patch = merge_patch(&sent, &document).unwrap_or_else(|| json!({}));
                write!(stream, "event: change\ndata: {patch}\n\n")?;
            }
            if is_over {
                stream.write_all(b"event: over\ndata: {}\n\n")?;
                return stream.flush();
            }
            stream.flush()?;
            sent = document;
            thread::sleep(MIN_INTERVAL);
            let wait = MAX_INTERVAL.saturating_sub(MIN_INTERVAL);
            (lines, is_over) = self.buffer.wait_for_lines(lines, wait);
            if stream.has_disconnected() {
                return Ok(());
            }
        }
    }

    /// Returns the document of a run whose trace has `lines` lines. The cached one is used if it is recent; its time is
    /// always current.
    fn document(&self, lines: usize) -> Value {
        let cached = self.documents.0.lock();
        let mut cached = cached.unwrap_or_else(PoisonError::into_inner);
        let is_current =
            |(of, age, _): &(usize, Clock, Value)| *of >= lines && age.elapsed() < MAX_AGE;
        if cached.as_ref().is_none_or(|it| !is_current(it)) {
            *cached = Some((lines, Clock::start(), self.whole_document()));
        }
        let mut document = cached.as_ref().map_or(Value::Null, |(_, _, it)| it.clone());
        drop(cached);
        if let Ok(run) = self.run() {
            document["now"] = json!(run.status.now().to_f64());
        }
        let queue = self.queue();
        let news = [
            ("unanswered", queue.silence().map(Value::from)),
            ("restarting", queue.world_restart().map(Value::from)),
        ];
        for (name, value) in news {
            let members = document.as_object_mut();
            members.map(|it| match value {
                Some(value) => it.insert(name.to_owned(), value),
                None => it.remove(name),
            });
        }
        document
    }

    fn whole_document(&self) -> Value {
        let mut state = self.state();
        (state.facts, state.numbers) = (Vec::new(), Vec::new());
        let mut document = json!(state);
        if let Ok(run) = self.run() {
            let plan = run.status.plan();
            document["lanes"] = json!(lanes(run, &plan));
            document["goals"] = json!(run.status.all_goals().goals);
            document["plan"] = json!(plan);
            document["guarantee"] = json!(run.status.guarantee());
            document["next"] = json!(run.status.next());
        }
        compact(document)
    }
}

/// Returns the lane of each action of the plan, and of those that ended last.
fn lanes(run: &ServedRun, plan: &PlanNow) -> BTreeMap<String, String> {
    let steps = plan.steps.iter().map(|step| {
        let start = step.start.0.to_f64();
        let duration = step.duration.as_ref().map_or(0.0, |it| it.0.to_f64());
        (step.action.as_str(), (start, start + duration))
    });
    let ended = plan.ended.iter();
    let ended = ended.map(|it| (it.action.as_str(), (it.since.0.to_f64(), it.end.0.to_f64())));
    // Actions of the plan that have ended count once.
    let is_open = |step: &(&str, (f64, f64))| !plan.ended.iter().any(|it| it.action == step.0);
    let actions: Vec<_> = ended.chain(steps.filter(is_open)).collect();
    let types = timeline::types(&run.task, actions.iter().map(|(name, _)| *name));
    let type_of = |object: &str| types.get(object).map(String::as_str);
    let lanes = lanes_of_actions(&actions, &type_of).into_iter();
    lanes.map(|(name, lane)| (name.to_owned(), lane)).collect()
}

/// Converts a document to a form with small differences: lists of objects become objects by key, numbers become
/// decimals, and members that are null are left out.
fn compact(value: Value) -> Value {
    match value {
        Value::Object(members) => match (members.get("exact"), members.get("decimal")) {
            (Some(_), Some(Value::Number(decimal))) => Value::Number(decimal.clone()),
            (Some(exact), Some(Value::Null)) => exact.clone(),
            _ => {
                let members = members.into_iter().filter(|(_, value)| !value.is_null());
                members
                    .map(|(name, value)| (name, compact(value)))
                    .collect()
            }
        },
        Value::Array(items) => {
            let mut keyed = Map::new();
            for (index, item) in items.into_iter().enumerate() {
                let mut key = key(index, &item);
                while keyed.contains_key(&key) {
                    key.push('+');
                }
                keyed.insert(key, compact(item));
            }
            Value::Object(keyed)
        }
        other => other,
    }
}

/// Returns the key of an item of a list: its ticket, its name with the time at which it was given, or its position.
fn key(index: usize, item: &Value) -> String {
    // A step of a plan has a ticket only once it is started.
    let has_end = item.get("end").is_some() || item.get("start").is_none();
    match (
        item.get("ticket"),
        item.get("name"),
        &item["given"]["exact"],
    ) {
        (Some(ticket), ..) if has_end => ticket.to_string(),
        (_, Some(Value::String(name)), Value::String(given)) => format!("{name} {given}"),
        (_, Some(Value::String(name)), _) => name.clone(),
        _ => index.to_string(),
    }
}

/// Returns the merge patch (RFC 7396) that turns `before` into `after`, or `None` if they are equal. Neither contains
/// nulls.
fn merge_patch(before: &Value, after: &Value) -> Option<Value> {
    let (Value::Object(old), Value::Object(new)) = (before, after) else {
        return (before != after).then(|| after.clone());
    };
    let removed = old.keys().filter(|name| !new.contains_key(*name));
    let mut patch: Map<String, Value> = removed.map(|it| (it.clone(), Value::Null)).collect();
    for (name, value) in new {
        match old.get(name) {
            Some(known) => patch.extend(merge_patch(known, value).map(|it| (name.clone(), it))),
            None => drop(patch.insert(name.clone(), value.clone())),
        }
    }
    (!patch.is_empty()).then_some(Value::Object(patch))
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::{compact, merge_patch};

    /// Applies a patch as RFC 7396 says.
    fn apply(target: &mut Value, patch: &Value) {
        let Value::Object(members) = patch else {
            *target = patch.clone();
            return;
        };
        if !target.is_object() {
            *target = json!({});
        }
        for (name, value) in members {
            if value.is_null() {
                drop(target.as_object_mut().map(|it| it.remove(name)));
            } else {
                apply(&mut target[name], value);
            }
        }
    }

    #[test]
    fn patch_turns_each_document_into_each_other() {
        let documents = [
            json!({}),
            json!({ "a": 1, "b": { "c": "x", "d": { "e": true } } }),
            json!({ "a": { "f": 2 }, "b": { "c": "y", "d": { "g": false } } }),
            json!({ "b": "text" }),
        ];
        for before in &documents {
            for after in &documents {
                let mut patched = before.clone();
                let patch = merge_patch(before, after);
                assert_eq!(patch.is_none(), before == after);
                apply(&mut patched, &patch.unwrap_or_else(|| json!({})));
                assert_eq!(patched, *after);
            }
        }
    }

    #[test]
    fn lists_become_objects_by_key() {
        let number = |exact: &str, decimal: f64| json!({ "exact": exact, "decimal": decimal });
        let document = json!({
            "goals": [
                { "name": "g", "given": number("1/2", 0.5), "why": null },
                { "name": "g", "given": number("3", 3.0), "why": "late" },
            ],
            "running": [{ "ticket": 7, "since": number("1", 1.0) }],
            "steps": [{ "start": number("1", 1.0), "ticket": 7 }],
            "parameters": [{ "name": "dur_0", "most": { "exact": "inf", "decimal": null } }],
        });
        let expected = json!({
            "goals": {
                "g 1/2": { "name": "g", "given": 0.5 },
                "g 3": { "name": "g", "given": 3.0, "why": "late" },
            },
            "running": { "7": { "ticket": 7, "since": 1.0 } },
            "steps": { "0": { "start": 1.0, "ticket": 7 } },
            "parameters": { "dur_0": { "name": "dur_0", "most": "inf" } },
        });
        assert_eq!(compact(document), expected);
    }
}
