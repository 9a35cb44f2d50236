//! Runs the embedded planner on many problems and prints one line of comma-separated values each.
//!
//! ```text
//! coverage [--limit SECONDS] [--memory MEGABYTES] [--first] [--only TEXT] [--plans] FOLDER|DOMAIN PROBLEM…
//! ```
//!
//! FOLDER holds a `manifest.csv` with the columns collection, domain, instance, `domain_file`,
//! `problem_file`; `--only` keeps the lines that contain the text. With a domain and problems
//! instead, these are run. With `--plans`, plans are printed to standard error.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "that is what the example does"
)]
#![allow(clippy::disallowed_methods, reason = "a benchmark looks at the clock")]

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use elbowroom_model::{Situation, Task};
use elbowroom_pddl::{Source, read_problem};
use elbowroom_planner::{Answer, Found, Progress, Settings, plan};

struct Options {
    limit: Duration,
    only: Option<String>,
    prints_plans: bool,
    settings: Settings,
    files: Vec<PathBuf>,
}

fn main() {
    let options = options();
    println!(
        "domain,instance,outcome,first_seconds,first_makespan,best_makespan,total_seconds,\
         read_seconds,actions,states,megabytes,first_metric,best_metric"
    );
    match &options.files[..] {
        [folder] => {
            let manifest = std::fs::read_to_string(folder.join("manifest.csv"));
            let manifest = manifest.unwrap_or_else(|error| panic!("manifest.csv: {error}"));
            for line in manifest.lines().skip(1) {
                if options
                    .only
                    .as_ref()
                    .is_some_and(|text| !line.contains(text))
                {
                    continue;
                }
                let columns: Vec<&str> = line.split(',').collect();
                if let [collection, domain, instance, domain_file, problem_file, ..] = columns[..] {
                    let name = format!("{collection}/{domain}");
                    let files = (&*folder.join(domain_file), &*folder.join(problem_file));
                    run(&options, &name, instance, files);
                }
            }
        }
        [domain, problems @ ..] => {
            for problem in problems {
                let name = domain.file_stem().unwrap_or_default().to_string_lossy();
                let instance = problem.file_stem().unwrap_or_default().to_string_lossy();
                run(&options, &name, &instance, (domain, problem));
            }
        }
        [] => eprintln!("give a folder with a manifest.csv, or a domain and problems"),
    }
}

fn options() -> Options {
    let mut options = Options {
        limit: Duration::from_secs(30),
        only: None,
        prints_plans: false,
        settings: Settings::default(),
        files: Vec::new(),
    };
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().unwrap_or_default();
        match argument.as_str() {
            "--limit" => {
                let seconds = value().parse().expect("--limit takes seconds");
                options.limit = Duration::from_secs_f64(seconds);
            }
            "--memory" => {
                let megabytes: usize = value().parse().expect("--memory takes megabytes");
                options.settings.max_memory = megabytes << 20;
            }
            "--only" => options.only = Some(value()),
            "--first" => options.settings.first_plan_only = true,
            "--plans" => options.prints_plans = true,
            _ => options.files.push(PathBuf::from(argument)),
        }
    }
    options
}

fn run(options: &Options, domain: &str, instance: &str, (first, second): (&Path, &Path)) {
    let begin = Instant::now();
    let source = |path: &Path| {
        let bytes = std::fs::read(path).unwrap_or_default();
        Source::from_bytes(path.display().to_string(), &bytes)
    };
    let problem = match read_problem(&source(first), &source(second)) {
        Ok((problem, _)) => problem,
        Err(diagnostics) => {
            let outcome = if diagnostics.is_unsupported() {
                "not-read-unsupported"
            } else {
                "not-read"
            };
            println!("{domain},{instance},{outcome},,,,,,,,,,");
            return;
        }
    };
    let mut task = Task::new(problem);
    let read = begin.elapsed().as_secs_f64();
    let situation = Situation::initial(&task);
    let begin = Instant::now();
    let mut first: Option<(f64, String, String)> = None;
    let metric = |found: &Found| found.metric.as_ref().map(|metric| metric.to_decimal(3));
    let mut observe = |progress: &Progress| {
        if let (Some(found), None) = (&progress.plan, &first) {
            let worth = (
                found.makespan.to_decimal(3),
                metric(found).unwrap_or_default(),
            );
            first = Some((begin.elapsed().as_secs_f64(), worth.0, worth.1));
        }
        if begin.elapsed() >= options.limit {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    let answer = plan(&mut task, &situation, &options.settings, &mut observe);
    let total = begin.elapsed().as_secs_f64();
    let (outcome, best, counts) = match &answer {
        Answer::Plan {
            found,
            stopped,
            counts,
        } => {
            if options.prints_plans {
                for step in &found.plan.steps {
                    let duration = step.duration.as_ref().map(|d| d.to_decimal(3));
                    let start = step.start.to_decimal(3);
                    eprintln!(
                        "{start}: {} [{}]",
                        step.action.name,
                        duration.unwrap_or_default()
                    );
                }
            }
            (
                format!("plan-{stopped:?}").to_lowercase(),
                found.makespan.to_decimal(3),
                *counts,
            )
        }
        Answer::Unsolvable { proof, counts } => {
            if options.prints_plans {
                eprintln!("{proof}");
            }
            ("unsolvable".to_owned(), String::new(), *counts)
        }
        Answer::NoneFound { stopped, counts } => (
            format!("none-{stopped:?}").to_lowercase(),
            String::new(),
            *counts,
        ),
        Answer::Unsupported(unsupported) => {
            if options.prints_plans {
                eprintln!("{unsupported}");
            }
            let counts = elbowroom_planner::Counts::default();
            ("unsupported".to_owned(), String::new(), counts)
        }
    };
    let (first_seconds, first_makespan, first_metric) = first
        .map_or_else(Default::default, |(time, makespan, metric)| {
            (format!("{time:.4}"), makespan, metric)
        });
    let best_metric = answer.found().and_then(metric).unwrap_or_default();
    println!(
        "{domain},{instance},{outcome},{first_seconds},{first_makespan},{best},{total:.4},\
         {read:.4},{},{},{},{first_metric},{best_metric}",
        counts.actions,
        counts.evaluated,
        counts.memory >> 20
    );
}
