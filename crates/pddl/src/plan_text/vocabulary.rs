//! Names of the actions and objects of a task, as plans may write them.

use std::collections::BTreeMap;

use elbowroom_model::Task;
use elbowroom_model::problem::{ObjectId, SchemaId};

/// Names of actions and objects, in lower case.
pub(super) struct Vocabulary {
    pub(super) schemas: BTreeMap<String, SchemaId>,
    pub(super) objects: BTreeMap<String, ObjectId>,
    /// Number of parameters of each action.
    parameters: Vec<usize>,
}

impl Vocabulary {
    pub(super) fn of(task: &Task) -> Self {
        let problem = task.problem();
        let schemas = problem.schemas.iter().enumerate();
        let objects = problem.objects.iter().enumerate();
        Self {
            schemas: schemas
                .map(|(index, it)| (it.name.to_ascii_lowercase(), SchemaId::from(index)))
                .collect(),
            objects: objects
                .map(|(index, it)| (it.name.to_ascii_lowercase(), ObjectId::from(index)))
                .collect(),
            parameters: problem
                .schemas
                .iter()
                .map(|it| it.parameters.len())
                .collect(),
        }
    }

    pub(super) fn schema(&self, word: &str) -> Option<SchemaId> {
        self.schemas.get(&word.to_ascii_lowercase()).copied()
    }

    pub(super) fn object(&self, word: &str) -> Option<ObjectId> {
        self.objects.get(&word.to_ascii_lowercase()).copied()
    }

    /// Number of parameters of the action with this name, `None` if there is no such action.
    pub(super) fn parameters(&self, word: &str) -> Option<usize> {
        let schema = self.schema(word)?;
        self.parameters.get(schema.index()).copied()
    }
}
