//! The planner that is part of this program.

use std::ops::ControlFlow;

use elbowroom::model::Situation;
use elbowroom::planner::{Answer as Planned, Counts, Progress, Settings, Stopped, plan};
use serde_json::{Value, json};

use super::Subject;
use super::conclusion::{self, Conclusion, Found};
use super::watch::Watch;
use crate::args::EMBEDDED;
use crate::clock::Clock;
use crate::exit::{Answer, Failure};
use crate::output::counted;

/// Plans, and prints what came of it.
pub(super) fn run(mut subject: Subject<'_>) -> Answer {
    let arguments = subject.arguments;
    let mut watch = Watch::start(arguments);
    let clock = Clock::start();
    let situation = Situation::initial(&subject.task);
    let mut settings = Settings {
        epsilon: arguments.epsilon.clone(),
        first_plan_only: watch.stops_at_first(),
        ..Settings::default()
    };
    if let Some(megabytes) = arguments.memory {
        settings.max_memory = usize::try_from(megabytes << 20).unwrap_or(usize::MAX);
    }
    let mut observe = |progress: &Progress| {
        let elapsed = clock.elapsed();
        if let Some(found) = &progress.plan {
            // The planner itself ends at the first plan if it is to.
            let _ = watch.plan(&found.makespan, found.metric.as_ref(), elapsed);
        }
        let states = progress.counts.evaluated;
        let what = || counted(usize::try_from(states).unwrap_or(usize::MAX), "state");
        if watch.is_late(elapsed) {
            return ControlFlow::Break(());
        }
        watch.show(elapsed, what)
    };
    let answer = plan(&mut subject.task, &situation, &settings, &mut observe);
    let (answer, stop, counts) = match answer {
        Planned::Plan {
            found,
            stopped,
            counts,
        } => {
            let answer = Found::Plan {
                plan: found.plan,
                makespan: found.makespan,
                metric: found.metric,
                repaired: None,
            };
            (answer, stop(stopped, &watch), counts)
        }
        Planned::Unsolvable { proof, counts } => {
            let reason = proof.to_string();
            (Found::NoPlan { reason }, "proved", counts)
        }
        Planned::NoneFound { stopped, counts } => {
            let stop = stop(stopped, &watch);
            let reason = none_found(stop, counts);
            (Found::Nothing { reason }, stop, counts)
        }
        Planned::Unsupported(unsupported) => {
            return Err(Failure::new(
                unsupported,
                "docs/planners.md says what the embedded planner supports; --planner names \
                 another one",
            ));
        }
    };
    let conclusion = Conclusion {
        planner: EMBEDDED.to_owned(),
        answer,
        elapsed: clock.elapsed(),
        first_plan: watch.first(),
        plans: watch.plans(),
        stop,
        statistics: statistics(counts),
    };
    // The line on the terminal goes before the answer comes.
    drop(watch);
    conclusion::print(&subject.task, arguments, &conclusion)
}

/// Why it ended, in a word.
fn stop(stopped: Stopped, watch: &Watch) -> &'static str {
    match stopped {
        Stopped::Interrupted if watch.is_cancelled() => "cancelled",
        Stopped::Interrupted => "time limit",
        Stopped::OutOfMemory => "memory limit",
        Stopped::FirstPlan => "first plan",
        Stopped::Exhausted => "exhausted",
    }
}

fn none_found(stop: &str, counts: Counts) -> String {
    let why = match stop {
        "cancelled" => "before it was stopped",
        "time limit" => "within the time limit",
        "memory limit" => "within the memory limit",
        _ => "within what the search can reach",
    };
    format!(
        "no plan was found {why}, and none is known not to exist ({} states)",
        counts.evaluated
    )
}

fn statistics(counts: Counts) -> Value {
    json!({
        "actions": counts.actions,
        "expanded": counts.expanded,
        "generated": counts.generated,
        "evaluated": counts.evaluated,
        "memory_bytes": counts.memory,
    })
}
