//! The actions of plans that differ: what a bound within plans goes by.

use elbowroom_model::{Situation, Task};
use elbowroom_sim::WorldModel;

use super::{Candidate, Candidates, Embedded, Limits};
use crate::timed::{self, Settings};

/// How many plans there are at most.
const MOST_PLANS: usize = 8;

/// How many variants of the problem they are made for at most, and how many states may be looked at for
/// all but the first.
const MOST_SEARCHES: usize = 8;
const OTHER_STATES: u64 = 10_000;

/// The [sets of actions](Settings::plans) within which a bound is looked for: those of plans that differ, as
/// the embedded planner makes them from the beginning, also for slow and scarce variants.
pub fn action_sets(
    task: &Task,
    world: &WorldModel,
    embedded: Embedded<'_>,
    goes_on: &dyn Fn() -> bool,
) -> Vec<Vec<String>> {
    sets(task, world, embedded, &|_| true, goes_on)
}

/// The same for a [policy](timed::Policy); none where there would be no table for the first of them either.
pub fn action_sets_to_tabulate(
    task: &Task,
    world: &WorldModel,
    embedded: Embedded<'_>,
    goes_on: &dyn Fn() -> bool,
) -> Vec<Vec<String>> {
    let is_of_use = |first: &[String]| {
        let settings = Settings {
            only: Some(first.to_vec()),
            ..Settings::default()
        };
        timed::knows(task, world, &settings)
    };
    sets(task, world, embedded, &is_of_use, goes_on)
}

fn sets(
    task: &Task,
    world: &WorldModel,
    embedded: Embedded<'_>,
    is_of_use: &dyn Fn(&[String]) -> bool,
    goes_on: &dyn Fn() -> bool,
) -> Vec<Vec<String>> {
    let limits = Limits {
        most_states: embedded.most_states,
        improve_states: embedded.improve_states,
        other_states: OTHER_STATES,
        searches: MOST_SEARCHES,
    };
    // What is only thought of gets no numbers.
    let thought = task.with_own_table();
    let situation = Situation::initial(&thought);
    let mut source = Candidates::new(&thought, &situation, Some(world), embedded.settings, limits);
    let names = |candidate: Candidate| -> Vec<String> {
        let steps = candidate.plan.steps.into_iter();
        steps.map(|step| step.action.name.clone()).collect()
    };
    let mut next = || source.next(&mut |_| goes_on()).map(names);
    let Some(first) = next().filter(|first| is_of_use(first)) else {
        return Vec::new();
    };
    let others = std::iter::from_fn(next).take(MOST_PLANS - 1);
    std::iter::once(first).chain(others).collect()
}
