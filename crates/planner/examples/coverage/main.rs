//! Runs the embedded planner on many problems and prints one line of comma-separated values each.
//!
//! ```text
//! coverage [--limit SECONDS] [--processor-time] [--memory MEGABYTES] [--first] [--only TEXT]…
//!          [--every K] [--plans] [--threads N]
//!          [--set NAME=VALUE]… [--without TECHNIQUE]… [--search NAME] FOLDER|DOMAIN PROBLEM…
//! ```
//!
//! FOLDER contains a `manifest.csv`, whose first line names its columns: `domain`, `instance`,
//! `domain_file` and `problem_file` are required, `collection` is optional. `--only` keeps the
//! lines that contain one of the texts, and `--every` every Kth of the instances of a domain with
//! durative actions. With a domain and problems instead, these are run. With `--plans`, plans are
//! printed to standard error. `--set` changes a constant of the search (`embedded/tuning.rs`),
//! `--without` switches a technique off, and `--search` runs one search of the portfolio alone.
//! With `--processor-time`, limits and times are processor time where the system provides it
//! (Linux), so that other load on the machine hardly affects them. It is available for one thread
//! only, so `--threads` is refused with it. `prepared_seconds` is the time until the search begins:
//! grounding, compilation and preprocessing. `read_seconds` precedes it.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "that is what the example does"
)]
#![allow(clippy::disallowed_methods, reason = "a benchmark looks at the clock")]

mod clock;
mod instances;

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clock::Clock;
use elbowroom_model::Situation;
use elbowroom_planner::{Answer, FoundPlan, Progress, Settings, TuningError, plan};
use instances::{Instance, Selection, instances, task};

struct Options {
    limit: Duration,
    selection: Selection,
    prints_plans: bool,
    counts_processor_time: bool,
    settings: Settings,
    files: Vec<PathBuf>,
}

fn main() -> ExitCode {
    let run_all = || {
        let options = options()?;
        let instances = instances(&options.files, &options.selection)?;
        println!(
            "domain,instance,outcome,first_seconds,first_makespan,best_makespan,total_seconds,\
             read_seconds,actions,states,megabytes,first_metric,best_metric,prepared_seconds"
        );
        for instance in &instances {
            run(&options, instance);
        }
        Ok::<_, String>(())
    };
    match run_all() {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::from(2)
        }
    }
}

fn options() -> Result<Options, String> {
    let mut options = Options {
        limit: Duration::from_secs(30),
        selection: Selection::default(),
        prints_plans: false,
        counts_processor_time: false,
        settings: Settings::default(),
        files: Vec::new(),
    };
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || {
            let value = arguments.next();
            value.ok_or_else(|| format!("{argument} takes a value"))
        };
        let wrong = |error: TuningError| format!("{argument}: {error}");
        let tuning = &mut options.settings.tuning;
        match argument.as_str() {
            "--limit" => {
                let seconds: Result<f64, _> = value()?.parse();
                let seconds = seconds
                    .ok()
                    .and_then(|s| Duration::try_from_secs_f64(s).ok());
                options.limit = seconds.ok_or("--limit takes seconds")?;
            }
            "--memory" => {
                let megabytes: Result<usize, _> = value()?.parse();
                let megabytes = megabytes.map_err(|_| "--memory takes megabytes")?;
                options.settings.max_memory = megabytes << 20;
            }
            "--threads" => {
                let threads: Result<usize, _> = value()?.parse();
                options.settings.threads = threads.map_err(|_| "--threads takes a number")?;
            }
            "--set" => {
                let value = value()?;
                let (name, value) = value.split_once('=').ok_or("--set takes NAME=VALUE")?;
                tuning.set(name, value).map_err(wrong)?;
            }
            "--without" => tuning.without.push(value()?.parse().map_err(wrong)?),
            "--search" => tuning.only = Some(value()?.parse().map_err(wrong)?),
            "--only" => options.selection.only.push(value()?),
            "--every" => {
                let every: Result<usize, _> = value()?.parse();
                options.selection.every = Some(every.map_err(|_| "--every takes a number")?);
            }
            "--first" => options.settings.first_plan_only = true,
            "--plans" => options.prints_plans = true,
            "--processor-time" => options.counts_processor_time = true,
            _ => options.files.push(PathBuf::from(argument)),
        }
    }
    if options.counts_processor_time && options.settings.threads > 1 {
        return Err("--processor-time is that of one thread: leave out --threads".to_owned());
    }
    Ok(options)
}

fn run(options: &Options, instance: &Instance) {
    let (domain, name) = (&instance.domain, &instance.name);
    let begin = Instant::now();
    let task = match task(instance) {
        Ok(task) => task,
        Err(outcome) => {
            println!("{domain},{name},{outcome},,,,,,,,,,,");
            return;
        }
    };
    let read = begin.elapsed().as_secs_f64();
    let situation = Situation::initial(&task);
    let begin = Clock::now(options.counts_processor_time);
    let mut first: Option<(f64, String, String)> = None;
    let metric = |found: &FoundPlan| found.metric.as_ref().map(|metric| metric.to_decimal(3));
    let mut prepared = 0.0;
    let mut observe = |progress: &Progress| {
        if progress.counts.evaluated == 0 {
            prepared = begin.elapsed().as_secs_f64();
        }
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
    let answer = plan(&task, &situation, &options.settings, &mut observe);
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
        Answer::NoneFound {
            stopped, counts, ..
        } => (
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
        "{domain},{name},{outcome},{first_seconds},{first_makespan},{best},{total:.4},\
         {read:.4},{},{},{},{first_metric},{best_metric},{prepared:.4}",
        counts.actions,
        counts.evaluated,
        counts.memory >> 20
    );
}
