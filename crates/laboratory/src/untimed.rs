//! Execution of plans in worlds without time: the experiments of paper 2.
//!
//! A world without time changes only when the executor makes a step. A *step* is the attempt to
//! start an action, or its end. The state is fully observed after every step. The rules of a trial
//! are those of the published experiments (Ribeiro et al., TIME 2021, section 3):
//!
//! - a trial has a limited number of planning *rounds* (ten there: a plan and nine replans);
//! - in each round a plan is made from the current state, and executed until the executor has
//!   completed or abandoned it;
//! - the trial succeeds if the goal holds when an execution ends, whether or not the plan was
//!   completed; actions that are still running then count as cancelled;
//! - if there is no plan, all remaining rounds are lost, because nothing changes between rounds.
//!
//! One rule is not from the paper, and applies only if dead ends are detected
//! ([`Game::dead_ends`]): a step that ends where there is no plan uses up a round, as a planning
//! request would do there. Without this rule, an executor could repeat arbitrary steps until a
//! broken thing repairs itself, and the success rate would depend on its persistence.
//!
//! Executors here choose steps instead of times, so they do not implement
//! [`Executor`](elbowroom_execution::Executor). They never wait.

mod adaptable;
mod esterel;
mod lookahead;
mod published;
mod registry;
mod shortest;
mod step_record;

use std::sync::Arc;

use elbowroom_model::ground::{Action, Body, Change, Condition, SnapAction};
use elbowroom_model::problem::{ObjectId, SchemaId};
use elbowroom_model::{State, Task, TimeTriggeredPlan};

pub use adaptable::Adaptable;
pub use elbowroom_probability::{Unsupported, all_actions, all_actions_under};
pub use esterel::Esterel;
pub use lookahead::{LookaheadPolicy, NotTabulated};
pub use published::PublishedExecutor;
pub use registry::{EXECUTORS, ExecutorEntry, ExecutorName, ExecutorServices, UnknownExecutor};
pub use shortest::Shortest;
pub use step_record::{Entry, StepKind, StepRecord};

/// World without time (a port).
pub trait UntimedWorld {
    /// Returns the true state.
    fn state(&self) -> &State;

    /// Tries to start an action whose start condition holds. Returns `true` if it has started. An
    /// instantaneous action is then done.
    fn attempt(&mut self, action: &Action) -> bool;

    /// Ends a running action whose end condition holds. Returns `true` if it has succeeded. It is
    /// not running afterwards in either case.
    fn end(&mut self, action: &Action) -> bool;
}

/// Executor for worlds without time.
pub trait UntimedExecutor {
    /// Resets the state of the previous trial. Cached results may be kept.
    fn begin(&mut self) {}

    /// Executes a plan until it is completed or infeasible.
    fn execute(&mut self, plan: &Arc<TimeTriggeredPlan>, stage: &mut InstrumentedWorld<'_>);
}

/// Planner: returns a plan from a state, or `None` if there is none.
///
/// The same plan should be the same `Arc`, because executors cache results by plan.
pub type Plans<'a> = dyn FnMut(&State) -> Option<Arc<TimeTriggeredPlan>> + 'a;

/// Limits of a trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Maximum number of planning rounds.
    pub rounds: usize,
    /// Maximum number of steps.
    pub steps: usize,
}

impl Default for Limits {
    /// Returns the ten rounds of the experiments. The limit of steps only ends trials in which an
    /// action never starts.
    fn default() -> Self {
        Self {
            rounds: 10,
            steps: 100_000,
        }
    }
}

/// Returns `true` if a state with these running actions is a dead end: the goal cannot be reached
/// from it even if nothing else goes wrong.
pub type DeadEndWatch<'a> = dyn Fn(&State, &[ActionName]) -> bool + 'a;

/// Ground action: its schema and its arguments.
pub type ActionName = (SchemaId, Vec<ObjectId>);

/// Components of a trial.
pub struct TrialSetup<'g> {
    /// The problem.
    pub task: &'g Task,
    /// The planner.
    pub plans: &'g mut Plans<'g>,
    /// Detection of dead ends, if any. Each step that ends in one uses up a round, and the trial is
    /// lost with the last round.
    pub dead_ends: Option<&'g DeadEndWatch<'g>>,
    /// Limits of the trial.
    pub limits: Limits,
    /// Record of the steps of the next trial, if any.
    pub record: Option<&'g mut StepRecord>,
}

