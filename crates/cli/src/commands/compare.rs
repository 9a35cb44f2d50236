//! `elbowroom compare`: executors in many runs, side by side.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use elbowroom::compare::{self, Experiment, Part, Results};
use elbowroom::perturbed::{self, PerturbedExperiment, PerturbedResults};
use elbowroom::report::table::Table;
use indicatif::{ProgressBar, ProgressStyle};

use crate::args::CompareArgs;
use crate::exit::{Answer, Exit, Failure};
use crate::interrupt::Interrupt;
use crate::look::Look;
use crate::{input, output};

/// Makes an experiment, or a part of it, or puts parts together.
pub(crate) fn run(arguments: &CompareArgs) -> Answer {
    let name = arguments.experiment.display().to_string();
    let text = input::source(&arguments.experiment, "experiment")?;
    let folder = arguments
        .experiment
        .parent()
        .map(Path::to_path_buf)
        .unwrap_or_default();
    let file = |name: &str| {
        let path = folder.join(name);
        fs::read_to_string(&path)
            .map_err(|error| format!("cannot read {}: {}", path.display(), output::plain(&error)))
    };
    // Who cannot write there learns it before hours of trials, not after.
    if let Some(folder) = &arguments.output {
        make_folder(folder)?;
    }
    if PerturbedExperiment::is_one(text.text()) {
        return perturbed(arguments, &name, text.text(), &file);
    }
    let experiment = Experiment::read(text.text(), &file)
        .map_err(|error| Failure::new(format!("{name}, {error}"), ""))?;
    let results = if arguments.merge.is_empty() {
        make(arguments, &experiment)?
    } else {
        merged(&arguments.merge, &experiment)?
    };
    let width = Look::of_stdout().width;
    // What was computed is shown, whatever becomes of the files.
    let written = match &arguments.output {
        Some(folder) => write(folder, &experiment, &results),
        None => Ok(()),
    };
    if arguments.json {
        output::print_json(&results.json())?;
    } else {
        output::print(&results.table(&experiment).within(width))?;
    }
    written.map(|()| ended(results.is_interrupted))
}

/// What was made is shown and kept, but is not what was asked for.
fn ended(is_interrupted: bool) -> Exit {
    if is_interrupted {
        Exit::Interrupted
    } else {
        Exit::Yes
    }
}

/// An experiment in worlds without time.
fn perturbed(
    arguments: &CompareArgs,
    name: &str,
    text: &str,
    file: &dyn Fn(&str) -> Result<String, String>,
) -> Answer {
    let wrong = |error| Failure::new(format!("{name}: {error}"), "");
    let experiment = PerturbedExperiment::read(text, file).map_err(wrong)?;
    let results = if arguments.merge.is_empty() {
        let (shard, shards) = arguments.shard.unwrap_or((0, 1));
        let part = Part {
            trials: arguments.trials.unwrap_or(experiment.trials),
            shard,
            shards,
            jobs: arguments.jobs,
        };
        let interrupt = Interrupt::listen();
        perturbed::run(&experiment, part, &|| !interrupt.is_requested()).map_err(wrong)?
    } else {
        merged_perturbed(&arguments.merge, &experiment)?
    };
    let table = perturbed::table(&results);
    let written = match &arguments.output {
        Some(folder) => write_perturbed(folder, &results, &table),
        None => Ok(()),
    };
    if arguments.json {
        output::print_json(&results.json())?;
    } else {
        output::print(&table.within(Look::of_stdout().width))?;
    }
    written.map(|()| ended(results.is_interrupted))
}

fn write_perturbed(
    folder: &Path,
    results: &PerturbedResults,
    table: &Table,
) -> Result<(), Failure> {
    let write = |name: &str, text: &str| output::write_file(&folder.join(name), text);
    write("results.json", &format!("{:#}\n", results.json()))?;
    write("table.md", &table.markdown())?;
    write("table.csv", &table.csv())?;
    for (name, plot) in perturbed::plots(results) {
        let svg = plot.svg().map_err(|error| Failure::new(error, ""))?;
        write(&format!("{name}.svg"), &svg)?;
    }
    Ok(())
}

fn merged_perturbed(
    paths: &[PathBuf],
    experiment: &PerturbedExperiment,
) -> Result<PerturbedResults, Failure> {
    let mut parts = Vec::new();
    for path in paths {
        let text = input::source(path, "results")?;
        let wrong = |error| Failure::new(format!("{}: {error}", path.display()), "");
        let part = PerturbedResults::read(text.text()).map_err(wrong)?;
        if !part.are_of(experiment) {
            return Err(of_another(path));
        }
        parts.push(part);
    }
    PerturbedResults::merged(&parts).map_err(|error| Failure::new(error, ""))
}

fn of_another(path: &Path) -> Failure {
    Failure::new(
        format!("{} is not of this experiment", path.display()),
        "give the results of its parts, made from the same files",
    )
}

fn make(arguments: &CompareArgs, experiment: &Experiment) -> Result<Results, Failure> {
    let (shard, shards) = arguments.shard.unwrap_or((0, 1));
    let part = Part {
        trials: arguments.trials.unwrap_or(experiment.trials),
        shard,
        shards,
        jobs: arguments.jobs,
    };
    let bar = ProgressBar::new(part.count(experiment)).with_style(
        ProgressStyle::with_template("{bar:30} {pos}/{len} trials, {eta} left")
            .expect("a template without mistakes"),
    );
    let interrupt = Interrupt::listen();
    let shown = Mutex::new(0_u64);
    let observe = |done: u64| {
        if let Ok(mut shown) = shown.lock()
            && done > *shown
        {
            *shown = done;
            bar.set_position(done);
        }
        !interrupt.is_requested()
    };
    let results = compare::run(experiment, part, &observe);
    bar.finish_and_clear();
    results.map_err(|error| Failure::new(error, ""))
}

fn merged(paths: &[PathBuf], experiment: &Experiment) -> Result<Results, Failure> {
    let mut parts = Vec::new();
    for path in paths {
        let text = input::source(path, "results")?;
        let wrong = |error| Failure::new(format!("{}: {error}", path.display()), "");
        let part = Results::read(text.text()).map_err(wrong)?;
        if !part.are_of(experiment) {
            return Err(of_another(path));
        }
        parts.push(part);
    }
    Results::merged(&parts).map_err(|error| Failure::new(error, ""))
}

fn write(folder: &Path, experiment: &Experiment, results: &Results) -> Result<(), Failure> {
    let table = results.table(experiment);
    output::write_file(
        &folder.join("results.json"),
        &format!("{:#}\n", results.json()),
    )?;
    output::write_file(&folder.join("table.md"), &table.markdown())?;
    output::write_file(&folder.join("table.csv"), &table.csv())
}

fn make_folder(folder: &Path) -> Result<(), Failure> {
    fs::create_dir_all(folder).map_err(|error| {
        Failure::new(
            format!(
                "cannot make the folder {}: {}",
                folder.display(),
                output::plain(&error)
            ),
            "choose a folder that you may make, or that exists already",
        )
    })
}
