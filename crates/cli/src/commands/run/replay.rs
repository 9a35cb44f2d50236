//! `elbowroom run --replay`: comparison of a stored run with its replay.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use elbowroom::answers::run::run as execute;
use elbowroom::answers::{Observer, StopRequest};
use elbowroom::execute::{RunInputs, RunSpec, SpecError, WorldNames};
use elbowroom::report::trace::{Line, Replay, ReplayPlanner, ReplayPreparer, ReplayWorld, Stored};
use serde_json::{Value, json};

use crate::exit::{Answer, Exit, Failure};
use crate::output::Output;
use crate::terminal::{ERROR, SUCCESS, styled};
use crate::{input, output};

pub(super) fn run(path: &Path, as_json: bool, output: &mut Output) -> Answer {
    let name = path.display().to_string();
    let text = input::record(path, "trace")?;
    let unreadable = |message: String| Failure::new(format!("{name}, {message}"), "");
    let stored = Stored::read(text.text()).map_err(|error| unreadable(error.to_string()))?;
    let spec: RunSpec = stored.header().map_err(|error| {
        let hint = "the trace may be of another version of this program";
        Failure::new(format!("{name}, {error}"), hint)
    })?;
    if spec.has_plan && stored.has_refused_plan() {
        return Err(Failure::new(
            format!(
                "{name} cannot be replayed: the plan of this run was rejected, and a trace does \
                 not contain a rejected plan"
            ),
            "no action was executed; `elbowroom run` with the same plan reports the reason",
        ));
    }
    let task = Arc::new(super::task(&spec, output)?);
    let unusable = |error: SpecError| unreadable(format!("line 1: {error}"));
    let inputs = RunInputs::of(spec, task, &WorldNames::default()).map_err(unusable)?;
    let (spec, task) = (inputs.spec(), inputs.task());
    let snapshot = stored.snapshot();
    let snapshot = snapshot.map_err(|error| unreadable(error.to_string()))?;
    let stand = snapshot.map(|it| it.restored(task)).transpose();
    let stand = stand.map_err(|why| unreadable(format!("line 2: {why}")))?;
    let first = if spec.has_plan {
        let first = stored.first_plan(task);
        first.map_err(|error| unreadable(error.to_string()))?
    } else {
        None
    };
    let mut replay = Replay::new(&stored, Arc::clone(task));
    let mut watch = StoredInterrupt(replay.interruption());
    let execution = inputs
        .execution(first)
        .map_err(unusable)?
        .resume_from(stand)
        .with_restarts(stored.restart_count())
        .with_planner(ReplayPlanner::new(&stored))
        .with_preparer(ReplayPreparer(inputs.preparer()))
        .recorded_by(&mut replay);
    let mut world = ReplayWorld::new(&stored, task);
    let outcome = execute(&inputs, execution, &mut world, &mut watch).map_err(unusable)?;
    let (agreed, difference) = replay.outcome();
    if as_json {
        output.json(&json!({
            "format": "elbowroom-replay",
            "version": 1,
            "trace": name,
            "agrees": difference.is_none(),
            "entries": agreed,
            "invalid": &outcome.answer.invalid,
            "complete": !stored.is_cut_off && stored.is_complete(),
            "difference": difference.as_ref().map(|it| json!({
                "line": it.line,
                "stored": json_of(&it.stored),
                "replayed": json_of(&it.replayed),
            })),
        }))?;
    } else {
        output::print(&match &difference {
            None => format!(
                "{}: the replay of {name} makes the same decisions ({agreed} entries{})\n",
                styled(SUCCESS, "agrees"),
                if stored.is_complete() {
                    ""
                } else {
                    "; the trace is incomplete"
                }
            ),
            Some(difference) => format!(
                "{}: the replay of {name} differs at line {}\n  stored    {}\n  replayed  {}\n",
                styled(ERROR, "differs"),
                difference.line,
                difference.stored.text(),
                difference.replayed.text()
            ),
        })?;
    }
    if !outcome.answer.invalid.is_empty() {
        return super::exit(&outcome, Some(name));
    }
    Ok(match difference {
        None => Exit::Yes,
        Some(_) => Exit::No,
    })
}

fn json_of(line: &Line) -> Value {
    serde_json::from_str(&line.text()).unwrap_or(Value::Null)
}

/// Watcher that ends the run where the stored one was interrupted.
struct StoredInterrupt(Arc<AtomicBool>);

impl Observer for StoredInterrupt {
    fn flow(&mut self) -> ControlFlow<StopRequest> {
        if self.0.load(Ordering::SeqCst) {
            ControlFlow::Break(StopRequest::Cancelled)
        } else {
            ControlFlow::Continue(())
        }
    }
}
