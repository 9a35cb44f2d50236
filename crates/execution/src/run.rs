//! Execution of a plan in a world, with monitoring and replanning.
//!
//! A [`Run`] is a state machine. [`Run::next`] returns its next request to the driver. Requests to
//! the world are commands, waits and looks: [`Run::observe`] and [`Run::observe_requested`] take the answers.
//! Other requests are for plans, and for plans prepared for the executor: [`Run::planned`] and
//! [`Run::prepared`] take these answers, at once or while the run continues. The driver implements
//! waiting and planning, as an event loop or otherwise. [`Run::run_to_end`] is the loop for a [`World`]
//! that blocks, with [`Workers`] that plan and prepare.
//!
//! The run handles incorrect reports, so executors do not have to:
//!
//! | report | handling |
//! | --- | --- |
//! | a second `Started` or an equal second `Ended` | ignored |
//! | `Ended` without `Started` | the action is assumed to have started when it was commanded |
//! | `Ended` after another, different `Ended` | a contradiction: the effects of the action's end are in doubt until they are observed, and the plan is abandoned |
//! | a report on a ticket that was never issued | ignored |
//! | a report on an action of an earlier plan | updates the state; the executor is notified of the changes |
//! | a success after a cancellation | the success counts: the action ended before the cancellation |
//! | a report with a time in the future, or before the action's start | its time is replaced by the nearest possible one |
//! | a late report | its own time counts for durations, its arrival for the state |
//! | repeated refusals, and nothing else | background plans are requested at growing intervals ([`RefusalBackoff`]) |
//! | feedback | if the completion has grown, the time-out counts from then on |
//! | a report that cannot be read, or names an object that the problem does not have | recorded and ignored |
//! | endless answers while the clock stands still or hardly advances | the world is broken ([`Verdict::WorldFailed`]) |
//! | no report at all | a warning ([`Entry::Warning`](crate::record::Entry::Warning)), and at its time-out ([`TimeoutRule`]) the action is cancelled and counts as failed. If the slack of running actions is monitored ([`RunSettings::monitors_slack`]), the same applies to an action whose delay no plan tolerates any more |
//! | a fact or value other than believed | believed; the executor is notified, and simulates the remaining plan |
//!
//! A run can also continue after its goal is reached ([`Run::persistent`]): goals are added and
//! abandoned while it runs, and it can be paused.
//!
//! With background planning ([`RunSettings::plans_in_background`]), execution continues during a search:
//!
//! | a plan is needed because | until the plan exists |
//! | --- | --- |
//! | goals were added or abandoned | the present plan continues. The new plan starts from the state that is expected when planning ends; actions that start until then are committed |
//! | the present plan is infeasible, or there is none | nothing is started; running actions continue and are monitored |
//!
//! A new plan takes over when the committed actions have begun, at the latest when planning was
//! expected to end. Steps that were executed meanwhile are removed from it, and it is shifted by
//! its delay. If the validator rejects the result, the plan is *outdated*, and another one is made.
//! During the second search in a row, the present plan continues only until that search is expected
//! to end; during further searches, nothing is started. Each outdated plan counts as a new plan
//! ([`RunSettings::max_replans`]).
//!
//! Goals that are added during a search wait for its end. When a goal is abandoned, the search ends
//! at once, three times in a row. The next search may then continue for a limited time, which grows
//! each time that it passes before there is a plan. So neither an endless search nor frequent
//! changes of goals block the run.
//!
//! The expected state is computed with the network of the present plan: an overdue action is
//! assumed to take a quarter longer than it has taken so far, its successors are delayed
//! accordingly, and actions that could not be started are left out. If a delay will make a new plan
//! necessary ([`RunSettings::monitors_slack`]), the planner is notified in advance, of the situation
//! in which everything else has started and ended as planned. It is notified again when events
//! deviate from that.
//!
//! Plans can also be prepared in the background ([`RunSettings::prepares_in_background`]). Then a new plan
//! is fitted to the present situation as soon as it exists, including committed actions that have
//! not begun, and is prepared for that situation. It takes over as soon as it is prepared, and its
//! executor is notified of the starts and ends since then:
//!
//! | until it is prepared | |
//! | --- | --- |
//! | the present plan starts an action that the new plan also has, and no earlier step of the new plan interferes with it | the action becomes part of the new plan |
//! | the present plan would start anything else | nothing is started any more |
//! | an unexpected report: a failure, silence, another fact or value, an amount | the plan is fitted again from there, at most twice, and nothing is started any more; after that, the executor is notified, and decides whether the plan is still feasible |
//!
//! If the remaining plan is kept for added goals, it is prepared in the same way.
//!
//! At the end of a run, running actions are cancelled and have [`SHUTDOWN_GRACE`] seconds to stop. Only a
//! world that cannot be reached any more receives no commands.
//!
//! The goal counts as reached only when no action is running, nothing is in doubt, the last timed
//! initial that affects the goal has happened, and the world has had an opportunity to observe the
//! goal ([`World::look`]).

