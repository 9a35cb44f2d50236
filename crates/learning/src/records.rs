//! Attempts to execute actions, extracted from logs.

use std::collections::BTreeMap;

use elbowroom_num::Rational;
use elbowroom_report::trace::schema::{IssuedCommandLine, ObservationLine};
use elbowroom_report::trace::{Line, Stored};

/// Outcome of an attempt.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Outcome {
    /// The action succeeded.
    Succeeded,
    /// The action failed, by chance or because a condition did not hold: logs give the reason in
    /// free text only.
    Failed,
    /// The action was cancelled.
    Cancelled,
    /// The action was running at the end of the log.
    Running,
}

/// One attempt to execute an action.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// The action with its objects: `(drive rover depot shelf)`.
    pub action: String,
    /// Time of the command, in seconds; `None` if it is not logged.
    pub commanded: Option<f64>,
    /// Start time; `None` if it never started.
    pub start: Option<f64>,
    /// End time, or the end of the log.
    pub end: f64,
    /// Outcome.
    pub outcome: Outcome,
    /// Planned duration; `None` if it is not logged, and for instantaneous actions.
    pub planned: Option<f64>,
}

impl Record {
    /// Returns the name of the action, without its objects.
    pub fn name(&self) -> &str {
        let inner = self.action.trim_matches(['(', ')']);
        inner.split_whitespace().next().unwrap_or_default()
    }
}

/// A start without an observed end.
struct Open {
    action: String,
    commanded: f64,
    planned: Option<f64>,
    start: Option<f64>,
}

/// Returns the starts of a trace, in the order of the commands. Observations that the run ignored
/// are omitted. If the start of a successful action was not reported, it is the time of the
/// command.
pub fn of_trace(trace: &Stored) -> Vec<Record> {
    let mut open: BTreeMap<u64, Open> = BTreeMap::new();
    let mut records: Vec<(u64, Record)> = Vec::new();
    let mut last = 0.0_f64;
    for line in &trace.lines {
        match line {
            Line::Command(line) => {
                last = last.max(float(&line.now.0));
                if let IssuedCommandLine::Start {
                    ticket,
                    action,
                    duration,
                } = &line.command
                {
                    let start = Open {
                        action: action.clone(),
                        commanded: float(&line.now.0),
                        planned: duration.as_ref().map(|duration| float(&duration.0)),
                        start: None,
                    };
                    open.insert(*ticket, start);
                }
            }
            Line::Passed(line) => last = last.max(float(&line.now.0)),
            Line::Observed(line) => match &line.as_processed() {
                Some(ObservationLine::Started { ticket, time, .. }) => {
                    let commanded = open.get(ticket).map_or(0.0, |open| open.commanded);
                    let time = float(&time.0).max(commanded);
                    // An instantaneous action is complete at its start. No end is reported.
                    let is_instantaneous =
                        open.get(ticket).is_some_and(|open| open.planned.is_none());
                    if let Some(started) = open.get_mut(ticket) {
                        started.start = Some(time);
                    }
                    if is_instantaneous && let Some(done) = open.remove(ticket) {
                        records.push((*ticket, closed(done, time, Outcome::Succeeded)));
                    }
                }
                Some(ObservationLine::Ended {
                    ticket,
                    outcome,
                    time,
                    ..
                }) => {
                    if let Some(open) = open.remove(ticket) {
                        let time = float(&time.0).max(open.start.unwrap_or(open.commanded));
                        let outcome = match outcome.as_str() {
                            "succeeded" => Outcome::Succeeded,
                            "cancelled" => Outcome::Cancelled,
                            _ => Outcome::Failed,
                        };
                        records.push((*ticket, closed(open, time, outcome)));
                    }
                }
                _ => {}
            },
            Line::Over(line) => last = last.max(float(&line.time)),
            _ => {}
        }
    }
    for (ticket, open) in open {
        let end = last.max(open.commanded);
        records.push((ticket, closed(open, end, Outcome::Running)));
    }
    records.sort_by_key(|(ticket, _)| *ticket);
    records.into_iter().map(|(_, record)| record).collect()
}

fn closed(open: Open, end: f64, outcome: Outcome) -> Record {
    let has_started = outcome == Outcome::Succeeded;
    Record {
        action: open.action,
        commanded: Some(open.commanded),
        start: open.start.or(has_started.then_some(open.commanded)),
        end,
        outcome,
        planned: open.planned,
    }
}

fn float(value: &Rational) -> f64 {
    value.to_f64()
}
