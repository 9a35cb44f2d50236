//! Guarantee over the time of a run, with the reasons for its changes.

use elbowroom::execution::GuaranteeLevel;
use elbowroom::report::decimal::nearest;
use elbowroom::report::schema::{DecisionLine, ObservationLine, WindowLine};
use elbowroom::report::trace::Line;

use super::bars::Bars;
use crate::document::Segment;

/// The guarantees so far.
#[derive(Default)]
pub(super) struct Guarantees {
    segments: Vec<Segment>,
    /// The last observation outside its planned window.
    deviation: Option<String>,
}

impl Guarantees {
    /// Processes a line of the trace.
    pub(super) fn read(&mut self, line: &Line, bars: &Bars) {
        match line {
            Line::Observed(observed) => {
                let (ticket, what, time) = match &observed.observation {
                    ObservationLine::Started { ticket, time, .. } => (ticket, "started", time),
                    ObservationLine::Ended {
                        ticket,
                        outcome,
                        time,
                        ..
                    } if outcome == "succeeded" => (ticket, "ended", time),
                    ObservationLine::Ended {
                        ticket,
                        outcome,
                        time,
                        ..
                    } => {
                        let action = bars.action(*ticket).unwrap_or("an action");
                        let at = nearest(&time.0);
                        self.deviation = Some(format!("{action} {outcome} at {at}"));
                        return;
                    }
                    _ => return,
                };
                if let Some(allowed) = missed(&observed.planned, &time.0) {
                    let action = bars.action(*ticket).unwrap_or("an action");
                    let at = nearest(&time.0);
                    self.deviation = Some(format!("{action} {what} at {at}, planned {allowed}"));
                }
            }
            Line::Decided(decided) => {
                let at = decided.now.0.to_f64();
                match (&decided.decision, &decided.reason.promise) {
                    (DecisionLine::GoalReached, _) => {}
                    (DecisionLine::Replan, _) => {
                        let words = format!("none: {}", decided.reason.words);
                        self.change(at, -1, "none", &words, "");
                    }
                    (_, Some(promise)) => {
                        let (level, words) = level_and_meaning(promise);
                        self.change(at, level, promise, words, &decided.reason.words);
                    }
                    (_, None) => {
                        self.change(at, -1, "none", "none: this executor gives no guarantee", "");
                    }
                }
            }
            Line::Plan(_) => self.deviation = None,
            _ => {}
        }
    }

    /// Returns all segments. The last one extends to the end of the run. Empty if no guarantee was
    /// ever given.
    pub(super) fn finish(mut self, end: f64) -> Vec<Segment> {
        if self.segments.iter().all(|segment| segment.level < 0) {
            return Vec::new();
        }
        if let Some(last) = self.segments.last_mut() {
            last.to = end;
        }
        self.segments
    }

    fn change(&mut self, at: f64, level: i8, name: &str, words: &str, reason: &str) {
        let deviation = self.deviation.as_deref();
        if let Some(last) = self.segments.last_mut() {
            if last.level == level && (level >= 0 || name == "none") {
                return;
            }
            last.to = at;
        }
        let is_worse = self.segments.last().is_some_and(|last| level < last.level);
        let because = match deviation {
            Some(deviation) if is_worse && level >= 0 => format!("; {deviation}"),
            // No deviation was observed: the reason is the passage of time.
            None if is_worse && level >= 0 => format!("; meanwhile, {reason}"),
            _ => String::new(),
        };
        self.segments.push(Segment {
            from: at,
            to: at,
            level,
            words: format!("{words}{because}"),
        });
    }
}

/// Returns the level and the meaning of a guarantee.
fn level_and_meaning(promise: &str) -> (i8, &'static str) {
    let mut known = GuaranteeLevel::TERMS.iter();
    match known.find(|(_, name, _)| *name == promise) {
        Some((GuaranteeLevel::Envelope, ..)) => (
            3,
            "works for all values inside the envelope, unless an action times out",
        ),
        Some((GuaranteeLevel::PartOfEnvelope, ..)) => (
            2,
            "works for all values inside a part of the envelope, unless an action times out",
        ),
        Some((GuaranteeLevel::Planned, ..)) => (
            1,
            "no guarantee, feasible at nominal durations: works if each action still to start takes as long as planned",
        ),
        Some((GuaranteeLevel::Luck, ..)) => (0, "no guarantee, may still work"),
        None => (-1, "none"),
    }
}

/// Describes the window if the time is outside.
fn missed(window: &WindowLine, time: &elbowroom::num::Rational) -> Option<String> {
    match (&window.earliest, &window.latest) {
        (Some(earliest), _) if *time < earliest.0 => {
            Some(format!("{} at the earliest", nearest(&earliest.0)))
        }
        (_, Some(latest)) if *time > latest.0 => {
            Some(format!("{} at the latest", nearest(&latest.0)))
        }
        _ => None,
    }
}
