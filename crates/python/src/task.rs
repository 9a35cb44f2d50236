//! Problems, and requests about them that need no execution.

use std::sync::Arc;

use elbowroom::answers::check::CheckRequest;
use elbowroom::answers::envelope::{EnvelopeRequest, Search};
use elbowroom::answers::plan::{self, PlanRequest};
use elbowroom::answers::stn::StnRequest;
use elbowroom::answers::{self, Exact};
use elbowroom::envelope::{Growth, Guarantee, Method};
use elbowroom::execute::SpecError;
use elbowroom::execution::run::TimeoutRule;
use elbowroom::external::Planner;
use elbowroom::model::validate::Settings;
use elbowroom::model::{self, TimeTriggeredPlan};
use elbowroom::plan::format;
use elbowroom::plan::parametrize::VarySpec;
use elbowroom::text::Source;
use elbowroom::{AnyPlan, PlanKind, RoundingRule, dot, pddl};
use pyo3::prelude::*;
use serde::{Deserialize, Serialize};

use crate::errors::{CallError, json, number, positive, run_without_gil};
use crate::progress_observer::ProgressObserver;

/// A problem with its texts.
#[pyclass(frozen, module = "elbowroom._native")]
pub(crate) struct Task {
    pub(crate) task: Arc<model::Task>,
    pub(crate) domain: Source,
    pub(crate) problem: Source,
}

/// Reads a domain and a problem, each given by a name for messages and a text. Also returns the
/// warnings, as records.
#[pyfunction]
pub(crate) fn read(
    py: Python<'_>,
    domain: (String, String),
    problem: (String, String),
    epsilon: &str,
) -> PyResult<(Task, String)> {
    run_without_gil(py, || {
        let domain = Source::new(domain.0, domain.1);
        let problem = Source::new(problem.0, problem.1);
        let epsilon = positive(epsilon, "epsilon")?;
        let (read, warnings) = pddl::read_problem(&domain, &problem)?;
        let warnings: Vec<_> = warnings.iter().map(pddl::Diagnostic::record).collect();
        let task = Arc::new(model::Task::new(read).with_epsilon(epsilon));
        let task = Task {
            task,
            domain,
            problem,
        };
        Ok((task, json(&warnings)))
    })
}

/// The options of a check, as JSON.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct CheckOptions {
    tolerance: Option<String>,
    rules: Rules,
}

/// Semantics used by the validator.
#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Rules {
    /// PDDL 2.1, with ε.
    #[default]
    Pddl,
    /// The same, but the goal must hold after the plan's last action, regardless of later timed
    /// initials.
    PddlGoalAfterActions,
    /// The semantics of unified-planning for problems without an ε.
    UnifiedPlanning,
    /// The semantics of unified-planning for problems with an ε.
    UnifiedPlanningWithEpsilon,
}

/// The options of an envelope, as JSON.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
struct EnvelopeOptions {
    vary: Vec<String>,
    guarantee: Guarantee,
    method: Option<Method>,
    precision: Option<String>,
    growth: Growth,
    sharpen: bool,
    enforce: bool,
    contains: Option<String>,
    timeout: Option<String>,
    most_checks: Option<usize>,
}

impl Default for EnvelopeOptions {
    fn default() -> Self {
        let search = Search::default();
        Self {
            vary: Vec::new(),
            guarantee: Guarantee::default(),
            method: search.method,
            precision: None,
            growth: search.growth,
            sharpen: search.sharpen,
            enforce: false,
            contains: None,
            timeout: None,
            most_checks: search.most_checks,
        }
    }
}

/// Makespans of a plan, which the document does not contain.
#[derive(Serialize)]
struct Makespans {
    nominal: Exact,
    at_lower: Option<Exact>,
    at_upper: Option<Exact>,
}

#[pymethods]
impl Task {
    /// The names of the domain and the problem.
    fn names(&self) -> (String, String) {
        let problem = self.task.problem();
        (problem.domain.clone(), problem.name.clone())
    }

    /// The texts of the domain and the problem, each with its name.
    fn texts(&self) -> [(String, String); 2] {
        [&self.domain, &self.problem]
            .map(|source| (source.name().to_owned(), source.text().to_owned()))
    }

