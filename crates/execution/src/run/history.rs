//! History of a run, and explanation of a dead end: the parts of the goal that can never become true again, and since
//! when.
//!
//! The history of the run is replayed to find the event that made part of the goal
//! [unreachable](super::reachability).

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::Task;
use elbowroom_model::ground::{Condition, FactId, FluentId};
use elbowroom_num::Rational;

use super::action_log::ActionLog;
use super::reachability::{MAX_STEPS, unreachable};
use crate::belief_state::BeliefState;
use crate::event::{ActionHandle, Ending};
use crate::reason::{Cause, Evidence, Reason, Subject, TimedChange};

/// An observation that was believed.
#[derive(Clone, Debug)]
pub(super) struct BelievedEvent {
    /// The time of the event.
    time: Rational,
    kind: BelievedEventKind,
}

#[derive(Clone, Debug)]
pub(super) enum BelievedEventKind {
    Started(ActionHandle),
    /// With its end effects.
    Ended(ActionHandle),
    /// Without its end effects.
    Stopped(ActionHandle),
    Fact(FactId, bool),
    Value(FluentId, Rational),
}

/// Number of events that are kept. If an earlier event made a goal unreachable, the explanation says
/// that the goal was never reachable.
const MAX_EVENTS: usize = 1000;

/// Limit on the number of parts of the goal that are explained.
const MAX_EXPLAINED_PARTS: usize = 3;

/// The believed observations of a run, for the explanation of a dead end.
pub(super) struct History {
    /// The belief before the first event.
    initial_belief: BeliefState,
    /// All believed observations, in order; none if nothing is to be explained.
    events: Vec<BelievedEvent>,
    is_explaining: bool,
}

impl History {
    /// Creates the history of a run that begins with this belief.
    pub(super) fn new(initial_belief: BeliefState) -> Self {
        Self {
            initial_belief,
            events: Vec::new(),
            is_explaining: false,
        }
    }

    /// Keeps the events from now on.
    pub(super) fn explain(&mut self) {
        self.is_explaining = true;
    }

    pub(super) fn is_explaining(&self) -> bool {
        self.is_explaining
    }

    pub(super) fn record(&mut self, time: &Rational, kind: BelievedEventKind) {
        if self.is_explaining {
            let time = time.clone();
            self.events.push(BelievedEvent { time, kind });
        }
    }

    /// Forgets all events. The history begins again with this belief.
    pub(super) fn restart(&mut self, belief: &BeliefState) {
        self.events.clear();
        self.initial_belief = belief.clone();
    }

    /// Forgets the earliest events when there are very many.
    pub(super) fn prune(&mut self, belief: &BeliefState, log: &ActionLog, now: &Rational) {
        // Only at twice the limit, so that it rarely happens.
        if self.events.len() >= 2 * MAX_EVENTS {
            let past = self.events.len() - MAX_EVENTS;
            let initial_belief = self.replay(belief, log, now).belief_after(past);
            self.initial_belief = initial_belief;
            self.events.drain(..past);
        }
    }

    /// Returns the first parts of the goal that can never become true again, and since when. `None`
    /// if they cannot be computed within the limit.
    pub(super) fn explain_unreachable_parts(
        &self,
        belief: &BeliefState,
        log: &ActionLog,
        now: &Rational,
    ) -> Option<Vec<(Condition, Reason)>> {
        let mut past = self.replay(belief, log, now);
        let mut present = past.belief_after(self.events.len());
        let _ = present.advance(now);
        let lost = unreachable(&present, MAX_STEPS)?;
        let explained = lost.into_iter().take(MAX_EXPLAINED_PARTS).map(|part| {
            let reason = past.explain(&part);
            (part, reason)
        });
        Some(explained.collect())
    }

    fn replay<'h>(
        &'h self,
        belief: &'h BeliefState,
        log: &'h ActionLog,
        now: &'h Rational,
    ) -> Replay<'h> {
        Replay {
            task: belief.task(),
            initial_belief: &self.initial_belief,
            history: &self.events,
            account: log,
            now,
            unreachable_parts: BTreeMap::new(),
        }
    }
}

/// Queries about the history of a run.
struct Replay<'a> {
    task: &'a Arc<Task>,
    initial_belief: &'a BeliefState,
    history: &'a [BelievedEvent],
    account: &'a ActionLog,
    now: &'a Rational,
    /// The unreachable parts of the goal, by the number of events before.
    unreachable_parts: BTreeMap<usize, Option<Vec<Condition>>>,
}

