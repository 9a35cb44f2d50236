//! Rewriting of numbers in problems.

use elbowroom_model::Task;
use elbowroom_model::ground::{Action, Expression as GroundExpression};
use elbowroom_model::problem::{
    Body, Comparison, DurationConstraint, Expression, Fluent, Function, FunctionId, ObjectId,
    Problem, Schema, SchemaId, Term,
};
use elbowroom_num::Rational;

/// Gives each instance of a schema its own duration, computed by `value` from its name and the
/// planned duration: the domain's, or the expected one. Durations that the domain does not fix to a constant are not
/// changed.
pub fn set_durations(
    task: &Task,
    schema: SchemaId,
    problem: &mut Problem,
    value: &dyn Fn(&str, &Rational) -> Rational,
) {
    let Body::Durative { duration, .. } = &problem.schemas[schema.index()].body else {
        return;
    };
    let [
        DurationConstraint {
            comparison: Comparison::Equal,
            bound: Expression::Constant(planned),
            ..
        },
    ] = duration.as_slice()
    else {
        return;
    };
    let planned = planned.clone();
    let has_expected = task.has_expected_durations();
    let known = add_function_of(task, schema, "duration", problem, &|name, arguments| {
        let action = has_expected.then(|| task.instantiate(schema, arguments).ok());
        let expected = action.flatten().as_ref().and_then(fixed_duration);
        Some(value(name, expected.as_ref().unwrap_or(&planned)))
    });
    problem.expected_durations.is_included.insert(schema);
    if let Body::Durative { duration, .. } = &mut problem.schemas[schema.index()].body {
        duration[0].bound = known;
    }
}

/// Returns the duration of an action if it is fixed to a number.
pub(crate) fn fixed_duration(action: &Action) -> Option<Rational> {
    let [only] = action.durative()?.duration.as_slice() else {
        return None;
    };
    match (&only.comparison, &only.bound) {
        (Comparison::Equal, GroundExpression::Constant(value)) => Some(value.clone()),
        _ => None,
    }
}

/// Adds a function of the schema's parameters, with a value for each of its instances.
pub fn add_function_of(
    task: &Task,
    schema: SchemaId,
    what: &str,
    problem: &mut Problem,
    value: &dyn Fn(&str, &[ObjectId]) -> Option<Rational>,
) -> Expression {
    let lifted = problem.schemas[schema.index()].clone();
    let function = FunctionId::from(problem.functions.len());
    problem.functions.push(Function {
        // PDDL names have no spaces, so the name is unique.
        name: format!("{} {what}", lifted.name),
        parameters: lifted.parameters.clone(),
    });
    for arguments in instances(&lifted, problem) {
        let name = task.action_name(schema, &arguments);
        if let Some(value) = value(&name, &arguments) {
            problem.initial_values.push((function, arguments, value));
        }
    }
    Expression::Fluent(Fluent {
        function,
        arguments: (0..lifted.parameters.len()).map(Term::Variable).collect(),
    })
}

/// Returns all argument lists with matching types.
fn instances(schema: &Schema, problem: &Problem) -> Vec<Vec<ObjectId>> {
    let mut instances: Vec<Vec<ObjectId>> = vec![Vec::new()];
    for parameter in &schema.parameters {
        let objects: Vec<ObjectId> = problem.objects_of(&parameter.types).collect();
        instances = instances
            .iter()
            .flat_map(|instance| {
                objects.iter().map(move |object| {
                    let mut longer = instance.clone();
                    longer.push(*object);
                    longer
                })
            })
            .collect();
    }
    instances
}
