//! Evaluation of terms under a binding of variables.

use crate::problem::{ObjectId, Term};

/// Returns the object that a term denotes.
pub(crate) fn resolve(term: Term, binding: &[ObjectId]) -> ObjectId {
    match term {
        Term::Variable(position) => binding[position],
        Term::Object(object) => object,
    }
}

/// Calls `action` with the objects that the terms denote.
pub(crate) fn with_arguments<R>(
    terms: &[Term],
    binding: &[ObjectId],
    action: impl FnOnce(&[ObjectId]) -> R,
) -> R {
    // Most predicates have at most six arguments; these need no allocation.
    let mut short = [ObjectId(0); 6];
    if let Some(short) = short.get_mut(..terms.len()) {
        for (place, &term) in short.iter_mut().zip(terms) {
            *place = resolve(term, binding);
        }
        action(short)
    } else {
        let long: Vec<_> = terms.iter().map(|&term| resolve(term, binding)).collect();
        action(&long)
    }
}
