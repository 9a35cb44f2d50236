//! Actions from which grounding removed parts that the validator still uses.

use std::collections::BTreeSet;

use elbowroom_model::Task;
use elbowroom_model::problem::{Change, FunctionId, PredicateId};
use elbowroom_model::reachability::Grounding;
use elbowroom_model::{ground, problem};

/// Returns the full form, as the validator uses it, of the actions from which grounding may have
/// removed a part that reads or writes a changing fact: a conditional effect that never happens, a
/// part of a disjunction that other parts decide, or an expression that is constant because such an
/// effect never happens. These parts still interfere.
///
/// Returns `None` if `may_continue` returned `false`.
pub(super) fn full_actions(
    task: &Task,
    grounding: &Grounding,
    may_continue: &mut dyn FnMut() -> bool,
) -> Option<Vec<Option<ground::Action>>> {
    let schemas = &task.problem().schemas;
    let perhaps = ConditionalWrites::of(schemas);
    let is_shortened: Vec<bool> = schemas
        .iter()
        .map(|schema| can_be_simplified(schema) || perhaps.is_read_by(schema))
        .collect();
    if !is_shortened.contains(&true) {
        return Some(Vec::new());
    }
    grounding
        .actions
        .iter()
        .map(|action| {
            if !is_shortened[action.schema.index()] {
                return Some(None);
            }
            // Instantiating an action with quantifiers can take a millisecond.
            let full = task.instantiate(action.schema, &action.arguments).ok();
            may_continue().then_some(full)
        })
        .collect()
}

/// Predicates and functions that conditional effects write.
#[derive(Default)]
struct ConditionalWrites {
    predicates: BTreeSet<PredicateId>,
    functions: BTreeSet<FunctionId>,
}

impl ConditionalWrites {
    fn of(schemas: &[problem::Schema]) -> Self {
        let mut perhaps = Self::default();
        for schema in schemas {
            let (first, second) = match &schema.body {
                problem::Body::Instantaneous { effects, .. } => (effects.as_slice(), &[][..]),
                problem::Body::Durative {
                    start_effects,
                    end_effects,
                    ..
                } => (start_effects.as_slice(), end_effects.as_slice()),
            };
            for effect in first.iter().chain(second).filter(|e| is_conditional(e)) {
                match &effect.change {
                    Change::Add(atom) | Change::Delete(atom) => {
                        perhaps.predicates.insert(atom.predicate);
                    }
                    Change::Update { fluent, .. } => {
                        perhaps.functions.insert(fluent.function);
                    }
                }
            }
        }
        perhaps
    }

    /// Returns `true` if the conditions at the start or end of an action read one of them.
    fn is_read_by(&self, schema: &problem::Schema) -> bool {
        if self.predicates.is_empty() && self.functions.is_empty() {
            return false;
        }
        match &schema.body {
            problem::Body::Instantaneous { condition, .. } => self.is_in(condition),
            problem::Body::Durative {
                at_start, at_end, ..
            } => self.is_in(at_start) || self.is_in(at_end),
        }
    }

    fn is_in(&self, condition: &problem::Condition) -> bool {
        use problem::Condition;
        match condition {
            Condition::Atom(atom) => self.predicates.contains(&atom.predicate),
            Condition::Equal(..) => false,
            Condition::Compare(_, left, right) => [left, right].iter().any(|side| {
                let mut is_in = false;
                side.visit_fluents(&mut |fluent| {
                    is_in |= self.functions.contains(&fluent.function);
                });
                is_in
            }),
            Condition::Not(part) | Condition::Forall(_, part) | Condition::Exists(_, part) => {
                self.is_in(part)
            }
            Condition::And(parts) | Condition::Or(parts) => {
                parts.iter().any(|part| self.is_in(part))
            }
        }
    }
}

fn is_conditional(effect: &problem::Effect) -> bool {
    let guard = &effect.guard;
    !(guard.at_start.is_trivial() && guard.over_all.is_trivial() && guard.now.is_trivial())
}

fn can_be_simplified(schema: &problem::Schema) -> bool {
    match &schema.body {
        problem::Body::Instantaneous { condition, effects } => {
            !is_conjunction(condition) || effects.iter().any(is_conditional)
        }
        problem::Body::Durative {
            at_start,
            at_end,
            start_effects,
            end_effects,
            continuous,
            ..
        } => {
            let mut effects = start_effects.iter().chain(end_effects);
            !is_conjunction(at_start)
                || !is_conjunction(at_end)
                || effects.any(is_conditional)
                || continuous
                    .iter()
                    .any(|effect| !effect.guard.at_start.is_trivial())
        }
    }
}

/// Returns `true` if only constants can be removed from the condition.
fn is_conjunction(condition: &problem::Condition) -> bool {
    match condition {
        problem::Condition::Atom(_)
        | problem::Condition::Equal(..)
        | problem::Condition::Compare(..) => true,
        problem::Condition::Not(part) => matches!(
            **part,
            problem::Condition::Atom(_) | problem::Condition::Equal(..)
        ),
        problem::Condition::And(parts) => parts.iter().all(is_conjunction),
        problem::Condition::Forall(_, part) => is_conjunction(part),
        problem::Condition::Or(_) | problem::Condition::Exists(..) => false,
    }
}
