//! Runs of planners on instances, and the file of their results.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, OpenOptions};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use elbowroom::external::{Event, Outcome, Planner, Report, Request, Settings, plan};
use elbowroom::model::expression::Expression;
use elbowroom::model::{Situation, Task};
use elbowroom::num::Rational;
use elbowroom::pddl::{Source, read_problem};
use elbowroom::pipeline;

use crate::manifest;
use crate::row::{self, Row};
use crate::val;

struct Options {
    data: PathBuf,
    planners: Vec<String>,
    output: PathBuf,
    /// Limit of processor time.
    seconds: u64,
    megabytes: u64,
    jobs: usize,
    only: Option<String>,
    every: usize,
    /// `true` to stop a planner at its first plan.
    first: bool,
    /// VAL's `Validate`, to validate the last plan.
    val: Option<PathBuf>,
}

/// One planner on one instance.
struct Job {
    row: Row,
    domain: PathBuf,
    problem: PathBuf,
}

pub(crate) fn main(arguments: &[String]) -> Result<(), String> {
    let options = options(arguments)?;
    let done = done(&options.output)?;
    let jobs: Vec<Job> = jobs(&options)?
        .into_iter()
        .filter(|job| !done.contains(&job.row.key()))
        .collect();
    eprintln!("{} runs, {} done before", jobs.len(), done.len());
    let file = OpenOptions::new()
        .create(true)
        .append(true)
        .open(&options.output)
        .map_err(|error| format!("{}: {error}", options.output.display()))?;
    let is_new = file.metadata().is_ok_and(|file| file.len() == 0);
    let writer = csv::WriterBuilder::new()
        .has_headers(is_new)
        .from_writer(file);
    let writer = Mutex::new(writer);
    let next = AtomicUsize::new(0);
    let work = || -> Result<(), String> {
        loop {
            let position = next.fetch_add(1, Ordering::Relaxed);
            let Some(job) = jobs.get(position) else {
                return Ok(());
            };
            let row = run(job, &options);
            eprintln!(
                "{}/{} {} {} {}: {}",
                position + 1,
                jobs.len(),
                row.planner,
                row.domain,
                row.instance,
                row.outcome
            );
            let mut writer = writer.lock().map_err(|_| "another job has failed")?;
            let written = writer.serialize(&row);
            written
                .and_then(|()| Ok(writer.flush()?))
                .map_err(|error| format!("the results cannot be written: {error}"))?;
        }
    };
    thread::scope(|scope| {
        let workers: Vec<_> = (0..options.jobs).map(|_| scope.spawn(work)).collect();
        for worker in workers {
            worker.join().map_err(|_| "a job panicked".to_owned())??;
        }
        Ok(())
    })
}

fn options(arguments: &[String]) -> Result<Options, String> {
    let mut options = Options {
        data: PathBuf::from("../shared/data/pddl"),
        planners: Vec::new(),
        output: PathBuf::new(),
        seconds: 30,
        megabytes: 4096,
        jobs: 1,
        only: None,
        every: 1,
        first: false,
        val: None,
    };
    let mut arguments = arguments.iter();
    while let Some(option) = arguments.next() {
        if option == "--first" {
            options.first = true;
            continue;
        }
        let value = arguments
            .next()
            .ok_or_else(|| format!("{option} needs a value"))?;
        let number = || {
            let number: Result<usize, _> = value.parse();
            number.map_err(|_| format!("{option} expects a number, found {value}"))
        };
        match option.as_str() {
            "--data" => options.data = PathBuf::from(value),
            "--planner" => options.planners.push(value.clone()),
            "-o" => options.output = PathBuf::from(value),
            "--time" => options.seconds = number()? as u64,
            "--memory" => options.megabytes = number()? as u64,
            "--jobs" => options.jobs = number()?.max(1),
            "--val" => options.val = Some(PathBuf::from(value)),
            "--only" => options.only = Some(value.clone()),
            "--every" => options.every = number()?.max(1),
            _ => return Err(format!("unknown option {option}")),
        }
    }
    if options.planners.is_empty() || options.output.as_os_str().is_empty() {
        return Err("expected at least one --planner, and a file with -o".to_owned());
    }
    Ok(options)
}

/// Returns the runs that are already in a file.
fn done(path: &Path) -> Result<BTreeSet<(String, String, String)>, String> {
    if !path.exists() {
        return Ok(BTreeSet::new());
    }
    Ok(row::read(path)?.iter().map(Row::key).collect())
}

/// Returns the runs of all planners on the temporal instances, instance by instance.
fn jobs(options: &Options) -> Result<Vec<Job>, String> {
    let mut jobs = Vec::new();
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for instance in manifest::read(&options.data)? {
        let text = options.only.as_ref();
        let is_wanted = text.is_none_or(|text| instance.line.contains(text.as_str()));
        if !instance.is_temporal || !is_wanted {
            continue;
        }
        let domain = format!("{}/{}", instance.collection, instance.domain);
        let count = counts.entry(domain.clone()).or_default();
        *count += 1;
        if !(*count - 1).is_multiple_of(options.every) {
            continue;
        }
        for planner in &options.planners {
            jobs.push(Job {
                row: Row {
                    planner: planner.clone(),
                    kinds: kinds(&domain, &instance.features),
                    domain: domain.clone(),
                    instance: instance.instance.clone(),
                    ..Row::default()
                },
                domain: instance.domain_file.clone(),
                problem: instance.problem_file.clone(),
            });
        }
    }
    Ok(jobs)
}

