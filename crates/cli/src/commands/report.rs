//! `elbowroom report`: a page for a browser, or a run for another viewer.

use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};

use crate::args::ReportArgs;
use crate::commands::compare::{FAILURES, traces};
use crate::exit::{Answer, Exit, Failure};
use crate::{input, output};

/// File with the results of `compare -o DIR`.
const RESULTS: &str = "results.json";

/// Writes the page, or the run for other viewers.
pub(crate) fn run(arguments: &ReportArgs) -> Answer {
    let path = if arguments.input.is_dir() {
        arguments.input.join(RESULTS)
    } else {
        arguments.input.clone()
    };
    let is_for_others = arguments.perfetto.is_some() || arguments.mcap.is_some();
    let target = match (&arguments.output, is_for_others) {
        (Some(target), _) => Some(target.clone()),
        (None, true) => None,
        (None, false) if io::stdout().is_terminal() => {
            return Err(Failure::new(
                "the page is HTML, and standard output is a terminal",
                format!("write it to a file: -o {}", default_output(&path).display()),
            ));
        }
        (None, false) => Some(PathBuf::from("-")),
    };
    let source = input::record(&path, "trace or answer")?;
    let failure = |error| Failure::new(error, "");
    if let Some(target) = &arguments.perfetto {
        let trace = elbowroom_page::perfetto(source.name(), source.text()).map_err(failure)?;
        output::write_bytes(target, &trace)?;
    }
    if let Some(target) = &arguments.mcap {
        let file = elbowroom_page::mcap(source.name(), source.text()).map_err(failure)?;
        output::write_bytes(target, &file)?;
    }
    if let Some(target) = target {
        let folder = path.with_file_name(FAILURES);
        let is_experiment = path.file_name().is_some_and(|name| name == RESULTS);
        let mut failed = Vec::new();
        if is_experiment && folder.is_dir() {
            for (place, file) in traces(&folder)? {
                let trace = input::record(&file, "trace")?;
                failed.push((place, trace.name().to_owned(), trace.text().to_owned()));
            }
        }
        let page = if failed.is_empty() {
            elbowroom_page::page(source.name(), source.text())
        } else {
            elbowroom_page::experiment_page(source.name(), source.text(), &failed)
        };
        let page = page.map_err(failure)?;
        output::write_file(&target, &page)?;
    }
    Ok(Exit::Yes)
}

/// Returns the input's name with another extension.
fn default_output(input: &Path) -> PathBuf {
    let stem = input.file_stem().filter(|stem| *stem != "-");
    Path::new(stem.unwrap_or_else(|| "report".as_ref())).with_extension("html")
}
