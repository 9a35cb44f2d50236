//! Renumbering of variables.
//!
//! The guard of a conditional effect is read before the variables of `forall`s inside the effect
//! are known. In the model, these precede the variables that the guard itself binds.

use elbowroom_model::problem::{Atom, Condition, Expression, Fluent, Term};

/// Returns the condition with the variables from number `first` on increased by `by`.
pub(super) fn renumber_variables(condition: Condition, first: usize, by: usize) -> Condition {
    if by == 0 {
        return condition;
    }
    let each = |parts: Vec<Condition>| {
        parts
            .into_iter()
            .map(|part| renumber_variables(part, first, by))
            .collect()
    };
    match condition {
        Condition::Atom(atom) => Condition::Atom(Atom {
            arguments: shift_terms(atom.arguments, first, by),
            ..atom
        }),
        Condition::Equal(left, right) => {
            Condition::Equal(shift_term(left, first, by), shift_term(right, first, by))
        }
        Condition::Compare(comparison, left, right) => Condition::Compare(
            comparison,
            shift_expression(left, first, by),
            shift_expression(right, first, by),
        ),
        Condition::Not(part) => Condition::Not(Box::new(renumber_variables(*part, first, by))),
        Condition::And(parts) => Condition::And(each(parts)),
        Condition::Or(parts) => Condition::Or(each(parts)),
        Condition::Forall(variables, part) => {
            Condition::Forall(variables, Box::new(renumber_variables(*part, first, by)))
        }
        Condition::Exists(variables, part) => {
            Condition::Exists(variables, Box::new(renumber_variables(*part, first, by)))
        }
    }
}

fn shift_expression(expression: Expression, first: usize, by: usize) -> Expression {
    let each = |parts: Vec<Expression>| {
        parts
            .into_iter()
            .map(|part| shift_expression(part, first, by))
            .collect()
    };
    let one = |part: Box<Expression>| Box::new(shift_expression(*part, first, by));
    match expression {
        Expression::Fluent(fluent) => Expression::Fluent(Fluent {
            arguments: shift_terms(fluent.arguments, first, by),
            ..fluent
        }),
        Expression::Add(parts) => Expression::Add(each(parts)),
        Expression::Multiply(parts) => Expression::Multiply(each(parts)),
        Expression::Subtract(left, right) => Expression::Subtract(one(left), one(right)),
        Expression::Divide(left, right) => Expression::Divide(one(left), one(right)),
        Expression::Negate(part) => Expression::Negate(one(part)),
        leaf @ (Expression::Constant(_)
        | Expression::Duration
        | Expression::TotalTime
        | Expression::Violations(_)
        | Expression::Unknown(_)) => leaf,
    }
}

fn shift_terms(terms: Vec<Term>, first: usize, by: usize) -> Vec<Term> {
    terms
        .into_iter()
        .map(|term| shift_term(term, first, by))
        .collect()
}

fn shift_term(term: Term, first: usize, by: usize) -> Term {
    match term {
        Term::Variable(position) if position >= first => Term::Variable(position + by),
        other => other,
    }
}
