//! Goals of a run: the open and the queued ones, the selection among them, and the idle state.

mod closing;
mod goal_selection;
mod kept;
mod open_goal;
mod queued;
mod selection;
mod shortfall;

use std::collections::BTreeSet;
use std::sync::Arc;

use elbowroom_model::{Task, TimeTriggeredPlan, problem};
use elbowroom_num::Rational;

use super::settings::Verdict;
use crate::belief_state::BeliefState;
use crate::event::Request;
use crate::reason::{Cause, Reason, Subject};
use crate::record::Recorder;
use goal_selection::GoalSelection;
use open_goal::{OpenGoal, conjunction, planning_task};

pub use open_goal::{GivenGoal, Goals, Wait};

/// Name of the problem's own goal.
pub const PROBLEM_GOAL_NAME: &str = "problem";

/// Objection to a request that is ignored.
type Objection = Option<&'static str>;

/// Reads the goals that are given to a run.
///
/// The result is the condition, or the error in words.
pub trait GoalReader: Send {
    /// Reads a goal of this task.
    ///
    /// # Errors
    /// If the text is not a condition of the task, in words.
    fn read(&self, task: &Task, text: &str) -> Result<problem::Condition, String>;
}

impl<F: Fn(&Task, &str) -> Result<problem::Condition, String> + Send> GoalReader for F {
    fn read(&self, task: &Task, text: &str) -> Result<problem::Condition, String> {
        self(task, text)
    }
}

/// A change of the goals.
pub(super) struct PendingGoalChange {
    pub(super) reason: Reason,
    /// `true` if goals were only added, so that the plan may also reach these.
    pub(super) are_goals_only_added: bool,
}

/// The requests that a run accepts, and its behaviour when another run would be over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    /// It accepts no requests, and is over.
    OneGoal,
    /// It accepts only pauses and the abandonment of its goal, and is over.
    Interactive,
    /// Its goal was abandoned: it is over as soon as no action is running.
    GoalAbandoned,
    /// It waits for the next request.
    Executive,
}

/// The goals of a run, and the state that depends on them.
#[allow(
    clippy::struct_excessive_bools,
    reason = "each is an independent state"
)]
pub(super) struct GoalManager<'a> {
    mode: Mode,
    reader: Box<dyn GoalReader + 'a>,
    /// The open goals; none if the run accepts no requests.
    goals: Vec<OpenGoal>,
    /// The goals whose release times have not come, and the goals to keep that are not pursued.
    queued: Vec<OpenGoal>,
    /// `true` if the goals were ever changed.
    have_changed: bool,
    is_paused: bool,
    /// The change of the goals since the present plan was made.
    pending_change: Option<PendingGoalChange>,
    /// The selection among the goals, while it is in progress.
    selection: Option<GoalSelection>,
    /// Conjuncts of goals that exclude each other, as proved by the planner's answers during the
    /// selection.
    conflicts: Vec<Vec<String>>,
    /// `true` if goals were closed during the last background search.
    has_closed_goals: bool,
    /// The present plan, on the world's clock.
    plan: Option<TimeTriggeredPlan>,
    /// The names of the plan's goals.
    planned_goals: BTreeSet<String>,
    /// Start of the idle state.
    idle_since: Option<Rational>,
    /// `true` if it is proved that no plan reaches the goals from there, including the effects of
    /// all coming timed initials.
    is_unsolvable: bool,
    effects: GoalEffects,
}

/// Effects of changed goals on the other parts of the run.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct GoalEffects {
    /// The goal of the task was set.
    pub(super) is_goal_set: bool,
    /// The pursued goals are achieved, and those that were set aside are pursued from now on.
    pub(super) are_others_pursued: bool,
}

/// The parts of the run that depend on the goals.
pub(super) struct GoalContext<'c> {
    pub(super) now: &'c Rational,
    pub(super) task: &'c mut Arc<Task>,
    pub(super) belief: &'c mut BeliefState,
    pub(super) recorder: &'c mut dyn Recorder,
    /// `true` if the executor chooses the order of the steps itself.
    pub(super) chooses_order: bool,
    /// `true` during a background search.
    pub(super) is_searching: bool,
}