/// Counts of the steps in a trial.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepCounts {
    /// Number of actions that have started.
    pub starts: u64,
    /// Number of durative actions that have ended, with success or not.
    pub ends: u64,
    /// Number of failed attempts to start an action.
    pub failed_starts: u64,
}

impl StepCounts {
    /// Returns the number of starts and ends, which are messages in the experiments.
    pub fn messages(self) -> u64 {
        self.starts + self.ends
    }

    /// Returns the number of executed actions as in the experiments: messages and failed starts.
    pub fn steps(self) -> u64 {
        self.messages() + self.failed_starts
    }
}

/// Ending of a failed trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Ending {
    /// The planner found no plan.
    NoPlan,
    /// All rounds were used up by plans that did not reach the goal.
    RoundLimit,
    /// The last round was used up by a step that ended in a dead end.
    DeadEnd,
    /// All steps were used up.
    StepLimit,
}

impl Ending {
    /// Returns the word used in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::NoPlan => "no-plan",
            Self::RoundLimit => "rounds-used-up",
            Self::DeadEnd => "dead-end",
            Self::StepLimit => "steps-used-up",
        }
    }
}

/// Failure of a trial.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TrialFailure {
    /// Its ending.
    pub ending: Ending,
    /// Its last step; `None` if there was none.
    pub last: Option<(StepKind, ActionName)>,
}

/// Result of a trial.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trial {
    /// Its failure; `None` if the goal held when an execution ended.
    pub failure: Option<TrialFailure>,
    /// Number of executions without success: 0 if the first plan reached the goal. In a failed
    /// trial, the number of all rounds.
    pub replans: usize,
    /// Counts of its steps.
    pub tally: StepCounts,
}

impl Trial {
    /// Returns `true` if the goal held when an execution ended.
    pub fn is_success(&self) -> bool {
        self.failure.is_none()
    }
}

/// World in the view of an executor, with counts of the steps.
pub struct InstrumentedWorld<'w> {
    task: &'w Task,
    world: &'w mut dyn UntimedWorld,
    tally: StepCounts,
    most_steps: u64,
    dead_ends: Option<&'w DeadEndWatch<'w>>,
    /// Running actions of this execution; maintained only if dead ends are detected.
    running: Vec<ActionName>,
    rounds_left: usize,
    is_dead_end: bool,
    is_lost: bool,
    last: Option<(StepKind, ActionName)>,
    /// The record, and the state before the current step.
    record: Option<(&'w mut StepRecord, State)>,
}

impl InstrumentedWorld<'_> {
    /// Returns the current state.
    pub fn state(&self) -> &State {
        self.world.state()
    }

    /// Returns `true` if a condition holds.
    pub fn holds(&self, condition: &Condition) -> bool {
        holds(condition, self.state())
    }

    /// Returns `true` if the goal holds.
    pub fn is_goal(&self) -> bool {
        self.holds(self.task.goal())
    }

    /// Returns `true` if no step is allowed any more: all steps are used up ([`Limits::steps`]),
    /// or, in a dead end, all rounds.
    pub fn is_over(&self) -> bool {
        self.is_lost || self.tally.steps() >= self.most_steps
    }

    /// Returns `true` if the last step has ended in a dead end, or `None` if dead ends are not
    /// detected.
    pub fn is_dead_end(&self) -> Option<bool> {
        self.dead_ends.map(|_| self.is_dead_end)
    }

    /// Returns the number of further steps that may end in a dead end. The next one after these
    /// loses the trial.
    pub fn dead_end_steps_left(&self) -> usize {
        self.rounds_left.saturating_sub(1)
    }

    /// Tries to start an action whose start condition holds. Returns `true` if it has started.
    pub fn attempt(&mut self, action: &Action) -> bool {
        let has_started = self.world.attempt(action);
        if has_started {
            self.tally.starts += 1;
        } else {
            self.tally.failed_starts += 1;
        }
        if self.dead_ends.is_some() && has_started && action.durative().is_some() {
            self.running.push(name_of(action));
        }
        let kind = if has_started {
            StepKind::Started
        } else {
            StepKind::NotStarted
        };
        self.record_step(kind, action);
        has_started
    }

    /// Ends a running action whose end condition holds. Returns `true` if it has succeeded.
    pub fn end(&mut self, action: &Action) -> bool {
        let has_succeeded = self.world.end(action);
        self.tally.ends += 1;
        if self.dead_ends.is_some() {
            let name = name_of(action);
            self.running.retain(|other| *other != name);
        }
        let kind = if has_succeeded {
            StepKind::Ended
        } else {
            StepKind::Failed
        };
        self.record_step(kind, action);
        has_succeeded
    }

    /// Abandons a running action, which will not be ended. This is not a step.
    pub fn abandon(&mut self, action: &Action) {
        let name = name_of(action);
        self.running.retain(|other| *other != name);
    }

    /// Records a step.
    fn record_step(&mut self, kind: StepKind, action: &Action) {
        self.update_dead_end();
        // In place, because there are very many steps and few of them are the last.
        let (last_kind, (schema, arguments)) = self
            .last
            .get_or_insert_with(|| (kind, (action.schema, Vec::new())));
        (*last_kind, *schema) = (kind, action.schema);
        arguments.clone_from(&action.arguments);
        if let Some((course, before)) = &mut self.record {
            let after = self.world.state();
            course.step(kind, action, (before, after), self.is_dead_end);
            before.clone_from(after);
        }
    }

    /// Updates the dead-end state after a step, and deducts a round in a dead end.
    fn update_dead_end(&mut self) {
        let Some(dead_ends) = self.dead_ends else {
            return;
        };
        self.is_dead_end = dead_ends(self.world.state(), &self.running);
        if self.is_dead_end {
            self.rounds_left = self.rounds_left.saturating_sub(1);
            self.is_lost = self.rounds_left == 0;
        }
    }
}

