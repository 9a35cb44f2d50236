//! Execution of plans.

use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use elbowroom_execution::run::{Report, RunSnapshot, Verdict};
use elbowroom_execution::{BeliefState, Entry, NoRecord, Planner, Preparer, Recorder, World};
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_report::trace::schema::ReportLine;
use serde::{Deserialize, Serialize};

use super::{Event, Observer, Version};
use crate::execute::{Listener, RunSpec, SpecError, Validated};

/// Requests a run.
pub struct RunRequest<'a> {
    /// The specification of the run.
    pub spec: &'a RunSpec,
    /// The problem, with the ε of the specification.
    pub task: &'a Arc<Task>,
    /// The initial plan; without one, the planner makes one.
    pub plan: Option<TimeTriggeredPlan>,
    /// State of an executive's run, to resume it instead.
    pub snapshot: Option<RunSnapshot>,
    /// Number of times that the run was over, without a plan, and was continued.
    pub restarts: usize,
    /// Replacement for the planner of the specification: a replay, or a planner with another clock
    /// than the watcher's.
    pub planner: Option<Box<dyn Planner + 'a>>,
    /// Replacement for the synchronous [`Analyst`](crate::execute::Analyst), which prepares plans.
    pub preparer: Option<Box<dyn Preparer + 'a>>,
    /// The recorder.
    pub recorder: Box<dyn Recorder + 'a>,
    /// Callback for the belief state, called whenever it may have changed.
    pub listener: Option<Listener<'a>>,
}

/// The answer, and the report behind it.
#[derive(Clone, Debug)]
pub struct RunOutcome {
    /// The answer as a document.
    pub answer: RunAnswer,
    /// The report of the run.
    pub report: Report,
}

/// The result of a run: `docs/formats/run-json.md`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunAnswer {
    /// The answer itself, as in the last line of a trace.
    #[serde(flatten)]
    pub report: ReportLine,
    /// The plans among which the first plan was chosen, in words; left out if it was not chosen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first_plan: Option<String>,
    /// The reason why an executor that evaluates each move has no table of moves and samples the
    /// world instead. Left out if it has a table, or needs none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub no_table: Option<String>,
    /// Violations that the validator finds in the execution: bugs of this program. Left out if there are
    /// none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub invalid: Vec<String>,
    /// Format of the document.
    pub format: RunFormat,
    /// Version of the document.
    pub version: Version,
}

/// Format of a document.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum RunFormat {
    /// The name `elbowroom-run`.
    #[default]
    #[serde(rename = "elbowroom-run")]
    Run,
}

/// Progress of a run.
#[derive(Clone, Copy, Debug)]
pub struct RunProgress<'a> {
    /// The latest entry of the record: a decision, a command, an observation, a plan, …
    pub entry: &'a Entry<'a>,
    /// The number of adopted plans.
    pub plans: usize,
}

impl<'a> RunRequest<'a> {
    /// Requests a run of the specification, without a plan and without a record.
    pub fn new(spec: &'a RunSpec, task: &'a Arc<Task>) -> Self {
        Self {
            spec,
            task,
            plan: None,
            snapshot: None,
            restarts: 0,
            planner: None,
            preparer: None,
            recorder: Box::new(NoRecord),
            listener: None,
        }
    }

    /// Starts with this plan.
    #[must_use]
    pub fn beginning_with(self, plan: impl Into<Option<TimeTriggeredPlan>>) -> Self {
        let plan = plan.into();
        Self { plan, ..self }
    }

    /// Resumes an executive's run from this state.
    #[must_use]
    pub fn resume_from(self, stand: impl Into<Option<RunSnapshot>>) -> Self {
        let stand = stand.into();
        Self {
            snapshot: stand,
            ..self
        }
    }

    /// Sets the number of times that the run was continued after its end.
    #[must_use]
    pub fn with_restarts(self, times: usize) -> Self {
        Self {
            restarts: times,
            ..self
        }
    }

    /// Replaces the planner that the specification names.
    #[must_use]
    pub fn with_planner(self, planner: impl Planner + 'a) -> Self {
        let planner: Option<Box<dyn Planner + 'a>> = Some(Box::new(planner));
        Self { planner, ..self }
    }

    /// Replaces the preparer of plans.
    #[must_use]
    pub fn with_preparer(self, preparer: impl Preparer + 'a) -> Self {
        let preparer: Option<Box<dyn Preparer + 'a>> = Some(Box::new(preparer));
        Self { preparer, ..self }
    }

    /// Reports the belief state, as [`Execution::told_to`](crate::execute::Execution::told_to).
    #[must_use]
    pub fn on_belief(self, listener: impl FnMut(&BeliefState) + Send + 'a) -> Self {
        let listener: Option<Listener<'a>> = Some(Box::new(listener));
        Self { listener, ..self }
    }

    /// Sets the recorder.
    #[must_use]
    pub fn recorded_by(self, recorder: impl Recorder + 'a) -> Self {
        let recorder = Box::new(recorder);
        Self { recorder, ..self }
    }
}