impl PendingGoalChange {
    fn of(words: String, may_keep: bool) -> Self {
        Self {
            reason: Reason::new(Cause::Asked).about(Subject::ExternalMessage(words)),
            are_goals_only_added: may_keep,
        }
    }
}

impl GoalContext<'_> {
    /// Makes the conjunction of these goals the goal of the task.
    fn pursue(&mut self, task: &Task, goals: &[OpenGoal]) {
        *self.task = Arc::new(planning_task(task, goals, self.chooses_order));
        let all = task.with_goal(conjunction(goals));
        self.belief.set_goal(&Arc::new(all));
    }
}

impl<'a> GoalManager<'a> {
    /// Creates the goals of a run that accepts no requests.
    pub(super) fn fixed() -> Self {
        Self {
            mode: Mode::OneGoal,
            reader: Box::new(|_: &Task, _: &str| Err("this run has one goal".to_owned())),
            goals: Vec::new(),
            queued: Vec::new(),
            have_changed: false,
            is_paused: false,
            pending_change: None,
            selection: None,
            conflicts: Vec::new(),
            has_closed_goals: false,
            plan: None,
            planned_goals: BTreeSet::new(),
            idle_since: None,
            is_unsolvable: false,
            effects: GoalEffects::default(),
        }
    }

    /// Creates the goals of a run that accepts pauses and the abandonment of its goal.
    pub(super) fn interactive(task: &Task) -> Self {
        let is_trivial = task.problem().goal.is_trivial();
        let goal = (!is_trivial).then(|| OpenGoal::problem_goal(task));
        Self {
            mode: Mode::Interactive,
            goals: goal.into_iter().collect(),
            ..Self::fixed()
        }
    }

    /// Creates the goals of an executive.
    pub(super) fn executive(task: &Task, reader: impl GoalReader + 'a) -> Self {
        Self {
            mode: Mode::Executive,
            reader: Box::new(reader),
            ..Self::interactive(task)
        }
    }

    /// Processes a request about goals or pauses.
    pub(super) fn process_request(
        &mut self,
        ctx: &mut GoalContext<'_>,
        request: &Request,
    ) -> Objection {
        match request {
            Request::Pursue { .. } if self.mode != Mode::Executive => {
                Some("this run accepts no other goals; the goal is ignored")
            }
            Request::Pursue { terms, .. } if !terms.value.is_positive() => {
                Some("the value of a goal must be positive; the goal is ignored")
            }
            Request::Pursue { terms, .. } if terms.keep && terms.deadline.is_some() => {
                Some("a goal to keep cannot have a deadline; the goal is ignored")
            }
            Request::Pursue { name, goal, terms } => {
                let Ok(condition) = self.reader.read(ctx.task, goal) else {
                    return Some("it is not a valid goal of this problem; it is ignored");
                };
                let text = Some(goal.clone());
                let mut given = OpenGoal::new(ctx.task, name.clone(), text, condition);
                given.terms.clone_from(terms);
                self.add_goal(ctx, given)
            }
            Request::Abandon { name } => self.abandon_goal(ctx, name),
            Request::Pause if self.is_paused => Some("the run is already paused"),
            Request::Resume if !self.is_paused => Some("the run is not paused"),
            Request::Pause | Request::Resume => {
                self.is_paused = *request == Request::Pause;
                None
            }
            Request::CancelAction { .. } => None,
        }
    }

    pub(super) fn accepts_requests(&self) -> bool {
        self.mode != Mode::OneGoal
    }

    /// Returns `true` for an executive, which becomes idle when another run would be over.
    pub(super) fn is_executive(&self) -> bool {
        self.mode == Mode::Executive
    }

    /// Returns `true` if the run becomes idle with this verdict, and is not over.
    pub(super) fn becomes_idle_after(&self, verdict: &Verdict) -> bool {
        self.is_executive()
            && match verdict {
                Verdict::GoalReached
                | Verdict::Unsolvable
                | Verdict::NoPlan { .. }
                | Verdict::PlannerFailed { .. }
                | Verdict::ReplanLimit => true,
                Verdict::TimeLimit | Verdict::Interrupted | Verdict::WorldFailed { .. } => false,
            }
    }

