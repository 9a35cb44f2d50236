//! What each technique of the embedded planner is worth: states evaluated to the first plan, with
//! all techniques, and with one of them switched off, or with one search of the portfolio alone.
//!
//! ```text
//! ablation [--states N] [--seconds S] [--without TECHNIQUE]… [--search NAME]… [--set NAME=VALUE]…
//!          [--only TEXT]… FOLDER|DOMAIN PROBLEM…
//! ```
//!
//! Without `--without` and `--search`, each technique is switched off in turn. The table is
//! Markdown. A search that has found nothing after N states (50,000) or S seconds (60) is shown as
//! a dash with the states it has evaluated; only the number of states makes that the same on each
//! machine.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "that is what the example does"
)]
#![allow(clippy::disallowed_methods, reason = "a benchmark looks at the clock")]

#[path = "../coverage/instances.rs"]
mod instances;

use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use elbowroom_model::Situation;
use elbowroom_planner::{Answer, Counts, Settings, Technique, Tuning, TuningError, plan};
use instances::{Instance, instances, task};

struct Options {
    states: u64,
    time: Duration,
    tuning: Tuning,
    /// A heading, and how to search.
    variants: Vec<(String, Tuning)>,
    only: Vec<String>,
    files: Vec<PathBuf>,
}

fn main() -> ExitCode {
    match options().and_then(|options| table(&options)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::from(2)
        }
    }
}

fn options() -> Result<Options, String> {
    let mut options = Options {
        states: 50_000,
        time: Duration::from_secs(60),
        tuning: Tuning::default(),
        variants: Vec::new(),
        only: Vec::new(),
        files: Vec::new(),
    };
    let (mut without, mut searches) = (Vec::new(), Vec::new());
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || {
            let value = arguments.next();
            value.ok_or_else(|| format!("{argument} takes a value"))
        };
        let wrong = |error: TuningError| format!("{argument}: {error}");
        let number = |value: String| {
            let number: Result<u64, _> = value.parse();
            number.map_err(|_| format!("{argument} takes a number, not {value}"))
        };
        match argument.as_str() {
            "--states" => options.states = number(value()?)?,
            "--seconds" => options.time = Duration::from_secs(number(value()?)?),
            "--set" => {
                let value = value()?;
                let (name, value) = value.split_once('=').ok_or("--set takes NAME=VALUE")?;
                options.tuning.set(name, value).map_err(wrong)?;
            }
            "--without" => without.push(value()?.parse::<Technique>().map_err(wrong)?),
            "--search" => {
                let name = value()?;
                searches.push((name.parse().map_err(wrong)?, name));
            }
            "--only" => options.only.push(value()?),
            _ => options.files.push(PathBuf::from(argument)),
        }
    }
    if without.is_empty() && searches.is_empty() {
        without.extend(Technique::ALL.iter().map(|(technique, _)| *technique));
    }
    let base = &options.tuning;
    options.variants.push(("all".to_owned(), base.clone()));
    for technique in without {
        let mut tuning = base.clone();
        tuning.without.push(technique);
        options
            .variants
            .push((format!("without {technique}"), tuning));
    }
    for (member, name) in searches {
        let mut tuning = base.clone();
        tuning.only = Some(member);
        options.variants.push((format!("{name} alone"), tuning));
    }
    Ok(options)
}

fn table(options: &Options) -> Result<(), String> {
    let instances = instances(&options.files, &options.only)?;
    let headings = options.variants.iter().map(|(heading, _)| heading.as_str());
    println!(
        "| instance | actions | {} |",
        headings.collect::<Vec<_>>().join(" | ")
    );
    println!("|---|--:|{}", "--:|".repeat(options.variants.len()));
    for instance in &instances {
        let mut line = String::new();
        let mut actions = 0;
        for (_, tuning) in &options.variants {
            let (text, counts) = cell(options, tuning, instance);
            actions = actions.max(counts.actions);
            let _ = write!(line, " {text} |");
        }
        println!(
            "| {} {} | {actions} |{line}",
            instance.domain, instance.name
        );
    }
    Ok(())
}

/// How many states were evaluated to the first plan, in words.
fn cell(options: &Options, tuning: &Tuning, instance: &Instance) -> (String, Counts) {
    let task = match task(instance) {
        Ok(task) => task,
        Err(outcome) => return (outcome.to_owned(), Counts::default()),
    };
    let situation = Situation::initial(&task);
    let settings = Settings {
        first_plan_only: true,
        tuning: tuning.clone(),
        ..Settings::default()
    };
    let begin = Instant::now();
    let answer = plan(&task, &situation, &settings, &mut |progress| {
        if progress.counts.evaluated >= options.states || begin.elapsed() >= options.time {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    match answer {
        Answer::Plan { counts, .. } => (counts.evaluated.to_string(), counts),
        Answer::Unsolvable { counts, .. } => (format!("no plan, {}", counts.evaluated), counts),
        Answer::NoneFound { counts, .. } => (format!("– in {}", counts.evaluated), counts),
        Answer::Unsupported(_) => ("unsupported".to_owned(), Counts::default()),
    }
}
