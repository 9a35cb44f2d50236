//! Which names are declared, and what they stand for.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::problem::{FunctionId, ObjectId, PredicateId, SchemaId, TypeId};

/// The declared names, in lower case.
#[derive(Debug, Default)]
pub(super) struct Names {
    pub(super) types: BTreeMap<String, TypeId>,
    pub(super) objects: BTreeMap<String, ObjectId>,
    /// Predicates may share a name if they differ in the number of arguments.
    pub(super) predicates: BTreeMap<String, Vec<PredicateId>>,
    /// As for predicates.
    pub(super) functions: BTreeMap<String, Vec<FunctionId>>,
    /// Functions whose values are objects. They are refused where they are declared, so their
    /// uses need no further diagnostic.
    pub(super) object_functions: BTreeSet<String>,
    pub(super) schemas: BTreeMap<String, SchemaId>,
}
