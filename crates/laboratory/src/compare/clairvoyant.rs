//! Plans with knowledge of the future: an upper bound for all executors.
//!
//! The problem is rewritten so that each action has the duration and the amounts of its first
//! execution in the world. With these, the planner knows the future exactly, unless a plan executes
//! the same action twice. Failures are ignored.

use elbowroom_execution::{PlanAnswer, Planner};
use elbowroom_model::problem::{
    Body, Change, Expression, ObjectId, Problem, Schema, SchemaId, Term,
};
use elbowroom_model::{Situation, Task};
use elbowroom_sim::draw::keyed;
use elbowroom_sim::{Purpose, WorldModel};

use elbowroom::execute::rewrite::{add_function_of, set_durations};

/// Summary of the row, in one sentence.
pub(super) const SUMMARY: &str = "Share of trials in which the planner, with the executors' \
                                  limits, finds a plan if everything is known in advance, or in \
                                  which one of the executors reaches the goal.";

/// Returns `true` if a plan reaches the goal when the world of that seed is known in advance.
pub(super) fn can_reach(
    task: &Task,
    world: &WorldModel,
    seed: u64,
    planner: &mut dyn Planner,
) -> bool {
    let known =
        Task::new(with_foreknowledge(task, world, seed)).with_epsilon(task.epsilon().clone());
    let situation = Situation::initial(&known);
    matches!(planner.plan(&known, &situation).answer, PlanAnswer::Plan(_))
}

/// Returns the problem with the durations and amounts of the world of that seed.
fn with_foreknowledge(task: &Task, world: &WorldModel, seed: u64) -> Problem {
    let mut problem = task.problem().clone();
    for index in 0..problem.schemas.len() {
        let schema = SchemaId::from(index);
        set_durations(task, schema, &mut problem, &|name, planned| {
            let mut rng = keyed(seed, name, 0, Purpose::Duration);
            world.duration(name, planned, &mut rng)
        });
        reveal_amounts(task, world, seed, schema, &mut problem);
    }
    problem
}

fn reveal_amounts(
    task: &Task,
    world: &WorldModel,
    seed: u64,
    schema: SchemaId,
    problem: &mut Problem,
) {
    for place in 0..2_u64 {
        let count = effects(&mut problem.schemas[schema.index()], place).map_or(0, |e| e.len());
        for index in 0..count {
            let effects = effects(&mut problem.schemas[schema.index()], place);
            let Some(Change::Update {
                fluent,
                value: Expression::Constant(planned),
                ..
            }) = effects
                .and_then(|effects| effects.get(index))
                .map(|it| &it.change)
            else {
                continue;
            };
            let (fluent, planned) = (fluent.clone(), planned.clone());
            let function = problem.functions[fluent.function.index()].name.clone();
            let value = |name: &str, arguments: &[ObjectId]| {
                let objects: Option<Vec<ObjectId>> = fluent
                    .arguments
                    .iter()
                    .map(|term| match term {
                        Term::Object(object) => Some(*object),
                        Term::Variable(variable) => arguments.get(*variable).copied(),
                    })
                    .collect();
                let fluent_name = task.problem().apply_name(&function, &objects?);
                let rule = world.amount(name, &fluent_name)?;
                let instance = format!("{name} {fluent_name} {place}");
                let mut rng = keyed(seed, &instance, 0, Purpose::Amount);
                Some(rule.draw(&planned, &world.resolution, &mut rng))
            };
            let what = format!("amount-{place}-{index}");
            let planned = planned.clone();
            let known = add_function_of(task, schema, &what, problem, &|name, arguments| {
                Some(value(name, arguments).unwrap_or_else(|| planned.clone()))
            });
            let effects = self::effects(&mut problem.schemas[schema.index()], place);
            if let Some(effects) = effects
                && let Change::Update { value, .. } = &mut effects[index].change
            {
                *value = known;
            }
        }
    }
}

fn effects(schema: &mut Schema, place: u64) -> Option<&mut Vec<elbowroom_model::problem::Effect>> {
    match (&mut schema.body, place) {
        (Body::Instantaneous { effects, .. }, 0) => Some(effects),
        (Body::Durative { start_effects, .. }, 0) => Some(start_effects),
        (Body::Durative { end_effects, .. }, 1) => Some(end_effects),
        _ => None,
    }
}
