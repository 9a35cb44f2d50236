//! Backtracking join: finds all bindings of a rule's variables for which its atoms are true facts.
//!
//! Each step matches the atom with the fewest facts that fit the current binding, so that a
//! contradiction is found early. Static tests prune as soon as their variables are bound.

use std::ops::ControlFlow;

use crate::problem::{ObjectId, Term};

use super::relaxation::Relaxation;
use super::rule::{JoinAtom, Rule};

/// The fact whose new bindings are searched: the rule's atom that it matches, and its position
/// among the events.
///
/// Each binding is found for one fact only, the latest one that it needs: atoms before the trigger
/// match only earlier facts, atoms after it no later ones.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trigger {
    pub(super) atom: usize,
    pub(super) event: u32,
}

/// Calls `sink` for each binding until it breaks. Also breaks when `count`, which is called for
/// each step, breaks.
pub(super) fn join(
    rule: &Rule,
    relaxation: &Relaxation,
    trigger: Option<Trigger>,
    count: &mut dyn FnMut() -> ControlFlow<()>,
    sink: &mut dyn FnMut(&[ObjectId]) -> ControlFlow<()>,
) -> ControlFlow<()> {
    let mut join = Join {
        rule,
        relaxation,
        trigger,
        binding: vec![ObjectId(0); rule.variables.len()],
        is_bound: vec![false; rule.variables.len()],
        trail: Vec::new(),
        remaining: (0..rule.atoms.len()).collect(),
        scratch: Vec::new(),
        count,
        sink,
    };
    match trigger {
        Some(trigger) => {
            join.remaining.swap_remove(trigger.atom);
            join.match_fact(trigger.atom, trigger.event)
        }
        None => join.extend(),
    }
}

struct Join<'r, 'a> {
    rule: &'r Rule<'a>,
    relaxation: &'r Relaxation<'a>,
    trigger: Option<Trigger>,
    binding: Vec<ObjectId>,
    is_bound: Vec<bool>,
    /// Bound variables, in the order of binding.
    trail: Vec<usize>,
    /// Atoms not yet matched, unordered.
    remaining: Vec<usize>,
    scratch: Vec<ObjectId>,
    count: &'r mut dyn FnMut() -> ControlFlow<()>,
    sink: &'r mut dyn FnMut(&[ObjectId]) -> ControlFlow<()>,
}

/// The facts that an atom may match.
enum Candidates<'r> {
    /// All arguments are known: this fact only.
    One(u32),
    /// The shortest list of facts in the index that share one argument. The other arguments have to
    /// be compared.
    Listed(&'r [u32]),
}

