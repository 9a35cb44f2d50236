//! Check that likelihood files are complete.

use std::ops::Range;

use elbowroom_model::problem::{PredicateId, SchemaId};
use toml::de::DeTable;

use super::super::{PartialChange, is_changed, names};
use super::Reader;

impl Reader<'_> {
    /// Checks that there is an entry for each fact and each action.
    pub(super) fn check_complete(&mut self, document: &DeTable<'_>) {
        let section = |name: &str| {
            let entry = document.iter().find(|(key, _)| key.get_ref() == name);
            entry.map_or(0..0, |(key, _)| key.span())
        };
        for (index, predicate) in self.problem.predicates.iter().enumerate() {
            let id = PredicateId::from(index);
            let is_mentioned = self.likelihoods.predicates.contains_key(&id)
                || self.likelihoods.facts.keys().any(|(p, _)| *p == id);
            if predicate.is_derived {
                continue;
            }
            if !is_mentioned && !is_changed(self.problem, id) {
                // A fact that nothing changes, and that is not mentioned, never changes by itself.
                let never = PartialChange::NEVER;
                self.likelihoods.predicates.insert(id, never);
                continue;
            }
            let all = self.likelihoods.predicates.get(&id).copied();
            let all = all.unwrap_or_default();
            let defaults = &self.likelihoods.defaults;
            if all.becomes_true.or(defaults.becomes_true).is_some()
                && all.becomes_false.or(defaults.becomes_false).is_some()
            {
                continue;
            }
            let mut missing = None;
            // Stops at the first tuple that is not listed, so the time is proportional to the
            // length of the list.
            names::for_each_tuple(self.problem, &predicate.parameters, &mut |tuple| {
                if self.likelihoods.spontaneous_change_of(id, tuple).is_none() {
                    missing = Some(self.problem.apply_name(&predicate.name, tuple));
                }
                missing.is_none()
            });
            if let Some(fact) = missing {
                self.mistakes.mistake(
                    section("facts"),
                    format!("the file does not define how {fact} changes by itself"),
                    format!(
                        "give `becomes_true` and `becomes_false` in [facts.{}], or in [defaults]",
                        predicate.name
                    ),
                );
            }
        }
        for (index, schema) in self.problem.schemas.iter().enumerate() {
            self.check_action(SchemaId::from(index), schema, &section("actions"));
        }
    }

    fn check_action(
        &mut self,
        id: SchemaId,
        schema: &elbowroom_model::problem::Schema,
        section: &Range<usize>,
    ) {
        let affected = names::affected(self.problem, id);
        if self.likelihoods.is_complete_for(id, &affected) {
            return;
        }
        let mut missing = None;
        names::for_each_tuple(self.problem, &schema.parameters, &mut |tuple| {
            if self.likelihoods.start_of(id, tuple).is_none() {
                let name = self.problem.apply_name(&schema.name, tuple);
                missing = Some(format!("how likely {name} is to start"));
            }
            for &(predicate, makes_true) in &affected {
                let effect = self.likelihoods.effect_of(id, tuple, predicate, makes_true);
                if missing.is_none() && effect.is_none() {
                    let name = self.problem.apply_name(&schema.name, tuple);
                    let predicate = &self.problem.predicates[predicate.index()].name;
                    missing = Some(format!("how likely the effect of {name} on {predicate} is"));
                }
            }
            missing.is_none()
        });
        if let Some(missing) = missing {
            self.mistakes.mistake(
                section.clone(),
                format!("the file does not define {missing}"),
                format!(
                    "give `start` and `effect` in [actions.{}], or in [defaults]",
                    schema.name
                ),
            );
        }
    }
}
