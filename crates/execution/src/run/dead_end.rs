//! Explanation of a dead end: the parts of the goal that can never become true again, and since
//! when.
//!
//! [`reachability`] computes an upper bound on the facts that can become true, ignoring deletions
//! and time. No plan can reach anything else. The history of the run is replayed to find the event
//! that made part of the goal unreachable.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::ground::{Condition, FactId, FluentId};
use elbowroom_model::{Situation, Task, reachability};
use elbowroom_num::{Interval, Rational};

use super::{Account, Run};
use crate::event::{Ending, Ticket};
use crate::progression::Progression;
use crate::reason::{About, Behind, Cause, Changed, Reason};

/// An observation that was believed.
#[derive(Clone, Debug)]
pub(super) struct Happened {
    /// The time of the event.
    time: Rational,
    what: What,
}

#[derive(Clone, Debug)]
pub(super) enum What {
    Started(Ticket),
    /// With its end effects.
    Ended(Ticket),
    /// Without its end effects.
    Stopped(Ticket),
    Fact(FactId, bool),
    Value(FluentId, Rational),
}

/// Limit on the work of reachability for an explanation: about a second.
const MOST_STEPS: u64 = 10_000_000;

/// The same limit for [`is_goal_unreachable`], which delays the run: about a tenth of a second.
const MOST_STEPS_MEANWHILE: u64 = 1_000_000;

/// Limit on the number of parts of the goal that are explained.
const MOST_NAMED: usize = 3;

impl Run<'_> {
    /// Records an observation that was believed, for a later explanation of a dead end.
    pub(super) fn note(&mut self, time: &Rational, what: What) {
        self.lost.in_vain = None;
        if !matches!(what, What::Stopped(_)) {
            self.refusals.forget();
        }
        if self.is_explaining {
            self.history.push(Happened {
                time: time.clone(),
                what,
            });
        }
    }

    /// Returns the parts of the goal that can never become true again, and since when.
    pub(super) fn dead_end(&self) -> Vec<Reason> {
        let mut past = self.past();
        let mut present = past.after(self.history.len());
        let _ = present.advance(&self.now);
        let Some(lost) = unreachable(&present, MOST_STEPS) else {
            return Vec::new();
        };
        if lost.is_empty() {
            let conflict = self.conflicts().into_iter().next();
            let reason = Reason::new(Cause::NotTogether);
            return vec![match conflict {
                Some(conflict) => reason.about(About::Said(conflict.in_words())),
                None => reason,
            }];
        }
        let explained = lost.iter().take(MOST_NAMED).map(|goal| past.explain(goal));
        explained.collect()
    }

    /// Returns the belief after the first `count` events of the history.
    pub(super) fn believed_after(&self, count: usize) -> Progression {
        self.past().after(count)
    }

    fn past(&self) -> Past<'_> {
        Past {
            task: self.belief.task(),
            beginning: &self.beginning,
            history: &self.history,
            account: &self.account,
            now: &self.now,
            known: BTreeMap::new(),
        }
    }
}

/// Queries about the history of a run.
struct Past<'a> {
    task: &'a Arc<Task>,
    beginning: &'a Progression,
    history: &'a [Happened],
    account: &'a Account,
    now: &'a Rational,
    /// The unreachable parts of the goal, by the number of events before.
    known: BTreeMap<usize, Option<Vec<Condition>>>,
}

