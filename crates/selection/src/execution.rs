//! Builder of a run: [`Execution`].

use std::sync::Arc;

use elbowroom_execution::executors::{
    ExecutorServices, ExecutorSpec, PolicyTableCache, UnknownExecutor,
};
use elbowroom_execution::run::{Ports, Report, Run, RunSettings, RunSnapshot};
use elbowroom_execution::{
    ActionValues, BeliefState, Executor, NoRecord, PlanComparator, Planner, PortWorkers, Preparer,
    Recorder, RolloutEvaluator, Workers, World,
};
use elbowroom_model::problem::Condition;
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_pddl::{Diagnostics, Source};
use elbowroom_probability::Likelihoods;

use crate::box_search::EnvelopeSettings;
use crate::plan_preparer::{ExactRegion, PlanPreparer};
use crate::planners::Embedded;

/// Reads a goal in PDDL for a running execution of this task: the condition alone, without `:goal`.
///
/// # Errors
/// One line in words, when it is not a condition of the problem.
pub fn read_goal(task: &Task, text: &str) -> Result<Condition, String> {
    match elbowroom_pddl::read_goal(&Source::new("the goal", text), task.problem()) {
        Ok((goal, _warnings)) => Ok(goal),
        Err(mistakes) => Err(first_error(&mistakes)),
    }
}

fn first_error(mistakes: &Diagnostics) -> String {
    let mut errors = mistakes.errors();
    errors.next().map_or_else(
        || "expected a condition".to_owned(),
        |first| first.to_string().replace(": error:", ":"),
    )
}

/// Executes a plan in a world, with one of the
/// [executors](elbowroom_execution::executors::EXECUTORS), and with the embedded planner for
/// replanning. [`Execution`] has further options.
///
/// # Errors
/// When there is no executor of that name. A run that fails is reported, not an error.
pub fn execute(
    task: &Arc<Task>,
    plan: &TimeTriggeredPlan,
    executor: &str,
    world: &mut dyn World,
) -> Result<Report, UnknownExecutor> {
    let execution = Execution::of(task).by(executor.parse()?);
    Ok(execution.beginning_with(plan.clone()).run_in(world))
}

/// Builder of a run: executor, planner, settings and ports. The defaults are those of the command
/// `elbowroom run`.
///
/// ```
/// use std::sync::Arc;
///
/// use elbowroom_selection::Execution;
/// use elbowroom_execution::run::{Next, Verdict};
/// use elbowroom_execution::{Command, Event, Ending, Observation, TimeAdvance};
/// use elbowroom_model::Task;
/// use elbowroom_num::Rational;
/// use elbowroom_pddl::{self as pddl, Source};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let domain = Source::new("domain", "
///     (define (domain post) (:requirements :durative-actions)
///       (:predicates (delivered))
///       (:durative-action deliver :parameters () :duration (= ?duration 10)
///         :effect (at end (delivered))))");
/// let problem = Source::new("problem", "
///     (define (problem letter) (:domain post) (:init) (:goal (delivered)))");
/// let (problem, _warnings) = pddl::read_problem(&domain, &problem)?;
///
/// // Without a plan, one is made.
/// let (mut run, mut workers) = Execution::of(&Arc::new(Task::new(problem))).by("stn".parse()?).run();
/// // The world of this event loop: each action starts at once, and takes as long as planned.
/// let mut coming: Vec<Observation> = Vec::new();
/// let report = loop {
///     match run.next() {
///         Next::Command(Command::Start { ticket, duration, .. }) => {
///             let now = run.now().clone();
///             let event = Event::Started { ticket, measured: Vec::new() };
///             coming.push(Observation { time: now.clone(), event });
///             let (ending, measured) = (Ending::Succeeded, Vec::new());
///             let event = Event::Ended { ticket, ending, measured };
///             coming.push(Observation { time: now + duration.unwrap_or_default(), event });
///         }
///         Next::Command(Command::Cancel { .. }) => coming.clear(),
///         Next::Wait { until } => {
///             let now = coming.iter().map(|it| it.time.clone()).chain([until]).min().unwrap();
///             let observations = coming.extract_if(.., |it| it.time <= now).collect();
///             run.observe(TimeAdvance { now, observations })?;
///         }
///         Next::Look { .. } => run.observe_requested(Vec::new())?,
///         Next::Over(report) => break report,
///         // A plan is to be made, or prepared: these workers answer at once.
///         request => run.delegate(request, &mut *workers),
///     }
/// };
/// assert_eq!(report.verdict, Verdict::GoalReached);
/// assert_eq!(report.time, Rational::from(10));
/// # Ok(())
/// # }
/// ```
#[must_use = "it does nothing until it is run"]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a setting of its own"
)]
pub struct Execution<'a> {
    task: Arc<Task>,
    plan: Option<TimeTriggeredPlan>,
    snapshot: Option<RunSnapshot>,
    restarts: usize,
    executor: ExecutorChoice<'a>,
    settings: RunSettings,
    flow: EnvelopeSettings,
    likelihoods: Arc<Likelihoods>,
    policy_tables: PolicyTableCache,
    plan_comparator: Option<Box<dyn PlanComparator>>,
    action_values: Option<Arc<dyn ActionValues>>,
    missing_table_reason: Option<String>,
    rollouts: Option<Box<dyn RunRollouts + 'a>>,
    planner: Option<Box<dyn Planner + 'a>>,
    preparer: Option<Box<dyn Preparer + 'a>>,
    recorder: Box<dyn Recorder + 'a>,
    stop_check: Box<dyn Fn() -> bool + Send + 'a>,
    is_explaining: bool,
    is_persistent: bool,
    is_interactive: bool,
    has_domain_commands: bool,
    listener: Option<Listener<'a>>,
}

