//! A run as an MCAP file (<https://mcap.dev>), which viewers such as Foxglove open together with
//! the robot's own logs.
//!
//! Messages are JSON with schemas: a log of all events, the action of each lane, each number, and
//! the guarantee. The file has no chunks, index or checksums, which readers do not require.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Value, json};

use crate::clock::nanoseconds;
use crate::document::{Chart, Document, Section, Text};

/// Converts the document of a run to an MCAP file; `None` if it contains no run.
pub(crate) fn file(document: &Document) -> Option<Vec<u8>> {
    let chart = document.sections.iter().find_map(|section| match section {
        Section::Chart(chart) if chart.is_run => Some(chart),
        _ => None,
    })?;
    let mut file = File::default();
    file.log(document);
    file.lanes(chart);
    file.guarantee(chart);
    file.numbers(document);
    Some(file.finish())
}

const MAGIC: &[u8] = b"\x89MCAP0\r\n";
const HEADER: u8 = 0x01;
const FOOTER: u8 = 0x02;
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;
const DATA_END: u8 = 0x0f;

/// A message, before sorting.
struct Message {
    nanoseconds: u64,
    channel: u16,
    data: Value,
}

#[derive(Default)]
struct File {
    /// Schemas and channels.
    head: Record,
    channels: u16,
    messages: Vec<Message>,
    topics: BTreeSet<String>,
}

impl File {
    /// Adds a channel with its own schema; `None` if there are too many.
    fn channel(&mut self, topic: &str, schema: &str, members: &Value) -> Option<u16> {
        let id = self.channels.checked_add(1)?;
        self.channels = id;
        let mut topic = topic.to_owned();
        while !self.topics.insert(topic.clone()) {
            topic.push('_');
        }
        let schema_data = json!({ "type": "object", "properties": members }).to_string();
        let mut record = Record::default();
        record.short(id);
        record.text(schema);
        record.text("jsonschema");
        record.text(&schema_data);
        self.head.record(SCHEMA, &record);
        let mut record = Record::default();
        record.short(id);
        record.short(id);
        record.text(&topic);
        record.text("json");
        record.number(0);
        self.head.record(CHANNEL, &record);
        Some(id)
    }

    fn message(&mut self, channel: u16, at: f64, data: Value) {
        let nanoseconds = nanoseconds(at);
        self.messages.push(Message {
            nanoseconds,
            channel,
            data,
        });
    }

    /// Writes every line of the trace, in the form of Foxglove's log panel.
    fn log(&mut self, document: &Document) {
        let log = document.sections.iter().find_map(|section| match section {
            Section::Table(table) if !table.times.is_empty() => Some(table),
            _ => None,
        });
        let members = json!({
            "timestamp": { "type": "object", "properties": {
                "sec": { "type": "integer" }, "nsec": { "type": "integer" } } },
            "level": { "type": "integer" },
            "message": { "type": "string" },
            "name": { "type": "string" },
            "file": { "type": "string" },
            "line": { "type": "integer" },
        });
        let (Some(log), Some(channel)) = (
            log,
            self.channel("/elbowroom/log", "foxglove.Log", &members),
        ) else {
            return;
        };
        let words = |text: &Text| -> String {
            match text {
                Text::Own(text) => text.clone(),
                Text::Shared(position) => document.texts[*position].clone(),
            }
        };
        for (row, at) in log.rows.iter().zip(&log.times) {
            let [_, kind, what, _, why] = row.as_slice() else {
                continue;
            };
            let (what, why) = (words(what), words(why));
            let message = if why.is_empty() {
                what
            } else {
                format!("{what}: {why}")
            };
            let time = nanoseconds(*at);
            let data = json!({
                "timestamp": { "sec": time / NANOSECONDS, "nsec": time % NANOSECONDS },
                "level": 2, "message": message, "name": words(kind), "file": "", "line": 0,
            });
            self.message(channel, *at, data);
        }
    }