impl Past<'_> {
    /// Returns the parts of the goal that were unreachable after the first `count` events, if that
    /// can be computed.
    fn unreachable_after(&mut self, count: usize) -> Option<Vec<Condition>> {
        if let Some(known) = self.known.get(&count) {
            return known.clone();
        }
        let found = unreachable(&self.after(count), MOST_STEPS);
        self.known.insert(count, found.clone());
        found
    }

    fn is_lost_after(&mut self, count: usize, goal: &Condition) -> bool {
        let lost = self.unreachable_after(count);
        lost.is_some_and(|lost| lost.contains(goal))
    }

    /// Returns the event since when a part of the goal has been unreachable.
    fn explain(&mut self, goal: &Condition) -> Reason {
        let about = About::Conditions(vec![self.task.describe_condition(goal)]);
        let reason = Reason::new(Cause::NeverAgain).about(about);
        // Goes back in growing strides until the part is reachable, then bisects.
        let mut lost = self.history.len();
        if !self.is_lost_after(lost, goal) {
            return self.between(lost, reason, goal);
        }
        let mut stride = 1;
        let mut open = loop {
            let before = lost.saturating_sub(stride);
            if !self.is_lost_after(before, goal) {
                break before;
            }
            if before == 0 {
                return self.at_the_beginning(reason, goal);
            }
            lost = before;
            stride *= 2;
        };
        while lost - open > 1 {
            let middle = usize::midpoint(open, lost);
            if self.is_lost_after(middle, goal) {
                lost = middle;
            } else {
                open = middle;
            }
        }
        self.between(open, reason, goal)
    }

    /// Explains a part of the goal that was reachable after `count` events, and unreachable after
    /// one more or because time has passed.
    fn between(&self, count: usize, reason: Reason, goal: &Condition) -> Reason {
        let next = self.history.get(count);
        let until = next.map_or(self.now, |next| &next.time).clone();
        if let Some((time, event)) = self.timed(&self.after(count), &until, goal) {
            return with_event(reason, event, time);
        }
        match next {
            Some(next) => with_event(reason, self.named(&next.what), next.time.clone()),
            None => reason.since(self.now.clone()),
        }
    }

    /// Explains a part of the goal that was unreachable after each observation: since a timed
    /// initial, or from the beginning.
    fn at_the_beginning(&self, reason: Reason, goal: &Condition) -> Reason {
        let start = self.after(0);
        if is_lost(&start, goal) {
            return reason;
        }
        match self.timed(&start, self.now, goal) {
            Some((time, event)) => with_event(reason, event, time),
            None => reason,
        }
    }

    /// Returns the first timed initials until then that make the part of the goal unreachable.
    fn timed(
        &self,
        from: &Progression,
        until: &Rational,
        goal: &Condition,
    ) -> Option<(Rational, Behind)> {
        let mut state = from.clone();
        let to_come = self.task.timed().iter().skip(state.timed_past());
        for timed in to_come.take_while(|timed| timed.time <= *until) {
            let _ = state.advance(&timed.time);
            if is_lost(&state, goal) {
                let event = Behind::Past(Changed::all(self.task, &timed.changes));
                return Some((timed.time.clone(), event));
            }
        }
        None
    }

    /// Describes an event by name.
    fn named(&self, what: &What) -> Behind {
        let task = self.task;
        let entry = |ticket: &Ticket| {
            let entry = self.account.get(*ticket);
            let name = entry.map(|entry| entry.action.name.clone());
            let ending = entry.and_then(|entry| Some(entry.ended.clone()?.1));
            (name.unwrap_or_default(), ending)
        };
        match what {
            What::Started(ticket) => Behind::Start(entry(ticket).0),
            What::Ended(ticket) => Behind::End(entry(ticket).0),
            What::Stopped(ticket) => match entry(ticket) {
                (action, Some(Ending::Failed { why })) => Behind::Failed { action, why },
                (action, _) => Behind::Cancelled(action),
            },
            What::Fact(fact, truth) => Behind::Fact {
                fact: task.fact_name(*fact),
                truth: *truth,
            },
            What::Value(fluent, value) => Behind::Value {
                fluent: task.fluent_name(*fluent),
                value: Some(value.clone()),
            },
        }
    }

    /// Returns the belief after `count` events.
    fn after(&self, count: usize) -> Progression {
        let mut state = self.beginning.clone();
        state.pursue(self.task);
        for happened in &self.history[..count] {
            // Values that cannot be computed stay the same, as they did in the run.
            let _ = state.arrive(&happened.time);
            match &happened.what {
                What::Started(ticket) => {
                    if let Some(entry) = self.account.get(*ticket) {
                        let planned = entry.planned.clone().unwrap_or_default();
                        let measured = &entry.measured[0];
                        let _ = state.start(*ticket, &entry.action, &planned, measured);
                    }
                }
                What::Ended(ticket) => {
                    if let Some(entry) = self.account.get(*ticket) {
                        let _ = state.end(*ticket, &entry.measured[1]);
                    }
                }
                What::Stopped(ticket) => state.stop(*ticket),
                What::Fact(fact, truth) => {
                    state.see_fact(*fact, *truth);
                }
                What::Value(fluent, value) => {
                    state.see_value(*fluent, value);
                }
            }
        }
        state
    }
}

fn with_event(reason: Reason, event: Behind, time: Rational) -> Reason {
    Reason {
        behind: vec![event],
        ..reason.since(time)
    }
}

fn is_lost(state: &Progression, goal: &Condition) -> bool {
    unreachable(state, MOST_STEPS).is_some_and(|lost| lost.contains(goal))
}

/// Returns `true` if part of the goal can never become true any more, and `false` if that cannot be
/// decided within a small limit.
pub(super) fn is_goal_unreachable(state: &Progression) -> bool {
    unreachable(state, MOST_STEPS_MEANWHILE).is_some_and(|lost| !lost.is_empty())
}

/// Returns the parts of the goal that can never become true any more, as far as that can be decided
/// within a small limit.
pub(super) fn hopeless_conditions(state: &Progression) -> Vec<Condition> {
    unreachable(state, MOST_STEPS_MEANWHILE).unwrap_or_default()
}

/// Returns the unreachable parts of the goal, if they can be computed within the limit.
fn unreachable(state: &Progression, step_limit: u64) -> Option<Vec<Condition>> {
    let running = state.running().values().map(|underway| {
        let duration = Interval::point(underway.planned.clone());
        state.running_action(underway, duration)
    });
    let situation = Situation {
        time: state.time().clone(),
        state: state.state(),
        running: running.collect(),
    };
    let task = Task::beginning_at(state.task(), &situation);
    let settings = reachability::Settings {
        step_limit,
        ..reachability::Settings::default()
    };
    match reachability::ground(&task, &settings) {
        reachability::Answer::Complete(grounding) => Some(grounding.unreachable_goals),
        reachability::Answer::LimitReached => None,
    }
}
