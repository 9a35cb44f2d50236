//! Execution of plans.

use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use elbowroom_execution::run::{Report, RunSnapshot, Verdict};
use elbowroom_execution::{Entry, Recorder, World};
use elbowroom_num::Rational;
use elbowroom_report::trace::schema::ReportLine;
use serde::{Deserialize, Serialize};

use super::{Event, Observer, Version};
use crate::execute::{Execution, RunInputs, SpecError, Validated};

/// The answer, and the report behind it.
#[derive(Clone, Debug)]
pub struct RunOutcome {
    /// The answer as a document.
    pub answer: RunAnswer,
    /// The report of the run.
    pub report: Report,
}

/// The result of a run: `docs/reference/formats/run-json.md`.
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

/// Executes a run in a world of the caller: `execution` is that of the inputs ([`RunInputs::execution`]), with the
/// caller's plan, recorder and other parts. [`simulate`] executes it in the world that the specification describes.
///
/// If the watcher stops the run, the running actions are cancelled, and the answer contains the
/// results so far. Without a planner, that of the specification is used; its planning time is measured by the watcher's
/// clock ([`PlanningTime::Measured`](elbowroom_execution::run::PlanningTime::Measured)).
///
/// # Errors
/// When the planner cannot be used. A run that fails is an answer, not an error.
pub fn run<'a>(
    inputs: &'a RunInputs,
    execution: Execution<'a>,
    world: &mut dyn World,
    watcher: &mut (dyn Observer + Send),
) -> Result<RunOutcome, SpecError> {
    let no_table = execution.missing_table_reason().map(str::to_owned);
    let shared = SharedObserver(Mutex::new(watcher));
    let clock = || {
        let millis = shared.get().elapsed().as_millis();
        Rational::new(i64::try_from(millis).unwrap_or(i64::MAX), 1000)
    };
    let may_continue = || shared.get().flow().is_continue();
    let remark = Arc::new(Mutex::new(None));
    let mut findings = None;
    let snapshot = execution.snapshot().cloned();
    let mut execution: Execution<'_> = execution.map_recorder(|recorder| {
        let (inner, validation) = Validated::new(recorder, inputs.task(), snapshot.as_ref());
        findings = Some(validation);
        Box::new(NotifyingRecorder {
            inner: Box::new(
                inner.on_finding(|invalid| shared.get().notice(&Event::Invalid(invalid))),
            ),
            observer: &shared,
            plans: 0,
            remark: Arc::clone(&remark),
        })
    });
    if !execution.has_planner() {
        execution = execution.with_planner(inputs.planner(&clock, &may_continue)?);
    }
    if !execution.has_preparer() {
        execution = execution.with_preparer(inputs.preparer().stopped_unless(may_continue));
    }
    let report = execution
        .with_stop_check(|| matches!(shared.get().flow(), ControlFlow::Break(_)))
        .with_explanations()
        .run_in(world);
    let first_plan = remark.lock().unwrap_or_else(PoisonError::into_inner).take();
    let invalid = findings.map(|it| it.findings()).unwrap_or_default();
    Ok(RunOutcome {
        answer: RunAnswer {
            first_plan,
            no_table,
            invalid: invalid.iter().map(ToString::to_string).collect(),
            ..RunAnswer::of(&report)
        },
        report,
    })
}

/// Executes a run in the world that the specification describes.
///
/// # Errors
/// When the world is a process, or an adversary that cannot be created.
pub fn simulate<'a>(
    inputs: &'a RunInputs,
    execution: Execution<'a>,
    watcher: &mut (dyn Observer + Send),
) -> Result<RunOutcome, SpecError> {
    let mut world = inputs.world(execution.first_plan())?;
    run(inputs, execution, world.as_mut(), watcher)
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
