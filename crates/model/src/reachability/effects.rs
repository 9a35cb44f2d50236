//! Effects of reached actions.

use std::ops::ControlFlow;

use crate::problem::{Body, Guard, ObjectId, SchemaId, Term, Variable};
use crate::terms::with_arguments;

use super::event::{Event, Symbol};
use super::fixpoint::Fixpoint;
use super::watch_lists::Pending;
use super::writes;

/// An effect: its schema, one of the schema's lists, and its position in the list.
#[derive(Clone, Copy, Debug)]
pub(super) struct EffectId {
    schema: SchemaId,
    list: List,
    position: usize,
}

/// The lists of effects of a schema. An instantaneous action has only start effects.
#[derive(Clone, Copy, Debug)]
pub(super) enum List {
    Start,
    Continuous,
    End,
}

/// The common form of discrete and continuous effects.
struct Effect<'a> {
    variables: &'a [Variable],
    guard: &'a Guard,
    symbol: Symbol,
    terms: &'a [Term],
}

impl List {
    fn len(self, body: &Body) -> usize {
        match (self, body) {
            (Self::Start, Body::Instantaneous { effects, .. }) => effects.len(),
            (Self::Start, Body::Durative { start_effects, .. }) => start_effects.len(),
            (Self::Continuous, Body::Durative { continuous, .. }) => continuous.len(),
            (Self::End, Body::Durative { end_effects, .. }) => end_effects.len(),
            (Self::Continuous | Self::End, Body::Instantaneous { .. }) => 0,
        }
    }

    fn get(self, body: &Body, position: usize) -> Effect<'_> {
        let effects = match (self, body) {
            (Self::Continuous, Body::Durative { continuous, .. }) => {
                let effect = &continuous[position];
                return Effect {
                    variables: &effect.variables,
                    guard: &effect.guard,
                    symbol: Symbol::Changed(effect.fluent.function),
                    terms: &effect.fluent.arguments,
                };
            }
            (Self::End, Body::Durative { end_effects, .. }) => end_effects,
            (_, Body::Durative { start_effects, .. }) => start_effects,
            (_, Body::Instantaneous { effects, .. }) => effects,
        };
        let effect = &effects[position];
        Effect {
            variables: &effect.variables,
            guard: &effect.guard,
            symbol: writes::symbol_of(&effect.change),
            terms: writes::terms_of(&effect.change),
        }
    }
}

impl Fixpoint<'_, '_> {
    /// Applies all effects of the list that are possible now; the others are queued.
    pub(super) fn apply_effects(
        &mut self,
        schema: SchemaId,
        list: List,
        binding: &mut Vec<ObjectId>,
    ) -> ControlFlow<()> {
        let problem = self.relaxation().problem;
        let body = &problem.schemas[schema.index()].body;
        for position in 0..list.len(body) {
            let id = EffectId {
                schema,
                list,
                position,
            };
            self.apply_effect(id, list.get(body, position).variables, binding)?;
        }
        ControlFlow::Continue(())
    }

    /// Applies the effect for all objects of the variables.
    fn apply_effect(
        &mut self,
        id: EffectId,
        variables: &[Variable],
        binding: &mut Vec<ObjectId>,
    ) -> ControlFlow<()> {
        let Some((first, rest)) = variables.split_first() else {
            let blockers = self.try_effect(id, binding)?;
            let pending = |binding: &[ObjectId]| Pending::Effect(id, binding.into());
            return self.watch_for(blockers, || pending(binding));
        };
        let domains = self.relaxation().domains;
        for &object in &*domains.objects(&first.types) {
            binding.push(object);
            self.apply_effect(id, rest, binding)?;
            binding.pop();
        }
        ControlFlow::Continue(())
    }

    /// Applies the effect if it is possible. Otherwise returns the events that it waits for.
    pub(super) fn try_effect(
        &mut self,
        id: EffectId,
        binding: &mut Vec<ObjectId>,
    ) -> ControlFlow<(), Vec<Event>> {
        self.count_step()?;
        let relaxation = self.relaxation();
        let body = &relaxation.problem.schemas[id.schema.index()].body;
        let effect = id.list.get(body, id.position);
        let guard = effect.guard;
        let mut blockers = Vec::new();
        let is_possible = [&guard.at_start, &guard.over_all, &guard.now]
            .into_iter()
            .all(|part| relaxation.is_possible(part, true, binding, &mut blockers));
        if is_possible {
            with_arguments(effect.terms, binding, |arguments| {
                self.add_event(effect.symbol, arguments);
            });
        }
        ControlFlow::Continue(blockers)
    }
}
