//! Planning: requests for a plan.

mod external;
mod improving;
mod no_plan_claim;
mod objective;

use std::ops::ControlFlow;
use std::time::Duration;

use elbowroom_model::{Situation, Step, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_planner::{Answer, Counts, FoundPlan, Progress, Settings, Stopped};
use elbowroom_selection::exhausted;
use elbowroom_verify::no_plan::NoPlan;
use serde::{Deserialize, Serialize};

use super::{Event, Exact, Observer, PlanProgress, RequestError, StopRequest, Version, exact};
use crate::plan_text;

pub use elbowroom_planner::no_plan::no_plan_certificate_from;
pub use external::{PlannerFailure, plan_with};
pub use improving::{BetterPlan, ImprovingPlans, ImprovingPlansRequest, NextPlan};
pub use objective::{
    BestPlanRequest, PlanAim, PlanChoice, PlanObjective, PlanValue, UnknownPlanObjective, best_plan,
};

/// Requests a plan.
#[derive(Debug)]
pub struct PlanRequest<'a> {
    /// The problem. Planning adds the facts that it uses to the table of this task.
    pub task: &'a Task,
    /// `true` if the search stops at the first plan. Otherwise it searches for better plans until
    /// the watcher stops it, or there are none.
    pub first_plan_only: bool,
    /// Memory limit of the search, in bytes (approximate).
    pub most_memory: Option<u64>,
    /// `true` if a ground action may overlap itself in plans of the embedded planner.
    pub self_overlap: bool,
    /// Number of threads of the embedded planner. The answer does not depend on it, except for the
    /// effect of a time limit.
    pub threads: usize,
}

/// The answer, and the plan.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanOutcome {
    /// The answer as a document.
    pub answer: PlanAnswer,
    /// The plan, if there is one.
    pub plan: Option<TimeTriggeredPlan>,
}

/// A plan, or the reason why there is none: `docs/reference/formats/plan-json.md`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanAnswer {
    /// Format of the document.
    pub format: PlanFormat,
    /// Version of the document.
    pub version: Version,
    /// The domain's name.
    pub domain: String,
    /// The problem's name.
    pub problem: String,
    /// The planner's name.
    pub planner: String,
    /// The answer itself.
    #[serde(flatten)]
    pub finding: PlanFinding,
    /// The choice among plans; left out if plans are compared by metric or makespan.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub choice: Option<PlanChoice>,
    /// Reason for the end of the search.
    pub stop: PlanStop,
    /// The number of plans found, each better than the one before as far as the planner knows.
    pub plans: usize,
    /// The time taken.
    pub seconds: f64,
    /// The time at which the first plan was found.
    pub first_plan_seconds: Option<f64>,
    /// Further statistics of the planner.
    pub statistics: PlanStatistics,
}

/// Format of a document.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum PlanFormat {
    /// The name `elbowroom-plan`.
    #[default]
    #[serde(rename = "elbowroom-plan")]
    Plan,
}

/// The result of a search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "answer")]
pub enum PlanFinding {
    /// A plan.
    #[serde(rename = "plan")]
    Plan {
        /// The time of the last happening.
        #[serde(with = "exact")]
        makespan: Rational,
        /// The value of the problem's metric, if it has one.
        #[serde(with = "exact::option")]
        metric: Option<Rational>,
        /// The validator's objection to the planner's own times, if they were repaired.
        repaired: Option<String>,
        /// The actions, by start time.
        steps: Vec<PlanStep>,
        /// The plan as text.
        plan: String,
    },
    /// No plan exists.
    #[serde(rename = "no plan")]
    NoPlan {
        /// The reason.
        reason: String,
        /// The proof, which [`elbowroom_verify::no_plan`] accepts.
        certificate: Box<NoPlan>,
    },
    /// No plan was found; there may be one.
    #[serde(rename = "none")]
    None {
        /// The reason.
        reason: String,
        /// The reason for the missing certificate, if the planner claims that no plan exists.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        uncertified: Option<String>,
        /// `true` if all plans without self-overlap were searched; left out otherwise.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        without_self_overlap: bool,
    },
}

/// An action of a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanStep {
    /// The start time.
    pub start: Exact,
    /// Its name: `(drive rover depot shelf)`.
    pub action: String,
    /// The duration; `None` for an instantaneous action.
    pub duration: Option<Exact>,
}

