//! A problem in mid-execution.

use std::sync::Arc;

use elbowroom_num::{Interval, Rational};

use crate::ground::{Action, Change, FluentId};
use crate::plan::{Step, TimeTriggeredPlan};
use crate::problem::{Problem, TimedChange, TimedInitial};
use crate::state::State;
use crate::task::Task;

/// A state at one moment, with the actions that are running.
///
/// Times are those of the task's own clock: its timed initials up to and including
/// [`Situation::time`] have happened, the later ones are to come.
///
/// A plan from here is a [`TimeTriggeredPlan`] whose first steps continue the running actions, in
/// their order, each with its own start (in the past) and a duration chosen among those still
/// possible; all further steps start at [`Situation::time`] or later. Whoever makes the situation
/// sees to it that `time` is far enough from the last happening for anything to be done at `time`.
#[derive(Clone, Debug, PartialEq)]
pub struct Situation {
    /// Now.
    pub time: Rational,
    /// The present state, after all that has happened.
    pub state: State,
    /// The actions that have started and not ended.
    pub running: Vec<RunningAction>,
}

/// A durative action under way.
#[derive(Clone, Debug, PartialEq)]
pub struct RunningAction {
    /// What is being done. Its guards have been decided as far as they could be: effects that
    /// will not take place are left out, and so is `Guard::at_start`.
    pub action: Arc<Action>,
    /// The time at which it started; not after [`Situation::time`].
    pub start: Rational,
    /// The durations it may turn out to have had, counted from its start. Those that would have
    /// it end before [`Situation::time`] are no longer possible, whatever stands here.
    pub duration: Interval,
}

impl Situation {
    /// A task's beginning: time 0, nothing running. Timed initials at time 0, if there are any,
    /// are to come.
    pub fn initial(task: &Task) -> Self {
        Self {
            time: Rational::ZERO,
            state: task.initial().clone(),
            running: Vec::new(),
        }
    }
}

impl Task {
    /// A task for finding out what can be reached from a situation, with the same facts and
    /// fluents under the same numbers: [`ground`](crate::reachability::ground) finds the actions
    /// that some plan from there can start.
    ///
    /// It begins with the situation's state. In its [`Task::problem`], though not in
    /// [`Task::timed`], what the running actions may do is listed among the timed initials.
    #[must_use]
    pub fn beginning_at(&self, situation: &Situation) -> Self {
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
                .map(|effect| self.some_value_of(effect.fluent));
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

    /// The problem for questions of what can be reached: what processes and events may do is listed
    /// among the timed initials.
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
            .chain(processes.map(|effect| self.some_value_of(effect.fluent)));
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
            Change::Update { fluent, .. } => self.some_value_of(*fluent),
        }
    }

    /// Stands for any change of a fluent: whether it changes is all that reachability asks.
    fn some_value_of(&self, fluent: FluentId) -> TimedChange {
        let (function, arguments) = self.application(fluent);
        TimedChange::Assign(function, arguments, Rational::ZERO)
    }
}

impl RunningAction {
    /// The action as a step of a plan, with the duration it will have had.
    pub fn step(&self, duration: Rational) -> Step {
        Step {
            start: self.start.clone(),
            action: self.action.clone(),
            duration: Some(duration),
        }
    }

    /// Whether it may still turn out to have had this duration.
    pub fn may_last(&self, duration: &Rational, now: &Rational) -> bool {
        self.duration.contains(duration) && &self.start + duration >= *now
    }

    /// Whether a step continues this action, apart from its duration.
    pub(crate) fn is_continued_by(&self, step: &Step) -> bool {
        step.start == self.start && step.action == self.action
    }
}

impl TimeTriggeredPlan {
    /// The steps that a plan from `situation` adds to what is running.
    pub fn new_steps(&self, situation: &Situation) -> &[Step] {
        self.steps.get(situation.running.len()..).unwrap_or(&[])
    }
}
