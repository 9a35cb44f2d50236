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
//! | no report at all | a warning ([`Entry::Warning`]), and at its time-out ([`TimeoutRule`]) the action is cancelled and counts as failed. If the slack of running actions is monitored ([`RunSettings::monitors_slack`]), the same applies to an action whose delay no plan tolerates any more |
//! | a fact or value other than believed | believed; the executor is notified, and simulates the remaining plan |
//!
//! A run can also continue after its goal is reached ([`Run::lasting`]): goals are added and
//! abandoned while it runs, and it can be paused.
//!
//! With background planning ([`RunSettings::plans_aside`]), execution continues during a search:
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
//! Plans can also be prepared in the background ([`RunSettings::readies_aside`]). Then a new plan
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

mod abandoned_plan;
mod action_log;
mod anticipated_replan;
mod background_search;
mod better_plan;
mod clock_watchdog;
mod dead_end;
mod doubts;
mod goal_closing;
mod goal_selection;
mod goals;
mod history_pruning;
mod kept_goals;
mod mid_execution;
mod observations;
mod pending;
mod persistent;
mod plan_start;
mod prediction;
mod queued_goals;
mod refusal_backoff;
mod replanning;
mod selection;
mod settings;
mod shortfall;
mod shutdown;
pub mod situation;
mod slack_monitor;
mod snapshot;
mod start_dependencies;
mod step;
mod timeout;
mod work_queue;

use std::collections::VecDeque;
use std::sync::Arc;

use elbowroom_model::ground::Action;
use elbowroom_model::{Footprint, Situation, Task, TimeTriggeredPlan};
use elbowroom_num::{Rational, work};

pub use action_log::{ActionLog, ExecutedStep, KnownStart};
pub use kept_goals::Wait;
pub use mid_execution::{EntryPoint, MidExecutionStart};
pub use observations::is_correction;
pub use persistent::{GoalReader, PROBLEM_GOAL_NAME};
pub use refusal_backoff::RefusalBackoff;
pub use settings::{
    MissingPlan, PlanningTime, Report, RunSettings, RunningRule, UnknownSetting, Verdict,
};
pub use shutdown::SHUTDOWN_GRACE;
pub use snapshot::{GivenGoal, Goals, PlanAdoption, RunPhase, RunSnapshot};
pub use step::{Next, UnexpectedAnswer};
pub use timeout::TimeoutRule;

use crate::belief_state::{BeliefState, GoalStatus};
use crate::event::{ActionHandle, Command};
use crate::executor::{Decided, Decision, DecisionContext, Executor, Order, PlanEvent, Planned};
use crate::reason::{Cause, Reason, Subject};
use crate::record::{Entry, Recorder};
use crate::request::Workers;
use crate::world::{World, WorldError};
use anticipated_replan::AnticipatedReplan;
use background_search::{BackgroundSearch, SearchResults};
use clock_watchdog::ClockWatchdog;
use dead_end::BelievedEvent;
use pending::AwaitedAnswer;
use persistent::GoalManager;
use shutdown::Shutdown;
use work_queue::PendingStep;

/// Work units ([`elbowroom_num::work`]) of a decision, and of each step of the plan in it.
const DECISION_WORK: u64 = 10_000;
const STEP_WORK: u64 = 250;

/// The components that a run calls itself.
pub struct Ports<'a> {
    /// The executor.
    pub executor: Box<dyn Executor + 'a>,
    /// The recorder.
    pub recorder: Box<dyn Recorder + 'a>,
}

