//! Planning with other planners.

use std::ops::ControlFlow;
use std::time::Duration;

use elbowroom_external::{
    Ending, Event, Outcome, Planner, Report, Request, Settings, Statistics, plan,
};
use elbowroom_model::Situation;
use elbowroom_pddl::Source;

use super::{
    PlanAnswer, PlanFinding, PlanFormat, PlanOutcome, PlanRequest, PlanStatistics, PlanStop,
    SearchMonitor, StopRequest, Version,
};
use crate::answers::{Observer, PlanProgress};
use crate::pipeline;

/// A planner that failed: it returned neither a plan nor an answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{planner}: {outcome}")]
pub struct PlannerFailure {
    /// The planner.
    pub planner: String,
    /// Its outcome.
    pub outcome: Outcome,
}

/// Searches for a plan with another planner. The planner reads domain and problem itself, and gets
/// its own time limit, so that it can end regularly.
///
/// # Errors
/// When the planner fails.
pub fn plan_with(
    planner: &Planner,
    request: &mut PlanRequest<'_>,
    [domain, problem]: [&Source; 2],
    time_limit: Option<Duration>,
    watcher: &mut dyn Observer,
) -> Result<PlanOutcome, PlannerFailure> {
    let situation = Situation::initial(request.task);
    let settings = Settings {
        work_limit: None,
        time_limit,
        memory_limit: request.most_memory,
        scratch: None,
    };
    let first_plan_only = request.first_plan_only;
    let mut course = SearchMonitor {
        started: watcher.elapsed(),
        watcher,
        plans: 0,
        first: None,
        stop_request: None,
    };
    let report = plan(
        planner,
        &mut Request {
            task: request.task,
            situation: &situation,
            domain,
            problem,
        },
        &settings,
        &mut pipeline::reschedule,
        &mut |event| course.on_event_of_planner(event, first_plan_only),
    );
    let halt = course.stop_request;
    let claim = match &report.outcome {
        Outcome::Unsolvable { .. } => {
            let says = format!("{}: {}", planner.name, report.outcome);
            // The planner's time limit does not apply to the certificate.
            Some(course.claimed_finding(
                request.task,
                says.clone(),
                &format!("no plan found: {says}"),
            ))
        }
        _ => None,
    };
    build_answer(planner, request, report, (halt, claim))
}

impl SearchMonitor<'_> {
    fn on_event_of_planner(&mut self, event: &Event<'_>, first_plan_only: bool) -> ControlFlow<()> {
        match event {
            Event::Running { memory, .. } => self.report(&PlanProgress {
                plan: None,
                makespan: None,
                metric: None,
                value: None,
                plans: self.plans,
                states: None,
                memory: Some(*memory),
            }),
            Event::Plan { found, .. } => {
                self.plans += 1;
                let flow = self.report(&PlanProgress {
                    plan: Some(&found.plan),
                    makespan: Some(&found.makespan),
                    metric: found.metric.as_ref(),
                    value: None,
                    plans: self.plans,
                    states: None,
                    memory: None,
                });
                if first_plan_only {
                    return ControlFlow::Break(());
                }
                flow
            }
            Event::Refused { .. } => ControlFlow::Continue(()),
        }
    }
}

/// Builds the answer, or an error if the planner failed.
fn build_answer(
    planner: &Planner,
    request: &PlanRequest<'_>,
    report: Report,
    (halt, claim): (Option<StopRequest>, Option<(PlanFinding, PlanStop)>),
) -> Result<PlanOutcome, PlannerFailure> {
    let name = &planner.name;
    let reason = format!("{name}: {}", report.outcome);
    let (plan, finding) = match report.outcome {
        Outcome::Plan(found) => {
            let finding = PlanFinding::of(
                request.task,
                &found.plan,
                found.makespan,
                found.metric,
                found.repaired,
            );
            (Some(found.plan), finding)
        }
        Outcome::Unsolvable { .. }
        | Outcome::NoneInTime
        | Outcome::Stopped
        | Outcome::GaveUp { .. }
        | Outcome::OutOfMemory { .. } => {
            let finding = claim.as_ref().map(|(finding, _)| finding.clone());
            let none = || PlanFinding::none(request.task, reason);
            (None, finding.unwrap_or_else(none))
        }
        outcome => {
            return Err(PlannerFailure {
                planner: name.clone(),
                outcome,
            });
        }
    };
    let statistics = report.statistics;
    let stop = match claim {
        Some((_, PlanStop::Proved)) => PlanStop::Proved,
        _ => stop(&statistics, halt),
    };
    let problem = request.task.problem();
    let answer = PlanAnswer {
        format: PlanFormat::Plan,
        version: Version,
        domain: problem.domain.clone(),
        problem: problem.name.clone(),
        planner: name.clone(),
        finding,
        choice: None,
        stop,
        plans: statistics.plans,
        seconds: statistics.elapsed.as_secs_f64(),
        first_plan_seconds: statistics.first_plan.map(|first| first.as_secs_f64()),
        statistics: PlanStatistics::External {
            refused: statistics.refused,
            peak_memory_bytes: statistics.peak_memory,
            printed_bytes: statistics.printed,
        },
    };
    Ok(PlanOutcome { answer, plan })
}

/// Returns the reason for the end of the planner.
fn stop(statistics: &Statistics, halt: Option<StopRequest>) -> PlanStop {
    match statistics.ending {
        Some(Ending::TimeLimit) => PlanStop::TimeLimit,
        Some(Ending::MemoryLimit) => PlanStop::MemoryLimit,
        Some(Ending::Stopped) => halt.map_or(PlanStop::FirstPlan, PlanStop::from),
        Some(Ending::Exited(_) | Ending::Signalled(_)) | None => PlanStop::Ended,
    }
}
