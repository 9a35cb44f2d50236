//! State during a run: the executor's beliefs about facts and numbers, recomputed from the reports
//! in the trace.

mod limits;

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom::answers::Exact;
use elbowroom::execution::{ActionHandle, BeliefState, Measured};
use elbowroom::model::Task;
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;
use elbowroom::report::decimal::nearest;
use elbowroom::report::schema::ObservationLine;
use elbowroom::report::trace::action_named;

use crate::document::{Change, SeriesLine, Texts};
use limits::{LimitPeriod, NumericLimits};

/// Maximum number of points kept for each number, so that the page of a long run stays small.
const MAX_POINTS: usize = 20_000;

/// Believed state during a run, with its history.
pub(crate) struct StateTimeline<'t> {
    task: &'t Arc<Task>,
    progression: BeliefState,
    /// Facts at the last call of [`record_changes`](Self::record_changes).
    facts: Vec<bool>,
    /// Values at the last call of [`record_changes`](Self::record_changes), by fluent.
    values: Vec<Option<Rational>>,
    /// The changes so far.
    changes: Vec<Change>,
    /// Points of each number so far: time and value.
    numbers: BTreeMap<FluentId, Vec<(Rational, Rational)>>,
    /// Limits that conditions impose on numbers.
    limits: NumericLimits,
}

impl<'t> StateTimeline<'t> {
    /// Creates the initial state.
    pub(crate) fn new(task: &'t Arc<Task>, texts: &mut Texts) -> Self {
        let progression = BeliefState::new(Arc::clone(task));
        let mut belief = Self {
            task,
            progression,
            facts: Vec::new(),
            values: Vec::new(),
            changes: Vec::new(),
            numbers: BTreeMap::new(),
            limits: NumericLimits::default(),
        };
        belief.record_changes(texts);
        belief
    }

    /// Advances the state to the time `to`.
    pub(crate) fn advance(&mut self, to: &Rational, texts: &mut Texts) {
        let past: Vec<Rational> = self
            .task
            .timed()
            .iter()
            .map(|timed| timed.time.clone())
            .filter(|time| time > self.progression.time() && time < to)
            .collect();
        for time in past.iter().chain([to]) {
            if time > self.progression.time() {
                // An error means that a number has no value. Such a number is not shown.
                let _ = self.progression.advance(time);
                self.record_changes(texts);
            }
        }
    }

    /// Records the start of an action with this planned duration.
    pub(crate) fn started(
        &mut self,
        ticket: u64,
        action: &str,
        planned: Option<&Rational>,
        observation: &ObservationLine,
        texts: &mut Texts,
    ) {
        let ObservationLine::Started { measured, time, .. } = observation else {
            return;
        };
        let Ok(action) = action_named(action, self.task) else {
            return;
        };
        self.advance(&time.0, texts);
        let _ = self.progression.advance_for_happening(&time.0);
        let measured = self.measured(measured.iter());
        self.limits
            .started(ActionHandle(ticket), &action, planned, &self.progression);
        let planned = planned.cloned().unwrap_or_default();
        let _ =
            self.progression
                .start(ActionHandle(ticket), &Arc::new(action), &planned, &measured);
        self.record_changes(texts);
    }

    /// Records an observation other than a start.
    pub(crate) fn record_observation(&mut self, observation: &ObservationLine, texts: &mut Texts) {
        match observation {
            ObservationLine::Ended {
                ticket,
                outcome,
                measured,
                time,
                ..
            } => {
                self.advance(&time.0, texts);
                let _ = self.progression.advance_for_happening(&time.0);
                let measured = self.measured(measured.iter());
                let has_succeeded = outcome == "succeeded";
                self.limits
                    .ended(ActionHandle(*ticket), has_succeeded, &self.progression);
                if has_succeeded {
                    let _ = self.progression.end(ActionHandle(*ticket), &measured);
                } else {
                    self.progression.stop(ActionHandle(*ticket));
                }
            }
            ObservationLine::Fact {
                fact,
                becomes,
                time,
            } => {
                self.advance(&time.0, texts);
                let _ = self.progression.advance_for_happening(&time.0);
                if let Some(fact) = self.task.fact_named(fact) {
                    self.progression.observe_fact(fact, *becomes);
                }
            }
            ObservationLine::Value {
                fluent,
                value,
                time,
            } => {
                self.advance(&time.0, texts);
                let _ = self.progression.advance_for_happening(&time.0);
                if let Some(fluent) = self.task.fluent_named(fluent) {
                    self.progression.observe_value(fluent, &value.0);
                }
            }
            ObservationLine::Started { .. }
            | ObservationLine::Feedback { .. }
            | ObservationLine::Goal { .. }
            | ObservationLine::Abandon { .. }
            | ObservationLine::CancelAction { .. }
            | ObservationLine::Pause { .. }
            | ObservationLine::Resume { .. }
            | ObservationLine::PlanMade { .. }
            | ObservationLine::PlanReady { .. }
            | ObservationLine::Unintelligible { .. } => {}
        }
        self.record_changes(texts);
    }

