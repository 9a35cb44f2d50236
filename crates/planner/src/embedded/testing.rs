//! Helpers shared by the module tests.

use elbowroom_model::reachability::{self, Answer};
use elbowroom_model::{Situation, Task};

use super::apply::Step;
use super::compile::{CompileInput, Compiled, compile};
use super::state::State;
use super::tuning::Tuning;

/// Compiles a small task from its initial state.
pub(crate) fn compiled(task: &Task) -> Compiled {
    compiled_with(task, &Tuning::default()).expect("a small task without unsupported features")
}

/// Compiles a small task with this tuning. Returns `None` if it is not supported.
pub(crate) fn compiled_with(task: &Task, tuning: &Tuning) -> Option<Compiled> {
    let situation = Situation::initial(task);
    let limits = reachability::Settings::default();
    let Answer::Complete(grounding) = reachability::ground(task, &limits) else {
        return None;
    };
    let wanted = CompileInput {
        situation: &situation,
        metric: false,
        tuning,
    };
    compile(task, &grounding, wanted, &mut || true).ok()
}

/// Returns all choices in a state, applicable or not.
pub(crate) fn choices(compiled: &Compiled, state: &State) -> impl Iterator<Item = Step> + use<> {
    let count = |length: usize| u32::try_from(length).expect("few");
    let starts = (0..count(compiled.actions.len())).map(Step::Start);
    let ends = (0..count(state.open.len())).map(Step::End);
    starts.chain(ends).chain([Step::Timed])
}
