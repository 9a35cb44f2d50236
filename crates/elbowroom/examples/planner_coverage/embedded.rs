//! The embedded planner as a process that prints its plans like any other planner.

use std::io::Write;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, Instant};

use elbowroom::model::{Situation, Task};
use elbowroom::pddl::{Source, read_problem, write_plan};
use elbowroom::planner::{Answer, Progress, Settings, plan};

/// Runs `embedded DOMAIN PROBLEM SECONDS MB`.
#[allow(clippy::disallowed_methods, reason = "a process keeps its own time")]
pub(crate) fn main(arguments: &[String]) -> Result<(), String> {
    let begin = Instant::now();
    let [domain, problem, seconds, megabytes] = arguments else {
        return Err("embedded DOMAIN PROBLEM SECONDS MB".to_owned());
    };
    let limit: u64 = seconds
        .parse()
        .map_err(|_| "expected a number of seconds")?;
    let limit = Duration::from_secs(limit);
    let megabytes: usize = megabytes.parse().map_err(|_| "expected a number of MB")?;
    let source = |path: &String| {
        let bytes = std::fs::read(Path::new(path)).map_err(|error| format!("{path}: {error}"))?;
        Ok::<_, String>(Source::from_bytes(path.as_str(), &bytes))
    };
    let (problem, _) = read_problem(&source(domain)?, &source(problem)?)
        .map_err(|diagnostics| diagnostics.to_string())?;
    let task = Task::new(problem);
    // A plan is written with the names of the task.
    let names = task.clone();
    let situation = Situation::initial(&task);
    let settings = Settings {
        // The rest is for other data of the process.
        max_memory: (megabytes << 20) / 10 * 8,
        ..Settings::default()
    };
    let mut observe = |progress: &Progress| {
        if let Some(found) = &progress.plan {
            println!("; Plan found\n{}", write_plan(&names, &found.plan));
            // Stops if the reader has closed the pipe.
            if std::io::stdout().flush().is_err() {
                return ControlFlow::Break(());
            }
        }
        if begin.elapsed() >= limit {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    match plan(&task, &situation, &settings, &mut observe) {
        Answer::Plan { .. } => {}
        Answer::Unsolvable { proof, .. } => println!("{proof}"),
        Answer::NoneFound { stopped, .. } => println!("no plan found: {stopped:?}"),
        Answer::Unsupported(unsupported) => println!("unsupported: {unsupported}"),
    }
    Ok(())
}
