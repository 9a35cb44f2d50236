//! Instantiation of actions by schema and arguments.

use crate::ground;
use crate::grounder::NoKnowledge;
use crate::problem::{ObjectId, SchemaId};
use crate::task::Task;

/// Error in the instantiation of an action.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InstantiateError {
    /// The number of arguments is wrong.
    #[error("`{action}` takes {expected} arguments, not {found}")]
    ArgumentCount {
        /// The action's name.
        action: String,
        /// Expected number.
        expected: usize,
        /// Given number.
        found: usize,
    },
    /// An argument is not of the parameter's type.
    #[error("`{object}` cannot be bound to {variable} of `{action}`: it is not of type {expected}")]
    ArgumentType {
        /// The action's name.
        action: String,
        /// The parameter.
        variable: String,
        /// The given object.
        object: String,
        /// The expected type.
        expected: String,
    },
}

impl Task {
    /// Returns the ground action of a schema with these arguments.
    ///
    /// Nothing is simplified, so that a diagnosis can report each condition as written.
    ///
    /// # Errors
    /// When number or types of the arguments do not fit the schema.
    pub fn instantiate(
        &self,
        schema: SchemaId,
        arguments: &[ObjectId],
    ) -> Result<ground::Action, InstantiateError> {
        self.check_arguments(schema, arguments)?;
        Ok(self.grounding(|grounder| grounder.action(schema, arguments, &NoKnowledge)))
    }

    fn check_arguments(
        &self,
        schema: SchemaId,
        arguments: &[ObjectId],
    ) -> Result<(), InstantiateError> {
        let schema = &self.problem.schemas[schema.index()];
        if schema.parameters.len() != arguments.len() {
            return Err(InstantiateError::ArgumentCount {
                action: schema.name.clone(),
                expected: schema.parameters.len(),
                found: arguments.len(),
            });
        }
        for (variable, &object) in schema.parameters.iter().zip(arguments) {
            if !self.problem.has_type(object, &variable.types) {
                let names: Vec<_> = variable
                    .types
                    .iter()
                    .map(|id| self.problem.types[id.index()].name.as_str())
                    .collect();
                return Err(InstantiateError::ArgumentType {
                    action: schema.name.clone(),
                    variable: variable.name.clone(),
                    object: self.problem.objects[object.index()].name.clone(),
                    expected: names.join(" or "),
                });
            }
        }
        Ok(())
    }
}
