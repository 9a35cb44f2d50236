//! Terms under a binding of their variables.

use crate::problem::{ObjectId, Term};

/// The object that a term stands for.
pub(crate) fn resolve(term: Term, binding: &[ObjectId]) -> ObjectId {
    match term {
        Term::Variable(position) => binding[position],
        Term::Object(object) => object,
    }
}

/// Calls `action` with the objects that the terms stand for.
pub(crate) fn with_arguments<R>(
    terms: &[Term],
    binding: &[ObjectId],
    action: impl FnOnce(&[ObjectId]) -> R,
) -> R {
    // Nearly all predicates are this short; then nothing is allocated.
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
