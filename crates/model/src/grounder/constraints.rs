//! Constraints and preferences without variables.

use elbowroom_num::Rational;

use super::Grounder;
use crate::constraint::{ActionPreference, Constraint, Constraints, Modal, SoftConstraint};
use crate::ground::{self, FactId, FluentId};
use crate::problem::{ObjectId, PreferenceId};
use crate::simplify::Constants;

/// No knowledge of constant facts or values.
struct NoStaticKnowledge;

impl Constants for NoStaticKnowledge {
    fn truth(&mut self, _: FactId) -> Option<bool> {
        None
    }

    fn value(&mut self, _: FluentId) -> Option<Rational> {
        None
    }
}

/// An instance of a preference among an action's conditions.
#[derive(Clone, Debug)]
pub(crate) struct SoftCondition {
    pub(crate) preference: PreferenceId,
    pub(crate) at_start: ground::Condition,
    pub(crate) over_all: ground::Condition,
    pub(crate) at_end: ground::Condition,
}

impl Grounder<'_> {
    /// Grounds all constraints of the problem, including goal preferences.
    pub(crate) fn constraints(&mut self) -> Constraints {
        let problem = self.problem;
        let mut ground = Constraints::default();
        for constraint in &problem.constraints {
            self.constraint(constraint, &mut Vec::new(), &mut ground);
        }
        ground
    }

    fn constraint(
        &mut self,
        constraint: &Constraint,
        binding: &mut Vec<ObjectId>,
        ground: &mut Constraints,
    ) {
        match constraint {
            Constraint::Modal(modal) => {
                let modal = self.modal(modal, binding);
                // Comparisons of objects make many instances trivial.
                let is_kept = matches!(&modal, Modal::Always(c) if c.is_trivial());
                if !is_kept {
                    ground.hard.push(modal);
                }
            }
            Constraint::And(parts) => {
                for part in parts {
                    self.constraint(part, binding, ground);
                }
            }
            Constraint::Forall(variables, part) => {
                self.for_all(variables, binding, &mut |grounder, binding| {
                    grounder.constraint(part, binding, ground);
                });
            }
            Constraint::Preference(preference, part) => {
                let mut inner = Constraints::default();
                self.constraint(part, binding, &mut inner);
                ground.soft.push(SoftConstraint {
                    preference: *preference,
                    all: inner.hard,
                });
            }
        }
    }

    fn modal(
        &mut self,
        modal: &Modal<crate::problem::Condition>,
        binding: &mut Vec<ObjectId>,
    ) -> Modal<ground::Condition> {
        modal.map(|condition| {
            let ground = self.ground_condition(condition, binding);
            ground.simplified(&mut NoStaticKnowledge)
        })
    }

    /// Returns the instances of a preference for an action with these arguments.
    pub(crate) fn action_preference(
        &mut self,
        preference: &ActionPreference,
        arguments: &[ObjectId],
        found: &mut Vec<SoftCondition>,
    ) {
        let mut binding = arguments.to_vec();
        self.for_all(
            &preference.variables,
            &mut binding,
            &mut |grounder, binding| {
                found.push(SoftCondition {
                    preference: preference.preference,
                    at_start: grounder.ground_condition(&preference.at_start, binding),
                    over_all: grounder.ground_condition(&preference.over_all, binding),
                    at_end: grounder.ground_condition(&preference.at_end, binding),
                });
            },
        );
    }
}