impl Replay<'_> {
    /// Returns the parts of the goal that were unreachable after the first `count` events, if that
    /// can be computed.
    fn unreachable_after(&mut self, count: usize) -> Option<Vec<Condition>> {
        if let Some(known) = self.unreachable_parts.get(&count) {
            return known.clone();
        }
        let found = unreachable(&self.belief_after(count), MAX_STEPS);
        self.unreachable_parts.insert(count, found.clone());
        found
    }

    fn is_unreachable_after(&mut self, count: usize, goal: &Condition) -> bool {
        let lost = self.unreachable_after(count);
        lost.is_some_and(|lost| lost.contains(goal))
    }

    /// Returns the event since when a part of the goal has been unreachable.
    fn explain(&mut self, goal: &Condition) -> Reason {
        let about = Subject::Conditions(vec![self.task.describe_condition(goal)]);
        let reason = Reason::new(Cause::NeverAgain).about(about);
        // Goes back in growing strides until the part is reachable, then bisects.
        let mut lost = self.history.len();
        if !self.is_unreachable_after(lost, goal) {
            return self.explain_between(lost, reason, goal);
        }
        let mut stride = 1;
        let mut open = loop {
            let before = lost.saturating_sub(stride);
            if !self.is_unreachable_after(before, goal) {
                break before;
            }
            if before == 0 {
                return self.explain_from_beginning(reason, goal);
            }
            lost = before;
            stride *= 2;
        };
        while lost - open > 1 {
            let middle = usize::midpoint(open, lost);
            if self.is_unreachable_after(middle, goal) {
                lost = middle;
            } else {
                open = middle;
            }
        }
        self.explain_between(open, reason, goal)
    }

    /// Explains a part of the goal that was reachable after `count` events, and unreachable after
    /// one more or because time has passed.
    fn explain_between(&self, count: usize, reason: Reason, goal: &Condition) -> Reason {
        let next = self.history.get(count);
        let until = next.map_or(self.now, |next| &next.time).clone();
        if let Some((time, event)) =
            self.explain_by_timed_initials(&self.belief_after(count), &until, goal)
        {
            return with_event(reason, event, time);
        }
        match next {
            Some(next) => with_event(reason, self.describe_event(&next.kind), next.time.clone()),
            None => reason.since(self.now.clone()),
        }
    }

    /// Explains a part of the goal that was unreachable after each observation: since a timed
    /// initial, or from the beginning.
    fn explain_from_beginning(&self, reason: Reason, goal: &Condition) -> Reason {
        let start = self.belief_after(0);
        if is_unreachable(&start, goal) {
            return reason;
        }
        match self.explain_by_timed_initials(&start, self.now, goal) {
            Some((time, event)) => with_event(reason, event, time),
            None => reason,
        }
    }

    /// Returns the first timed initials until then that make the part of the goal unreachable.
    fn explain_by_timed_initials(
        &self,
        from: &BeliefState,
        until: &Rational,
        goal: &Condition,
    ) -> Option<(Rational, Evidence)> {
        let mut state = from.clone();
        let to_come = self.task.timed().iter().skip(state.past_timed_initials());
        for timed in to_come.take_while(|timed| timed.time <= *until) {
            let _ = state.advance(&timed.time);
            if is_unreachable(&state, goal) {
                let event = Evidence::Past(TimedChange::all(self.task, &timed.changes));
                return Some((timed.time.clone(), event));
            }
        }
        None
    }

    /// Describes an event by name.
    fn describe_event(&self, what: &BelievedEventKind) -> Evidence {
        let task = self.task;
        let entry = |ticket: &ActionHandle| {
            let entry = self.account.get(*ticket);
            let name = entry.map(|entry| entry.action.name.clone());
            let ending = entry.and_then(|entry| Some(entry.ended.clone()?.1));
            (name.unwrap_or_default(), ending)
        };
        match what {
            BelievedEventKind::Started(ticket) => Evidence::Start(entry(ticket).0),
            BelievedEventKind::Ended(ticket) => Evidence::End(entry(ticket).0),
            BelievedEventKind::Stopped(ticket) => match entry(ticket) {
                (action, Some(Ending::Failed { why })) => Evidence::Failed { action, why },
                (action, _) => Evidence::Cancelled(action),
            },
            BelievedEventKind::Fact(fact, truth) => Evidence::Fact {
                fact: task.fact_name(*fact),
                truth: *truth,
            },
            BelievedEventKind::Value(fluent, value) => Evidence::Value {
                fluent: task.fluent_name(*fluent),
                value: Some(value.clone()),
            },
        }
    }

    /// Returns the belief after `count` events.
    fn belief_after(&self, count: usize) -> BeliefState {
        let mut state = self.initial_belief.clone();
        state.set_goal(self.task);
        for happened in &self.history[..count] {
            // Values that cannot be computed stay the same, as they did in the run.
            let _ = state.advance_for_happening(&happened.time);
            match &happened.kind {
                BelievedEventKind::Started(ticket) => {
                    if let Some(entry) = self.account.get(*ticket) {
                        let planned = entry.planned.clone().unwrap_or_default();
                        let measured = &entry.measured[0];
                        let _ = state.start(*ticket, &entry.action, &planned, measured);
                    }
                }
                BelievedEventKind::Ended(ticket) => {
                    if let Some(entry) = self.account.get(*ticket) {
                        let _ = state.end(*ticket, &entry.measured[1]);
                    }
                }
                BelievedEventKind::Stopped(ticket) => state.stop(*ticket),
                BelievedEventKind::Fact(fact, truth) => {
                    state.observe_fact(*fact, *truth);
                }
                BelievedEventKind::Value(fluent, value) => {
                    state.observe_value(*fluent, value);
                }
            }
        }
        state
    }
}

fn with_event(reason: Reason, event: Evidence, time: Rational) -> Reason {
    Reason {
        evidence: vec![event],
        ..reason.since(time)
    }
}

fn is_unreachable(state: &BeliefState, goal: &Condition) -> bool {
    unreachable(state, MAX_STEPS).is_some_and(|lost| lost.contains(goal))
}
