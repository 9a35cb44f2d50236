//! The actions of a run that ended last.

use std::collections::VecDeque;

use elbowroom::num::Rational;
use elbowroom::report::exact::Exact;

use super::super::documents::{EndedAction, Running};

/// Number of ended actions that are kept.
const MAX_ENDED: usize = 50;

/// List of the actions that ended last, oldest first.
#[derive(Clone, Default)]
pub(super) struct EndedActions(VecDeque<EndedAction>);

impl EndedActions {
    /// Adds an action that has ended, with its outcome.
    pub(super) fn add(&mut self, action: Running, outcome: &str, end: &Rational) {
        self.0.push_back(EndedAction {
            ticket: action.ticket,
            action: action.action,
            since: action.since,
            end: Exact(end.clone()),
            state: outcome.to_owned(),
        });
        if self.0.len() > MAX_ENDED {
            self.0.pop_front();
        }
    }

    /// Returns the actions.
    pub(super) fn all(&self) -> Vec<EndedAction> {
        self.0.iter().cloned().collect()
    }
}
