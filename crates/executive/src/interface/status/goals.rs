//! The goals of a persistent run, and their states.

use std::collections::VecDeque;

use elbowroom::execution::{GoalChange, GoalTerms, Reason, UnreachedGoal};
use elbowroom::num::Rational;
use elbowroom::report::exact::Exact;
use elbowroom::report::trace::{ClosedGoalLine, GoalLine, SnapshotLine, WaitLine};

use super::super::documents::{GoalNow, GoalsNow, OpenGoal};

/// Maximum number of closed goals in the list.
const MAX_CLOSED: usize = 1000;

const QUEUED: &str = "queued";
const PURSUED: &str = "pursued";
const SET_ASIDE: &str = "set-aside";
const IMPOSSIBLE: &str = "impossible";
const UNPLANNED: &str = "unplanned";
const KEPT: &str = "kept";
const ACHIEVED: &str = "achieved";
const CANCELLED: &str = "cancelled";
const FAILED: &str = "failed";

/// Reason for the state of a queued goal.
const NOT_RELEASED: &str = "its release time is in the future";

/// Reason for the state of a queued goal to keep.
const OTHERS_FIRST: &str = "it does not hold, but other goals are pursued first";

/// The open goals, and the most recently closed ones.
#[derive(Clone, Debug, Default)]
pub(super) struct GoalList {
    open: Vec<GoalNow>,
    closed: VecDeque<GoalNow>,
}

impl GoalList {
    /// Adds an open goal with this name and text.
    pub(super) fn add(&mut self, (name, goal): (&str, &str), terms: &GoalTerms, now: &Rational) {
        let is_early = terms.release.as_ref().is_some_and(|it| it > now);
        // Goals to keep are evaluated afterwards.
        let is_queued = is_early || terms.keep;
        self.open.push(GoalNow {
            name: name.to_owned(),
            goal: goal.to_owned(),
            value: Exact(terms.value.clone()),
            deadline: terms.deadline.clone().map(Exact),
            release: terms.release.clone().map(Exact),
            keep: terms.keep,
            by: terms.by.clone(),
            state: if is_queued { QUEUED } else { PURSUED }.to_owned(),
            given: Some(Exact(now.clone())),
            since: Exact(now.clone()),
            why: is_early.then(|| NOT_RELEASED.to_owned()),
        });
    }

    /// Returns the open goals.
    pub(super) fn open(&self) -> Vec<OpenGoal> {
        let open = self.open.iter().map(|goal| OpenGoal {
            name: goal.name.clone(),
            goal: goal.goal.clone(),
            aside: goal.why.clone().filter(|_| goal.state == SET_ASIDE),
            release: goal
                .release
                .clone()
                .filter(|_| goal.why.as_deref() == Some(NOT_RELEASED)),
            keep: goal.keep.then(|| goal.state.clone()),
        });
        open.collect()
    }

    /// Returns `true` if no goal is open.
    pub(super) fn is_empty(&self) -> bool {
        self.open.is_empty()
    }

    /// Returns the next release time if all open goals are queued.
    pub(super) fn next_release(&self) -> Option<&Rational> {
        let is_idle = self.open.iter().all(is_waiting);
        let times = self.open.iter().filter(|_| is_idle);
        times
            .filter_map(|goal| Some(&goal.release.as_ref()?.0))
            .min()
    }

    /// Adds the closed goals to a snapshot, and the times at which the open ones were given.
    pub(super) fn complete(&self, snapshot: &mut SnapshotLine) {
        for line in snapshot.goals.iter_mut().chain(&mut snapshot.queued) {
            let known = self.open.iter().find(|goal| goal.name == line.name);
            line.given = known.and_then(|goal| goal.given.clone());
        }
        snapshot.closed = self.closed_lines();
    }

    fn closed_lines(&self) -> Vec<ClosedGoalLine> {
        let lines = self.closed.iter().map(|goal| ClosedGoalLine {
            name: goal.name.clone(),
            goal: goal.goal.clone(),
            value: goal.value.clone(),
            deadline: goal.deadline.clone(),
            release: goal.release.clone(),
            keep: goal.keep,
            by: goal.by.clone(),
            state: goal.state.clone(),
            given: goal.given.clone(),
            since: goal.since.clone(),
            why: goal.why.clone(),
        });
        lines.collect()
    }

