//! Executed actions, as steps of a plan for the validator.

use std::sync::Arc;

use elbowroom_model::Step;
use elbowroom_model::ground::{
    Action, Body, Change, Condition, DurativeBody, Effect, Expression, SnapAction,
};
use elbowroom_num::Rational;

use super::{ActionLog, StartEntry};
use crate::event::{ActionHandle, Ending, Measured};

/// An executed action, as a step of a plan for the validator.
///
/// Measured amounts replace those of the domain, and there are no duration constraints. An action
/// that was stopped has only its start effects and its continuous effects.
#[derive(Clone, Debug, PartialEq)]
pub struct ExecutedStep {
    /// The ticket of the start.
    pub ticket: ActionHandle,
    /// The outcome; `None` if it had not ended.
    pub ending: Option<Ending>,
    /// The step.
    pub step: Step,
}

impl ActionLog {
    /// Returns all actions that have started and are not forgotten, as steps for the validator.
    pub(in crate::run) fn executed(&self, now: &Rational) -> Vec<ExecutedStep> {
        self.finished_steps
            .iter()
            .cloned()
            .chain(self.executed_steps(now))
            .collect()
    }

    pub(super) fn executed_steps<'a>(
        &'a self,
        now: &'a Rational,
    ) -> impl Iterator<Item = ExecutedStep> + 'a {
        self.entries.iter().filter_map(move |(ticket, entry)| {
            let start = entry.started.clone()?;
            let end = entry.ended.as_ref().map_or(now, |(time, _)| time);
            let ending = entry.ended.as_ref().map(|(_, ending)| ending.clone());
            let is_whole = ending == Some(Ending::Succeeded);
            let duration = entry
                .planned
                .as_ref()
                .map(|_| (end - &start).max(Rational::ZERO));
            Some(ExecutedStep {
                ticket: *ticket,
                ending,
                step: Step {
                    action: Arc::new(action_as_executed(entry, is_whole)),
                    start,
                    duration,
                },
            })
        })
    }
}

/// Returns the action with the measured amounts, with its planned duration wherever it reads
/// `?duration` before its end, and without the effects that did not happen.
fn action_as_executed(entry: &StartEntry, is_whole: bool) -> Action {
    let planned = entry.planned.as_ref();
    let planned = planned.and_then(|planned| entry.action.with_planned_duration(planned));
    let mut action = planned.unwrap_or_else(|| Action::clone(&entry.action));
    match &mut action.body {
        Body::Instantaneous(snap) => set_measured_amounts(snap, &entry.measured[0]),
        Body::Durative(body) => {
            body.duration.clear();
            for (snap, measured) in [&mut body.start, &mut body.end]
                .into_iter()
                .zip(&entry.measured)
            {
                if !measured.is_empty() {
                    set_measured_amounts(Arc::make_mut(snap), measured);
                }
            }
            if !is_whole {
                truncate_cancelled(body);
            }
        }
    }
    action
}

fn set_measured_amounts(snap: &mut SnapAction, measured: &[Measured]) {
    for Effect { change, .. } in &mut snap.effects {
        if let Change::Update { fluent, value, .. } = change
            && let Some(measured) = measured.iter().find(|measured| measured.fluent == *fluent)
        {
            *value = Expression::Constant(measured.amount.clone());
        }
    }
}

/// Removes the end and the over-all conditions of a cancelled action.
fn truncate_cancelled(body: &mut DurativeBody) {
    body.over_all = Condition::TRUE;
    body.end = Arc::new(SnapAction {
        condition: Condition::TRUE,
        effects: Vec::new(),
    });
}
