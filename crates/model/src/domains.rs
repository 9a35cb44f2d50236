//! Ranges of variables.

use std::borrow::Cow;

use crate::problem::{ObjectId, Problem, TypeId};

/// The objects of each type, subtypes included, in order of declaration.
#[derive(Clone, Debug)]
pub(crate) struct Domains {
    by_type: Vec<Vec<ObjectId>>,
}

impl Domains {
    pub(crate) fn of(problem: &Problem) -> Self {
        let by_type = (0..problem.types.len())
            .map(|index| problem.objects_of(&[TypeId::from(index)]).collect())
            .collect();
        Self { by_type }
    }

    /// Returns the objects of any of the types, in order of declaration.
    pub(crate) fn objects(&self, types: &[TypeId]) -> Cow<'_, [ObjectId]> {
        match types {
            [] => Cow::Borrowed(&[]),
            [only] => Cow::Borrowed(&self.by_type[only.index()]),
            several => {
                let mut union: Vec<ObjectId> = several
                    .iter()
                    .flat_map(|id| &self.by_type[id.index()])
                    .copied()
                    .collect();
                union.sort_unstable();
                union.dedup();
                Cow::Owned(union)
            }
        }
    }
}
