//! Names that are in scope at a position of a text.

use std::collections::BTreeMap;

use elbowroom_model::problem::{Term, Unknown, Variable};

use crate::lower::constraints::FoundPreference;

/// The names that are in scope inside an action, a rule or a goal.
#[derive(Debug, Default)]
pub(super) struct Scope {
    /// Parameters, then the variables of enclosing quantifiers, in the order of the indices of
    /// [`Term::Variable`].
    pub(super) variables: Vec<Variable>,
    /// `:synth-parameters` and `:control` parameters of the action.
    pub(super) unknowns: Vec<String>,
    /// Indices of the unknowns that are `:control` parameters.
    pub(super) controls: Vec<u32>,
    /// Index of the variable for each object function value that is used as an argument, by the
    /// position of the application.
    pub(super) values: BTreeMap<(usize, usize), usize>,
    /// `true` if `?duration` is in scope.
    pub(super) has_duration: bool,
    /// `true` if `total-time` is in scope.
    pub(super) has_total_time: bool,
    /// Number of enclosing forms in which ignoring a preference would change the hard conditions.
    pub(super) without_preferences: usize,
    /// Number of variables that are parameters of the action.
    pub(super) parameters: usize,
    /// The preferences found.
    pub(super) soft: Vec<FoundPreference>,
}

impl Scope {
    /// Returns the innermost variable of that name (in lower case).
    pub(super) fn variable(&self, name: &str) -> Option<(Term, &Variable)> {
        let position = self.variables.iter().rposition(|v| v.name == name)?;
        Some((Term::Variable(position), &self.variables[position]))
    }

    /// Returns the action's unknown of that name (in lower case).
    pub(super) fn unknown(&self, name: &str) -> Option<Unknown> {
        position(&self.unknowns, name).map(Unknown::Action)
    }
}

/// Returns the index of the name in a list of unknowns.
pub(super) fn position(names: &[String], name: &str) -> Option<u32> {
    let position = names.iter().position(|own| own == name)?;
    u32::try_from(position).ok()
}
