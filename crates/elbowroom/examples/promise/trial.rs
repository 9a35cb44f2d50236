//! Runs of one plan, without a planner.

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom::envelope::{Guarantee, Oracle, StopReason, irr};
use elbowroom::execute::{Execution, PlanPreparer};
use elbowroom::execution::run::{PlanningTime, Report, RunSettings, TimeoutRule, Verdict};
use elbowroom::execution::{
    DispatchableCache, GuaranteeLevel, NoPlanner, NoRecord, PlanForm, PreparationResult,
    PrepareError, Preparer, Recorder, World,
};
use elbowroom::model::validate::{self, validate};
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::pipeline;
use elbowroom::plan::DecoupledEnvelope;
use elbowroom::sim::{SimWorld, WorldModel};

use super::deviations::{Course, Stray};
use super::lateness;
use super::subject::Subject;

/// Plan, prepared for every executor.
pub(crate) struct Ready<'a> {
    pub(crate) subject: &'a Subject,
    /// For `stn` and `fixed`.
    pub(crate) network: PreparationResult,
    /// With all durations as parameters, and the box.
    pub(crate) open: PreparationResult,
    /// For `esterel`, `adaptable` and `lookahead`.
    orderings: Result<PreparationResult, PrepareError>,
}

/// Outcome of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Outcome {
    /// Failure in one word, if any.
    pub(crate) failure: Option<&'static str>,
    /// Explanation of the failure.
    pub(crate) why: String,
}

/// Limits for widening boxes.
#[derive(Clone, Copy)]
pub(crate) struct Search<'a> {
    pub(crate) most_checks: usize,
    /// Returns `false` to stop.
    pub(crate) may_continue: &'a (dyn Fn() -> bool + Sync),
}

/// Box of a plan with all durations as parameters, and its search effort.
pub(crate) struct Boxed {
    pub(crate) envelope: DecoupledEnvelope,
    pub(crate) checks: usize,
    /// `true` if the search was completed.
    pub(crate) is_finished: bool,
}

impl<'a> Ready<'a> {
    /// Prepares a plan as `elbowroom run` does, with the dynamic guarantee.
    ///
    /// # Errors
    /// It cannot be prepared; the text says why.
    pub(crate) fn new(subject: &'a Subject, search: Search<'_>) -> Result<Self, String> {
        let task = &subject.task;
        let nominal = subject.freed.nominal.clone();
        let instances = subject.freed.instances.clone();
        let open = pipeline::open(task, subject.freed.clone(), &[])
            .map_err(|_| "durations cannot be left open".to_owned())?;
        let closed = pipeline::without_parameters(task, subject.freed.clone());
        let open = Arc::new(open);
        let boxed = boxed(task, &open, Guarantee::Dynamic, search)?;
        let mut analyst = PlanPreparer::new(pipeline::Settings::default());
        Ok(Self {
            subject,
            network: PreparationResult {
                time_triggered: subject.plan.clone(),
                plan: closed,
                instances: instances.clone(),
                nominal: nominal.clone(),
                envelope: None,
                forms: DispatchableCache::default(),
                order: None,
            },
            open: PreparationResult {
                time_triggered: subject.plan.clone(),
                plan: Arc::unwrap_or_clone(open),
                instances,
                nominal,
                envelope: Some(boxed.envelope),
                forms: DispatchableCache::default(),
                order: None,
            },
            orderings: analyst.prepare(task, &subject.plan, PlanForm::PartialOrder),
        })
    }

    /// Returns the same plan with another box.
    pub(crate) fn with_open(&self, open: PreparationResult) -> Self {
        Self {
            subject: self.subject,
            network: self.network.clone(),
            open,
            orderings: self.orderings.clone(),
        }
    }

    /// Returns the dynamic box.
    pub(crate) fn envelope(&self) -> &DecoupledEnvelope {
        let envelope = self.open.envelope.as_ref();
        envelope.expect("it was made with one")
    }

    /// Runs an executor in a world without deviations.
    pub(crate) fn run_as_planned(&self, executor: &str) -> Outcome {
        let model = WorldModel::without_deviations();
        let mut world = SimWorld::new(Arc::clone(&self.subject.task), &model, 0);
        self.run(executor, &mut world)
    }

    /// Runs an executor in any world.
    pub(crate) fn run(&self, executor: &str, world: &mut dyn World) -> Outcome {
        let report = self.report(executor, world);
        self.outcome(&report)
    }

    /// Runs an executor in any world with this time-out rule.
    pub(crate) fn run_timed(
        &self,
        executor: &str,
        world: &mut dyn World,
        timeout: &TimeoutRule,
    ) -> Outcome {
        let report = self.recorded(executor, world, timeout, NoRecord);
        self.outcome(&report)
    }

