//! Value of the problem's metric at the end of a plan.

use elbowroom_num::Rational;

use super::Report;
use crate::Task;
use crate::problem::{Expression, ObjectId, Term};

impl Report {
    /// Returns the value of the problem's `:metric`, without a change of sign: with `maximize`,
    /// greater values are better. `total-time` is the makespan.
    ///
    /// Returns `None` if the problem has no metric, or one that reads a fluent without a final
    /// value, or counts violations that cannot be decided.
    pub fn metric(&self, task: &Task) -> Option<Rational> {
        let expression = &task.problem().metric.as_ref()?.expression;
        expression.evaluate(&mut |leaf| match leaf {
            Expression::TotalTime => Some(self.makespan.clone()),
            Expression::Violations(preference) => {
                let violations = self.preferences.violations(*preference)?;
                Some(Rational::from(i64::try_from(violations).ok()?))
            }
            Expression::Fluent(fluent) => {
                let objects = fluent.arguments.iter().map(|term| match term {
                    Term::Object(object) => Some(*object),
                    Term::Variable(_) => None,
                });
                let objects: Option<Vec<ObjectId>> = objects.collect();
                let fluent = task.find_fluent(fluent.function, &objects?)?;
                self.state.values.get(&fluent).cloned()
            }
            _ => None,
        })
    }
}
