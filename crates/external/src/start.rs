//! Preparation of the planner's process.

use std::fs;
use std::io;
use std::path::Path;
use std::process;
use std::time::Duration;

use super::command::{PlaceholderValues, find_program};
use super::outcome::Outcome;
use super::registry::{Kind, Planner};
use super::request::{Question, Request};
use super::settings::Settings;
use super::workspace::Workspace;

/// Python script that runs engines of unified-planning.
const UP_SHIM: &str = include_str!("up_shim.py");
/// Value of `{time}` without a time limit: a day.
const NO_TIME_LIMIT: u64 = 86_400;
/// Value of `{memory}` without a memory limit: a million MB.
const NO_MEMORY_LIMIT: u64 = 1_000_000;

/// Returns everything needed to start the planner, or the reason why it cannot be started.
pub(super) fn prepare(
    planner: &Planner,
    request: &Request<'_>,
    settings: &Settings,
) -> Result<(Question, Workspace, process::Command), Outcome> {
    let question = Question::of(request).map_err(|reason| {
        let help = "plan from a time at which that action has ended, or use the embedded planner";
        not_started(reason, help)
    })?;
    let program = match &planner.kind {
        Kind::Program(command) => &command.program,
        Kind::UnifiedPlanning { python, .. } => python,
    };
    let found = find_program(program).ok_or_else(|| {
        let what = if program.is_file() {
            "no permission to execute"
        } else {
            "there is no program"
        };
        not_started(
            format!("{what} {}", program.display()),
            &planner.install_hint,
        )
    })?;
    let domain = request.domain.text();
    let scratch = settings.scratch.as_deref();
    let workspace = Workspace::new(scratch, domain, &question.text).map_err(|error| {
        let help = "free some disk space there, or set TMPDIR to a folder with write permission";
        not_started(format!("cannot create a temporary folder: {error}"), help)
    })?;
    let command = command(planner, &found, &workspace, settings).map_err(|error| {
        not_started(
            format!("cannot write to its folder: {error}"),
            "free some disk space",
        )
    })?;
    Ok((question, workspace, command))
}

pub(super) fn not_started(reason: String, help: &str) -> Outcome {
    Outcome::NotStarted {
        reason,
        help: help.to_owned(),
    }
}

/// Returns the command of the process.
fn command(
    planner: &Planner,
    program: &Path,
    workspace: &Workspace,
    settings: &Settings,
) -> io::Result<process::Command> {
    let seconds = |limit: Duration| limit.as_secs() + u64::from(limit.subsec_nanos() > 0);
    let filling = PlaceholderValues {
        domain: workspace.domain(),
        problem: workspace.problem(),
        plan: workspace.plan(),
        time: settings.time_limit.map_or(NO_TIME_LIMIT, seconds),
        memory: settings
            .memory_limit
            .map_or(NO_MEMORY_LIMIT, |bytes| bytes >> 20),
    };
    let mut command = process::Command::new(program);
    match &planner.kind {
        Kind::Program(own) => {
            command.args(own.substitute(&filling));
        }
        Kind::UnifiedPlanning { engine, .. } => {
            let shim = workspace.path().join("up_shim.py");
            fs::write(&shim, UP_SHIM)?;
            command.arg(shim).arg(engine);
            command.args([filling.domain, filling.problem]);
            command.arg(filling.time.to_string());
        }
    }
    command
        .current_dir(workspace.path())
        // Temporary files are removed with the folder.
        .env("TMPDIR", workspace.path())
        // Decimal points in numbers, not commas.
        .env("LC_ALL", "C")
        .env("PYTHONUNBUFFERED", "1")
        .env("PYTHONDONTWRITEBYTECODE", "1");
    Ok(command)
}
