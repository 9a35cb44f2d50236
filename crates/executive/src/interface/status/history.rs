//! Closed goals and ended actions in a segment of a trace.

use std::collections::BTreeMap;

use elbowroom::execution::{GoalChange, GoalTerms};
use elbowroom::num::Rational;
use elbowroom::report::exact::Exact;
use elbowroom::report::schema::{
    CommandLine, GoalChangeLine, GoalState, IssuedCommandLine, Line, ObservationLine,
};
use elbowroom::report::trace::Stored;

use super::super::documents::{EndedAction, GoalNow};
use super::goals::GoalList;
use super::{SUCCEEDED, Status};

/// The name of the verdict with which all pursued goals are closed.
const GOAL_REACHED: &str = "goal-reached";

/// The closed goals and the ended actions of a segment, in the order of their ends.
pub(crate) struct SegmentHistory {
    pub(crate) goals: Vec<GoalNow>,
    pub(crate) actions: Vec<EndedAction>,
    /// The last goals that were closed before the segment began.
    pub(crate) closed_before: Vec<GoalNow>,
}

/// An action that was commanded and has not ended.
struct Open {
    action: String,
    since: Exact,
    is_instantaneous: bool,
}

struct Follower {
    open_goals: GoalList,
    open: BTreeMap<u64, Open>,
    history: SegmentHistory,
}

impl SegmentHistory {
    /// Reads the history of a segment of the run that `status` follows.
    pub(crate) fn of(stored: &Stored, status: &Status) -> Self {
        let mut follower = Follower {
            open_goals: status.lock().first_goals.clone(),
            open: BTreeMap::new(),
            history: Self {
                goals: Vec::new(),
                actions: Vec::new(),
                closed_before: Vec::new(),
            },
        };
        if let Ok(Some(snapshot)) = stored.snapshot() {
            follower.open_goals = follower.open_goals.at(&snapshot);
            follower.history.closed_before = follower.open_goals.take_closed();
            for start in snapshot.starts.iter().filter(|it| it.is_open()) {
                let open = Open {
                    action: start.action.clone(),
                    since: start.ordered.clone(),
                    is_instantaneous: start.duration.is_none(),
                };
                follower.open.insert(start.ticket, open);
            }
        }
        for line in &stored.lines {
            follower.follow(line);
            let closed = follower.open_goals.take_closed();
            follower.history.goals.extend(closed);
        }
        follower.history
    }
}

impl Follower {
    fn follow(&mut self, line: &Line) {
        match line {
            Line::Command(line) => self.command(line),
            Line::Observed(line) => {
                if let Some(observation) = line.as_processed() {
                    self.observe(&observation);
                }
            }
            Line::Goal(line) => self.change_goal(line),
            Line::Resting(line) if line.verdict.as_deref() == Some(GOAL_REACHED) => {
                self.open_goals.close_all(&line.now.0);
            }
            _ => {}
        }
    }

    fn command(&mut self, line: &CommandLine) {
        if let IssuedCommandLine::Start {
            ticket,
            action,
            duration,
        } = &line.command
        {
            let open = Open {
                action: action.clone(),
                since: line.now.clone(),
                is_instantaneous: duration.is_none(),
            };
            self.open.insert(*ticket, open);
        }
    }

    fn observe(&mut self, observation: &ObservationLine) {
        match observation {
            ObservationLine::Started { ticket, time, .. }
                if self.open.get(ticket).is_some_and(|it| it.is_instantaneous) =>
            {
                self.end(*ticket, SUCCEEDED, time);
            }
            ObservationLine::Ended {
                ticket,
                outcome,
                time,
                ..
            } => self.end(*ticket, outcome, time),
            ObservationLine::Goal {
                name,
                goal,
                value,
                deadline,
                release,
                keep,
                by,
                time,
            } => {
                let number = |it: &Option<Exact>| it.as_ref().map(|it| it.0.clone());
                let terms = GoalTerms {
                    value: number(value).unwrap_or(Rational::ONE),
                    deadline: number(deadline),
                    release: number(release),
                    keep: *keep,
                    by: by.clone(),
                };
                self.open_goals.cancel(name, "replaced", &time.0);
                self.open_goals.add((name, goal), &terms, &time.0);
            }
            ObservationLine::Abandon { name, time } => {
                self.open_goals.cancel(name, "abandoned", &time.0);
            }
            _ => {}
        }
    }

    fn end(&mut self, ticket: u64, outcome: &str, time: &Exact) {
        if let Some(open) = self.open.remove(&ticket) {
            self.history.actions.push(EndedAction {
                ticket,
                action: open.action,
                since: open.since,
                end: time.clone(),
                state: outcome.to_owned(),
            });
        }
    }

    fn change_goal(&mut self, line: &GoalChangeLine) {
        let why = line.why.as_deref().unwrap_or_default();
        let change = match line.becomes {
            GoalState::Achieved => GoalChange::Achieved,
            GoalState::SetAside => GoalChange::SetAside { why },
            GoalState::Pursued => GoalChange::Pursued,
            GoalState::Released => GoalChange::Released,
            GoalState::Kept => GoalChange::Kept,
            GoalState::Queued => GoalChange::Queued { why },
            GoalState::Failed => GoalChange::Failed { why },
        };
        self.open_goals.change(&line.name, change, &line.now.0);
    }
}