/// Executes a plan in a world of the caller. [`simulate`] executes plans in a world that the
/// specification describes.
///
/// If the watcher stops the run, the running actions are cancelled, and the answer contains the
/// results so far. Planning time is measured by the watcher's clock
/// ([`PlanningTime::Measured`](elbowroom_execution::run::PlanningTime::Measured)).
///
/// # Errors
/// When the specification contradicts itself. A run that fails is an answer, not an error.
pub fn run(
    request: RunRequest<'_>,
    world: &mut dyn World,
    watcher: &mut (dyn Observer + Send),
) -> Result<RunOutcome, SpecError> {
    let spec = request.spec;
    let mut execution = spec.execution(request.task)?;
    let no_table = execution.missing_table_reason().map(str::to_owned);
    if let Some(preparer) = request.preparer {
        execution = execution.with_preparer(preparer);
    }
    let model = spec.beliefs(request.task.problem());
    let model = model.map_err(SpecError::World)?;
    let shared = SharedObserver(Mutex::new(watcher));
    let clock = || {
        let millis = shared.get().elapsed().as_millis();
        Rational::new(i64::try_from(millis).unwrap_or(i64::MAX), 1000)
    };
    let goes_on = || shared.get().flow().is_continue();
    let planner = match request.planner {
        Some(planner) => planner,
        None => spec.planner_for(request.task, model.as_ref(), &clock, &goes_on)?,
    };
    let remark = Arc::new(Mutex::new(None));
    let (inner, validation) =
        Validated::new(request.recorder, request.task, request.snapshot.as_ref());
    let inner = inner.on_finding(|invalid| shared.get().notice(&Event::Invalid(invalid)));
    let recorder = NotifyingRecorder {
        inner: Box::new(inner),
        observer: &shared,
        plans: 0,
        remark: Arc::clone(&remark),
    };
    let mut listener = request.listener;
    let report = execution
        .on_belief(move |belief| {
            if let Some(listener) = &mut listener {
                listener(belief);
            }
        })
        .beginning_with(request.plan)
        .resume_from(request.snapshot)
        .with_restarts(request.restarts)
        .with_planner(planner)
        .recorded_by(recorder)
        .with_stop_check(|| matches!(shared.get().flow(), ControlFlow::Break(_)))
        .with_explanations()
        .run_in(world);
    let first_plan = remark.lock().unwrap_or_else(PoisonError::into_inner).take();
    Ok(RunOutcome {
        answer: RunAnswer {
            first_plan,
            no_table,
            invalid: validation
                .findings()
                .iter()
                .map(ToString::to_string)
                .collect(),
            ..RunAnswer::of(&report)
        },
        report,
    })
}

/// Executes a plan in the world that the specification describes.
///
/// # Errors
/// When there is no such world: the specification names a process or contradicts itself, or the
/// world file cannot be read.
pub fn simulate(
    request: RunRequest<'_>,
    watcher: &mut (dyn Observer + Send),
) -> Result<RunOutcome, SpecError> {
    let spec = request.spec;
    let model = spec.simulation(request.task.problem());
    let model = model.map_err(SpecError::World)?;
    let Some(model) = model else {
        return Err(SpecError::Process);
    };
    let mut world = spec.world(&model, request.task, request.plan.as_ref())?;
    run(request, world.as_mut(), watcher)
}

impl RunAnswer {
    /// Returns the document about a run.
    pub fn of(report: &Report) -> Self {
        Self {
            report: ReportLine::of(report),
            first_plan: None,
            no_table: None,
            invalid: Vec::new(),
            format: RunFormat::Run,
            version: Version,
        }
    }
}

impl RunOutcome {
    /// Returns the verdict of the run.
    pub fn verdict(&self) -> &Verdict {
        &self.report.verdict
    }
}

/// A watcher with shared access.
struct SharedObserver<'w>(Mutex<&'w mut (dyn Observer + Send)>);

impl<'w> SharedObserver<'w> {
    fn get(&self) -> MutexGuard<'_, &'w mut (dyn Observer + Send)> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Recorder that also notifies the watcher.
struct NotifyingRecorder<'a, 'w> {
    inner: Box<dyn Recorder + 'a>,
    observer: &'a SharedObserver<'w>,
    plans: usize,
    /// The planner's remark on the first plan.
    remark: Arc<Mutex<Option<String>>>,
}

impl Recorder for NotifyingRecorder<'_, '_> {
    fn record(&mut self, entry: &Entry<'_>) {
        self.inner.record(entry);
        self.plans += usize::from(matches!(entry, Entry::PlanAdopted(_)));
        if let Entry::Planned {
            remark: Some(remark),
            ..
        } = entry
        {
            let mut first = self.remark.lock().unwrap_or_else(PoisonError::into_inner);
            first.get_or_insert_with(|| (*remark).to_owned());
        }
        let plans = self.plans;
        self.observer
            .get()
            .notice(&Event::Run(RunProgress { entry, plans }));
    }

    fn commit(&mut self) {
        self.inner.commit();
    }

    fn begin_anew(&mut self, stand: &dyn Fn() -> RunSnapshot) -> bool {
        self.inner.begin_anew(stand)
    }
}
