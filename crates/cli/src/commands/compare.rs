//! `elbowroom compare`: comparison of executors over many runs.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::{fs, io};

use elbowroom::answers::{Event, Observer, StopRequest};
use elbowroom::report::table::Table;
use elbowroom_laboratory::answer::{
    AnyExperiment, CompareAnswer, CompareRequest, FailurePosition, compare_recorded,
};
use elbowroom_laboratory::error::ExperimentError;
use elbowroom_laboratory::record::TrialRecords;
use elbowroom_laboratory::trials::Part;

use crate::args::CompareArgs;
use crate::exit::{Answer, Exit, Failure};
use crate::interrupt::Interrupt;
use crate::output::Output;
use crate::progress::Progress;
use crate::terminal::{ERROR, stdout_layout, styled};
use crate::time_limit::Stopwatch;
use crate::{input, output};
use elbowroom_executive::messages::io_error_message;

/// Folder for the traces of failed trials, inside the folder of the results.
pub(crate) const FAILURES: &str = "failures";
/// Maximum number of kinds of failure, for each executor and world, whose trace is written.
const MAX_PER_CELL: usize = 3;
/// Maximum number of traces written in total.
const MAX_FAILURES: usize = 60;

/// Runs an experiment or a part of it, or merges parts.
pub(crate) fn run(arguments: &CompareArgs, output: &mut Output) -> Answer {
    let text = input::source(&arguments.experiment, "experiment")?;
    let folder = arguments
        .experiment
        .parent()
        .map(Path::to_path_buf)
        .unwrap_or_default();
    let file = |name: &str| {
        let path = folder.join(name);
        fs::read_to_string(&path).map_err(|error| {
            format!(
                "cannot read {}: {}",
                path.display(),
                io_error_message(&error)
            )
        })
    };
    // An unwritable folder is reported before the trials, not after hours of them.
    if let Some(folder) = &arguments.output {
        make_folder(folder)?;
    }
    let mut experiment = AnyExperiment::read(&text, &file)?;
    if let Some(seed) = arguments.seed {
        experiment.set_seed(seed);
    }
    let records = arguments.each_trial.then(TrialRecords::default);
    let answer = if arguments.merge.is_empty() {
        run_trials(arguments, &experiment, records.as_ref())?
    } else {
        merge_results(&arguments.merge, &experiment)?
    };
    let table = answer.table(&experiment)?;
    // The results are printed even if the files cannot be written.
    let written = match &arguments.output {
        Some(folder) => write(folder, &answer, &table, records)
            .and_then(|()| write_failures(folder, &experiment, &answer)),
        None => Ok(()),
    };
    if arguments.json {
        output.json(&answer.json())?;
    } else {
        output::print(&table.fit_to_width(stdout_layout().width))?;
    }
    // The results of an interrupted experiment are printed and written, but the exit code is not 0.
    written.map(|()| {
        let invalid = answer.invalid_notes();
        if !invalid.is_empty() {
            for note in invalid {
                output::print_to_stderr(&styled(ERROR, &note));
            }
            output::print_to_stderr(
                "Please report it. With `-o DIR`, DIR/failures has the traces.",
            );
            Exit::Bug
        } else if answer.is_interrupted() {
            Exit::Interrupted
        } else {
            Exit::Yes
        }
    })
}

fn run_trials(
    arguments: &CompareArgs,
    experiment: &AnyExperiment,
    records: Option<&TrialRecords>,
) -> Result<CompareAnswer, Failure> {
    let (shard, shards) = arguments.shard.unwrap_or((0, 1));
    let part = Part {
        trials: arguments.trials.unwrap_or(experiment.trials()),
        shard,
        shards,
        jobs: arguments.jobs,
    };
    let mut watch = TrialMonitor {
        line: Progress::new(),
        stopwatch: Stopwatch::start(&Interrupt::listen()),
    };
    let answer = compare_recorded(CompareRequest { experiment, part }, records, &mut watch);
    drop(watch);
    Ok(answer?)
}

/// Watcher that shows the number of trials made, and ends them on request.
struct TrialMonitor {
    line: Progress,
    stopwatch: Stopwatch,
}

impl Observer for TrialMonitor {
    fn flow(&mut self) -> ControlFlow<StopRequest> {
        self.stopwatch.flow()
    }