    /// Removes and returns the closed goals.
    pub(super) fn take_closed(&mut self) -> Vec<GoalNow> {
        std::mem::take(&mut self.closed).into()
    }

    /// Returns the open goal of that name, or otherwise the last closed one.
    pub(super) fn find(&self, name: &str) -> Option<GoalNow> {
        let mut all = self.open.iter().chain(self.closed.iter().rev());
        all.find(|goal| goal.name == name).cloned()
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
        let now = |line: &GoalLine, state: String, why: Option<String>| GoalNow {
            name: line.name.clone(),
            goal: line.goal.as_ref().or(own).cloned().unwrap_or_default(),
            value: line.value.clone().unwrap_or(Exact(Rational::ONE)),
            deadline: line.deadline.clone(),
            release: line.release.clone(),
            keep: line.keep,
            by: line.by.clone(),
            state,
            given: line.given.clone(),
            since: Exact(snapshot.now().clone()),
            why,
        };
        let open = snapshot.goals.iter();
        let open = open.map(|line| now(line, state(line.aside.is_some()), line.aside.clone()));
        let queued = snapshot.queued.iter().map(|line| {
            let (state, why) = match line.waits {
                Some(WaitLine::Holds) => (KEPT, None),
                Some(WaitLine::Others) => (QUEUED, Some(OTHERS_FIRST.to_owned())),
                Some(WaitLine::Conflict) => (QUEUED, line.aside.clone()),
                None => {
                    let release = line.release.as_ref();
                    let is_early = release.is_some_and(|it| it.0 > *snapshot.now());
                    (QUEUED, is_early.then(|| NOT_RELEASED.to_owned()))
                }
            };
            now(line, state.to_owned(), why)
        });
        Self {
            open: open.chain(queued).collect(),
            closed: snapshot.closed.iter().map(closed).collect(),
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
            GoalChange::SetAside { why } | GoalChange::Queued { why } => Some(why.to_owned()),
            GoalChange::Pursued | GoalChange::Released | GoalChange::Kept => None,
        };
        if let Some(goal) = self.open.iter_mut().find(|goal| goal.name == name) {
            goal.state = match change {
                GoalChange::Queued { .. } => QUEUED.to_owned(),
                GoalChange::Kept => KEPT.to_owned(),
                _ => state(why.is_some()),
            };
            goal.since = Exact(now.clone());
            goal.why = why;
        }
    }

    /// Marks the open goals without a plan as impossible, as far as that is proven, and otherwise
    /// as unplanned.
    pub(super) fn mark_unplanned(&mut self, unreached: &[UnreachedGoal], now: &Rational) {
        for goal in self.open.iter_mut().filter(|it| !is_waiting(it)) {
            let Some(found) = unreached.iter().find(|it| it.name == goal.name) else {
                continue;
            };
            let state = if found.is_impossible {
                IMPOSSIBLE
            } else {
                UNPLANNED
            };
            state.clone_into(&mut goal.state);
            goal.since = Exact(now.clone());
            goal.why = joined(&found.reasons);
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

    /// Closes all open goals as achieved, except queued ones and goals to keep.
    pub(super) fn close_all(&mut self, now: &Rational) {
        self.close(now, ACHIEVED, None, |goal| !goal.keep && !is_waiting(goal));
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
        let surplus = self.closed.len().saturating_sub(MAX_CLOSED);
        self.closed.drain(..surplus);
    }
}

/// Returns `true` if an open goal is not pursued, and not considered for a plan.
fn is_waiting(goal: &GoalNow) -> bool {
    [QUEUED, KEPT].contains(&goal.state.as_str())
}

fn state(is_aside: bool) -> String {
    if is_aside { SET_ASIDE } else { PURSUED }.to_owned()
}

/// Returns a closed goal of a snapshot.
fn closed(line: &ClosedGoalLine) -> GoalNow {
    let line = line.clone();
    GoalNow {
        name: line.name,
        goal: line.goal,
        value: line.value,
        deadline: line.deadline,
        release: line.release,
        keep: line.keep,
        by: line.by,
        state: line.state,
        given: line.given,
        since: line.since,
        why: line.why,
    }
}

/// Returns the reasons in words, if there are any.
pub(super) fn joined(reasons: &[Reason]) -> Option<String> {
    let words: Vec<String> = reasons.iter().map(ToString::to_string).collect();
    (!words.is_empty()).then(|| words.join("; "))
}