/// Callback for the belief state of a run ([`Run::on_belief`]).
pub type Listener<'a> = Box<dyn FnMut(&BeliefState) + Send + 'a>;

/// The executor of a run: a registered one, or the caller's own.
enum ExecutorChoice<'a> {
    Registered(ExecutorSpec),
    Custom(Box<dyn Executor + 'a>),
}

/// The rollouts of a run, a port: they evaluate its decisions, and may already know the best plan
/// for a situation.
pub trait RunRollouts: Send {
    /// Returns an evaluator of decisions.
    fn evaluator(&self) -> Box<dyn RolloutEvaluator>;

    /// Returns a planner that answers with the best plan, if one was found for the situation, and
    /// otherwise calls `planner`.
    fn wrap_planner<'a>(&self, planner: Box<dyn Planner + 'a>) -> Box<dyn Planner + 'a>;
}

impl<'a> Execution<'a> {
    /// Creates an execution of a task, without an initial plan.
    pub fn of(task: &Arc<Task>) -> Self {
        Self {
            task: Arc::clone(task),
            plan: None,
            snapshot: None,
            restarts: 0,
            executor: ExecutorChoice::Registered(ExecutorSpec::default()),
            settings: RunSettings::default(),
            flow: EnvelopeSettings::default(),
            likelihoods: Arc::new(Likelihoods::certain()),
            policy_tables: PolicyTableCache::default(),
            plan_comparator: None,
            action_values: None,
            missing_table_reason: None,
            rollouts: None,
            planner: None,
            preparer: None,
            recorder: Box::new(NoRecord),
            stop_check: Box::new(|| false),
            is_explaining: false,
            is_persistent: false,
            is_interactive: false,
            has_domain_commands: false,
            listener: None,
        }
    }

    /// Starts with this plan. Without one, the planner makes one.
    pub fn beginning_with(self, plan: impl Into<Option<TimeTriggeredPlan>>) -> Self {
        let plan = plan.into();
        Self { plan, ..self }
    }

    /// Resumes an executive's run from this state: see [`Run::standing`].
    pub fn resume_from(self, stand: impl Into<Option<RunSnapshot>>) -> Self {
        let stand = stand.into();
        Self {
            snapshot: stand,
            ..self
        }
    }

    /// Sets the number of times that the run was continued after its end: see [`Run::with_restarts`].
    pub fn with_restarts(self, times: usize) -> Self {
        Self {
            restarts: times,
            ..self
        }
    }

