//! Statistics of no-plan certificates: how many answers that no plan exists have one, by kind, with
//! their size and the times to make and check them.
//!
//! ```text
//! certified problems FOLDER [TEXT]… each problem of a folder with a manifest.csv
//! certified changed FOLDER [TEXT]…  the same with timed initials sooner, or an initial fact less
//! certified from-here FOLDER     situations in the middle of plans for delivery and RCLL problems
//! ```
//!
//! Prints a line for each answer that no plan exists, and sums. If there are texts, only lines of
//! the manifest that contain one of them are used. The time limit of each problem is two seconds.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "that is what the example does"
)]
#![allow(
    clippy::disallowed_methods,
    reason = "an experiment looks at the clock"
)]

mod changed;
mod situations;
mod statistics;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use elbowroom::model::{Situation, Task};
use elbowroom::pddl::read_problem;
use elbowroom::planner::{Answer, Settings, plan};
use elbowroom::text::Source;
use statistics::Sums;

/// Time limit of the planner.
const LIMIT: Duration = Duration::from_secs(2);

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let outcome = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["problems", folder, ref texts @ ..] => {
            problems(Path::new(folder), texts, &mut plan_problem)
        }
        ["changed", folder, ref texts @ ..] => {
            problems(Path::new(folder), texts, &mut changed::plan_variants)
        }
        ["from-here", folder] => situations::plan_situations(Path::new(folder)),
        _ => Err(
            "`certified problems|changed FOLDER [TEXT]…` or `certified from-here FOLDER`"
                .to_owned(),
        ),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::from(2)
        }
    }
}

type Visitor<'a> = &'a mut dyn FnMut(&str, &Task, &mut Sums);

fn problems(folder: &Path, texts: &[&str], each: Visitor<'_>) -> Result<(), String> {
    let manifest = folder.join("manifest.csv");
    let text = std::fs::read_to_string(&manifest).map_err(|error| error.to_string())?;
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let column = |name: &str| {
        let place = names.iter().position(|column| column.trim() == name);
        place.ok_or_else(|| format!("{} has no column `{name}`", manifest.display()))
    };
    let files = [column("domain_file")?, column("problem_file")?];
    let mut sums = Sums::default();
    for line in lines.filter(|line| texts.is_empty() || texts.iter().any(|own| line.contains(own)))
    {
        let cells: Vec<&str> = line.split(',').collect();
        let [Some(domain), Some(problem)] = files.map(|file| cells.get(file)) else {
            continue;
        };
        if let Some(task) = task(&folder.join(domain), &folder.join(problem)) {
            each(problem, &task, &mut sums);
        }
    }
    sums.print();
    Ok(())
}

fn task(domain: &PathBuf, problem: &PathBuf) -> Option<Task> {
    let source = |path: &PathBuf| {
        let bytes = std::fs::read(path).ok()?;
        Some(Source::from_bytes(path.display().to_string(), &bytes))
    };
    let (problem, _) = read_problem(&source(domain)?, &source(problem)?).ok()?;
    Some(Task::new(problem))
}

fn plan_problem(name: &str, task: &Task, sums: &mut Sums) {
    let situation = Situation::initial(task);
    sums.count_answer(name, task, &situation, &first_plan(task, &situation, LIMIT));
}

fn first_plan(task: &Task, situation: &Situation, limit: Duration) -> Answer {
    let settings = Settings {
        first_plan_only: true,
        ..Settings::default()
    };
    let begin = Instant::now();
    plan(task, situation, &settings, &mut |_| {
        if begin.elapsed() > limit {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    })
}
