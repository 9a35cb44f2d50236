//! Processes and events without variables.

use std::collections::BTreeSet;

use super::{Grounder, NoKnowledge};
use crate::autonomous::{Autonomous, GroundEvent, GroundProcess};
use crate::problem::{
    Body, Change, Condition, Effect, ObjectId, PredicateId, Problem, Term, TimedChange, Variable,
};

/// Facts that are the same in every state.
struct Static<'a> {
    /// For each predicate, `true` if nothing changes it.
    is_static: Vec<bool>,
    initial: BTreeSet<(PredicateId, &'a [ObjectId])>,
}

impl Grounder<'_> {
    /// Grounds all processes and events of the problem that may ever be active or happen.
    pub(crate) fn autonomous(&mut self) -> Autonomous {
        let problem = self.problem;
        let mut ground = Autonomous::default();
        if problem.processes.is_empty() && problem.events.is_empty() {
            return ground;
        }
        let facts = Static::of(problem);
        for process in &problem.processes {
            let (condition, parameters) = (&process.condition, &process.parameters);
            self.for_possible(&facts, condition, parameters, &mut |grounder, binding| {
                ground.processes.push(GroundProcess {
                    name: problem.apply_name(&process.name, binding),
                    condition: grounder.ground_condition(condition, binding),
                    effects: grounder.ground_continuous(&process.effects, binding, &NoKnowledge),
                });
            });
        }
        for event in &problem.events {
            let (condition, parameters) = (&event.condition, &event.parameters);
            self.for_possible(&facts, condition, parameters, &mut |grounder, binding| {
                let name = problem.apply_name(&event.name, binding);
                let snap = grounder.ground_snap(condition, &event.effects, binding, &NoKnowledge);
                ground.events.push(GroundEvent { name, snap });
            });
        }
        ground
    }

    /// Calls `action` for each choice of objects for the parameters that static facts allow.
    fn for_possible(
        &mut self,
        facts: &Static<'_>,
        condition: &Condition,
        parameters: &[Variable],
        action: &mut dyn FnMut(&mut Self, &mut Vec<ObjectId>),
    ) {
        let mut conjuncts = Vec::new();
        conjuncts_of(condition, &mut conjuncts);
        self.choose(facts, &conjuncts, parameters, &mut Vec::new(), action);
    }

    fn choose(
        &mut self,
        facts: &Static<'_>,
        conjuncts: &[&Condition],
        parameters: &[Variable],
        binding: &mut Vec<ObjectId>,
        action: &mut dyn FnMut(&mut Self, &mut Vec<ObjectId>),
    ) {
        if conjuncts
            .iter()
            .any(|part| facts.is_ruled_out(part, binding))
        {
            return;
        }
        let Some(next) = parameters.get(binding.len()) else {
            action(self, binding);
            return;
        };
        let domains = self.domains;
        for &object in &*domains.objects(&next.types) {
            binding.push(object);
            self.choose(facts, conjuncts, parameters, binding, action);
            binding.pop();
        }
    }
}

fn conjuncts_of<'c>(condition: &'c Condition, found: &mut Vec<&'c Condition>) {
    match condition {
        Condition::And(parts) => parts.iter().for_each(|part| conjuncts_of(part, found)),
        other => found.push(other),
    }
}

impl<'a> Static<'a> {
    fn of(problem: &'a Problem) -> Self {
        let derived = problem.predicates.iter();
        let mut is_static: Vec<bool> = derived.map(|predicate| !predicate.is_derived).collect();
        let mut change = |effects: &[Effect]| {
            for effect in effects {
                if let Change::Add(atom) | Change::Delete(atom) = &effect.change {
                    is_static[atom.predicate.index()] = false;
                }
            }
        };
        for schema in &problem.schemas {
            match &schema.body {
                Body::Instantaneous { effects, .. } => change(effects),
                Body::Durative {
                    start_effects,
                    end_effects,
                    ..
                } => {
                    change(start_effects);
                    change(end_effects);
                }
            }
        }
        problem
            .events
            .iter()
            .for_each(|event| change(&event.effects));
        for timed in &problem.timed {
            match &timed.change {
                TimedChange::Add(predicate, _) | TimedChange::Delete(predicate, _) => {
                    is_static[predicate.index()] = false;
                }
                TimedChange::Assign(..) => {}
            }
        }
        let initial = problem.initial_facts.iter();
        Self {
            is_static,
            initial: initial
                .map(|(predicate, arguments)| (*predicate, arguments.as_slice()))
                .collect(),
        }
    }

    /// Returns `true` if the bound parameters are sufficient to make the conjunct false in every
    /// state.
    fn is_ruled_out(&self, conjunct: &Condition, binding: &[ObjectId]) -> bool {
        let resolve = |term: &Term| match term {
            Term::Object(object) => Some(*object),
            Term::Variable(position) => binding.get(*position).copied(),
        };
        match conjunct {
            Condition::Atom(atom) if self.is_static[atom.predicate.index()] => {
                let arguments: Option<Vec<_>> = atom.arguments.iter().map(resolve).collect();
                arguments.is_some_and(|arguments| {
                    !self
                        .initial
                        .contains(&(atom.predicate, arguments.as_slice()))
                })
            }
            Condition::Equal(left, right) => {
                let (left, right) = (resolve(left), resolve(right));
                left.is_some() && right.is_some() && left != right
            }
            _ => false,
        }
    }
}
