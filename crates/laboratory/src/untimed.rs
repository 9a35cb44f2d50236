//! Executing plans where there is no time: the experiments of paper 2.
//!
//! A world without time goes on when something is done in it, and only then. A *step* is the
//! attempt to start an action, or its end. Facts are seen as they are after every step. The rules
//! of a trial are those of the published experiments (Ribeiro et al., TIME 2021, section 3):
//!
//! - a trial has so many planning *rounds* (ten there: a plan, and nine replans);
//! - in each round a plan is made from what holds, and executed until the executor has done all of
//!   it, or gives it up;
//! - the trial succeeds if the goal holds when an execution ends, given up or not; what is still
//!   under way then counts as let go;
//! - where there is no plan, all rounds that are left are lost, as nothing changes between rounds.
//!
//! One rule is ours, and holds only where somebody looks out for dead ends ([`Game::dead_ends`]): a
//! step that ends where there is no plan uses up a round, as asking for a plan there would. Without
//! it an executor could do something, no matter what, until what is broken mends itself, and how
//! often executors succeed would say how stubborn they are.
//!
//! Executors here choose steps, not times, and so are of another kind than
//! [`Executor`](elbowroom_execution::Executor): there is nothing to wait for.

mod adaptable;
mod course;
mod esterel;
mod lookahead;
mod published;
mod registry;
mod shortest;

use std::sync::Arc;

use elbowroom_model::ground::{Action, Body, Change, Condition, SnapAction};
use elbowroom_model::problem::{ObjectId, SchemaId};
use elbowroom_model::{State, Task, TimeTriggeredPlan};

pub use adaptable::Adaptable;
pub use course::{Course, Entry, StepKind};
pub use elbowroom_probability::{Unsupported, all_actions, all_actions_under};
pub use esterel::Esterel;
pub use lookahead::{Foresighted, NoForesight};
pub use published::AsPublished;
pub use registry::{EXECUTORS, ExecutorName, Means, Registered, UnknownExecutor};
pub use shortest::Shortest;

/// A world without time: a port.
pub trait UntimedWorld {
    /// The true state.
    fn state(&self) -> &State;

    /// Tries to start an action whose start condition holds; says whether it has started. An
    /// instantaneous action is then done.
    fn attempt(&mut self, action: &Action) -> bool;

    /// Ends an action that has started and whose end condition holds; says whether that has
    /// succeeded. It is no longer under way in any case.
    fn end(&mut self, action: &Action) -> bool;
}

/// An executor for worlds without time.
pub trait UntimedExecutor {
    /// Forgets the trial before. What has been calculated may be kept.
    fn begin(&mut self) {}

    /// Executes a plan until it is done, or does not work any more.
    fn execute(&mut self, plan: &Arc<TimeTriggeredPlan>, stage: &mut Stage<'_>);
}

/// A planner: from a state to a plan, `None` if there is none.
///
/// The same plan should be the same `Arc`: executors remember what they have made of it.
pub type Plans<'a> = dyn FnMut(&State) -> Option<Arc<TimeTriggeredPlan>> + 'a;

/// Limits of a trial.
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

/// Says whether a state is a dead end while these actions are under way: whether the goal could not
/// be reached from it even if nothing went wrong any more.
pub type DeadEndWatch<'a> = dyn Fn(&State, &[ActionName]) -> bool + 'a;

/// A ground action: its schema and its arguments.
pub type ActionName = (SchemaId, Vec<ObjectId>);

/// The components of a trial.
pub struct Game<'g> {
    /// The problem.
    pub task: &'g Task,
    /// The plans, with their planner.
    pub plans: &'g mut Plans<'g>,
    /// Who looks out for dead ends, if somebody does; then each step that ends in one uses up a
    /// round, and the trial is lost with the last one.
    pub dead_ends: Option<&'g DeadEndWatch<'g>>,
    /// When it is over in any case.
    pub limits: Limits,
    /// Where the steps of the next trial are written down, if somebody wants to read them.
    pub course: Option<&'g mut Course>,
}

/// Counts of the steps in a trial.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Actions that have started.
    pub starts: u64,
    /// Actions that have ended, well or not; of those that take time.
    pub ends: u64,
    /// Attempts to start that failed.
    pub failed_starts: u64,
}

impl Tally {
    /// Starts and ends: what the experiments send as messages.
    pub fn messages(self) -> u64 {
        self.starts + self.ends
    }

    /// Executed actions as the experiments count them: messages and failed starts.
    pub fn steps(self) -> u64 {
        self.messages() + self.failed_starts
    }
}

/// How a trial ended that did not succeed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Ending {
    /// The planner found no plan.
    NoPlan,
    /// All rounds were used up by plans that did not lead to the goal.
    RoundsUsedUp,
    /// The last round was used up by a step that ended in a dead end.
    DeadEnd,
    /// All steps were used up.
    StepsUsedUp,
}

impl Ending {
    /// The word in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::NoPlan => "no-plan",
            Self::RoundsUsedUp => "rounds-used-up",
            Self::DeadEnd => "dead-end",
            Self::StepsUsedUp => "steps-used-up",
        }
    }
}