    /// Writes the action of each lane over time.
    fn lanes(&mut self, chart: &Chart) {
        let Some(grouping) = chart.groupings.get(chart.chosen) else {
            return;
        };
        for (lane, name) in grouping.lanes.iter().enumerate() {
            let mut changes: Vec<(f64, bool, &str)> = Vec::new();
            for bar in chart
                .bars
                .iter()
                .filter(|bar| bar.lanes.get(chart.chosen) == Some(&lane))
            {
                if let Some((start, end)) = bar.actual {
                    changes.push((start, true, &bar.name));
                    if bar.outcome != "running" {
                        changes.push((end, false, &bar.name));
                    }
                }
            }
            let members = json!({ "action": { "type": "string" } });
            let topic = format!("/elbowroom/lanes/{}", topic_component(name));
            let Some(channel) = self.channel(&topic, "elbowroom.Lane", &members) else {
                return;
            };
            // At equal times, ends come before starts.
            changes.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let mut running: BTreeMap<&str, usize> = BTreeMap::new();
            for (at, is_start, action) in changes {
                let count = running.entry(action).or_default();
                *count = if is_start {
                    *count + 1
                } else {
                    count.saturating_sub(1)
                };
                running.retain(|_, count| *count > 0);
                let names: Vec<&str> = running.keys().copied().collect();
                self.message(channel, at, json!({ "action": names.join(", ") }));
            }
        }
    }

    fn guarantee(&mut self, chart: &Chart) {
        let members = json!({ "level": { "type": "integer" }, "words": { "type": "string" } });
        if chart.guarantee.is_empty() {
            return;
        }
        if let Some(channel) = self.channel("/elbowroom/guarantee", "elbowroom.Guarantee", &members)
        {
            for segment in &chart.guarantee {
                let data = json!({ "level": segment.level, "words": segment.words });
                self.message(channel, segment.from, data);
            }
        }
    }

    /// Writes a channel for each number.
    fn numbers(&mut self, document: &Document) {
        let members = json!({ "name": { "type": "string" }, "value": { "type": "number" } });
        for section in &document.sections {
            let Section::Series(series) = section else {
                continue;
            };
            for line in &series.lines {
                let topic = format!("/elbowroom/numbers/{}", topic_component(&line.name));
                let Some(channel) = self.channel(&topic, "elbowroom.Number", &members) else {
                    return;
                };
                for (at, value) in &line.points {
                    self.message(channel, *at, json!({ "name": line.name, "value": value }));
                }
            }
        }
    }

    fn finish(mut self) -> Vec<u8> {
        self.messages.sort_by_key(|message| message.nanoseconds);
        let mut file = Record::default();
        file.bytes.extend(MAGIC);
        let mut header = Record::default();
        header.text("");
        header.text("elbowroom");
        file.record(HEADER, &header);
        file.bytes.extend(&self.head.bytes);
        for (sequence, message) in (0_u32..).zip(&self.messages) {
            let mut record = Record::default();
            record.short(message.channel);
            record.number(sequence);
            record.long(message.nanoseconds);
            record.long(message.nanoseconds);
            record.bytes.extend(message.data.to_string().as_bytes());
            file.record(MESSAGE, &record);
        }
        let mut end = Record::default();
        end.number(0);
        file.record(DATA_END, &end);
        let mut footer = Record::default();
        footer.long(0);
        footer.long(0);
        footer.number(0);
        file.record(FOOTER, &footer);
        file.bytes.extend(MAGIC);
        file.bytes
    }
}

/// The bytes of a record, or of several.
#[derive(Default)]
struct Record {
    bytes: Vec<u8>,
}

impl Record {
    fn short(&mut self, value: u16) {
        self.bytes.extend(value.to_le_bytes());
    }

    fn number(&mut self, value: u32) {
        self.bytes.extend(value.to_le_bytes());
    }

    fn long(&mut self, value: u64) {
        self.bytes.extend(value.to_le_bytes());
    }

    fn text(&mut self, text: &str) {
        // No trace that fits into memory contains longer texts.
        let length = u32::try_from(text.len()).unwrap_or(u32::MAX);
        self.number(length);
        self.bytes.extend(text.as_bytes());
    }

    fn record(&mut self, kind: u8, content: &Self) {
        self.bytes.push(kind);
        self.long(content.bytes.len() as u64);
        self.bytes.extend(&content.bytes);
    }
}

/// Converts a name to a part of a topic.
fn topic_component(name: &str) -> String {
    let trimmed = name.trim_matches(['(', ')']);
    let kept = |letter: char| letter.is_ascii_alphanumeric() || letter == '-' || letter == '_';
    trimmed
        .chars()
        .map(|letter| if kept(letter) { letter } else { '_' })
        .collect()
}

const NANOSECONDS: u64 = 1_000_000_000;
