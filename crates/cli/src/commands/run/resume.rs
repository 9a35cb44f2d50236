//! `elbowroom run --resume`: resumes a run whose program has died.

use std::cell::OnceCell;
use std::path::Path;
use std::sync::Arc;

use elbowroom::execute::{RunInputs, WorldNames};
use elbowroom_executive::Error;
use elbowroom_executive::journal::Segments;
use elbowroom_executive::operator::OperatorInterface;
use elbowroom_executive::resume::{InterruptedRun, JournaledRun, ResumeSettings};
use serde_json::Value;

use super::page::Page;
use super::spec::contradiction_failure;
use super::{CommandHost, background, failure, limits};
use crate::args::RunArgs;
use crate::exit::{Answer, Exit, Failure};
use crate::input;
use crate::interrupt::Interrupt;
use crate::output::{self, Output};
use crate::time_limit::Stopwatch;

/// Reads the journal of a run.
fn journaled_run(path: &Path) -> Result<JournaledRun, Failure> {
    // Opening a named pipe could block forever.
    if std::fs::metadata(path).is_ok_and(|it| !it.is_file()) {
        return Err(Failure::new(
            format!("{} is not a file", path.display()),
            "give the file that --journal has written",
        ));
    }
    let length = std::fs::metadata(path).map_or(0, |it| it.len());
    let text = input::source(path, "journal")?;
    Ok(InterruptedRun::read(path, text.text(), length)?)
}

/// Part of the command that supports operators of a resumed run.
pub(in crate::commands) trait ResumeHost {
    /// Returns the operators' interface to a run of these inputs.
    ///
    /// # Errors
    /// When the command does not support such a run.
    fn operator(
        &self,
        inputs: &RunInputs,
        interrupt: &Interrupt,
    ) -> Result<OperatorInterface, Error>;

    /// Returns the rotation settings of the journal.
    fn segments(&self) -> Option<Segments> {
        None
    }
}

/// Host of `elbowroom run`, which has no operators except on the page of the run.
pub(super) struct StandaloneHost<'a> {
    arguments: &'a RunArgs,
    page: OnceCell<Page>,
}

impl<'a> StandaloneHost<'a> {
    pub(super) fn new(arguments: &'a RunArgs) -> Self {
        let page = OnceCell::new();
        Self { arguments, page }
    }

    /// Ends the HTTP interface, if there is one.
    pub(super) fn close(&self) {
        if let Some(page) = self.page.get() {
            page.close();
        }
    }
}

impl ResumeHost for StandaloneHost<'_> {
    fn operator(
        &self,
        inputs: &RunInputs,
        interrupt: &Interrupt,
    ) -> Result<OperatorInterface, Error> {
        let spec = inputs.spec();
        if spec.is_persistent {
            return Err(Error::new(
                "this is the journal of an executive (`elbowroom serve`)",
                "continue with `elbowroom serve --resume`",
            ));
        }
        if spec.is_interactive && self.arguments.token.is_none() {
            return Err(Error::new(
                "the run may be paused, and can then only be resumed from its page",
                "give --serve and --token again",
            ));
        }
        let page = Page::open(self.arguments, inputs, interrupt)?;
        Ok(self.page.get_or_init(|| page).operator.clone())
    }
}

/// Prints that there is nothing to resume. A supervisor must not start the command again.
fn achieved(path: &Path, report: &Value, arguments: &RunArgs, output: &mut Output) -> Answer {
    if arguments.json {
        output.json(report)?;
    } else {
        let name = path.display();
        output::print(&format!(
            "done: the run of {name} has already reached its goal; `elbowroom report {name}` shows its actions\n"
        ))?;
    }
    Ok(Exit::Yes)
}

/// Resumes the run of a journal.
pub(in crate::commands) fn run(
    path: &Path,
    arguments: &RunArgs,
    host: &dyn ResumeHost,
    output: &mut Output,
) -> Answer {
    let interrupted = match journaled_run(path)? {
        JournaledRun::Interrupted(run) => run,
        JournaledRun::Achieved(report) => return achieved(path, &report, arguments, output),
    };
    let threads = super::spec::threads_of(arguments, &interrupted.spec().planner)?;
    let interrupted = interrupted.with_threads(threads);
    let spec = interrupted.spec().clone();
    let task = Arc::new(super::task(&spec, output)?);
    let inputs = RunInputs::of(spec, task, &WorldNames::default());
    let inputs = inputs.map_err(contradiction_failure)?;
    let interrupt = Interrupt::listen_with_world();
    let learning = super::learning(arguments, path)?;
    let settings = ResumeSettings {
        embedded: None,
        inputs: &inputs,
        background: background(arguments, &interrupt),
        limits: limits(arguments),
        observer: learning.as_ref().map(|it| Box::new(it.observer()) as _),
        warnings: output::warnings(),
    };
    let host = CommandHost {
        arguments,
        interrupt: &interrupt,
        viewers: OnceCell::new(),
        started: &|| (),
        resume: Some(host),
    };
    let outcome = interrupted.resume(settings, &host, &mut Stopwatch::start(&interrupt));
    if let Some(learning) = learning {
        learning.finish();
    }
    let outcome = host.close(outcome).map_err(failure)?;
    super::print_outcome((arguments, inputs.spec()), outcome, output)
}
