//! State of a problem during execution.

use std::sync::Arc;

use elbowroom_num::{Interval, Rational};

use crate::ground::{Action, Change, FluentId};
use crate::plan::{Step, TimeTriggeredPlan};
use crate::problem::{Problem, TimedChange, TimedInitial};
use crate::state::State;
use crate::task::Task;

/// A state at one moment, with the running actions.
///
/// Times refer to the task's own clock: its timed initials up to and including [`Situation::time`]
/// have happened, the later ones are pending.
///
/// A plan from here is a [`TimeTriggeredPlan`] whose first steps continue the running actions, in
/// their order, each with its own start (in the past) and one of the durations that are still
/// possible. All further steps start at [`Situation::time`] or later. The creator of the situation
/// has to ensure that `time` is far enough from the last happening, so that actions can start at
/// `time`.
#[derive(Clone, Debug, PartialEq)]
pub struct Situation {
    /// Present time.
    pub time: Rational,
    /// Present state, after all happenings so far.
    pub state: State,
    /// Actions that have started and not ended.
    pub running: Vec<RunningAction>,
}

/// A running durative action.
#[derive(Clone, Debug, PartialEq)]
pub struct RunningAction {
    /// The action. Guards that are already known have been evaluated: effects that will not take
    /// place are left out, and so is `Guard::at_start`.
    pub action: Arc<Action>,
    /// Start time; not after [`Situation::time`].
    pub start: Rational,
    /// Possible durations, counted from its start. Those that would have ended it before
    /// [`Situation::time`] are no longer possible, even if the interval contains them.
    pub duration: Interval,
}

impl Situation {
    /// Returns the initial situation of a task: time 0, no running actions. Timed initials at time
    /// 0 are pending.
    pub fn initial(task: &Task) -> Self {
        Self {
            time: Rational::ZERO,
            state: task.initial().clone(),
            running: Vec::new(),
        }
    }
}

impl Task {
    /// Returns a task for reachability analysis from a situation, with the same facts and fluents
    /// under the same numbers: [`ground`](crate::reachability::ground) finds the actions that some
    /// plan from there can start.
    ///
    /// Its initial state is the situation's state. The possible effects of running actions are
    /// among the timed initials of its [`Task::problem`], though not of [`Task::timed`].
    #[must_use]
    pub fn starting_from(&self, situation: &Situation) -> Self {
        let mut problem = (*self.problem).clone();
        let facts = situation.state.facts.iter();
        problem.initial_facts = facts.map(|&fact| self.atom(fact)).collect();
        let values = situation.state.values.iter();
        problem.initial_values = values
            .map(|(&fluent, value)| {
                let (function, arguments) = self.application(fluent);
                (function, arguments, value.clone())
            })
            .collect();
        problem.timed.retain(|timed| timed.time > situation.time);
        let bodies = situation
            .running
            .iter()
            .filter_map(|running| running.action.durative());
        for body in bodies {
            let effects = body.end.effects.iter();
            let at_end = effects.map(|effect| self.possible_change(&effect.change));
            let meanwhile = body
                .continuous
                .iter()
                .map(|effect| self.arbitrary_change_of(effect.fluent));
            let changes: Vec<TimedChange> = at_end.chain(meanwhile).collect();
            problem
                .timed
                .extend(changes.into_iter().map(|change| TimedInitial {
                    time: situation.time.clone(),
                    change,
                }));
        }
        let mut task = self.clone();
        task.problem = Arc::new(problem);
        task.initial = situation.state.clone();
        task
    }

    /// Returns the problem for reachability analysis: the possible effects of processes and events
    /// are among the timed initials.
    pub(crate) fn with_autonomous_changes(&self) -> Arc<Problem> {
        let autonomous = self.autonomous();
        if autonomous.is_empty() {
            return Arc::clone(&self.problem);
        }
        let mut problem = (*self.problem).clone();
        let events = autonomous.events.iter();
        let events = events.flat_map(|event| &event.snap.effects);
        let processes = autonomous.processes.iter();
        let processes = processes.flat_map(|process| &process.effects);
        let changes = events
            .map(|effect| self.possible_change(&effect.change))
            .chain(processes.map(|effect| self.arbitrary_change_of(effect.fluent)));
        problem.timed.extend(changes.map(|change| TimedInitial {
            time: Rational::ZERO,
            change,
        }));
        Arc::new(problem)
    }

    fn possible_change(&self, change: &Change) -> TimedChange {
        match change {
            Change::Add(fact) => {
                let (predicate, arguments) = self.atom(*fact);
                TimedChange::Add(predicate, arguments)
            }
            Change::Delete(fact) => {
                let (predicate, arguments) = self.atom(*fact);
                TimedChange::Delete(predicate, arguments)
            }
            Change::Update { fluent, .. } => self.arbitrary_change_of(*fluent),
        }
    }

    /// Represents any change of a fluent: reachability depends only on the fact that it changes.
    fn arbitrary_change_of(&self, fluent: FluentId) -> TimedChange {
        let (function, arguments) = self.application(fluent);
        TimedChange::Assign(function, arguments, Rational::ZERO)
    }
}

impl RunningAction {
    /// Returns the action as a step of a plan with this duration.
    pub fn step(&self, duration: Rational) -> Step {
        Step {
            start: self.start.clone(),
            action: self.action.clone(),
            duration: Some(duration),
        }
    }

    /// Returns `true` if this duration is still possible at `now`.
    pub fn can_last(&self, duration: &Rational, now: &Rational) -> bool {
        self.duration.contains(duration) && &self.start + duration >= *now
    }

    /// Returns `true` if a step continues this action, with any duration.
    pub(crate) fn is_continued_by(&self, step: &Step) -> bool {
        step.start == self.start && step.action == self.action
    }
}

impl TimeTriggeredPlan {
    /// Returns the steps that a plan from `situation` adds to the running actions.
    pub fn new_steps(&self, situation: &Situation) -> &[Step] {
        self.steps.get(situation.running.len()..).unwrap_or(&[])
    }
}
