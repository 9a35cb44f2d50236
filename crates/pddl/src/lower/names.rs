//! The declared names and their meanings.

use std::collections::BTreeMap;

use elbowroom_model::Problem;
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
    /// Functions whose values are objects, as the predicates that represent them. Like other
    /// functions, several of them may have the same name.
    pub(super) object_functions: BTreeMap<String, Vec<PredicateId>>,
    pub(super) schemas: BTreeMap<String, SchemaId>,
}

impl Names {
    /// Returns the names of a problem that was read before.
    pub(super) fn of(problem: &Problem) -> Self {
        let mut names = Self::default();
        for (id, named) in (0..).zip(&problem.types) {
            names.types.insert(named.name.clone(), TypeId(id));
        }
        for (id, named) in (0..).zip(&problem.objects) {
            names.objects.insert(named.name.clone(), ObjectId(id));
        }
        for (id, named) in (0..).zip(&problem.predicates) {
            let is_function = problem.object_functions.contains(&PredicateId(id));
            let list = if is_function {
                &mut names.object_functions
            } else {
                &mut names.predicates
            };
            list.entry(named.name.clone())
                .or_default()
                .push(PredicateId(id));
        }
        for (id, named) in (0..).zip(&problem.functions) {
            let same = names.functions.entry(named.name.clone()).or_default();
            same.push(FunctionId(id));
        }
        for (id, named) in (0..).zip(&problem.schemas) {
            names.schemas.insert(named.name.clone(), SchemaId(id));
        }
        names
    }
}
