//! Measures the contribution of each technique of the embedded planner: states evaluated to the
//! first plan, with all techniques, with one of them switched off, or with one search of the
//! portfolio alone. Prints a summary over all instances.
//!
//! ```text
//! ablation [--states N] [--seconds S] [--processor-time] [--memory MEGABYTES]
//!          [--without TECHNIQUE]… [--search NAME]… [--set NAME=VALUE]…
//!          [--only TEXT]… [--every K] FOLDER|DOMAIN PROBLEM…
//! ```
//!
//! Without `--without` and `--search`, each technique that takes part before the first plan is
//! switched off in turn. The tables are Markdown. A search that has found nothing after N states
//! (50,000) or S seconds (60; with `--processor-time`, of the processor) is shown as a dash with
//! the number of states it has evaluated. Only the limit on states makes this the same on each
//! machine. `--only` and `--every` are those of the example `coverage`.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "that is what the example does"
)]
#![allow(clippy::disallowed_methods, reason = "a benchmark looks at the clock")]

#[path = "../coverage/clock.rs"]
mod clock;
#[path = "../coverage/instances.rs"]
mod instances;
mod summary;

use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clock::Clock;
use elbowroom_model::Situation;
use elbowroom_planner::{Answer, Counts, Settings, Technique, Tuning, TuningError, plan};
use instances::{Instance, Selection, instances, task};
use summary::{Answered, Comparison};

/// Techniques used only after the first plan.
const AFTER_THE_FIRST_PLAN: [Technique; 4] = [
    Technique::Cleanup,
    Technique::Rescheduling,
    Technique::Repair,
    Technique::Leniency,
];

struct Options {
    states: u64,
    time: Duration,
    counts_processor_time: bool,
    memory: Option<usize>,
    tuning: Tuning,
    /// Headings and settings of the variants.
    variants: Vec<(String, Tuning)>,
    selection: Selection,
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
        counts_processor_time: false,
        memory: None,
        tuning: Tuning::default(),
        variants: Vec::new(),
        selection: Selection::default(),
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
        let size = |number: u64| {
            usize::try_from(number).map_err(|_| format!("{argument} takes a smaller number"))
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
            "--only" => options.selection.only.push(value()?),
            "--every" => options.selection.every = Some(size(number(value()?)?)?),
            "--memory" => options.memory = Some(size(number(value()?)?)? << 20),
            "--processor-time" => options.counts_processor_time = true,
            _ => options.files.push(PathBuf::from(argument)),
        }
    }
    if without.is_empty() && searches.is_empty() {
        let all = Technique::ALL.iter().map(|(technique, _)| *technique);
        without.extend(all.filter(|own| !AFTER_THE_FIRST_PLAN.contains(own)));
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
    let instances = instances(&options.files, &options.selection)?;
    let headings = options.variants.iter().map(|(heading, _)| heading.as_str());
    println!(
        "| instance | actions | {} |",
        headings.collect::<Vec<_>>().join(" | ")
    );
    println!("|---|--:|{}", "--:|".repeat(options.variants.len()));
    // Outcome of each instance, for each variant.
    let mut outcomes: Vec<Vec<Option<Answered>>> = vec![Vec::new(); options.variants.len()];
    for instance in &instances {
        let mut line = String::new();
        let mut actions = 0;
        for ((_, tuning), outcomes) in options.variants.iter().zip(&mut outcomes) {
            let Cell {
                text,
                actions: own,
                answered,
            } = cell(options, tuning, instance);
            actions = actions.max(own);
            outcomes.push(answered);
            let _ = write!(line, " {text} |");
        }
        println!(
            "| {} {} | {actions} |{line}",
            instance.domain, instance.name
        );
    }
    let headings = options.variants.iter().map(|(heading, _)| heading.as_str());
    println!();
    print!("{}", Comparison::table(headings.zip(&outcomes)));
    Ok(())
}

/// Result of one search.
struct Cell {
    /// Number of states evaluated to the first plan, as text.
    text: String,
    actions: u64,
    /// `None` if there was neither a plan nor a proof.
    answered: Option<Answered>,
}

fn cell(options: &Options, tuning: &Tuning, instance: &Instance) -> Cell {
    let cell = |text: String, counts: Counts, answered| Cell {
        text,
        actions: counts.actions,
        answered,
    };
    let task = match task(instance) {
        Ok(task) => task,
        Err(outcome) => return cell(outcome.to_owned(), Counts::default(), None),
    };
    let situation = Situation::initial(&task);
    let mut settings = Settings {
        first_plan_only: true,
        tuning: tuning.clone(),
        ..Settings::default()
    };
    settings.max_memory = options.memory.unwrap_or(settings.max_memory);
    // Only the states up to the first plan count.
    settings.tuning.without.push(Technique::Cleanup);
    let clock = Clock::now(options.counts_processor_time);
    let answer = plan(&task, &situation, &settings, &mut |progress| {
        if progress.counts.evaluated >= options.states || clock.elapsed() >= options.time {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    let answered = |counts: &Counts| {
        Some(Answered {
            states: counts.evaluated,
            time: clock.elapsed(),
        })
    };
    match answer {
        Answer::Plan { counts, .. } => {
            cell(counts.evaluated.to_string(), counts, answered(&counts))
        }
        Answer::Unsolvable { counts, .. } => {
            let text = format!("no plan, {}", counts.evaluated);
            cell(text, counts, answered(&counts))
        }
        Answer::NoneFound { counts, .. } => {
            cell(format!("– in {}", counts.evaluated), counts, None)
        }
        Answer::Unsupported(_) => cell("unsupported".to_owned(), Counts::default(), None),
    }
}