    /// Sets the executor.
    pub fn by(self, executor: ExecutorSpec) -> Self {
        let executor = ExecutorChoice::Registered(executor);
        Self { executor, ..self }
    }

    /// Sets an executor of the caller.
    pub fn with_executor(self, executor: impl Executor + 'a) -> Self {
        let executor = ExecutorChoice::Custom(Box::new(executor));
        Self { executor, ..self }
    }

    /// Sets the settings of the run.
    pub fn with_settings(self, settings: RunSettings) -> Self {
        Self { settings, ..self }
    }

    /// Sets the open quantities, the guarantee and the search of envelopes.
    pub fn with_envelopes(self, flow: EnvelopeSettings) -> Self {
        Self { flow, ..self }
    }

    /// Sets the likelihoods, for executors that use them.
    pub fn with_likelihoods(self, likelihoods: Arc<Likelihoods>) -> Self {
        Self {
            likelihoods,
            ..self
        }
    }

    /// Reuses policy tables for the same problem and likelihoods from other runs.
    pub fn with_policy_tables(self, policy_tables: PolicyTableCache) -> Self {
        Self {
            policy_tables,
            ..self
        }
    }

    /// Sets the comparator of plans, for executors that use it
    /// ([`Needs::odds`](elbowroom_execution::executors::Needs::odds)).
    pub fn with_plan_comparator(self, odds: Option<Box<dyn PlanComparator>>) -> Self {
        Self {
            plan_comparator: odds,
            ..self
        }
    }

    /// Sets the table of action values, for executors that use it
    /// ([`Needs::action_values`](elbowroom_execution::executors::Needs::action_values)).
    pub fn with_action_values(self, action_values: Option<Arc<dyn ActionValues>>) -> Self {
        Self {
            action_values,
            ..self
        }
    }

    /// Records why an executor that evaluates each move has no table of action values.
    pub fn with_missing_table_reason(self, no_table: Option<String>) -> Self {
        Self {
            missing_table_reason: no_table,
            ..self
        }
    }

    /// Returns why there is no table of moves for an executor that evaluates each move; `None` if
    /// there is one or none was attempted.
    pub fn missing_table_reason(&self) -> Option<&str> {
        self.missing_table_reason.as_deref()
    }

    /// Sets the rollouts, for executors that use them
    /// ([`Needs::rollouts`](elbowroom_execution::executors::Needs::rollouts)).
    pub fn with_rollouts<R: RunRollouts + 'a>(self, rollouts: Option<R>) -> Self {
        Self {
            rollouts: rollouts.map(|it| Box::new(it) as Box<dyn RunRollouts + 'a>),
            ..self
        }
    }

    /// Sets the planner. The default is the embedded one with its usual limits
    /// ([`Embedded::default`]).
    pub fn with_planner(self, planner: impl Planner + 'a) -> Self {
        let planner: Option<Box<dyn Planner + 'a>> = Some(Box::new(planner));
        Self { planner, ..self }
    }

    /// Sets the preparer of plans. The default is an [`PlanPreparer`].
    pub fn with_preparer(self, preparer: impl Preparer + 'a) -> Self {
        let preparer: Option<Box<dyn Preparer + 'a>> = Some(Box::new(preparer));
        Self { preparer, ..self }
    }

    /// Sets the recorder.
    pub fn recorded_by(self, recorder: impl Recorder + 'a) -> Self {
        let recorder = Box::new(recorder);
        Self { recorder, ..self }
    }