mod action_log;
mod adoption;
mod agenda;
mod background;
mod background_search;
mod better_plan;
mod clock_watchdog;
mod closing;
mod decisions;
mod domain_commands;
mod doubts;
mod goals;
mod history;
mod mid_execution;
mod observations;
mod persistent;
mod plan_start;
mod reachability;
mod refusal_backoff;
mod replanning;
mod replans;
mod requests;
mod rotation;
mod search_results;
mod settings;
mod shutdown;
pub mod situation;
mod snapshot;
mod start_dependencies;
mod step;
mod view;
mod warnings;
mod work_queue;

use std::sync::Arc;

use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

pub use action_log::{ActionLog, ExecutedStep, KnownStart};
pub use agenda::Next;
pub use closing::SHUTDOWN_GRACE;
pub use goals::{GivenGoal, GoalReader, Goals, PROBLEM_GOAL_NAME, Wait};
pub use mid_execution::{EntryPoint, MidExecutionStart};
pub use observations::is_correction;
pub use refusal_backoff::RefusalBackoff;
pub use settings::{
    MissingPlan, PlanningTime, Report, RunSettings, RunningRule, TimeoutRule, UnknownSetting,
    Verdict,
};
pub use snapshot::{PlanAdoption, RunPhase, RunSnapshot};
pub use step::UnexpectedAnswer;

use crate::belief_state::BeliefState;
use crate::executor::{Executor, PlanEvent, PlanForm};
use crate::record::Recorder;
use crate::request::Workers;
use crate::world::{World, WorldError};
use agenda::{Agenda, PendingStep};
use background::BackgroundPlanning;
use clock_watchdog::ClockWatchdog;
use closing::Closing;
use goals::{GoalContext, GoalManager};
use history::History;
use replans::Replans;
use search_results::SearchResults;
use view::RunView;

/// The components that a run calls itself.
pub struct Ports<'a> {
    /// The executor.
    pub executor: Box<dyn Executor + 'a>,
    /// The recorder.
    pub recorder: Box<dyn Recorder + 'a>,
}

/// Execution of a plan.
///
/// Each part owns its state. The methods, in the other files of this module, route reports, answers
/// and decisions between the parts.
pub struct Run<'a> {
    task: Arc<Task>,
    /// The task with the durations of commands, if they differ from those of plans.
    domain: Option<Arc<Task>>,
    ports: Ports<'a>,
    settings: RunSettings,
    now: Rational,
    belief: BeliefState,
    /// News for the next decision.
    plan_events: Vec<PlanEvent>,
    /// Number of steps of the present plan.
    steps: usize,
    /// Callback that receives the belief whenever reports were processed.
    listener: Box<dyn FnMut(&BeliefState) + Send + 'a>,
    /// The starts, and their outcomes.
    action_log: ActionLog,
    goals: GoalManager<'a>,
    agenda: Agenda,
    background: BackgroundPlanning,
    search_results: SearchResults,
    replans: Replans,
    clock_watchdog: ClockWatchdog,
    /// Actions refused by the world since the last other event.
    refusal_backoff: RefusalBackoff,
    history: History,
    closing: Closing<'a>,
}

/// Reason to stop following the plan.
enum Stop {
    Ended(Verdict),
    WorldFailed(WorldError),
}

/// Executes a plan in a world. Without a plan, makes one first.
///
/// Always returns if the ports do: the run has a time limit ([`RunSettings::time_limit`]), and a
/// world whose clock does not reach it is broken ([`Verdict::WorldFailed`]).
pub fn run(
    task: Arc<Task>,
    first: Option<&TimeTriggeredPlan>,
    settings: &RunSettings,
    ports: Ports<'_>,
    workers: &mut dyn Workers,
    world: &mut dyn World,
) -> Report {
    Run::new(task, first.cloned(), settings.clone(), ports).run_to_end(world, workers)
}