    pub(super) fn is_goal_abandoned(&self) -> bool {
        self.mode == Mode::GoalAbandoned
    }

    /// Records that a run other than an executive has no goal any more. Returns `false` for an
    /// executive.
    pub(super) fn note_goal_abandoned(&mut self) -> bool {
        if !self.is_executive() {
            self.mode = Mode::GoalAbandoned;
        }
        !self.is_executive()
    }

    /// Returns the effects on the other parts of the run since the last call.
    pub(super) fn take_effects(&mut self) -> GoalEffects {
        std::mem::take(&mut self.effects)
    }

    /// Returns `true` if the goals are not, or no longer, those of the problem.
    pub(super) fn have_changed(&self) -> bool {
        self.have_changed
    }

    pub(super) fn is_empty(&self) -> bool {
        self.goals.is_empty()
    }

    pub(super) fn is_paused(&self) -> bool {
        self.is_paused
    }

    /// Returns `true` if the goals have changed since a plan was requested.
    pub(super) fn is_change_pending(&self) -> bool {
        self.pending_change.is_some()
    }

    /// Returns `true` if goals were abandoned or replaced, `false` if they were only added, and
    /// `None` if they have not changed.
    pub(super) fn has_abandoned_goals(&self) -> Option<bool> {
        let change = self.pending_change.as_ref()?;
        Some(!change.are_goals_only_added)
    }

    /// Takes the change of the goals, which ends the idle state.
    pub(super) fn take_change(&mut self) -> Option<PendingGoalChange> {
        let change = self.pending_change.take()?;
        self.idle_since = None;
        Some(change)
    }

    /// Repeats a change of the goals, merged with later changes.
    pub(super) fn requeue_change(&mut self, change: PendingGoalChange) {
        self.pending_change = Some(match self.pending_change.take() {
            None => change,
            Some(later) => PendingGoalChange {
                are_goals_only_added: later.are_goals_only_added && change.are_goals_only_added,
                ..later
            },
        });
    }

    /// Returns the change of the goals in words, and `true` if goals were only added. `None` if
    /// they have not changed.
    pub(super) fn describe_change(&self) -> Option<(String, bool)> {
        let change = self.pending_change.as_ref()?;
        let words = change.reason.about.as_ref().map(ToString::to_string);
        Some((words.unwrap_or_default(), change.are_goals_only_added))
    }

    pub(super) fn restore_change(&mut self, change: Option<(String, bool)>) {
        self.pending_change =
            change.map(|(words, may_keep)| PendingGoalChange::of(words, may_keep));
    }

    /// Records a change of the goals.
    fn record_change(&mut self, ctx: &mut GoalContext<'_>, what: String, may_keep: bool) {
        self.set_goal(ctx);
        let earlier = self.pending_change.take();
        let what = match earlier.as_ref().and_then(|it| it.reason.about.as_ref()) {
            Some(earlier) => format!("{earlier}, {what}"),
            None => what,
        };
        let may_keep = may_keep && earlier.is_none_or(|earlier| earlier.are_goals_only_added);
        self.pending_change = Some(PendingGoalChange::of(what, may_keep));
    }

    /// Makes the conjunction of all pursued goals the goal of the task.
    fn set_goal(&mut self, ctx: &mut GoalContext<'_>) {
        self.have_changed = true;
        self.effects.is_goal_set = true;
        ctx.pursue(&Arc::clone(ctx.task), &self.goals);
    }

    pub(super) fn open(&self) -> Goals {
        Goals {
            open: self.goals.iter().map(GivenGoal::of).collect(),
            are_changed: self.have_changed,
        }
    }

    pub(super) fn queued(&self) -> Vec<GivenGoal> {
        self.queued.iter().map(GivenGoal::of).collect()
    }

    /// Parses given goals again.
    fn parse_again(&self, problem: &Task, goals: &[GivenGoal]) -> Vec<OpenGoal> {
        let goals = goals.iter().filter_map(|given| {
            let goal = match &given.text {
                None => OpenGoal::problem_goal(problem),
                Some(text) => {
                    let condition = self.reader.read(problem, text).ok()?;
                    OpenGoal::new(problem, given.name.clone(), Some(text.clone()), condition)
                }
            };
            Some(OpenGoal {
                terms: given.terms.clone(),
                set_aside: given.set_aside.clone(),
                missed_deadline: given.missed_deadline.clone(),
                is_announced: given.set_aside.is_some() && given.wait != Wait::Conflict,
                wait: given.wait,
                ..goal
            })
        });
        goals.collect()
    }

