//! The least fixpoint: instances that can start, instances that can end, and the effects of both,
//! until no new events are found.
//!
//! Each event is processed once, in the order of discovery. It triggers the joins of the rules that
//! it matches, and retries entries that waited for it: bindings whose tests were not yet possible,
//! started actions that could not yet end, and conditional effects.

use std::collections::BTreeSet;
use std::ops::ControlFlow;

use crate::problem::{Body, ObjectId, PredicateId, SchemaId};

use super::Settings;
use super::effects::List;
use super::event::{Event, Symbol};
use super::join::{Trigger, join};
use super::relaxation::Relaxation;
use super::rule::{Head, Rule};
use super::watch_lists::{EntryId, Pending, WatchLists};
use crate::hash::Set;

/// Objects for a schema's parameters.
pub(super) type Arguments = Box<[ObjectId]>;

/// The reachable atoms and values.
pub(super) struct Reachable<'a> {
    pub(super) relaxation: Relaxation<'a>,
    /// Arguments of the instances that can start, by schema.
    pub(super) instances: Vec<Set<Arguments>>,
    /// For each of these instances, `true` if it can also end.
    pub(super) can_end: Vec<Vec<bool>>,
}

/// Computes the fixpoint without the `banned` instances (for each schema). Returns `None` if a
/// limit was reached. `count` is called for each step, and breaks at the step limit.
pub(super) fn fixpoint<'a>(
    relaxation: Relaxation<'a>,
    rules: &[Rule<'a>],
    banned: &[BTreeSet<Arguments>],
    settings: &Settings,
    count: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<Reachable<'a>> {
    let mut fixpoint = Fixpoint::new(relaxation, rules, banned, settings, count);
    match fixpoint.run() {
        ControlFlow::Continue(()) => Some(fixpoint.reachable),
        ControlFlow::Break(()) => None,
    }
}

/// State of the computation. Its methods break when a limit is reached.
pub(super) struct Fixpoint<'f, 'a> {
    reachable: Reachable<'a>,
    rules: &'f [Rule<'a>],
    excluded: &'f [BTreeSet<Arguments>],
    /// Number of further instances that may be found.
    remaining_instances: usize,
    count: &'f mut dyn FnMut() -> ControlFlow<()>,
    /// For each predicate, the rule atoms that match its facts, without static atoms.
    triggers: Vec<Vec<(usize, usize)>>,
    waiting: WatchLists,
}

