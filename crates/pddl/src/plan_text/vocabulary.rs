//! Names of the actions and objects of a task, in the forms that plans may use.

use std::collections::BTreeMap;

use elbowroom_model::Task;
use elbowroom_model::problem::{ObjectId, SchemaId};

/// Maximum number of parts into which words are split.
const MAX_PARTS: usize = 32;

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

    /// Returns the number of parameters of the action with this name, or `None` if there is no such
    /// action.
    pub(super) fn parameters(&self, word: &str) -> Option<usize> {
        let schema = self.schema(word)?;
        self.parameters.get(schema.index()).copied()
    }

    /// Returns `true` for the name of an action joined with objects: `pick_o1`. With `may_be_numbered`, numbers, `start`
    /// and `end` alone are enough: `pick-1`, `pick_start`.
    pub(super) fn is_joined(&self, word: &str, may_be_numbered: bool) -> bool {
        let is_joint = |c: char| "_-+.@/".contains(c);
        let mut ends = word.match_indices(is_joint).map(|(at, _)| at);
        let Some(first) = ends.find(|&at| self.schema(&word[..at]).is_some()) else {
            return false;
        };
        // From the left, the places at which a part may begin.
        let rest = &word[first + 1..];
        if !may_be_numbered && rest.split(is_joint).all(is_counted) {
            return false;
        }
        let ends: Vec<usize> = rest
            .match_indices(is_joint)
            .map(|(at, _)| at)
            .chain([rest.len()])
            .collect();
        if ends.len() > MAX_PARTS {
            return false;
        }
        let mut begins = vec![0];
        for &end in &ends {
            let is_part = |&begin: &usize| begin <= end && self.is_part(&rest[begin..end]);
            if begins.iter().any(is_part) {
                begins.push(end + 1);
            }
        }
        begins.last() == Some(&(rest.len() + 1))
    }

    /// Returns `true` for an object, a number, `start` or `end`.
    fn is_part(&self, word: &str) -> bool {
        is_counted(word) || self.object(word).is_some()
    }
}

/// Returns `true` for a number, `start` or `end`.
fn is_counted(word: &str) -> bool {
    matches!(word.to_ascii_lowercase().as_str(), "start" | "end")
        || word.bytes().all(|byte| byte.is_ascii_digit())
}
