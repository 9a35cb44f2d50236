//! What a metric is worth at the end of a plan.

use elbowroom_model::Task;
use elbowroom_model::problem::{Expression, ObjectId, Term};
use elbowroom_model::validate::Report;
use elbowroom_num::Rational;

/// The value of a metric's expression, if it has one.
pub(crate) fn metric_value(
    task: &Task,
    expression: &Expression,
    report: &Report,
) -> Option<Rational> {
    expression.evaluate(&mut |leaf| match leaf {
        Expression::TotalTime => Some(report.makespan.clone()),
        Expression::Fluent(fluent) => {
            let objects = fluent.arguments.iter().map(|term| match term {
                Term::Object(object) => Some(*object),
                Term::Variable(_) => None,
            });
            let objects: Option<Vec<ObjectId>> = objects.collect();
            let fluent = task.find_fluent(fluent.function, &objects?)?;
            report.state.values.get(&fluent).cloned()
        }
        _ => None,
    })
}
