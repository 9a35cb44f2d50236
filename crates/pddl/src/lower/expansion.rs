//! Size of conditions and effects after the expansion of quantifiers.
//!
//! The model expands quantifiers over objects. A few nested quantifiers over many objects would
//! exhaust the memory, so they are refused here, where the text can be shown.

use std::collections::BTreeMap;

use elbowroom_model::Problem;
use elbowroom_model::problem::{Body, Condition, Constraint, Effect, Guard, TypeId, Variable};

use crate::lower::Reader;
use crate::source::Span;

/// Maximum number of parts of one condition, or of the effects of one action, after expansion.
const MAX_PARTS: u64 = 10_000_000;

/// Counter of the parts after expansion.
struct Sizes<'a> {
    problem: &'a Problem,
    /// Number of objects for each set of types.
    objects: BTreeMap<&'a [TypeId], u64>,
}

impl Reader {
    /// Reports conditions and effects that are too large when expanded. Objects must have been
    /// read.
    pub(super) fn check_expansion(&mut self, goal: Option<Span>) {
        let problem = &self.problem;
        let mut sizes = Sizes {
            problem,
            objects: BTreeMap::new(),
        };
        let mut too_large: Vec<(Span, String)> = Vec::new();
        let mut check = |size: u64, span: Span, what: String| {
            if size > MAX_PARTS {
                too_large.push((span, what));
            }
        };
        if let Some(span) = goal {
            check(
                sizes.of_condition(&problem.goal),
                span,
                "the goal".to_owned(),
            );
        }
        for (rule, span) in problem.rules.iter().zip(&self.rule_spans) {
            let name = &problem.predicates[rule.predicate.index()].name;
            let size = sizes.of_condition(&rule.body);
            check(size, *span, format!("this rule of `{name}`"));
        }
        for (schema, span) in problem.schemas.iter().zip(&self.schema_spans) {
            let size = sizes.of_body(&schema.body);
            check(size, *span, format!("action `{}`", schema.name));
        }
        for (process, span) in problem.processes.iter().zip(&self.process_spans) {
            let size = process.effects.iter().fold(1, |size, effect| {
                sizes
                    .of_guarded(&effect.variables, &effect.guard)
                    .saturating_add(size)
            });
            let size = size
                .saturating_add(sizes.of_condition(&process.condition))
                .saturating_mul(sizes.combinations(&process.parameters));
            check(size, *span, format!("process `{}`", process.name));
        }
        for (event, span) in problem.events.iter().zip(&self.event_spans) {
            let size = sizes
                .of_effects(&event.effects)
                .saturating_add(sizes.of_condition(&event.condition))
                .saturating_mul(sizes.combinations(&event.parameters));
            check(size, *span, format!("event `{}`", event.name));
        }
        for (constraint, span) in problem.constraints.iter().zip(&self.constraint_spans) {
            check(
                sizes.of_constraint(constraint),
                *span,
                "a constraint".to_owned(),
            );
        }
        for preference in &problem.action_preferences {
            let position = preference.schema.index();
            let Some(span) = self.schema_spans.get(position) else {
                continue;
            };
            let parts = [
                &preference.at_start,
                &preference.over_all,
                &preference.at_end,
            ];
            let size = parts.into_iter().fold(0_u64, |size, part| {
                size.saturating_add(sizes.of_condition(part))
            });
            let size = size.saturating_mul(sizes.combinations(&preference.variables));
            let name = &problem.schemas[position].name;
            check(size, *span, format!("a preference of action `{name}`"));
        }
        for (span, what) in too_large {
            self.report
                .error(span, format!("{what} has more than {MAX_PARTS} parts"))
                .label("when its quantifiers are expanded")
                .advise("use fewer nested quantifiers, or narrower types");
        }
    }
}

impl<'a> Sizes<'a> {
    fn of_body(&mut self, body: &'a Body) -> u64 {
        match body {
            Body::Instantaneous { condition, effects } => self
                .of_condition(condition)
                .saturating_add(self.of_effects(effects)),
            Body::Durative {
                at_start,
                over_all,
                at_end,
                start_effects,
                end_effects,
                continuous,
                ..
            } => {
                let mut size = 0_u64;
                for condition in [at_start, over_all, at_end] {
                    size = size.saturating_add(self.of_condition(condition));
                }
                for effects in [start_effects, end_effects] {
                    size = size.saturating_add(self.of_effects(effects));
                }
                for effect in continuous {
                    size = size.saturating_add(self.of_guarded(&effect.variables, &effect.guard));
                }
                size
            }
        }
    }

    fn of_effects(&mut self, effects: &'a [Effect]) -> u64 {
        effects.iter().fold(0, |size, effect| {
            size.saturating_add(self.of_guarded(&effect.variables, &effect.guard))
        })
    }

    fn of_guarded(&mut self, variables: &'a [Variable], guard: &'a Guard) -> u64 {
        let mut size = 1_u64;
        for part in [&guard.at_start, &guard.over_all, &guard.now] {
            size = size.saturating_add(self.of_condition(part));
        }
        size.saturating_mul(self.combinations(variables))
    }

    fn of_constraint(&mut self, constraint: &'a Constraint) -> u64 {
        match constraint {
            Constraint::Modal(modal) => modal
                .conditions()
                .into_iter()
                .fold(1, |size, part| size.saturating_add(self.of_condition(part))),
            Constraint::And(parts) => parts.iter().fold(0, |size, part| {
                size.saturating_add(self.of_constraint(part))
            }),
            Constraint::Forall(variables, part) => self
                .of_constraint(part)
                .saturating_mul(self.combinations(variables)),
            Constraint::Preference(_, part) => self.of_constraint(part),
        }
    }

    fn of_condition(&mut self, condition: &'a Condition) -> u64 {
        match condition {
            Condition::Atom(_) | Condition::Equal(..) | Condition::Compare(..) => 1,
            Condition::Not(part) => self.of_condition(part),
            Condition::And(parts) | Condition::Or(parts) => parts
                .iter()
                .fold(0, |size, part| size.saturating_add(self.of_condition(part))),
            Condition::Forall(variables, part) | Condition::Exists(variables, part) => self
                .of_condition(part)
                .saturating_mul(self.combinations(variables)),
        }
    }

    /// Returns the number of ways to choose objects for the variables.
    fn combinations(&mut self, variables: &'a [Variable]) -> u64 {
        let problem = self.problem;
        variables.iter().fold(1, |product: u64, variable| {
            let types = variable.types.as_slice();
            let objects = self.objects.entry(types).or_insert_with(|| {
                u64::try_from(problem.objects_of(types).count()).unwrap_or(u64::MAX)
            });
            product.saturating_mul(*objects)
        })
    }
}