impl<'r> Join<'r, '_> {
    /// Matches the remaining atoms.
    fn extend(&mut self) -> ControlFlow<()> {
        let Some((slot, candidates)) = self.most_selective() else {
            return self.enumerate();
        };
        let atom = self.remaining.swap_remove(slot);
        match candidates {
            Candidates::One(event) => self.match_fact(atom, event)?,
            Candidates::Listed(events) => {
                for &event in events {
                    self.match_fact(atom, event)?;
                }
            }
        }
        self.remaining.push(atom);
        ControlFlow::Continue(())
    }

    /// Returns the atom with the fewest candidates, as its position in `remaining`.
    fn most_selective(&mut self) -> Option<(usize, Candidates<'r>)> {
        let mut best: Option<(usize, Candidates<'r>)> = None;
        for (slot, &atom) in self.remaining.iter().enumerate() {
            let candidates = candidates(
                self.relaxation,
                &self.rule.atoms[atom],
                &self.binding,
                &self.is_bound,
                &mut self.scratch,
            );
            if best
                .as_ref()
                .is_none_or(|(_, best)| candidates.len() < best.len())
            {
                if candidates.len() == 0 {
                    return Some((slot, candidates));
                }
                best = Some((slot, candidates));
            }
        }
        best
    }

    /// Matches the atom with the fact, and continues with the remaining atoms.
    fn match_fact(&mut self, atom: usize, event: u32) -> ControlFlow<()> {
        self.count_step()?;
        let rule = self.rule;
        if !self.is_first_trigger(atom, event) {
            return ControlFlow::Continue(());
        }
        let mark = self.trail.len();
        let arguments = self.relaxation.reached.arguments(event);
        let fits = (rule.atoms[atom].terms.iter().zip(arguments))
            .all(|(&term, &object)| self.unify(term, object));
        if fits && self.static_tests_hold(mark) {
            self.extend()?;
        }
        self.undo(mark);
        ControlFlow::Continue(())
    }

    /// Prevents that a binding is found for several triggers.
    fn is_first_trigger(&self, atom: usize, event: u32) -> bool {
        let Some(trigger) = self.trigger else {
            return true;
        };
        // Facts of a static predicate are never triggers.
        self.rule.atoms[atom].is_static
            || event < trigger.event
            || (event == trigger.event && atom >= trigger.atom)
    }

    fn unify(&mut self, term: Term, object: ObjectId) -> bool {
        match term {
            Term::Object(own) => own == object,
            Term::Variable(variable) if self.is_bound[variable] => self.binding[variable] == object,
            Term::Variable(variable) => {
                let fits = self.rule.variables[variable].contains(object);
                if fits {
                    self.bind(variable, object);
                }
                fits
            }
        }
    }

    fn bind(&mut self, variable: usize, object: ObjectId) {
        self.binding[variable] = object;
        self.is_bound[variable] = true;
        self.trail.push(variable);
    }

    fn undo(&mut self, mark: usize) {
        for variable in self.trail.drain(mark..) {
            self.is_bound[variable] = false;
        }
    }

    /// Returns `true` if all static tests hold that became decidable with the bindings since
    /// `mark`.
    fn static_tests_hold(&mut self, mark: usize) -> bool {
        let fresh = &self.trail[mark..];
        self.rule.static_tests.iter().all(|test| {
            let is_due = test.reads.iter().any(|variable| fresh.contains(variable))
                && test.reads.iter().all(|&variable| self.is_bound[variable]);
            // Static tests have no blockers.
            let none = &mut Vec::new();
            !is_due || test.is_possible(self.relaxation, &self.binding, &mut self.scratch, none)
        })
    }

    /// Tries all objects for the variables that no atom binds.
    fn enumerate(&mut self) -> ControlFlow<()> {
        let Some(variable) = self.is_bound.iter().position(|is_bound| !is_bound) else {
            return (self.sink)(&self.binding);
        };
        let rule = self.rule;
        for &object in &rule.variables[variable].objects {
            self.count_step()?;
            let mark = self.trail.len();
            self.bind(variable, object);
            if self.static_tests_hold(mark) {
                self.enumerate()?;
            }
            self.undo(mark);
        }
        ControlFlow::Continue(())
    }

    fn count_step(&mut self) -> ControlFlow<()> {
        (self.count)()
    }
}

impl Candidates<'_> {
    fn len(&self) -> usize {
        match self {
            Self::One(_) => 1,
            Self::Listed(list) => list.len(),
        }
    }
}

fn candidates<'r>(
    relaxation: &'r Relaxation,
    atom: &JoinAtom,
    binding: &[ObjectId],
    is_bound: &[bool],
    known: &mut Vec<ObjectId>,
) -> Candidates<'r> {
    let reached = &relaxation.reached;
    let mut shortest = reached.all(atom.predicate);
    known.clear();
    for (position, &term) in atom.terms.iter().enumerate() {
        let object = match term {
            Term::Object(object) => object,
            Term::Variable(variable) if is_bound[variable] => binding[variable],
            Term::Variable(_) => continue,
        };
        known.push(object);
        let list = reached.with_argument(atom.predicate, position, object);
        if list.len() < shortest.len() {
            shortest = list;
        }
    }
    // Comparing a short list is faster than looking up a fact.
    if known.len() < atom.terms.len() || shortest.len() <= 1 {
        return Candidates::Listed(shortest);
    }
    match reached.position(atom.predicate, known) {
        Some(position) => Candidates::One(u32::try_from(position).expect("fewer than 2^32 events")),
        None => Candidates::Listed(&[]),
    }
}
