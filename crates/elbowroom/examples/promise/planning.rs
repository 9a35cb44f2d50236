//! Plans of the embedded planner, stored as text.

use std::fs;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use elbowroom::model::{Situation, Task};
use elbowroom::pddl::write_plan;
use elbowroom::planner::{Answer, Settings, plan as search};

use super::sources::Source;
use super::subject::Planning;

/// Prefix of files that say that there is no plan, independent of the limits.
const NO_PLAN: &str = "; none: ";

/// Prefix of files that say that no plan was found; the limits follow.
const NOT_FOUND: &str = "; not found within ";

/// Reason why there is no plan.
enum Without {
    /// None exists, or the planner does not support the problem.
    Ever(&'static str),
    /// None was found within the limits.
    Yet,
}

/// Returns the stored plan, or a new one. If no plan was found earlier, the search is repeated if
/// the limits have changed.
///
/// # Errors
/// There is no plan; the text says why.
pub(crate) fn plan(source: &Source, task: &Task, how: &Planning) -> Result<String, String> {
    let file = file(source, how);
    let limits = limits(how);
    if let Some(text) = file.as_ref().and_then(|file| fs::read_to_string(file).ok()) {
        if let Some(why) = text.strip_prefix(NO_PLAN) {
            return Err(why.trim_end().to_owned());
        }
        match text.strip_prefix(NOT_FOUND) {
            None => return Ok(text),
            Some(earlier) if how.time.is_none() || earlier.trim_end() == limits => {
                return Err(format!("no plan found within {}", earlier.trim_end()));
            }
            Some(_) => {}
        }
    }
    let Some(time) = how.time else {
        return Err("no plan has been made yet".to_owned());
    };
    let made = made(task, how, time);
    if let Some(file) = file {
        let text = match &made {
            Ok(text) => text.clone(),
            Err(Without::Ever(why)) => format!("{NO_PLAN}{why}\n"),
            Err(Without::Yet) => format!("{NOT_FOUND}{limits}\n"),
        };
        // If the plan cannot be stored, it is computed again the next time.
        let _ = fs::write(file, text);
    }
    made.map_err(|without| match without {
        Without::Ever(why) => why.to_owned(),
        Without::Yet => format!("no plan found within {limits}"),
    })
}

/// Describes the limits of the search.
fn limits(how: &Planning) -> String {
    let seconds = how.time.map_or(0, |time| time.as_secs());
    format!("{} states and {seconds} s", how.states)
}

fn file(source: &Source, how: &Planning) -> Option<PathBuf> {
    let name = format!("{}--{}.plan", source.family, source.name);
    Some(how.cache.as_ref()?.join(name.replace('/', "-")))
}

#[allow(clippy::disallowed_methods, reason = "planning has a time limit")]
fn made(task: &Task, how: &Planning, time: Duration) -> Result<String, Without> {
    let begin = Instant::now();
    let situation = Situation::initial(task);
    let settings = Settings {
        first_plan_only: true,
        max_memory: 1 << 30,
        ..Settings::default()
    };
    let answer = search(task, &situation, &settings, &mut |progress| {
        if begin.elapsed() > time || progress.counts.evaluated > how.states {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    match answer {
        Answer::Plan { found, .. } => Ok(write_plan(task, &found.plan)),
        Answer::Unsolvable { .. } => Err(Without::Ever("there is no plan")),
        Answer::NoneFound { .. } => Err(Without::Yet),
        Answer::Unsupported(_) => Err(Without::Ever("beyond the embedded planner")),
    }
}
