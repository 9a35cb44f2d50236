//! A run as a trace in the native format of Perfetto (<https://ui.perfetto.dev>), track events.
//!
//! Each lane of the chart is a track, with executed and planned actions on tracks below it. Slices
//! on one track do not overlap, as the format requires. Numbers are counters, moments and decisions
//! are instants, and flows connect actions ordered by the plan. The field numbers are those of
//! `perfetto_trace.proto`.

use crate::clock::nanoseconds;
use crate::document::{Bar, Chart, Document, Section, Series, Text};

/// Converts the document of a run to a Perfetto trace; `None` if it contains no run.
pub(crate) fn trace(document: &Document) -> Option<Vec<u8>> {
    let chart = document.sections.iter().find_map(|section| match section {
        Section::Chart(chart) if chart.is_run => Some(chart),
        _ => None,
    })?;
    let mut trace = Trace::default();
    let run = trace.track(&document.title, None, false);
    trace.lanes(chart, run, document);
    trace.moments(chart, run);
    for section in &document.sections {
        if let Section::Series(series) = section {
            trace.counters(series, run);
        }
    }
    Some(trace.finish())
}

/// Identifier of the single sequence of packets.
const SEQUENCE: u64 = 1;

/// The kind of a track event.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    End = 2,
    Counter = 4,
    Instant = 3,
    Begin = 1,
}

/// An event, before sorting.
struct Event {
    nanoseconds: u64,
    /// Order of events with equal times: ends first, begins last.
    rank: u8,
    message: Message,
}

#[derive(Default)]
struct Trace {
    tracks: Vec<Message>,
    events: Vec<Event>,
}

impl Trace {
    /// Adds a track and returns its number.
    fn track(&mut self, name: &str, parent: Option<u64>, is_counter: bool) -> u64 {
        let uuid = self.tracks.len() as u64 + 1;
        let mut descriptor = Message::default();
        descriptor.number(1, uuid);
        descriptor.text(2, name);
        if let Some(parent) = parent {
            descriptor.number(5, parent);
        }
        if is_counter {
            descriptor.message(8, &Message::default());
        }
        // Children of a track are shown in order of creation.
        descriptor.number(11, 3);
        descriptor.number(12, uuid);
        let mut packet = Message::default();
        packet.number(10, SEQUENCE);
        packet.message(60, &descriptor);
        self.tracks.push(packet);
        uuid
    }

    fn event(&mut self, at: f64, kind: Kind, track: u64, fill: impl FnOnce(&mut Message)) {
        let mut event = Message::default();
        event.number(9, kind as u64);
        event.number(11, track);
        fill(&mut event);
        let mut packet = Message::default();
        let nanoseconds = nanoseconds(at);
        packet.number(8, nanoseconds);
        packet.number(10, SEQUENCE);
        packet.message(11, &event);
        let rank = match kind {
            Kind::End => 0,
            Kind::Counter | Kind::Instant => 1,
            Kind::Begin => 2,
        };
        self.events.push(Event {
            nanoseconds,
            rank,
            message: packet,
        });
    }

    /// Writes the actions, lane by lane.
    fn lanes(&mut self, chart: &Chart, run: u64, document: &Document) {
        let Some(grouping) = chart.groupings.get(chart.chosen) else {
            return;
        };
        let flows = flows(chart);
        for (lane, name) in grouping.lanes.iter().enumerate() {
            let numbered = chart.bars.iter().enumerate();
            let is_on_it = |(_, bar): &(usize, &Bar)| bar.lanes.get(chart.chosen) == Some(&lane);
            let bars: Vec<(usize, &Bar)> = numbered.filter(is_on_it).collect();
            if bars.is_empty() {
                continue;
            }
            let parent = self.track(name, Some(run), false);
            let done = bars
                .iter()
                .filter_map(|&(index, bar)| Some((index, bar, bar.actual?)));
            self.slices("done", parent, done.collect(), Some(&flows), document);
            let planned = bars
                .iter()
                .filter_map(|&(index, bar)| Some((index, bar, bar.planned?)));
            self.slices("planned", parent, planned.collect(), None, document);
        }
    }