    /// Returns the task with these goals; `problem` is the task with the goal of the problem.
    pub(super) fn task_with(
        &self,
        problem: &Arc<Task>,
        goals: &Goals,
        chooses_order: bool,
    ) -> Arc<Task> {
        if !goals.are_changed {
            return Arc::clone(problem);
        }
        let open = self.parse_again(problem, &goals.open);
        Arc::new(planning_task(problem, &open, chooses_order))
    }

    /// Restores the open and the queued goals; `problem` is the task with the goal of the problem.
    pub(super) fn restore(
        &mut self,
        ctx: &mut GoalContext<'_>,
        problem: &Task,
        (goals, queued): (&Goals, &[GivenGoal]),
        is_paused: bool,
    ) {
        self.goals = self.parse_again(problem, &goals.open);
        self.queued = self.parse_again(problem, queued);
        if goals.are_changed {
            ctx.pursue(problem, &self.goals);
        }
        self.have_changed = goals.are_changed;
        self.is_paused = is_paused;
    }

    /// Records that a plan for these goals begins.
    pub(super) fn note_plan(
        &mut self,
        ctx: &mut GoalContext<'_>,
        plan: &TimeTriggeredPlan,
        goals: &Goals,
    ) {
        if !self.accepts_requests() {
            return;
        }
        self.has_closed_goals = false;
        self.plan = Some(plan.clone());
        self.idle_since = None;
        let pursued = goals.open.iter().filter(|it| it.set_aside.is_none());
        self.planned_goals = pursued.map(|it| it.name.clone()).collect();
        let planned = &self.planned_goals;
        let goals = self.goals.iter_mut();
        for goal in goals.filter(|goal| planned.contains(&goal.name)) {
            goal.missed_deadline = None;
        }
        self.select_after_success(ctx);
    }

    pub(super) fn drop_plan(&mut self) {
        self.plan = None;
        self.planned_goals.clear();
    }

    /// Returns the present plan, on the world's clock, if there is one and the run accepts
    /// requests.
    pub(super) fn plan(&self) -> Option<&TimeTriggeredPlan> {
        self.plan.as_ref()
    }

    /// Returns the start of the idle state, if the run is idle, and `true` if no plan reaches the
    /// open goals from there.
    pub(super) fn idle_since(&self) -> Option<(&Rational, bool)> {
        Some((self.idle_since.as_ref()?, self.is_unsolvable))
    }

    /// Sets the start of the idle state. `is_unsolvable` is `true` if no plan reaches the open
    /// goals from there.
    pub(super) fn set_idle_since(&mut self, since: Rational, is_unsolvable: bool) {
        self.idle_since = Some(since);
        self.is_unsolvable = is_unsolvable;
    }

    /// Begins the idle state after this verdict; `None` without goals. Returns the names of the
    /// goals until then.
    pub(super) fn become_idle(
        &mut self,
        ctx: &mut GoalContext<'_>,
        verdict: Option<&Verdict>,
    ) -> Vec<String> {
        self.set_idle_since(ctx.now.clone(), verdict == Some(&Verdict::Unsolvable));
        self.has_closed_goals = false;
        let names = self.goals.iter().map(|it| it.name.clone()).collect();
        if verdict == Some(&Verdict::GoalReached) {
            let achieved = std::mem::take(&mut self.goals);
            self.keep_achieved(achieved);
            self.set_goal(ctx);
        }
        names
    }

    /// Ends the idle state, and pursues all goals.
    pub(super) fn wake(&mut self, ctx: &mut GoalContext<'_>) {
        self.idle_since = None;
        self.retry_conflicting_goals();
        self.pursue_all(ctx);
    }

    /// Returns `true` if the run is idle although goals are open, and a timed initial may make them
    /// reachable.
    pub(super) fn awaits_timed_initials(&self) -> bool {
        self.idle_since.is_some() && !self.goals.is_empty() && !self.is_unsolvable
    }
}
