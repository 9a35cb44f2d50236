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
    let value = |part: &Expression| metric_value(task, part, report);
    Some(match expression {
        Expression::Constant(value) => value.clone(),
        Expression::TotalTime => report.makespan.clone(),
        Expression::Fluent(fluent) => {
            let objects = fluent.arguments.iter().map(|term| match term {
                Term::Object(object) => Some(*object),
                Term::Variable(_) => None,
            });
            let objects: Option<Vec<ObjectId>> = objects.collect();
            let fluent = task.find_fluent(fluent.function, &objects?)?;
            report.state.values.get(&fluent)?.clone()
        }
        Expression::Duration | Expression::Unknown(_) => return None,
        Expression::Add(parts) => {
            let mut sum = Rational::ZERO;
            for part in parts {
                sum += value(part)?;
            }
            sum
        }
        Expression::Multiply(parts) => {
            let mut product = Rational::ONE;
            for part in parts {
                product *= value(part)?;
            }
            product
        }
        Expression::Subtract(left, right) => value(left)? - value(right)?,
        Expression::Divide(left, right) => value(left)?.checked_div(&value(right)?)?,
        Expression::Negate(part) => -value(part)?,
    })
}