/// How a trial failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lost {
    /// How it ended.
    pub ending: Ending,
    /// Its last step; `None` if there was none.
    pub last: Option<(StepKind, ActionName)>,
}

/// The result of a trial.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trial {
    /// How it failed; `None` if the goal held when an execution ended.
    pub lost: Option<Lost>,
    /// Executions without success: 0 if the first plan led to the goal. Where the trial has failed,
    /// all rounds.
    pub replans: usize,
    /// The work done.
    pub tally: Tally,
}

impl Trial {
    /// Whether the goal held when an execution ended.
    pub fn is_success(&self) -> bool {
        self.lost.is_none()
    }
}

/// A world as an executor is given it: it counts what is done.
pub struct Stage<'w> {
    task: &'w Task,
    world: &'w mut dyn UntimedWorld,
    tally: Tally,
    most_steps: u64,
    dead_ends: Option<&'w DeadEndWatch<'w>>,
    /// Actions that have started in this execution and not ended; known only where dead ends are
    /// looked for.
    running: Vec<ActionName>,
    rounds_left: usize,
    is_dead_end: bool,
    is_lost: bool,
    last: Option<(StepKind, ActionName)>,
    /// What is written down, and the state before the step that is being made.
    course: Option<(&'w mut Course, State)>,
}

impl Stage<'_> {
    /// The facts and numbers that hold.
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

    /// Whether nothing may be done any more: all steps are used up ([`Limits::steps`]), or, in a
    /// dead end, all rounds.
    pub fn is_over(&self) -> bool {
        self.is_lost || self.tally.steps() >= self.most_steps
    }

    /// Whether the last step has ended in a dead end; `None` if dead ends are not watched for.
    pub fn is_dead_end(&self) -> Option<bool> {
        self.dead_ends.map(|_| self.is_dead_end)
    }

    /// The number of more steps that may end in a dead end; the next one after these loses the
    /// trial.
    pub fn patience(&self) -> usize {
        self.rounds_left.saturating_sub(1)
    }

    /// Tries to start an action whose start condition holds.
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
        self.done(kind, action);
        has_started
    }

    /// Ends an action that has started and whose end condition holds; says whether that has
    /// succeeded.
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
        self.done(kind, action);
        has_succeeded
    }

    /// Lets an action go that has started: it will not be ended. That is no step.
    pub fn let_go(&mut self, action: &Action) {
        let name = name_of(action);
        self.running.retain(|other| *other != name);
    }

    /// After a step.
    fn done(&mut self, kind: StepKind, action: &Action) {
        self.look_out();
        // In place: there are very many steps, and few of them are the last.
        let (last_kind, (schema, arguments)) = self
            .last
            .get_or_insert_with(|| (kind, (action.schema, Vec::new())));
        (*last_kind, *schema) = (kind, action.schema);
        arguments.clone_from(&action.arguments);
        if let Some((course, before)) = &mut self.course {
            let after = self.world.state();
            course.step(kind, action, (before, after), self.is_dead_end);
            before.clone_from(after);
        }
    }

    /// Asks whether the step has ended in a dead end, and what that costs.
    fn look_out(&mut self) {
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

/// Makes a trial.
pub fn trial(
    game: &mut Game<'_>,
    world: &mut dyn UntimedWorld,
    executor: &mut dyn UntimedExecutor,
) -> Trial {
    executor.begin();
    if let Some(course) = game.course.as_deref_mut() {
        *course = Course::default();
    }
    let before = game.course.as_ref().map(|_| world.state().clone());
    let mut stage = Stage {
        task: game.task,
        world,
        tally: Tally::default(),
        most_steps: game.limits.steps as u64,
        dead_ends: game.dead_ends,
        running: Vec::new(),
        rounds_left: game.limits.rounds,
        is_dead_end: false,
        is_lost: false,
        last: None,
        course: game.course.as_deref_mut().zip(before),
    };
    let mut executions = 0;
    let ending = loop {
        if stage.is_lost {
            break Ending::DeadEnd;
        }
        if stage.is_over() {
            break Ending::StepsUsedUp;
        }
        if stage.rounds_left == 0 {
            break Ending::RoundsUsedUp;
        }
        let Some(plan) = (game.plans)(stage.state()) else {
            break Ending::NoPlan;
        };
        if let Some((course, _)) = &mut stage.course {
            course.plan(&plan);
        }
        stage.rounds_left -= 1;
        stage.running.clear();
        stage.is_dead_end = false;
        executor.execute(&plan, &mut stage);
        if stage.is_goal() {
            return Trial {
                lost: None,
                replans: executions,
                tally: stage.tally,
            };
        }
        executions += 1;
    };
    if let Some((course, _)) = &mut stage.course {
        course.ending = Some(ending);
    }
    Trial {
        lost: Some(Lost {
            ending,
            last: stage.last,
        }),
        replans: game.limits.rounds,
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

/// Applies the effects of a snap action, if nothing goes wrong; additions win over deletions.
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
