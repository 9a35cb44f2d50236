//! Executing plans where there is no time: the experiments of paper 2.
//!
//! A world without time goes on when something is done in it, and only then. A *step* is the
//! attempt to start an action, or its end. Facts are seen as they are after every step. The rules of
//! a trial are those of the published experiments (Ribeiro et al., TIME 2021, section 3):
//!
//! - a trial has so many planning *rounds* (ten there: a plan, and nine replans);
//! - in each round a plan is made from what holds, and executed until the executor has done all of
//!   it, or gives it up;
//! - the trial succeeds if the goal holds when an execution ends, given up or not; what is still
//!   under way then counts as let go;
//! - where there is no plan, all rounds that are left are lost, as nothing changes between rounds.
//!
//! Executors here choose steps, not times, and so are of another kind than
//! [`Executor`](crate::Executor): there is nothing to wait for.

mod actions;
mod adaptable;
mod esterel;
mod lookahead;
mod published;
mod shortest;

use std::sync::Arc;

use elbowroom_model::ground::{Action, Body, Change, Condition, SnapAction};
use elbowroom_model::{State, Task, TimeTriggeredPlan};

pub use actions::{Unsupported, all_actions};
pub use adaptable::Adaptable;
pub use esterel::Esterel;
pub use lookahead::{Foresighted, NoForesight};
pub use published::AsPublished;
pub use shortest::Shortest;

/// A world without time: a port.
pub trait UntimedWorld {
    /// What is true, as everyone sees it.
    fn state(&self) -> &State;

    /// Tries to start an action whose start condition holds; says whether it has started. An
    /// instantaneous action is then done.
    fn attempt(&mut self, action: &Action) -> bool;

    /// Ends an action that has started and whose end condition holds.
    fn end(&mut self, action: &Action);
}

/// Who executes plans in such worlds.
pub trait UntimedExecutor {
    /// Forgets the trial before. What has been calculated may be kept.
    fn begin(&mut self) {}

    /// Executes a plan until it is done, or does not work any more.
    fn execute(&mut self, plan: &Arc<TimeTriggeredPlan>, stage: &mut Stage<'_>);
}

/// Who plans: from what holds to a plan, `None` if there is none.
///
/// The same plan should be the same `Arc`: executors remember what they have made of it.
pub type Plans<'a> = dyn FnMut(&State) -> Option<Arc<TimeTriggeredPlan>> + 'a;

/// When a trial is over in any case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Planning rounds.
    pub rounds: usize,
    /// Steps.
    pub steps: usize,
}

impl Default for Limits {
    /// The ten rounds of the experiments. The steps are only there so that an action that never
    /// starts is not tried for ever.
    fn default() -> Self {
        Self {
            rounds: 10,
            steps: 100_000,
        }
    }
}

/// What was done in a trial.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Actions that have started.
    pub starts: u64,
    /// Actions that have ended; of those that take time.
    pub ends: u64,
    /// Attempts to start that failed.
    pub failed_starts: u64,
}

impl Tally {
    /// Starts and ends: what the experiments send as messages.
    pub fn messages(self) -> u64 {
        self.starts + self.ends
    }

    /// What the experiments call executed actions: messages and failed starts.
    pub fn steps(self) -> u64 {
        self.messages() + self.failed_starts
    }
}

/// How a trial went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Trial {
    /// Whether the goal held when an execution ended.
    pub is_success: bool,
    /// Rounds without success: 0 if the first plan led to the goal.
    pub replans: usize,
    /// What was done.
    pub tally: Tally,
}

/// A world as an executor is given it: it counts what is done.
pub struct Stage<'w> {
    task: &'w Task,
    world: &'w mut dyn UntimedWorld,
    tally: Tally,
    most_steps: u64,
}

impl Stage<'_> {
    /// What is true.
    pub fn state(&self) -> &State {
        self.world.state()
    }

    /// Whether a condition holds.
    pub fn holds(&self, condition: &Condition) -> bool {
        holds(condition, self.state())
    }

    /// Whether the goal holds.
    pub fn is_goal(&self) -> bool {
        self.holds(self.task.goal())
    }

    /// Whether nothing may be done any more ([`Limits::steps`]).
    pub fn is_over(&self) -> bool {
        self.tally.steps() >= self.most_steps
    }

    /// Tries to start an action whose start condition holds.
    pub fn attempt(&mut self, action: &Action) -> bool {
        let has_started = self.world.attempt(action);
        if has_started {
            self.tally.starts += 1;
        } else {
            self.tally.failed_starts += 1;
        }
        has_started
    }

    /// Ends an action that has started and whose end condition holds.
    pub fn end(&mut self, action: &Action) {
        self.world.end(action);
        self.tally.ends += 1;
    }
}

/// Makes a trial.
pub fn trial(
    task: &Task,
    world: &mut dyn UntimedWorld,
    plans: &mut Plans<'_>,
    executor: &mut dyn UntimedExecutor,
    limits: Limits,
) -> Trial {
    executor.begin();
    let mut stage = Stage {
        task,
        world,
        tally: Tally::default(),
        most_steps: limits.steps as u64,
    };
    for round in 0..limits.rounds {
        let Some(plan) = plans(stage.state()) else {
            break;
        };
        executor.execute(&plan, &mut stage);
        if stage.is_goal() {
            return Trial {
                is_success: true,
                replans: round,
                tally: stage.tally,
            };
        }
        if stage.is_over() {
            break;
        }
    }
    Trial {
        is_success: false,
        replans: limits.rounds,
        tally: stage.tally,
    }
}

/// Whether a condition holds; one on numbers never does, as there are none
/// ([`all_actions`] refuses them).
fn holds(condition: &Condition, state: &State) -> bool {
    match condition {
        Condition::Fact(fact) => state.facts.contains(fact),
        Condition::Compare(..) => false,
        Condition::Not(part) => !holds(part, state),
        Condition::And(parts) => parts.iter().all(|part| holds(part, state)),
        Condition::Or(parts) => parts.iter().any(|part| holds(part, state)),
    }
}

/// Needed at the start; all that an instantaneous action needs.
fn start_of(action: &Action) -> &SnapAction {
    match &action.body {
        Body::Instantaneous(snap) => snap,
        Body::Durative(body) => &body.start,
    }
}

/// What a snap action does if nothing goes wrong; additions win over deletions.
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
