//! The goals of a persistent run, and their states.

use std::collections::VecDeque;

use elbowroom_execution::{GoalChange, GoalTerms};
use elbowroom_num::Rational;
use elbowroom_report::exact::Exact;
use elbowroom_report::trace::SnapshotLine;

use super::super::documents::{GoalNow, GoalsNow, OpenGoal};

/// Maximum number of closed goals in the list.
const MOST_CLOSED: usize = 1000;

const PURSUED: &str = "pursued";
const SET_ASIDE: &str = "set-aside";
const IMPOSSIBLE: &str = "impossible";
const UNPLANNED: &str = "unplanned";
const ACHIEVED: &str = "achieved";
const CANCELLED: &str = "cancelled";
const FAILED: &str = "failed";

/// The open goals, and the most recently closed ones.
#[derive(Clone, Debug, Default)]
pub(super) struct GoalList {
    open: Vec<GoalNow>,
    closed: VecDeque<GoalNow>,
}

impl GoalList {
    /// Adds an open goal with this name and text.
    pub(super) fn add(&mut self, (name, goal): (&str, &str), terms: &GoalTerms, now: &Rational) {
        self.open.push(GoalNow {
            name: name.to_owned(),
            goal: goal.to_owned(),
            value: Exact(terms.value.clone()),
            deadline: terms.deadline.clone().map(Exact),
            state: PURSUED.to_owned(),
            given: Some(Exact(now.clone())),
            since: Exact(now.clone()),
            why: None,
        });
    }

    /// Returns the open goals.
    pub(super) fn open(&self) -> Vec<OpenGoal> {
        let open = self.open.iter().map(|goal| OpenGoal {
            name: goal.name.clone(),
            goal: goal.goal.clone(),
            aside: goal.why.clone().filter(|_| goal.state == SET_ASIDE),
        });
        open.collect()
    }

    /// Returns all goals in the list.
    pub(super) fn all(&self) -> GoalsNow {
        let goals = self.closed.iter().chain(&self.open).cloned().collect();
        GoalsNow { goals }
    }

    /// Returns the goals of a run that continues from a snapshot. The goal of the problem has its
    /// text from this list.
    pub(super) fn at(&self, snapshot: &SnapshotLine) -> Self {
        let own = self.open.first().map(|goal| &goal.goal);
        let open = snapshot.goals.iter().map(|line| GoalNow {
            name: line.name.clone(),
            goal: line.goal.as_ref().or(own).cloned().unwrap_or_default(),
            value: line.value.clone().unwrap_or(Exact(Rational::ONE)),
            deadline: line.deadline.clone(),
            state: state(line.aside.is_some()),
            given: None,
            since: Exact(snapshot.now().clone()),
            why: line.aside.clone(),
        });
        Self {
            open: open.collect(),
            closed: VecDeque::new(),
        }
    }

    /// Changes an open goal.
    pub(super) fn change(&mut self, name: &str, change: GoalChange<'_>, now: &Rational) {
        let why = match change {
            GoalChange::Achieved => {
                self.close(now, ACHIEVED, None, |goal| goal.name == name);
                return;
            }
            GoalChange::Failed { why } => {
                self.close(now, FAILED, Some(why), |goal| goal.name == name);
                return;
            }
            GoalChange::SetAside { why } => Some(why.to_owned()),
            GoalChange::Pursued => None,
        };
        if let Some(goal) = self.open.iter_mut().find(|goal| goal.name == name) {
            goal.state = state(why.is_some());
            goal.since = Exact(now.clone());
            goal.why = why;
        }
    }

    /// Marks the open goals after a failed search for a plan. Pursued goals become impossible if it
    /// `is_certain` that no plan exists, otherwise unplanned. Goals that are still set aside are
    /// impossible.
    pub(super) fn mark_unplanned(&mut self, is_certain: bool, why: &str, now: &Rational) {
        for goal in &mut self.open {
            let is_pursued = goal.state == PURSUED;
            let is_unplanned = is_pursued && !is_certain;
            let state = if is_unplanned { UNPLANNED } else { IMPOSSIBLE };
            state.clone_into(&mut goal.state);
            goal.since = Exact(now.clone());
            if is_pursued {
                goal.why = (!why.is_empty()).then(|| why.to_owned());
            }
        }
    }

    /// Marks the open goals as pursued, because another plan was requested.
    pub(super) fn mark_pursued(&mut self) {
        for goal in &mut self.open {
            if [IMPOSSIBLE, UNPLANNED].contains(&goal.state.as_str()) {
                PURSUED.clone_into(&mut goal.state);
                goal.why = None;
            }
        }
    }

    /// Closes an open goal that is not achieved.
    pub(super) fn cancel(&mut self, name: &str, why: &str, now: &Rational) {
        self.close(now, CANCELLED, Some(why), |goal| goal.name == name);
    }

    /// Closes all open goals as achieved.
    pub(super) fn close_all(&mut self, now: &Rational) {
        self.close(now, ACHIEVED, None, |_| true);
    }

    fn close(
        &mut self,
        now: &Rational,
        state: &str,
        why: Option<&str>,
        is_it: impl Fn(&GoalNow) -> bool,
    ) {
        for goal in self.open.extract_if(.., |goal| is_it(goal)) {
            self.closed.push_back(GoalNow {
                state: state.to_owned(),
                since: Exact(now.clone()),
                why: why.map(str::to_owned),
                ..goal
            });
        }
        let surplus = self.closed.len().saturating_sub(MOST_CLOSED);
        self.closed.drain(..surplus);
    }
}

fn state(is_aside: bool) -> String {
    if is_aside { SET_ASIDE } else { PURSUED }.to_owned()
}
