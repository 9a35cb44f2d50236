//! Plans of the embedded planner, kept as text.

use std::fs;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Instant;

use elbowroom::model::{Situation, Task};
use elbowroom::pddl::write_plan;
use elbowroom::planner::{Answer, Settings, plan as search};

use super::sources::Source;
use super::subject::Planning;

/// In files that say that there is none.
const NO_PLAN: &str = "; none: ";

/// The plan that was made earlier, or a new one.
///
/// # Errors
/// Why there is none.
pub(crate) fn plan(source: &Source, task: &mut Task, how: &Planning) -> Result<String, String> {
    let file = file(source, how);
    if let Some(text) = file.as_ref().and_then(|file| fs::read_to_string(file).ok()) {
        return match text.strip_prefix(NO_PLAN) {
            Some(why) => Err(why.trim_end().to_owned()),
            None => Ok(text),
        };
    }
    let made = made(task, how);
    if let Some(file) = file {
        let text = match &made {
            Ok(text) => text.clone(),
            Err(why) => format!("{NO_PLAN}{why}\n"),
        };
        // What cannot be kept is made again the next time.
        let _ = fs::write(file, text);
    }
    made
}

fn file(source: &Source, how: &Planning) -> Option<PathBuf> {
    let name = format!("{}--{}.plan", source.family, source.name);
    Some(how.cache.as_ref()?.join(name.replace('/', "-")))
}

#[allow(clippy::disallowed_methods, reason = "planning has a time limit")]
fn made(task: &mut Task, how: &Planning) -> Result<String, String> {
    let Some(time) = how.time else {
        return Err("no plan has been made yet".to_owned());
    };
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
        Answer::Unsolvable { .. } => Err("there is no plan".to_owned()),
        Answer::NoneFound { .. } => Err("no plan found within the limits".to_owned()),
        Answer::Unsupported(_) => Err("beyond the embedded planner".to_owned()),
    }
}