impl<'f, 'a> Fixpoint<'f, 'a> {
    fn new(
        relaxation: Relaxation<'a>,
        rules: &'f [Rule<'a>],
        banned: &'f [BTreeSet<Arguments>],
        settings: &Settings,
        count: &'f mut dyn FnMut() -> ControlFlow<()>,
    ) -> Self {
        let mut triggers = vec![Vec::new(); relaxation.problem.predicates.len()];
        for (index, rule) in rules.iter().enumerate() {
            for (position, atom) in rule.atoms.iter().enumerate() {
                if !atom.is_static {
                    triggers[atom.predicate.index()].push((index, position));
                }
            }
        }
        let schema_count = relaxation.problem.schemas.len();
        Self {
            reachable: Reachable {
                relaxation,
                instances: vec![Set::default(); schema_count],
                can_end: vec![Vec::new(); schema_count],
            },
            rules,
            excluded: banned,
            remaining_instances: settings.action_limit,
            count,
            triggers,
            waiting: WatchLists::new(settings.action_limit),
        }
    }

    fn run(&mut self) -> ControlFlow<()> {
        for (index, rule) in self.rules.iter().enumerate() {
            if rule.atoms.iter().all(|atom| atom.is_static) {
                self.apply(index, None)?;
            }
        }
        let mut position = 0;
        while let Some(event) = self.reachable.relaxation.reached.get(position) {
            let symbol = event.symbol;
            for ticket in self.waiting.wake(event) {
                self.retry(ticket)?;
            }
            if let Symbol::True(predicate) = symbol {
                self.trigger(predicate, position)?;
            }
            position += 1;
        }
        ControlFlow::Continue(())
    }

    fn trigger(&mut self, predicate: PredicateId, position: usize) -> ControlFlow<()> {
        let event = u32::try_from(position).expect("fewer than 2^32 events");
        for index in 0..self.triggers[predicate.index()].len() {
            let (rule, atom) = self.triggers[predicate.index()][index];
            self.apply(rule, Some(Trigger { atom, event }))?;
        }
        ControlFlow::Continue(())
    }

    /// Derives the new conclusions of a rule.
    fn apply(&mut self, index: usize, trigger: Option<Trigger>) -> ControlFlow<()> {
        let rule = &self.rules[index];
        let mut possible: Set<Arguments> = Set::default();
        let mut impossible: Vec<(Arguments, Vec<Event>)> = Vec::new();
        let mut own = Vec::new();
        let (reachable, banned, room) = (&self.reachable, self.excluded, self.remaining_instances);
        let relaxation = &reachable.relaxation;
        join(rule, relaxation, trigger, self.count, &mut |binding| {
            let arguments = &binding[..rule.parameter_count];
            if possible.contains(arguments) || !reachable.is_new(rule.head, arguments, banned) {
                return ControlFlow::Continue(());
            }
            let mut blockers = Vec::new();
            if rule.are_tests_possible(relaxation, binding, &mut own, &mut blockers) {
                possible.insert(arguments.into());
            } else if !blockers.is_empty() {
                impossible.push((binding.into(), blockers));
            }
            if possible.len() + impossible.len() > room {
                return ControlFlow::Break(());
            }
            ControlFlow::Continue(())
        })?;
        for (binding, blockers) in impossible {
            self.watch_for(blockers, || Pending::Binding(index, binding))?;
        }
        for arguments in possible {
            self.conclude(rule.head, arguments)?;
        }
        ControlFlow::Continue(())
    }

    fn conclude(&mut self, head: Head, arguments: Arguments) -> ControlFlow<()> {
        match head {
            Head::Derived(predicate) => {
                self.add_event(Symbol::True(predicate), &arguments);
                ControlFlow::Continue(())
            }
            Head::Start { schema, and_end } => self.start(schema, arguments, and_end),
        }
    }

    fn start(&mut self, schema: SchemaId, arguments: Arguments, and_end: bool) -> ControlFlow<()> {
        let mut binding = arguments.to_vec();
        let (index, is_new) = self.reachable.instances[schema.index()].insert_full(arguments);
        if !is_new {
            return ControlFlow::Continue(());
        }
        if self.remaining_instances == 0 {
            return ControlFlow::Break(());
        }
        self.remaining_instances -= 1;
        self.reachable.can_end[schema.index()].push(false);
        self.apply_effects(schema, List::Start, &mut binding)?;
        self.apply_effects(schema, List::Continuous, &mut binding)?;
        if and_end {
            return self.end(schema, index);
        }
        let blockers = self.try_to_end(schema, index)?;
        self.watch_for(blockers, || Pending::End(schema, index))
    }

    /// Ends the instance if that is possible. Otherwise returns the events that it waits for.
    fn try_to_end(&mut self, schema: SchemaId, index: usize) -> ControlFlow<(), Vec<Event>> {
        let relaxation = &self.reachable.relaxation;
        let mut binding = self.reachable.instances[schema.index()][index].to_vec();
        let mut blockers = Vec::new();
        let can_end = match &relaxation.problem.schemas[schema.index()].body {
            Body::Instantaneous { .. } => true,
            Body::Durative {
                duration,
                over_all,
                at_end,
                ..
            } => {
                let is_vacuous = !over_all.is_trivial()
                    && relaxation.may_take_no_time(duration, &binding, &mut blockers);
                (is_vacuous || relaxation.is_possible(over_all, true, &mut binding, &mut blockers))
                    && relaxation.is_possible(at_end, true, &mut binding, &mut blockers)
                    && relaxation.is_duration_possible(duration, true, &binding, &mut blockers)
            }
        };
        if can_end {
            self.end(schema, index)?;
        }
        ControlFlow::Continue(blockers)
    }

    fn end(&mut self, schema: SchemaId, index: usize) -> ControlFlow<()> {
        self.reachable.can_end[schema.index()][index] = true;
        let mut binding = self.reachable.instances[schema.index()][index].to_vec();
        self.apply_effects(schema, List::End, &mut binding)
    }

    /// Retries an entry that waited for an event which has just been reached.
    fn retry(&mut self, ticket: EntryId) -> ControlFlow<()> {
        self.count_step()?;
        let Some(pending) = self.waiting.get(ticket).cloned() else {
            return ControlFlow::Continue(());
        };
        let blockers = match &pending {
            Pending::Binding(rule, binding) => self.try_binding(*rule, binding)?,
            Pending::End(schema, index) => self.try_to_end(*schema, *index)?,
            Pending::Effect(id, binding) => self.try_effect(*id, &mut binding.to_vec())?,
        };
        self.waiting.requeue(ticket, blockers);
        ControlFlow::Continue(())
    }

    /// Applies a rule's conclusion if its tests are possible. Otherwise returns the events that it
    /// waits for.
    fn try_binding(&mut self, rule: usize, binding: &[ObjectId]) -> ControlFlow<(), Vec<Event>> {
        let rule = &self.rules[rule];
        let arguments = &binding[..rule.parameter_count];
        let mut blockers = Vec::new();
        let relaxation = &self.reachable.relaxation;
        if self.reachable.is_new(rule.head, arguments, self.excluded)
            && rule.are_tests_possible(relaxation, binding, &mut Vec::new(), &mut blockers)
        {
            self.conclude(rule.head, arguments.into())?;
        }
        ControlFlow::Continue(blockers)
    }

    /// Queues an impossible conclusion until one of the blockers is reached.
    pub(super) fn watch_for(
        &mut self,
        blockers: Vec<Event>,
        pending: impl FnOnce() -> Pending,
    ) -> ControlFlow<()> {
        if blockers.is_empty() {
            return ControlFlow::Continue(());
        }
        self.waiting.enqueue(pending(), blockers)
    }

    pub(super) fn relaxation(&self) -> &Relaxation<'a> {
        &self.reachable.relaxation
    }

    pub(super) fn add_event(&mut self, symbol: Symbol, arguments: &[ObjectId]) {
        self.reachable.relaxation.reached.insert(symbol, arguments);
    }

    pub(super) fn count_step(&mut self) -> ControlFlow<()> {
        (self.count)()
    }
}

impl Reachable<'_> {
    /// Returns `true` if the conclusion is neither banned nor known.
    fn is_new(&self, head: Head, arguments: &[ObjectId], banned: &[BTreeSet<Arguments>]) -> bool {
        match head {
            Head::Derived(predicate) => !self.relaxation.reached.is_ever_true(predicate, arguments),
            Head::Start { schema, .. } => {
                !self.instances[schema.index()].contains(arguments)
                    && !banned[schema.index()].contains(arguments)
            }
        }
    }
}
