//! Goals that may have deadlines.

use elbowroom_model::ground;
use elbowroom_model::problem::{Body, Change, Condition, Effect, Guard};
use elbowroom_model::{Footprint, Task};

/// Returns the reason why a goal of this task cannot have a deadline, in words; `None` if it can.
///
/// The envelope of a plan respects a deadline if the goal is about facts that unconditional effects
/// of actions change.
pub fn obstacle_to_deadline(task: &Task, goal: &Condition) -> Option<String> {
    if !task.problem().constraints.is_empty() || !task.constraints().soft.is_empty() {
        let why = "a goal cannot have a deadline where the problem has constraints or preferences";
        return Some(why.to_owned());
    }
    let ground = task.with_goal(goal.clone()).goal().clone();
    let footprint = Footprint::of_condition(task, &ground);
    if !footprint.reads_fluents.is_empty() {
        return Some("a goal about numbers cannot have a deadline".to_owned());
    }
    let mut obstacle = None;
    ground.visit_facts(&mut |fact| {
        if obstacle.is_none() {
            obstacle = obstacle_of_fact(task, fact);
        }
    });
    obstacle
}

fn obstacle_of_fact(task: &Task, fact: ground::FactId) -> Option<String> {
    let name = task.fact_name(fact);
    if task.is_derived(fact) {
        let why =
            format!("`{name}` is derived from other facts, so the goal cannot have a deadline");
        return Some(why);
    }
    let (predicate, _) = task.atom(fact);
    let changes = |effect: &&Effect| matches!(&effect.change, Change::Add(atom) | Change::Delete(atom) if atom.predicate == predicate);
    let schemas = task.problem().schemas.iter();
    let conditional = schemas.filter(|schema| {
        let mut effects = effects(&schema.body).filter(changes);
        effects.any(|effect| effect.guard != Guard::default())
    });
    let first = conditional.map(|schema| schema.name.as_str()).next()?;
    Some(format!(
        "a conditional effect of `{first}` changes `{name}`, so the goal cannot have a deadline"
    ))
}

fn effects(body: &Body) -> impl Iterator<Item = &Effect> {
    let (first, second) = match body {
        Body::Instantaneous { effects, .. } => (effects.as_slice(), [].as_slice()),
        Body::Durative {
            start_effects,
            end_effects,
            ..
        } => (start_effects.as_slice(), end_effects.as_slice()),
    };
    first.iter().chain(second)
}