/// Reasons for the end of a search for plans.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum PlanStop {
    /// The first plan was sufficient.
    #[serde(rename = "first plan")]
    FirstPlan,
    /// The time limit was reached.
    #[serde(rename = "time limit")]
    TimeLimit,
    /// The memory limit was reached.
    #[serde(rename = "memory limit")]
    MemoryLimit,
    /// The watcher cancelled the search.
    #[serde(rename = "cancelled")]
    Cancelled,
    /// The search space is exhausted (embedded planner).
    #[serde(rename = "exhausted")]
    Exhausted,
    /// A certificate proves that there is no plan.
    #[serde(rename = "proved")]
    Proved,
    /// The planner ended by itself (other planners), or the maximum number of plans was compared.
    #[serde(rename = "ended")]
    Ended,
}

/// Statistics of a planner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum PlanStatistics {
    /// The embedded planner.
    Embedded {
        /// Number of ground actions.
        actions: u64,
        /// Number of expanded states.
        expanded: u64,
        /// Number of generated successors.
        generated: u64,
        /// Number of states that were evaluated by the heuristic.
        evaluated: u64,
        /// Approximate size of the states, in bytes.
        memory_bytes: usize,
    },
    /// Another planner.
    External {
        /// Number of plans that were rejected or could not be read.
        refused: usize,
        /// Peak memory of all its processes together, in bytes.
        peak_memory_bytes: u64,
        /// Size of its output, in bytes.
        printed_bytes: u64,
    },
}

pub use crate::execute::EMBEDDED;

/// Searches for a plan with the embedded planner.
///
/// A missing plan is reported in the answer, not as an error.
///
/// # Errors
/// When the problem has features that the embedded planner does not support.
pub fn plan(
    request: &mut PlanRequest<'_>,
    watcher: &mut dyn Observer,
) -> Result<PlanOutcome, RequestError> {
    let begun = watcher.elapsed();
    let situation = Situation::initial(request.task);
    let mut settings = Settings {
        first_plan_only: request.first_plan_only,
        self_overlap: request.self_overlap,
        threads: request.threads,
        ..Settings::default()
    };
    if let Some(bytes) = request.most_memory {
        settings.max_memory = usize::try_from(bytes).unwrap_or(usize::MAX);
    }
    let mut course = SearchMonitor {
        watcher,
        started: begun,
        plans: 0,
        first: None,
        stop_request: None,
    };
    let answer = elbowroom_planner::plan(request.task, &situation, &settings, &mut |progress| {
        course.step(progress)
    });
    let (found, stop, counts) = match answer {
        Answer::Plan {
            found,
            stopped,
            counts,
        } => (Ok(found), course.stop(stopped), counts),
        Answer::Unsolvable { proof, counts } => {
            let (finding, stop) = course.refuted_finding(request.task, &proof, counts);
            (Err(finding), stop, counts)
        }
        Answer::NoneFound {
            stopped,
            without_self_overlap,
            counts,
        } => {
            let stop = course.stop(stopped);
            let reason = no_plan_reason(stop, (counts, without_self_overlap), settings.max_memory);
            (Err(PlanFinding::none(request.task, reason)), stop, counts)
        }
        Answer::Unsupported(unsupported) => {
            return Err(RequestError::Unsupported(unsupported.to_string()));
        }
    };
    let (plan, finding) = match found {
        Ok(FoundPlan {
            plan,
            makespan,
            metric,
            ..
        }) => {
            let finding = PlanFinding::of(request.task, &plan, makespan, metric, None);
            (Some(plan), finding)
        }
        Err(finding) => (None, finding),
    };
    let answer = course.answer(request.task, (finding, None), (stop, counts));
    Ok(PlanOutcome { answer, plan })
}

/// Returns the answer of a planner that was stopped before the problem was read.
pub fn stopped_before_reading(planner: &str, halt: StopRequest, elapsed: Duration) -> PlanOutcome {
    let stop = PlanStop::from(halt);
    let ended = match halt {
        StopRequest::TimeLimit => "stopped at the time limit",
        StopRequest::MemoryLimit => "stopped at the memory limit",
        StopRequest::Cancelled => "stopped",
    };
    let reason = format!(
        "no plan found: {ended}, before domain and problem were read; this does not prove that \
         none exists"
    );
    PlanOutcome {
        answer: PlanAnswer {
            format: PlanFormat::Plan,
            version: Version,
            domain: String::new(),
            problem: String::new(),
            planner: planner.to_owned(),
            finding: PlanFinding::None {
                reason,
                uncertified: None,
                without_self_overlap: false,
            },
            choice: None,
            stop,
            plans: 0,
            seconds: elapsed.as_secs_f64(),
            first_plan_seconds: None,
            statistics: Counts::default().into(),
        },
        plan: None,
    }
}

