//! Another planner, supervised.

use std::fmt::Write as _;
use std::ops::ControlFlow;

use elbowroom::flow;
use elbowroom::model::Situation;
use elbowroom::planner::external::{
    Ending, Event, Outcome, Planner, Report, Request, Settings, Statistics, plan,
};
use serde_json::json;

use super::Subject;
use super::conclusion::{self, Conclusion, Found};
use super::watch::Watch;
use crate::args::PlanArgs;
use crate::exit::{Answer, Failure};

/// The planner that the command line asks for.
pub(super) fn planner(arguments: &PlanArgs) -> Result<Planner, Failure> {
    Planner::named(&arguments.planner).map_err(|error| {
        Failure::new(
            error,
            "`elbowroom plan --help` says more; --planner embedded is always there",
        )
    })
}

/// Has it plan, and prints what came of it.
pub(super) fn run(planner: &Planner, mut subject: Subject<'_>) -> Answer {
    let arguments = subject.arguments;
    let mut watch = Watch::start(arguments);
    let situation = Situation::initial(&subject.task);
    let settings = Settings {
        work_limit: None,
        epsilon: arguments.epsilon.clone(),
        time_limit: watch.limit(),
        memory_limit: arguments.memory.map(|megabytes| megabytes << 20),
        scratch: None,
    };
    let report = plan(
        planner,
        &mut Request {
            task: &mut subject.task,
            situation: &situation,
            domain: &subject.domain,
            problem: &subject.problem,
        },
        &settings,
        &mut |task, plan| flow::repaired(task, plan, &arguments.epsilon),
        &mut |event| observe(&mut watch, event),
    );
    let is_cancelled = watch.is_cancelled();
    // The line on the terminal goes before the answer comes.
    drop(watch);
    let conclusion = conclude(planner, report, is_cancelled)?;
    conclusion::print(&subject.task, arguments, &conclusion)
}

fn observe(watch: &mut Watch, event: &Event<'_>) -> ControlFlow<()> {
    match event {
        Event::Running { elapsed, memory } => {
            watch.show(*elapsed, || format!("{} MB", memory >> 20))
        }
        Event::Plan { found, elapsed } => {
            watch.plan(&found.makespan, found.metric.as_ref(), *elapsed)
        }
        Event::Refused { .. } => ControlFlow::Continue(()),
    }
}

/// The answer; failures of the planner are failures.
fn conclude(planner: &Planner, report: Report, is_cancelled: bool) -> Result<Conclusion, Failure> {
    let name = &planner.name;
    let in_words = format!("{name}: {}", report.outcome);
    let answer = match report.outcome {
        Outcome::Plan(found) => Found::Plan {
            plan: found.plan,
            makespan: found.makespan,
            metric: found.metric,
            repaired: found.repaired,
        },
        Outcome::Unsolvable { .. } => Found::NoPlan { reason: in_words },
        Outcome::NoneInTime
        | Outcome::Stopped
        | Outcome::GaveUp { .. }
        | Outcome::OutOfMemory { .. } => Found::Nothing { reason: in_words },
        Outcome::Crashed { excerpt, .. } => {
            let help = "this is a fault of that planner; try another one";
            return Err(with_excerpt(
                in_words,
                "what it printed last",
                &excerpt,
                help,
            ));
        }
        Outcome::NotUnderstood { excerpt, .. } => {
            let help = "if this is a complaint about the command line or the domain, see \
                        docs/planners.md for what this planner wants";
            return Err(with_excerpt(
                in_words,
                "what it printed last",
                &excerpt,
                help,
            ));
        }
        Outcome::Refused { plan, .. } => {
            let help = "this plan is the planner's, and is not printed as an answer; \
                        `elbowroom check` says more about it";
            return Err(with_excerpt(in_words, "its plan", &plan, help));
        }
        Outcome::Unsupported { .. } => {
            return Err(Failure::new(in_words, "try another planner"));
        }
        Outcome::NotStarted { help, .. } => return Err(Failure::new(in_words, help)),
    };
    let statistics = report.statistics;
    Ok(Conclusion {
        planner: name.clone(),
        answer,
        elapsed: statistics.elapsed,
        first_plan: statistics.first_plan,
        plans: statistics.plans,
        stop: stop(&statistics, is_cancelled),
        statistics: json!({
            "refused": statistics.refused,
            "peak_memory_bytes": statistics.peak_memory,
            "printed_bytes": statistics.printed,
        }),
    })
}

/// Why it ended, in a word.
fn stop(statistics: &Statistics, is_cancelled: bool) -> &'static str {
    match statistics.ending {
        Some(Ending::TimeLimit) => "time limit",
        Some(Ending::MemoryLimit) => "memory limit",
        Some(Ending::Stopped) if is_cancelled => "cancelled",
        Some(Ending::Stopped) => "first plan",
        Some(Ending::Exited(_) | Ending::Signalled(_)) | None => "ended",
    }
}

/// Excerpts longer than this hide what they are shown for.
const MOST_LINES: usize = 12;

fn with_excerpt(message: String, title: &str, excerpt: &str, help: &str) -> Failure {
    let lines: Vec<&str> = excerpt.lines().collect();
    let shown = &lines[lines.len().saturating_sub(MOST_LINES)..];
    let mut text = message;
    if !shown.is_empty() {
        let _ = write!(text, "\n  {title}:");
    }
    for line in shown {
        let _ = write!(text, "\n    {line}");
    }
    Failure::new(text, help)
}