/// Returns the difficult features of an instance.
fn kinds(domain: &str, features: &str) -> String {
    /// Domains without sequential plans.
    const CONCURRENT: &[&str] = &["match", "tms", "driverlogshift", "concurrency"];
    let features: BTreeSet<&str> = features.split_whitespace().collect();
    let mut kinds = Vec::new();
    if features.contains("TIL") {
        kinds.push("deadlines");
    }
    if features.contains("num-cond") || features.contains("num-eff") {
        kinds.push("numbers");
    }
    let name = domain.to_lowercase();
    if CONCURRENT.iter().any(|word| name.contains(word)) {
        kinds.push("concurrency");
    }
    kinds.join(" ")
}

fn run(job: &Job, options: &Options) -> Row {
    let mut row = job.row.clone();
    let outcome = |row: Row, outcome: &str, note: String| Row {
        outcome: outcome.to_owned(),
        note,
        ..row
    };
    let source = |path: &Path| match fs::read(path) {
        Ok(bytes) => Source::from_bytes(path.display().to_string(), &bytes),
        Err(error) => Source::new(path.display().to_string(), error.to_string()),
    };
    let (domain, problem) = (source(&job.domain), source(&job.problem));
    let task = match read_problem(&domain, &problem) {
        Ok((problem, _)) => Task::new(problem),
        Err(errors) => {
            let first = errors.errors().next().map(ToString::to_string);
            return outcome(row, "not read", without_folders(&first.unwrap_or_default()));
        }
    };
    let planner = match planner(&row.planner) {
        Ok(planner) => planner,
        Err(error) => return outcome(row, "not started", error),
    };
    let settings = Settings {
        work_limit: Some(Duration::from_secs(options.seconds)),
        // Wall-clock limit, for a planner that hangs.
        time_limit: Some(Duration::from_secs(options.seconds * 6)),
        memory_limit: Some(options.megabytes << 20),
        ..Settings::default()
    };
    let situation = Situation::initial(&task);
    let metric = task.problem().metric.as_ref();
    let better_metric = metric.filter(|metric| metric.expression != Expression::TotalTime);
    let mut makespans = Vec::new();
    let mut metrics = Vec::new();
    let report = plan(
        &planner,
        &mut Request {
            task: &task,
            situation: &situation,
            domain: &domain,
            problem: &problem,
        },
        &settings,
        &mut pipeline::reschedule,
        &mut |event| {
            if let Event::Plan { found, .. } = event {
                makespans.push(found.makespan.clone());
                metrics.extend(found.metric.clone());
                if options.first {
                    return ControlFlow::Break(());
                }
            }
            ControlFlow::Continue(())
        },
    );
    let shown = |makespan: Option<&Rational>| {
        makespan
            .map(|makespan| makespan.to_decimal(3))
            .unwrap_or_default()
    };
    row.first_makespan = shown(makespans.first());
    // The last plan may have a larger makespan, because planners may optimize a metric without
    // time.
    row.best_makespan = shown(makespans.iter().min());
    if let Some(metric) = better_metric {
        let best = if metric.maximize {
            metrics.iter().max()
        } else {
            metrics.iter().min()
        };
        row.best_metric = shown(best);
        row.better = String::from(if metric.maximize { "more" } else { "less" });
    }
    if let (Some(val), Some(found)) = (&options.val, report.outcome.found()) {
        row.val = val::verdict(val, &job.domain, &job.problem, &found.plan);
    }
    filled(row, &report)
}

/// Returns the planner of that name; the embedded one as a separate process.
fn planner(name: &str) -> Result<Planner, String> {
    if name != "embedded" {
        return Planner::named(name).map_err(|error| error.to_string());
    }
    let program = std::env::current_exe().map_err(|error| error.to_string())?;
    let line = format!(
        "'{}' embedded {{domain}} {{problem}} {{time}} {{memory}}",
        program.display()
    );
    let mut planner = Planner::named(&line).map_err(|error| error.to_string())?;
    name.clone_into(&mut planner.name);
    Ok(planner)
}

fn filled(row: Row, report: &Report) -> Row {
    let seconds = |time: Duration| format!("{:.3}", time.as_secs_f64());
    let statistics = &report.statistics;
    let note = match &report.outcome {
        Outcome::Plan(found) => found.repaired.clone().unwrap_or_default(),
        Outcome::NotUnderstood { excerpt, .. } | Outcome::Crashed { excerpt, .. } => {
            let last: Vec<&str> = excerpt.lines().rev().take(2).collect();
            format!("{}: {}", report.outcome, last.join(" / "))
        }
        other => other.to_string(),
    };
    let found = report.outcome.found();
    Row {
        outcome: report.outcome.name().to_owned(),
        first_seconds: statistics.first_plan.map(seconds).unwrap_or_default(),
        plans: statistics.plans.to_string(),
        refused: statistics.refused.to_string(),
        repaired: found
            .map(|found| {
                if found.repaired.is_some() {
                    "yes"
                } else {
                    "no"
                }
                .to_owned()
            })
            .unwrap_or_default(),
        seconds: seconds(statistics.work),
        megabytes: (statistics.peak_memory >> 20).to_string(),
        note: without_folders(&note).chars().take(300).collect(),
        ..row
    }
}

/// Replaces absolute paths in a message by file names, so that it does not depend on the machine.
fn without_folders(message: &str) -> String {
    let words = message.split(' ').map(|word| match word.rsplit_once('/') {
        Some((_, name)) if word.starts_with('/') && !name.is_empty() => name,
        _ => word,
    });
    words.collect::<Vec<_>>().join(" ")
}
