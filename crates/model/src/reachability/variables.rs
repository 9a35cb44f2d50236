//! Variables that conditions read.

use crate::problem::{Condition, Expression, Term};

/// Marks each variable read. Variables that inner quantifiers bind have positions beyond the end of
/// `read` and are not marked.
pub(super) fn of_condition(condition: &Condition, read: &mut [bool]) {
    match condition {
        Condition::Atom(atom) => of_terms(&atom.arguments, read),
        Condition::Equal(left, right) => of_terms(&[*left, *right], read),
        Condition::Compare(_, left, right) => {
            of_expression(left, read);
            of_expression(right, read);
        }
        Condition::Not(part) | Condition::Forall(_, part) | Condition::Exists(_, part) => {
            of_condition(part, read);
        }
        Condition::And(parts) | Condition::Or(parts) => {
            for part in parts {
                of_condition(part, read);
            }
        }
    }
}

/// Marks each variable read.
pub(super) fn of_expression(expression: &Expression, read: &mut [bool]) {
    expression.visit_fluents(&mut |fluent| of_terms(&fluent.arguments, read));
}

fn of_terms(terms: &[Term], read: &mut [bool]) {
    for term in terms {
        if let Term::Variable(position) = *term
            && let Some(is_read) = read.get_mut(position)
        {
            *is_read = true;
        }
    }
}