/// Execution of a plan.
pub struct Run<'a> {
    task: Arc<Task>,
    ports: Ports<'a>,
    settings: RunSettings,
    now: Rational,
    clock_watchdog: ClockWatchdog,
    belief: BeliefState,
    /// The starts, and their outcomes.
    action_log: ActionLog,
    /// Number of steps of the present plan.
    steps: usize,
    plan_events: Vec<PlanEvent>,
    replans: usize,
    reasons: Vec<Reason>,
    /// The expected planning time.
    expected_planning_time: Rational,
    /// The last awaited request whose answer was a plan: the task with its goals, the situation,
    /// and the assumption about late actions.
    planned_for: Option<(Arc<Task>, Situation, situation::OverrunEstimate)>,
    /// All believed observations, in order.
    history: Vec<BelievedEvent>,
    /// Returns `true` if the run is to end.
    stop_check: Box<dyn Fn() -> bool + Send + 'a>,
    is_explaining: bool,
    /// The situation of the next plan if a late action does not end, as reported to the planner.
    anticipated_replan: Option<AnticipatedReplan>,
    /// The belief before the first event of the history.
    initial_belief: BeliefState,
    /// Callback that receives the belief whenever reports were processed.
    listener: Box<dyn FnMut(&BeliefState) + Send + 'a>,
    /// State of an executive, or of an attended run.
    goal_manager: Option<GoalManager<'a>>,
    /// The tasks before the next decision; the last one is next.
    work_queue: Vec<PendingStep>,
    /// The open question to the driver.
    open_request: Option<Next>,
    /// Requests for the driver without an awaited answer.
    outbox: VecDeque<Next>,
    /// Number of requests for plans and prepared plans so far.
    requests: u64,
    /// Continuation of the run when the awaited answer arrives.
    pending: Option<AwaitedAnswer>,
    /// The background search for a plan.
    search: Option<BackgroundSearch>,
    /// The task with the goals of the present plan, with background planning.
    plan_task: Option<Arc<Task>>,
    /// Results of earlier background searches.
    search_results: SearchResults,
    /// Actions refused by the world since the last other event.
    refusal_backoff: RefusalBackoff,
    /// The end of the run, while running actions are being cancelled.
    shutdown: Option<Shutdown>,
    /// The report, once the run is over.
    report: Option<Report>,
    /// Number of times that the run was continued after its end.
    restarts_left: usize,
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
        let allowance = match &settings.planning_time {
            PlanningTime::Seconds(seconds) => seconds.clone(),
            PlanningTime::Measured => Rational::ZERO,
        };
        let belief = BeliefState::new(Arc::clone(&task));
        Self {
            initial_belief: belief.clone(),
            listener: Box::new(|_| {}),
            goal_manager: None,
            anticipated_replan: None,
            belief,
            action_log: ActionLog::default(),
            steps: 0,
            task,
            ports,
            settings,
            now: Rational::ZERO,
            clock_watchdog: ClockWatchdog::default(),
            plan_events: Vec::new(),
            replans: 0,
            reasons: Vec::new(),
            expected_planning_time: allowance,
            planned_for: None,
            history: Vec::new(),
            stop_check: Box::new(|| false),
            is_explaining: false,
            work_queue: vec![PendingStep::Begin(first)],
            open_request: None,
            outbox: VecDeque::new(),
            requests: 0,
            pending: None,
            search: None,
            plan_task: None,
            search_results: SearchResults::default(),
            refusal_backoff: RefusalBackoff::default(),
            shutdown: None,
            report: None,
            restarts_left: 0,
        }
    }

    /// Makes the run end as soon as `is_to_end` returns `true`: running actions are cancelled, and
    /// the report is complete. It is called before each decision, and after each answer of the
    /// world and of the planner.
    #[must_use]
    pub fn with_stop_check(mut self, is_to_end: impl Fn() -> bool + Send + 'a) -> Self {
        self.stop_check = Box::new(is_to_end);
        self
    }

    /// Makes the run explain why no plan reaches the goal any more: the parts of the goal that can
    /// never become true again, and since when ([`Report::dead_end`]). That takes several
    /// groundings by reachability, each about as long as the embedded planner's.
    #[must_use]
    pub fn with_explanations(mut self) -> Self {
        self.is_explaining = true;
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

    fn decide(&mut self) -> Decided {
        work::spend(DECISION_WORK + STEP_WORK.saturating_mul(self.steps as u64));
        let news = std::mem::take(&mut self.plan_events);
        let as_planned = self.belief_of_the_plan();
        let decided = self.ports.executor.decide(&DecisionContext {
            now: &self.now,
            plan_events: &news,
            belief: as_planned.as_ref().unwrap_or(&self.belief),
        });
        self.ports.recorder.record(&Entry::Decided {
            now: &self.now,
            decided: &decided,
        });
        decided
    }

    /// Makes a decision, and adds its consequences to the work queue.
    fn decide_and_enqueue(&mut self) -> Result<(), Stop> {
        self.check_stop_request()?;
        self.close_momentary_goals();
        self.close_achieved_goals();
        self.tend_kept_goals();
        if self.poll_planner()? || self.handle_requests()? {
            return Ok(());
        }
        let decided = self.decide();
        let is_hindered = match &decided.decision {
            Decision::Start(orders) => !self.may_start(orders),
            decision => *decision == Decision::GoalReached,
        };
        if is_hindered {
            self.cancel_optional_search();
        }
        match decided.decision {
            // The plan that is being prepared could not continue these actions.
            Decision::Start(orders) if !self.may_start(&orders) => self.abandon_plan(),
            Decision::Start(orders) => {
                // Immediate starts are reported at once, and must be known before the next
                // decision.
                self.work_queue.push(PendingStep::Wait(self.now.clone()));
                self.start(orders);
            }
            Decision::Cancel(steps) => {
                let tickets = steps.iter();
                let tickets = tickets.filter_map(|step| self.action_log.ticket(*step));
                self.cancel(tickets.collect());
            }
            Decision::Wait { .. } if self.seek_better_plan() => {}
            Decision::Wait { until } => self.wait(until)?,
            Decision::Replan => {
                self.cancel_search();
                self.note_abandoned(&decided.reason);
                self.replan(&decided.reason)?;
            }
            // The plan has reached its goals, and another one is being made.
            Decision::GoalReached if self.search.is_some() => self.abandon_plan(),
            Decision::GoalReached => match self.belief.goal_status() {
                GoalStatus::Awaited(time) => self.wait(Some(self.next_goal_timed_initial(time)))?,
                GoalStatus::Reached | GoalStatus::Unmet => self.request_goal_look(),
            },
        }
        Ok(())
    }

    /// Records the starts of actions. The world receives the commands before anything else is done.
    fn start(&mut self, orders: Vec<Order>) {
        let mut commands = Vec::with_capacity(orders.len());
        for mut order in orders {
            order.action = self.whole_action(order.action);
            let ticket = self.action_log.open(&order, &self.now);
            let planned = order.duration.clone().unwrap_or_default();
            let timeout = self.settings.timeout.of(&order.action.name, &planned);
            let command = Command::Start {
                ticket,
                action: order.action,
                duration: order.duration,
            };
            self.ports.recorder.record(&Entry::Command {
                now: &self.now,
                command: &command,
                planned: &order.planned,
                timeout: timeout.as_ref(),
            });
            commands.push(command);
        }
        self.send(commands);
    }

    /// Returns the action with all its effects. An action that was running when the plan was made has
    /// no other effects in the plan than those that could still take place. If it has to be started
    /// again, the others can take place as well.
    fn whole_action(&self, action: Arc<Action>) -> Arc<Action> {
        match self.task.instantiate(action.schema, &action.arguments) {
            Ok(whole) if whole != *action => Arc::new(whole),
            _ => action,
        }
    }

    /// Records the cancellation of actions. The world receives the commands before anything else is
    /// done.
    pub(crate) fn cancel(&mut self, tickets: Vec<ActionHandle>) {
        let mut commands = Vec::with_capacity(tickets.len());
        for ticket in tickets {
            let command = Command::Cancel { ticket };
            self.ports.recorder.record(&Entry::Command {
                now: &self.now,
                command: &command,
                planned: &Planned::default(),
                timeout: None,
            });
            self.action_log.note_cancel(ticket, &self.now);
            commands.push(command);
        }
        self.send(commands);
    }

    /// Sends recorded commands to the world.
    fn send(&mut self, commands: Vec<Command>) {
        self.ports.recorder.commit();
        self.work_queue
            .extend(commands.into_iter().rev().map(PendingStep::Send));
    }

    /// Waits until the executor's next decision time, or until a warning or a time-out is due.
    fn wait(&mut self, until: Option<Rational>) -> Result<(), Stop> {
        let timeout = self.next_timeout();
        // More reports on the present moment may arrive; if none do, a condition has failed.
        let breaking = self.belief.is_over_all_failing();
        let breaking = breaking.then(|| &self.now + self.task.epsilon());
        let warning = self.warn_of_late_actions();
        let doubt = self.update_forecast();
        let until = until.into_iter().chain(timeout).chain(breaking);
        let taking_over = self.next_search_decision();
        let until = until.chain(warning).chain(doubt).chain(taking_over).min();
        let Some(until) = until.map(|until| until.max(self.now.clone())) else {
            // Nothing is running, nothing is due, and the plan is not done.
            return self.replan(&Reason::new(Cause::Late).about(Subject::Nothing));
        };
        self.work_queue.push(PendingStep::CheckTimeouts);
        self.work_queue.push(PendingStep::Wait(until));
        Ok(())
    }

    /// Requests an observation of the goal, which the executor considers reached. The world's
    /// answer decides.
    fn request_goal_look(&mut self) {
        let task = self.belief.task();
        let mut footprint = Footprint::of_condition(task, task.goal());
        self.open_request = Some(Next::Look {
            facts: std::mem::take(&mut footprint.reads).into_iter().collect(),
            fluents: footprint.reads_fluents.into_iter().collect(),
        });
    }

    fn is_goal_certain(&self) -> bool {
        self.goal_status_without_plan() == Some(GoalStatus::Reached)
    }

    /// Returns the status of the goal if it holds, or will hold, without further actions.
    fn goal_status_without_plan(&self) -> Option<GoalStatus> {
        let is_idle = self.action_log.open_tickets().next().is_none();
        let outlook = is_idle.then(|| self.belief.goal_status());
        outlook.filter(|outlook| *outlook != GoalStatus::Unmet)
    }

    /// Returns the next time at which timed initials may achieve a goal. If all goals must stay
    /// true, that is `time`; a goal with a deadline may already be achieved for a moment before.
    fn next_goal_timed_initial(&self, time: Rational) -> Rational {
        let next = self.belief.next_timed().cloned();
        let next = next.filter(|_| self.next_deadline_of_a_goal().is_some());
        next.unwrap_or(time)
    }

    /// If no plan is needed, accepts the goal as reached, or waits for the timed initials that it
    /// depends on and then checks again. Returns `false` if a plan is needed.
    fn finish_if_goal_holds(&mut self, reason: &Reason) -> bool {
        match self.goal_status_without_plan() {
            None | Some(GoalStatus::Unmet) => return false,
            Some(GoalStatus::Reached) => self.request_goal_look(),
            Some(GoalStatus::Awaited(time)) => {
                let until = self.next_goal_timed_initial(time);
                self.work_queue.push(PendingStep::Replan(reason.clone()));
                self.work_queue.push(PendingStep::Wait(until));
            }
        }
        self.plan_events.clear();
        true
    }

    /// Requests a plan from the present situation; see [`RunningRule`] for the running actions.
    fn replan(&mut self, reason: &Reason) -> Result<(), Stop> {
        // The deviation may have been the end of the last step.
        if self.finish_if_goal_holds(reason) || self.wait_after_refusal(reason) {
            return Ok(());
        }
        if reason.cause != Cause::NewPlan {
            self.reasons.push(reason.clone());
            self.replans += 1;
            if self.replans > self.settings.max_replans {
                self.replans -= 1;
                let overdue = self.longer_than_planned();
                if overdue.is_empty() || self.settings.max_replans == 0 {
                    return self.continue_abandoned_plan_or_stop(Verdict::ReplanLimit);
                }
                // Their ends may achieve the goal.
                self.reasons.pop();
                self.work_queue.push(PendingStep::Replan(reason.clone()));
                let doubts = self.belief.doubt_count();
                self.work_queue
                    .push(PendingStep::WaitForActions(overdue, doubts));
                return Ok(());
            }
        }
        self.search_results.is_plan_infeasible = true;
        self.work_queue.push(PendingStep::Plan(reason.clone()));
        if self.replans == self.settings.max_replans {
            // The last permitted plan is not requested while overdue actions are running.
            let overdue = self.longer_than_planned();
            let doubts = self.belief.doubt_count();
            self.work_queue
                .push(PendingStep::WaitForActions(overdue, doubts));
        }
        self.settle_running_actions();
        Ok(())
    }
}