    fn notice(&mut self, event: &Event<'_>) {
        if let Event::Trials(progress) = event {
            let elapsed = self.stopwatch.elapsed();
            let (done, of) = (progress.done, progress.total);
            self.line.show(elapsed, || {
                let left = of.saturating_sub(done) * elapsed.as_secs() / done.max(1);
                format!("{done} of {of} trials, about {left} s left")
            });
        }
    }
}

fn merge_results(paths: &[PathBuf], experiment: &AnyExperiment) -> Result<CompareAnswer, Failure> {
    let mut parts = Vec::new();
    for path in paths {
        let text = input::source(path, "results")?;
        let part = CompareAnswer::read(text.text(), experiment).map_err(|error| match error {
            ExperimentError::WrongExperiment => Failure::new(
                format!("{} belongs to another experiment", path.display()),
                "give results of parts of this experiment, computed from the same files",
            ),
            other => Failure::new(format!("{}: {other}", path.display()), ""),
        });
        parts.push(part?);
    }
    Ok(CompareAnswer::merge_results(&parts)?)
}

fn write(
    folder: &Path,
    answer: &CompareAnswer,
    table: &Table,
    records: Option<TrialRecords>,
) -> Result<(), Failure> {
    let write = |name: &str, text: &str| output::write_file(&folder.join(name), text);
    write("results.json", &format!("{:#}\n", answer.json()))?;
    write("table.md", &table.markdown())?;
    write("table.csv", &answer.records().csv())?;
    if let Some(records) = records {
        write("trials.csv", &records.table().csv())?;
    }
    for (name, plot) in answer.plots() {
        write(&format!("{name}.svg"), &plot.svg())?;
    }
    Ok(())
}

/// Writes traces of failed trials to their own folder: the first of each frequent kind, named by
/// row, column and kind. Traces of an earlier experiment are removed.
fn write_failures(
    folder: &Path,
    experiment: &AnyExperiment,
    answer: &CompareAnswer,
) -> Result<(), Failure> {
    let folder = folder.join(FAILURES);
    if folder.is_dir() {
        for old in traces(&folder)? {
            fs::remove_file(&old.1).map_err(|error| {
                let words = io_error_message(&error);
                Failure::new(format!("cannot replace {}: {words}", old.1.display()), "")
            })?;
        }
    }
    // After an interrupt, no further trials are run.
    let mut failed = if answer.is_interrupted() {
        Vec::new()
    } else {
        answer.failed_trials(MAX_PER_CELL, MAX_FAILURES)
    };
    failed.retain(|failed| experiment.is_repeatable(failed));
    if !failed.is_empty() {
        make_folder(&folder)?;
    }
    for (failed, trace) in failed.iter().zip(experiment.traces(&failed)?) {
        let (row, column, kind) = failed.position;
        let name = format!("{row}-{column}-{kind}.jsonl");
        output::write_file(&folder.join(name), &trace)?;
    }
    Ok(())
}

/// Returns the traces of failed trials in the folder of an experiment: row, column and kind of
/// each, and its file.
pub(crate) fn traces(folder: &Path) -> Result<Vec<(FailurePosition, PathBuf)>, Failure> {
    let wrong = |error: &io::Error| {
        let words = io_error_message(error);
        Failure::new(format!("cannot read {}: {words}", folder.display()), "")
    };
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).map_err(|error| wrong(&error))? {
        let path = entry.map_err(|error| wrong(&error))?.path();
        if path.extension().is_none_or(|it| it != "jsonl") {
            continue;
        }
        let stem = path.file_stem().and_then(|stem| stem.to_str());
        let numbers = stem.into_iter().flat_map(|stem| stem.split('-'));
        let numbers: Option<Vec<usize>> = numbers.map(|number| number.parse().ok()).collect();
        if let Some([row, column, kind]) = numbers.as_deref() {
            found.push(((*row, *column, *kind), path.clone()));
        }
    }
    found.sort();
    Ok(found)
}

fn make_folder(folder: &Path) -> Result<(), Failure> {
    fs::create_dir_all(folder).map_err(|error| {
        Failure::new(
            format!(
                "cannot create the folder {}: {}",
                folder.display(),
                io_error_message(&error)
            ),
            "choose an existing folder, or one that you may create",
        )
    })
}

impl From<ExperimentError> for Failure {
    fn from(error: ExperimentError) -> Self {
        match error {
            ExperimentError::Text(diagnostics) => diagnostics.into(),
            other => Self::new(other, ""),
        }
    }
}