    /// Validates a plan and returns a document.
    fn check(&self, py: Python<'_>, plan: (String, String), options: &str) -> PyResult<String> {
        run_without_gil(py, || {
            let options: CheckOptions = read_options(options)?;
            let settings = match options.rules {
                Rules::Pddl => Settings::default(),
                Rules::PddlGoalAfterActions => Settings {
                    counts_later_timed: false,
                    ..Settings::default()
                },
                Rules::UnifiedPlanning => Settings::like_unified_planning(),
                Rules::UnifiedPlanningWithEpsilon => Settings {
                    refuses_equal_writes: true,
                    ..Settings::default()
                },
            };
            let tolerance = options.tolerance.as_deref();
            let rule = RoundingRule {
                tolerance: tolerance
                    .map(|tolerance| number(tolerance, "tolerance"))
                    .transpose()?,
                settings: settings.clone(),
            };
            let name = plan.0.clone();
            let plan = self.time_triggered_by(plan, &rule)?;
            let request = CheckRequest {
                task: &self.task,
                plan: Some(&plan),
                name,
                settings,
            };
            Ok(json(&answers::check::check(&request)?))
        })
    }

    /// The steps of a plan (start, action, duration), and `True` if it is a plan with fixed times.
    fn steps(
        &self,
        py: Python<'_>,
        plan: (String, String),
    ) -> PyResult<Option<Vec<(String, String, Option<String>)>>> {
        run_without_gil(py, || {
            let AnyPlan::TimeTriggered(plan) = self.any_plan(plan)? else {
                return Ok(None);
            };
            let steps = plan.steps.iter().map(|step| {
                let duration = step.duration.as_ref().map(ToString::to_string);
                (step.start.to_string(), step.action.name.clone(), duration)
            });
            Ok(Some(steps.collect()))
        })
    }