impl<'a> Run<'a> {
    /// Creates a run of this plan; without one, the run makes a plan first.
    pub fn new(
        task: Arc<Task>,
        first: Option<TimeTriggeredPlan>,
        settings: RunSettings,
        ports: Ports<'a>,
    ) -> Self {
        let expected_time = match &settings.planning_time {
            PlanningTime::Seconds(seconds) => seconds.clone(),
            PlanningTime::Measured => Rational::ZERO,
        };
        let belief = BeliefState::new(Arc::clone(&task));
        let mut run = Self {
            history: History::new(belief.clone()),
            belief,
            task,
            domain: None,
            ports,
            settings,
            now: Rational::ZERO,
            plan_events: Vec::new(),
            steps: 0,
            listener: Box::new(|_| {}),
            action_log: ActionLog::default(),
            goals: GoalManager::fixed(),
            agenda: Agenda::default(),
            background: BackgroundPlanning::new(expected_time),
            search_results: SearchResults::default(),
            replans: Replans::default(),
            clock_watchdog: ClockWatchdog::default(),
            refusal_backoff: RefusalBackoff::default(),
            closing: Closing::new(),
        };
        run.agenda.push(PendingStep::Begin(first));
        run
    }

    /// Makes the run end as soon as `must_end` returns `true`: running actions are cancelled, and
    /// the report is complete. It is called before each decision, and after each answer of the
    /// world and of the planner.
    #[must_use]
    pub fn with_stop_check(mut self, must_end: impl Fn() -> bool + Send + 'a) -> Self {
        self.closing.set_stop_check(must_end);
        self
    }

    /// Makes the run continue up to `times` times after it was over without its goal
    /// ([`Verdict::NoPlan`], [`Verdict::PlannerFailed`]): another plan is searched for, from the
    /// situation at its end. [`Run::run_to_end`] does that by itself.
    #[must_use]
    pub fn with_restarts(mut self, times: usize) -> Self {
        self.closing.set_restarts(times);
        self
    }

    /// Makes the run explain why no plan reaches the goal any more: the parts of the goal that can
    /// never become true again, and since when ([`Report::dead_end`]). That takes several
    /// groundings by reachability, each about as long as the embedded planner's.
    #[must_use]
    pub fn with_explanations(mut self) -> Self {
        self.history.explain();
        self
    }

    /// Passes the belief to `listener`, at the beginning and whenever reports of the world were
    /// processed. Decisions wait for the listener.
    #[must_use]
    pub fn on_belief(mut self, mut listener: impl FnMut(&BeliefState) + Send + 'a) -> Self {
        listener(&self.belief);
        self.listener = Box::new(listener);
        self
    }

    /// Turns the run into an executive, which does not end when its goal is reached or unreachable.
    /// It waits for other goals ([`Event::Requested`](crate::Event::Requested)), which `reader` reads. It
    /// ends at the time limit, when the world fails, or when its end is requested.
    #[must_use]
    pub fn persistent(mut self, reader: impl GoalReader + 'a) -> Self {
        self.goals = GoalManager::executive(&self.task, reader);
        self
    }

    /// Makes the run accept pauses and the abandonment of its goal, but no other goals. When the
    /// goal is abandoned, nothing more is started, and the run is over ([`Verdict::Interrupted`])
    /// when the running actions have ended.
    #[must_use]
    pub fn interactive(mut self) -> Self {
        self.goals = GoalManager::interactive(&self.task);
        self
    }

    fn view(&self) -> RunView<'_> {
        RunView {
            task: &self.task,
            settings: &self.settings,
            now: &self.now,
            belief: &self.belief,
            log: &self.action_log,
            executor: &*self.ports.executor,
            expected_planning_time: self.background.expected_time(),
            have_goals_changed: self.goals.have_changed(),
        }
    }

    /// Returns `true` if the executor chooses the order of the steps itself, with its own step
    /// numbers.
    fn chooses_order(&self) -> bool {
        self.ports.executor.need() == PlanForm::PartialOrder
    }

    /// Changes the goals, and applies the effects to the other parts.
    fn with_goals<T>(
        &mut self,
        change: impl FnOnce(&mut GoalManager<'a>, &mut GoalContext<'_>) -> T,
    ) -> T {
        let mut context = GoalContext {
            now: &self.now,
            chooses_order: self.ports.executor.need() == PlanForm::PartialOrder,
            task: &mut self.task,
            belief: &mut self.belief,
            recorder: &mut *self.ports.recorder,
            is_searching: self.background.search().is_some(),
        };
        let result = change(&mut self.goals, &mut context);
        let effects = self.goals.take_effects();
        if effects.is_goal_set {
            self.background.take_anticipated();
            self.refusal_backoff.reset();
        }
        if effects.are_others_pursued {
            self.drop_steps();
            self.history.restart(&self.belief);
            self.replans = Replans::default();
            self.search_results = SearchResults::default();
        }
        result
    }

    /// Running actions are no longer part of a plan.
    fn drop_steps(&mut self) {
        self.action_log
            .begin_plan(&std::collections::BTreeMap::new());
    }
}