    /// Replaces the recorder by a decorator of it.
    pub fn map_recorder(
        self,
        decorate: impl FnOnce(Box<dyn Recorder + 'a>) -> Box<dyn Recorder + 'a>,
    ) -> Self {
        let recorder = decorate(self.recorder);
        Self { recorder, ..self }
    }

    /// Returns `true` if a planner was set.
    pub fn has_planner(&self) -> bool {
        self.planner.is_some()
    }

    /// Returns `true` if a preparer was set.
    pub fn has_preparer(&self) -> bool {
        self.preparer.is_some()
    }

    /// Returns the state from which the run is resumed, if any.
    pub fn snapshot(&self) -> Option<&RunSnapshot> {
        self.snapshot.as_ref()
    }

    /// Returns the first plan, if it was set.
    pub fn first_plan(&self) -> Option<&TimeTriggeredPlan> {
        self.plan.as_ref()
    }

    /// See [`Run::with_stop_check`].
    pub fn with_stop_check(self, must_end: impl Fn() -> bool + Send + 'a) -> Self {
        let must_end = Box::new(must_end);
        Self {
            stop_check: must_end,
            ..self
        }
    }

    /// See [`Run::with_explanations`].
    pub fn with_explanations(self) -> Self {
        Self {
            is_explaining: true,
            ..self
        }
    }

    /// Makes the run persistent: it continues after reaching the goal, and accepts further goals in
    /// PDDL. See [`Run::persistent`].
    pub fn persistent(self, is_lasting: bool) -> Self {
        Self {
            is_persistent: is_lasting,
            ..self
        }
    }

    /// Makes the run accept pauses and the abandonment of its goal: see [`Run::interactive`].
    pub fn interactive(self, is_attended: bool) -> Self {
        Self {
            is_interactive: is_attended,
            ..self
        }
    }

    /// Gives commands the durations of the domain, where plans have other ones: see [`Run::with_domain_commands`].
    pub fn with_domain_commands(self, has_domain_commands: bool) -> Self {
        Self {
            has_domain_commands,
            ..self
        }
    }

    /// See [`Run::on_belief`].
    pub fn on_belief(self, listener: impl FnMut(&BeliefState) + Send + 'a) -> Self {
        let listener: Option<Listener<'a>> = Some(Box::new(listener));
        Self { listener, ..self }
    }

    /// Returns the run, to be driven step by step by an event loop, and the workers that answer its requests for
    /// plans.
    #[must_use = "a run does nothing until `next` is called"]
    pub fn run(mut self) -> (Run<'a>, Box<dyn Workers + 'a>) {
        let executor = match self.executor {
            ExecutorChoice::Custom(executor) => executor,
            ExecutorChoice::Registered(executor) => {
                let needs = executor.needs();
                self.rollouts = self.rollouts.filter(|_| needs.rollouts);
                executor.build(ExecutorServices {
                    region: Box::new(ExactRegion),
                    likelihoods: self.likelihoods,
                    comparator: self.plan_comparator.filter(|_| executor.needs_odds()),
                    policy_cache: self.policy_tables,
                    order_cache: None,
                    action_values: self.action_values.filter(|_| needs.action_values),
                    rollout: self.rollouts.as_ref().map(|it| it.evaluator()),
                    has_planner: self.settings.max_replans > 0
                        && self.planner.as_ref().is_none_or(Planner::makes_plans),
                })
            }
        };
        let planner = self
            .planner
            .unwrap_or_else(|| Box::new(Embedded::default()));
        let planner = match &self.rollouts {
            Some(rollouts) => rollouts.wrap_planner(planner),
            None => planner,
        };
        let preparer = self
            .preparer
            .unwrap_or_else(|| Box::new(PlanPreparer::new(self.flow)));
        let workers = PortWorkers::new(planner, preparer);
        let ports = Ports {
            executor,
            recorder: self.recorder,
        };
        let mut run = Run::new(self.task, self.plan, self.settings, ports)
            .with_stop_check(self.stop_check)
            .with_restarts(self.restarts);
        if self.has_domain_commands {
            run = run.with_domain_commands();
        }
        if self.is_persistent {
            run = run.persistent(read_goal);
        } else if self.is_interactive {
            run = run.interactive();
        }
        if let Some(stand) = self.snapshot {
            run = run.standing(stand);
        }
        if let Some(listener) = self.listener {
            run = run.on_belief(listener);
        }
        if self.is_explaining {
            run = run.with_explanations();
        }
        (run, Box::new(workers))
    }

    /// Executes the whole run in this world.
    pub fn run_in(self, world: &mut dyn World) -> Report {
        let (run, mut workers) = self.run();
        run.run_to_end(world, &mut *workers)
    }
}