    /// Searches for a plan. Returns a document, and `True` if Ctrl-C ended the search.
    #[pyo3(signature = (planner, time_limit, first, memory, jobs, self_overlap, progress))]
    #[expect(
        clippy::too_many_arguments,
        reason = "each is a keyword argument in Python"
    )]
    fn plan(
        &self,
        py: Python<'_>,
        planner: &str,
        time_limit: Option<f64>,
        first: bool,
        memory: Option<u64>,
        jobs: Option<usize>,
        self_overlap: bool,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(String, bool)> {
        run_without_gil(py, || {
            let is_embedded = planner.eq_ignore_ascii_case(plan::EMBEDDED);
            let threads = threads(jobs, EVERY_PROCESSOR, is_embedded)?;
            if self_overlap && !is_embedded {
                return Err(SpecError::SelfOverlap(planner.to_owned()).into());
            }
            let mut watch = ProgressObserver::start(time_limit, progress);
            let limit = time_limit.map(std::time::Duration::try_from_secs_f64);
            let limit = limit.transpose().map_err(CallError::request)?;
            let mut request = PlanRequest {
                task: &self.task,
                first_plan_only: first,
                most_memory: memory,
                self_overlap,
                threads,
            };
            let outcome = if is_embedded {
                plan::plan(&mut request, &mut watch)?
            } else {
                let planner = Planner::named(planner)
                    .map_err(|error| CallError::Planner(error.to_string()))?;
                let sources = [&self.domain, &self.problem];
                plan::plan_with(&planner, &mut request, sources, limit, &mut watch)?
            };
            Ok((json(&outcome.answer), watch.ended()?))
        })
    }

    /// Converts a plan to a network: a document, its STN plan file, and its drawing for Graphviz.
    fn stn(
        &self,
        py: Python<'_>,
        plan: (String, String),
    ) -> PyResult<(String, Option<String>, Option<String>)> {
        run_without_gil(py, || {
            let request = StnRequest {
                task: &self.task,
                plan: self.any_plan(plan)?,
            };
            let outcome = answers::stn::stn(&request)?;
            let text = match &outcome.plan {
                Some(plan) => Some(format::write(&self.task, plan).map_err(CallError::request)?),
                None => None,
            };
            let plan = outcome.plan.as_ref();
            let dot = plan.map(|plan| dot::to_dot(&self.task, plan));
            Ok((json(&outcome.answer), text, dot))
        })
    }

    /// Computes an envelope: a document, the makespans, and `True` if Ctrl-C ended the computation.
    fn envelope(
        &self,
        py: Python<'_>,
        plan: (String, String),
        options: &str,
        time_limit: Option<f64>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(String, Option<String>, bool)> {
        run_without_gil(py, || {
            let options: EnvelopeOptions = read_options(options)?;
            let mut watch = ProgressObserver::start(time_limit, progress);
            let name = plan.0.clone();
            let search = Search::default();
            let request = EnvelopeRequest {
                name,
                vary: specifications(&options.vary)?,
                guarantee: options.guarantee,
                enforce: options.enforce,
                contains: options.contains,
                timeout: match &options.timeout {
                    Some(rule) => rule.parse().map_err(CallError::request)?,
                    None => TimeoutRule::default(),
                },
                search: Search {
                    method: options.method,
                    precision: match &options.precision {
                        Some(precision) => positive(precision, "precision")?,
                        None => search.precision.clone(),
                    },
                    relative: match options.precision {
                        Some(_) => None,
                        None => search.relative.clone(),
                    },
                    growth: options.growth,
                    sharpen: options.sharpen,
                    most_checks: options.most_checks,
                    best: search.best.clone(),
                },
                ..EnvelopeRequest::new(&self.task, self.any_plan(plan)?)
            };
            let outcome = answers::envelope::envelope(&request, &mut watch)?;
            let makespans = match &outcome.answer.finding {
                answers::envelope::EnvelopeFinding::Envelope { makespans, .. } => {
                    makespans.as_ref().map(|makespans| {
                        json(&Makespans {
                            nominal: Exact(makespans.nominal.clone()),
                            at_lower: makespans.at_lower.clone().map(Exact),
                            at_upper: makespans.at_upper.clone().map(Exact),
                        })
                    })
                }
                _ => None,
            };
            Ok((json(&outcome.answer), makespans, watch.ended()?))
        })
    }
}

impl Task {
    /// Reads a plan of either kind, with the default rule about rounded numbers. The content, or
    /// the extension `.stn`, determines the kind.
    fn any_plan(&self, plan: (String, String)) -> Result<AnyPlan, CallError> {
        self.any_plan_by(plan, &RoundingRule::default())
    }

    fn any_plan_by(
        &self,
        (name, text): (String, String),
        rule: &RoundingRule,
    ) -> Result<AnyPlan, CallError> {
        let is_stn_name = name.to_ascii_lowercase().ends_with(".stn");
        let source = Source::new(name, text);
        if is_stn_name || PlanKind::of_text(source.text()) == PlanKind::Stn {
            return Ok(format::read(&source, &self.task)?.into());
        }
        // An empty list of steps is a plan, although a text without actions is not.
        if source.text().is_empty() {
            return Ok(TimeTriggeredPlan::default().into());
        }
        let (plan, _warnings) = rule.read_plan(&source, &self.task)?;
        Ok(plan.into())
    }

    /// Reads a plan with fixed times.
    pub(crate) fn time_triggered(
        &self,
        plan: (String, String),
    ) -> Result<TimeTriggeredPlan, CallError> {
        self.time_triggered_by(plan, &RoundingRule::default())
    }

    fn time_triggered_by(
        &self,
        plan: (String, String),
        rule: &RoundingRule,
    ) -> Result<TimeTriggeredPlan, CallError> {
        let name = plan.0.clone();
        match self.any_plan_by(plan, rule)? {
            AnyPlan::TimeTriggered(plan) => Ok(plan),
            AnyPlan::Stn(_) => Err(CallError::Request(format!(
                "{name} is an STN plan without fixed times; give a plan with fixed times, or \
                 compute the envelope of this one"
            ))),
        }
    }
}

/// Parses the specifications of the quantities that may vary.
fn specifications(texts: &[String]) -> Result<Vec<VarySpec>, CallError> {
    let specs = texts.iter().map(|text| text.parse::<VarySpec>());
    specs.collect::<Result<_, _>>().map_err(CallError::request)
}

/// Value of `jobs` that requests one thread per processor.
pub(crate) const EVERY_PROCESSOR: usize = 0;

/// Returns the number of threads of the embedded planner for one plan: `jobs`, or else `usual`.
pub(crate) fn threads(
    jobs: Option<usize>,
    usual: usize,
    is_embedded: bool,
) -> Result<usize, CallError> {
    if jobs.is_some() && !is_embedded {
        return Err(CallError::request(
            "`jobs` is the number of threads of the embedded planner; other planners have their \
             own settings",
        ));
    }
    Ok(match jobs.unwrap_or(usual) {
        EVERY_PROCESSOR => std::thread::available_parallelism().map_or(1, usize::from),
        jobs => jobs,
    })
}

/// Reads options from JSON.
pub(crate) fn read_options<'a, T: Deserialize<'a>>(text: &'a str) -> Result<T, CallError> {
    serde_json::from_str(text).map_err(|error| {
        // The position is useless, because the user did not write the JSON text.
        let message = error.to_string();
        let end = message.rfind(" at line ").unwrap_or(message.len());
        CallError::Request(message[..end].to_owned())
    })
}