    /// Returns the changes, and a line for each number that has changed.
    pub(crate) fn finish(self) -> (Vec<Change>, Vec<SeriesLine>) {
        let changed = self.numbers.into_iter().filter(|(_, points)| {
            let first = points.first().map(|(_, value)| value);
            points.iter().any(|(_, value)| Some(value) != first)
        });
        let mut limits = self.limits.finish(&self.progression);
        let lines = changed.map(|(fluent, points)| {
            let own = limits.remove(&fluent).unwrap_or_default();
            SeriesLine {
                closest: limits::describe_closest_point(&own, &points),
                limits: own.iter().map(LimitPeriod::limit).collect(),
                ..line(self.task.fluent_name(fluent), &points)
            }
        });
        let lines = lines.collect();
        (self.changes, lines)
    }

    fn measured<'m>(
        &self,
        measured: impl Iterator<Item = (&'m String, &'m Exact)>,
    ) -> Vec<Measured> {
        measured
            .filter_map(|(fluent, amount)| {
                Some(Measured {
                    fluent: self.task.fluent_named(fluent)?,
                    amount: amount.0.clone(),
                })
            })
            .collect()
    }

    /// Records the changes since the last call.
    fn record_changes(&mut self, texts: &mut Texts) {
        let time = self.progression.time().clone();
        let at = time.to_f64();
        self.facts.resize(self.task.fact_count(), false);
        self.values.resize(self.task.fluent_count(), None);
        for (fact, was_true) in (0..).map(FactId).zip(&mut self.facts) {
            let is_true = self.progression.fact(fact);
            if is_true != *was_true {
                *was_true = is_true;
                self.changes.push(Change {
                    at,
                    kind: "fact",
                    name: texts.share(&self.task.fact_name(fact)),
                    value: is_true.then(|| "true".to_owned()),
                });
            }
        }
        for (fluent, index) in (0..).map(FluentId).zip(0..self.values.len()) {
            let Some(value) = self.progression.value(fluent) else {
                continue;
            };
            if self.values[index].as_ref() == Some(value) {
                continue;
            }
            let value = value.clone();
            let before = self.values[index].replace(value.clone());
            let is_moving = self.is_moving(fluent);
            let points = self.numbers.entry(fluent).or_default();
            if points.len() < MAX_POINTS {
                // The number jumps: it had the previous value until now.
                if let (Some(before), false) = (before, is_moving) {
                    points.push((time.clone(), before));
                }
                points.push((time.clone(), value.clone()));
            }
            self.changes.push(Change {
                at,
                kind: "number",
                name: texts.share(&self.task.fluent_name(fluent)),
                value: Some(nearest(&value)),
            });
        }
    }

    /// Returns `true` if a running action changes the fluent continuously.
    fn is_moving(&self, fluent: FluentId) -> bool {
        self.progression.running().values().any(|underway| {
            let body = underway.action.durative();
            body.is_some_and(|body| body.continuous.iter().any(|effect| effect.fluent == fluent))
        })
    }
}

/// Converts a number to a line, with its extremes as text.
fn line(name: String, points: &[(Rational, Rational)]) -> SeriesLine {
    let values = || points.iter().map(|(_, value)| value);
    let word = |value: Option<&Rational>| value.map(nearest).unwrap_or_default();
    SeriesLine {
        name,
        words: format!(
            "{} at the beginning, {} at the end, between {} and {}",
            word(values().next()),
            word(values().next_back()),
            word(values().min()),
            word(values().max()),
        ),
        points: points
            .iter()
            .map(|(time, value)| (time.to_f64(), value.to_f64()))
            .collect(),
        limits: Vec::new(),
        closest: None,
    }
}