    /// Writes slices on as few tracks as possible without overlaps.
    fn slices(
        &mut self,
        name: &str,
        parent: u64,
        mut spans: Vec<(usize, &Bar, (f64, f64))>,
        flows: Option<&[Flows]>,
        document: &Document,
    ) {
        spans.sort_by(|a, b| a.2.0.total_cmp(&b.2.0).then(a.0.cmp(&b.0)));
        let mut tracks: Vec<(f64, u64)> = Vec::new();
        for (index, bar, (start, end)) in spans {
            let free = tracks.iter().position(|(until, _)| *until <= start);
            let row = free.unwrap_or_else(|| {
                let track = self.track(name, Some(parent), false);
                tracks.push((f64::NEG_INFINITY, track));
                tracks.len() - 1
            });
            tracks[row].0 = end;
            let track = tracks[row].1;
            let fill = |event: &mut Message| {
                event.text(
                    22,
                    if flows.is_some() {
                        bar.outcome
                    } else {
                        "planned"
                    },
                );
                event.text(23, &bar.name);
                for (label, text) in &bar.details {
                    let text = match text {
                        Text::Own(text) => text,
                        Text::Shared(position) => &document.texts[*position],
                    };
                    event.annotation(label, text);
                }
                let (leaving, entering) = flows.map_or((&[][..], &[][..]), |flows| {
                    (&flows[index].0, &flows[index].1)
                });
                for &flow in leaving {
                    event.fixed(47, flow);
                }
                for &flow in entering {
                    event.fixed(48, flow);
                }
            };
            if nanoseconds(end) > nanoseconds(start) {
                self.event(start, Kind::Begin, track, fill);
                self.event(end, Kind::End, track, |_| {});
            } else {
                self.event(start, Kind::Instant, track, fill);
            }
        }
    }

    /// Writes deadlines, decisions, and the guarantee.
    fn moments(&mut self, chart: &Chart, run: u64) {
        let named = |name: &str| {
            let name = name.to_owned();
            move |event: &mut Message| event.text(23, &name)
        };
        if !chart.guarantee.is_empty() {
            let track = self.track("guarantee", Some(run), false);
            for segment in chart
                .guarantee
                .iter()
                .filter(|segment| segment.to > segment.from)
            {
                self.event(segment.from, Kind::Begin, track, named(&segment.words));
                self.event(segment.to, Kind::End, track, |_| {});
            }
        }
        if !chart.marks.is_empty() {
            let track = self.track("deadlines and other events", Some(run), false);
            for mark in &chart.marks {
                self.event(mark.at, Kind::Instant, track, named(&mark.name));
            }
        }
        if !chart.decisions.is_empty() {
            let track = self.track("decisions", Some(run), false);
            for decision in &chart.decisions {
                self.event(decision.at, Kind::Instant, track, named(&decision.words));
            }
        }
    }

    /// Writes numbers over time.
    fn counters(&mut self, series: &Series, run: u64) {
        for line in &series.lines {
            let track = self.track(&line.name, Some(run), true);
            for (time, value) in &line.points {
                self.event(*time, Kind::Counter, track, |event| {
                    event.double(44, *value);
                });
            }
        }
    }

    fn finish(mut self) -> Vec<u8> {
        self.events
            .sort_by_key(|event| (event.nanoseconds, event.rank));
        let mut trace = Message::default();
        let packets = self
            .tracks
            .iter()
            .chain(self.events.iter().map(|event| &event.message));
        for packet in packets {
            trace.message(1, packet);
        }
        trace.bytes
    }
}

/// The flows that leave a bar, and those that end at it: one for each ordering.
type Flows = (Vec<u64>, Vec<u64>);

/// Returns the flows of each bar. Only orderings of executed actions are shown.
fn flows(chart: &Chart) -> Vec<Flows> {
    let mut flows = vec![Flows::default(); chart.bars.len()];
    let is_done = |bar: usize| chart.bars[bar].actual.is_some();
    for (flow, &(from, to)) in (1..).zip(&chart.orderings) {
        if is_done(from) && is_done(to) {
            flows[from].0.push(flow);
            flows[to].1.push(flow);
        }
    }
    flows
}

/// A message of Protocol Buffers.
#[derive(Default)]
struct Message {
    bytes: Vec<u8>,
}

impl Message {
    fn varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.bytes.push(value.to_le_bytes()[0] | 0x80);
            value >>= 7;
        }
        self.bytes.push(value.to_le_bytes()[0]);
    }

    fn key(&mut self, field: u64, wire: u64) {
        self.varint((field << 3) | wire);
    }

    fn number(&mut self, field: u64, value: u64) {
        self.key(field, 0);
        self.varint(value);
    }

    fn fixed(&mut self, field: u64, value: u64) {
        self.key(field, 1);
        self.bytes.extend(value.to_le_bytes());
    }

    fn double(&mut self, field: u64, value: f64) {
        self.fixed(field, value.to_bits());
    }

    fn text(&mut self, field: u64, text: &str) {
        self.key(field, 2);
        self.varint(text.len() as u64);
        self.bytes.extend(text.as_bytes());
    }

    fn message(&mut self, field: u64, message: &Self) {
        self.key(field, 2);
        self.varint(message.bytes.len() as u64);
        self.bytes.extend(&message.bytes);
    }

    /// Adds a named value to an event.
    fn annotation(&mut self, name: &str, value: &str) {
        let mut annotation = Self::default();
        annotation.text(6, value);
        annotation.text(10, name);
        self.message(4, &annotation);
    }
}