    /// Runs `guarded` with a late start of this action. Returns `None` if the run ended for that
    /// reason before the executor could know.
    pub(crate) fn run_late(&self, world: &mut dyn World, late: &str) -> Option<Outcome> {
        let report = self.report("guarded", world);
        let is_excused = lateness::excuses(&self.subject.task, &self.open, &report, late);
        (!is_excused).then(|| self.outcome(&report))
    }

    /// Runs an executor in a world with one unexpected deviation. A failure counts if the last
    /// promise was at least as strong as `weakest`, or if `live` abandoned a feasible plan. Also
    /// returns `true` if the plan was abandoned.
    pub(crate) fn run_strained(
        &self,
        executor: &str,
        world: &mut dyn World,
        stray: Stray,
        weakest: GuaranteeLevel,
    ) -> (Outcome, bool) {
        let mut course = Course::new(&self.open.plan, stray);
        let report = self.recorded(executor, world, &TimeoutRule::Off, &mut course);
        let outcome = self.outcome(&report);
        let is_in_vain = executor == "live" && course.is_given_up_in_vain(&self.subject.task);
        let failure = match outcome.failure {
            Some(_) if is_in_vain => Some("abandons a plan that works"),
            failure => failure.filter(|_| course.is_promised(weakest)),
        };
        let why = outcome.why;
        (Outcome { failure, why }, course.is_given_up())
    }

    pub(crate) fn report(&self, executor: &str, world: &mut dyn World) -> Report {
        self.recorded(executor, world, &TimeoutRule::Off, NoRecord)
    }

    fn recorded(
        &self,
        executor: &str,
        world: &mut dyn World,
        timeout: &TimeoutRule,
        recorder: impl Recorder,
    ) -> Report {
        let settings = RunSettings {
            timeout: timeout.clone(),
            planning_time: PlanningTime::Seconds(Rational::ZERO),
            time_limit: Rational::from(1_000_000_000_000_i64),
            ..RunSettings::default()
        };
        Execution::of(&self.subject.task)
            .beginning_with(self.subject.plan.clone())
            .by(executor.parse().expect("an executor that there is"))
            .with_settings(settings)
            .with_preparer(Remembered(self))
            .with_planner(NoPlanner)
            .recorded_by(recorder)
            .run_in(world)
    }

    fn outcome(&self, report: &Report) -> Outcome {
        let failed = |failure, why| Outcome {
            failure: Some(failure),
            why,
        };
        if let Some(reason) = report.reasons.first() {
            return failed("replans", reason.to_string());
        }
        if report.verdict != Verdict::GoalReached {
            return failed(report.verdict.name(), format!("{:?}", report.verdict));
        }
        let verdict = self.judged(report);
        if let validate::Verdict::Invalid(violation) = verdict {
            return failed("not valid", violation.to_string());
        }
        Outcome {
            failure: None,
            why: String::new(),
        }
    }

    /// Validates the execution.
    fn judged(&self, report: &Report) -> validate::Verdict {
        let steps = report.executed.iter().map(|executed| executed.step.clone());
        let plan = TimeTriggeredPlan {
            steps: steps.collect(),
        };
        validate(&self.subject.task, &plan, &validate::Settings::default())
    }
}

/// Preparer that returns the prepared forms of the plan.
struct Remembered<'a>(&'a Ready<'a>);

impl Preparer for Remembered<'_> {
    fn prepare(
        &mut self,
        _task: &Arc<Task>,
        _plan: &TimeTriggeredPlan,
        need: PlanForm,
    ) -> Result<PreparationResult, PrepareError> {
        match need {
            PlanForm::Orderings | PlanForm::PartialOrder => self.0.orderings.clone(),
            PlanForm::Network => Ok(self.0.network.clone()),
            PlanForm::OpenNetwork | PlanForm::Envelope => Ok(self.0.open.clone()),
        }
    }
}

/// Returns the box of a plan with that guarantee.
///
/// # Errors
/// There is no box; the text says why.
pub(crate) fn boxed(
    task: &Arc<Task>,
    plan: &Arc<elbowroom::plan::ParametrizedPlan>,
    guarantee: Guarantee,
    search: Search<'_>,
) -> Result<Boxed, String> {
    let beyond = |_| "beyond exact analysis".to_owned();
    let mut oracle = Oracle::new(task, plan, guarantee).map_err(beyond)?;
    let settings = elbowroom::envelope::Settings {
        most_checks: Some(search.most_checks),
        ..elbowroom::envelope::Settings::default()
    };
    let run = irr(&mut oracle, &settings, &mut |_| {
        if (search.may_continue)() {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    });
    let run = run.map_err(beyond)?;
    let envelope = run.envelope;
    Ok(Boxed {
        is_finished: run.stop == StopReason::Converged,
        envelope: envelope
            .map_err(|objection| format!("not guaranteed even as planned ({objection})"))?,
        checks: run.checks,
    })
}
