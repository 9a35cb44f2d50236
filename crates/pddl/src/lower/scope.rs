//! What can be named at one place of a text.

use std::collections::BTreeMap;

use elbowroom_model::problem::{Term, Unknown, Variable};

use crate::lower::constraints::Soft;

/// The names that mean something inside an action, a rule, a goal.
#[derive(Debug, Default)]
pub(super) struct Scope {
    /// Parameters, then the variables of enclosing quantifiers; the order that
    /// [`Term::Variable`] counts in.
    pub(super) variables: Vec<Variable>,
    /// `:synth-parameters` and `:control` parameters of the action.
    pub(super) unknowns: Vec<String>,
    /// Which of the unknowns are `:control` parameters.
    pub(super) controls: Vec<u32>,
    /// The values of object functions that stand as arguments, by the place of the application:
    /// which variable has the value.
    pub(super) values: BTreeMap<(usize, usize), usize>,
    /// Whether `?duration` means something.
    pub(super) has_duration: bool,
    /// Whether `total-time` means something.
    pub(super) has_total_time: bool,
    /// How many enclosing forms are such that leaving out a preference would change what must
    /// hold.
    pub(super) without_preferences: usize,
    /// How many of the variables are parameters of the action.
    pub(super) parameters: usize,
    /// The preferences found.
    pub(super) soft: Vec<Soft>,
}

impl Scope {
    /// The innermost variable of that name (in lower case).
    pub(super) fn variable(&self, name: &str) -> Option<(Term, &Variable)> {
        let position = self.variables.iter().rposition(|v| v.name == name)?;
        Some((Term::Variable(position), &self.variables[position]))
    }

    /// The action's unknown of that name (in lower case).
    pub(super) fn unknown(&self, name: &str) -> Option<Unknown> {
        position(&self.unknowns, name).map(Unknown::Action)
    }
}

/// Where the name stands in a list of unknowns.
pub(super) fn position(names: &[String], name: &str) -> Option<u32> {
    let position = names.iter().position(|own| own == name)?;
    u32::try_from(position).ok()
}