impl SearchMonitor<'_> {
    /// Builds the answer, with the choice if the plan was chosen among several.
    fn answer(
        &mut self,
        task: &Task,
        (finding, choice): (PlanFinding, Option<PlanChoice>),
        (stop, counts): (PlanStop, Counts),
    ) -> PlanAnswer {
        let problem = task.problem();
        PlanAnswer {
            format: PlanFormat::Plan,
            version: Version,
            domain: problem.domain.clone(),
            problem: problem.name.clone(),
            planner: EMBEDDED.to_owned(),
            finding,
            choice,
            stop,
            plans: self.plans,
            seconds: self.elapsed().as_secs_f64(),
            first_plan_seconds: self.first.map(|first| first.as_secs_f64()),
            statistics: counts.into(),
        }
    }
}

impl PlanFinding {
    fn of(
        task: &Task,
        plan: &TimeTriggeredPlan,
        makespan: Rational,
        metric: Option<Rational>,
        repaired: Option<String>,
    ) -> Self {
        let steps = Step::by_start(&plan.steps)
            .into_iter()
            .map(|step| PlanStep {
                start: Exact(step.start.clone()),
                action: step.action.name.clone(),
                duration: step.duration.clone().map(Exact),
            });
        Self::Plan {
            makespan,
            metric,
            repaired,
            steps: steps.collect(),
            plan: plan_text(task, plan),
        }
    }
}

impl From<Counts> for PlanStatistics {
    fn from(counts: Counts) -> Self {
        Self::Embedded {
            actions: counts.actions,
            expanded: counts.expanded,
            generated: counts.generated,
            evaluated: counts.evaluated,
            memory_bytes: counts.memory,
        }
    }
}

impl From<StopRequest> for PlanStop {
    fn from(halt: StopRequest) -> Self {
        match halt {
            StopRequest::TimeLimit => Self::TimeLimit,
            StopRequest::MemoryLimit => Self::MemoryLimit,
            StopRequest::Cancelled => Self::Cancelled,
        }
    }
}

/// Counts the plans found, and notifies the watcher.
struct SearchMonitor<'a> {
    watcher: &'a mut dyn Observer,
    started: Duration,
    plans: usize,
    /// The time at which the first plan was found.
    first: Option<Duration>,
    /// The watcher's reason to stop.
    stop_request: Option<StopRequest>,
}

impl SearchMonitor<'_> {
    fn elapsed(&mut self) -> Duration {
        self.watcher.elapsed().saturating_sub(self.started)
    }

    fn step(&mut self, progress: &Progress) -> ControlFlow<()> {
        if progress.plan.is_some() {
            self.plans += 1;
            let elapsed = self.elapsed();
            self.first.get_or_insert(elapsed);
        }
        let found = progress.plan.as_ref();
        self.report(&PlanProgress {
            plan: found.map(|found| &found.plan),
            makespan: found.map(|found| &found.makespan),
            metric: found.and_then(|found| found.metric.as_ref()),
            value: None,
            plans: self.plans,
            states: Some(progress.counts.evaluated),
            memory: None,
        })
    }

    fn report(&mut self, progress: &PlanProgress<'_>) -> ControlFlow<()> {
        self.watcher.notice(&Event::Plan(progress.clone()));
        match self.watcher.flow() {
            ControlFlow::Continue(()) => ControlFlow::Continue(()),
            ControlFlow::Break(halt) => {
                self.stop_request = Some(halt);
                ControlFlow::Break(())
            }
        }
    }

    fn stop(&self, stopped: Stopped) -> PlanStop {
        match stopped {
            Stopped::Interrupted => self
                .stop_request
                .map_or(PlanStop::Cancelled, PlanStop::from),
            Stopped::OutOfMemory => PlanStop::MemoryLimit,
            Stopped::FirstPlan => PlanStop::FirstPlan,
            Stopped::Exhausted => PlanStop::Exhausted,
        }
    }
}

/// Returns the reason why no plan was found. `memory` is the memory limit, in bytes.
fn no_plan_reason(
    stop: PlanStop,
    (counts, without_self_overlap): (Counts, bool),
    memory: usize,
) -> String {
    let evaluated = counts.evaluated;
    let ended = match stop {
        PlanStop::Cancelled => format!("stopped after {evaluated} states"),
        PlanStop::TimeLimit => format!("stopped at the time limit, after {evaluated} states"),
        PlanStop::MemoryLimit => format!(
            "stopped at the memory limit of {} MB, after {evaluated} states",
            memory >> 20
        ),
        _ => return exhausted(counts, without_self_overlap),
    };
    format!("no plan found: {ended}; this does not prove that none exists")
}