fn name_of(action: &Action) -> ActionName {
    (action.schema, action.arguments.clone())
}

/// Runs a trial.
pub fn trial(
    game: &mut TrialSetup<'_>,
    world: &mut dyn UntimedWorld,
    executor: &mut dyn UntimedExecutor,
) -> Trial {
    executor.begin();
    if let Some(course) = game.record.as_deref_mut() {
        *course = StepRecord::default();
    }
    let before = game.record.as_ref().map(|_| world.state().clone());
    let mut stage = InstrumentedWorld {
        task: game.task,
        world,
        tally: StepCounts::default(),
        most_steps: game.limits.steps as u64,
        dead_ends: game.dead_ends,
        running: Vec::new(),
        rounds_left: game.limits.rounds,
        is_dead_end: false,
        is_lost: false,
        last: None,
        record: game.record.as_deref_mut().zip(before),
    };
    let mut executions = 0;
    let ending = loop {
        if stage.is_lost {
            break Ending::DeadEnd;
        }
        if stage.is_over() {
            break Ending::StepLimit;
        }
        if stage.rounds_left == 0 {
            break Ending::RoundLimit;
        }
        let Some(plan) = (game.plans)(stage.state()) else {
            break Ending::NoPlan;
        };
        if let Some((course, _)) = &mut stage.record {
            course.plan(&plan);
        }
        stage.rounds_left -= 1;
        stage.running.clear();
        stage.is_dead_end = false;
        executor.execute(&plan, &mut stage);
        if stage.is_goal() {
            return Trial {
                failure: None,
                replans: executions,
                tally: stage.tally,
            };
        }
        executions += 1;
    };
    if let Some((course, _)) = &mut stage.record {
        course.ending = Some(ending);
    }
    Trial {
        failure: Some(TrialFailure {
            ending,
            last: stage.last,
        }),
        replans: game.limits.rounds,
        tally: stage.tally,
    }
}

/// Returns `true` if a condition holds. A numeric condition never does, because there are no
/// numbers ([`all_actions`] rejects them).
fn holds(condition: &Condition, state: &State) -> bool {
    match condition {
        Condition::Fact(fact) => state.facts.contains(fact),
        Condition::Compare(..) => false,
        Condition::Not(part) => !holds(part, state),
        Condition::And(parts) => parts.iter().all(|part| holds(part, state)),
        Condition::Or(parts) => parts.iter().any(|part| holds(part, state)),
    }
}

/// Returns the start of an action, or the whole of an instantaneous one.
fn start_of(action: &Action) -> &SnapAction {
    match &action.body {
        Body::Instantaneous(snap) => snap,
        Body::Durative(body) => &body.start,
    }
}

/// Applies all effects of a snap action; additions win over deletions.
fn apply(snap: &SnapAction, state: &mut State) {
    for effect in &snap.effects {
        if let Change::Delete(fact) = effect.change {
            state.facts.remove(&fact);
        }
    }
    for effect in &snap.effects {
        if let Change::Add(fact) = effect.change {
            state.facts.insert(fact);
        }
    }
}
