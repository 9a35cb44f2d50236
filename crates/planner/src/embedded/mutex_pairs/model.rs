//! Atoms and operators of a problem for `h²`. The operators are starts, ends and timed initials.

use super::super::compile::{Action, Change, Compiled, NONE, Snap};
use super::super::formula::{Formula, Literal};
use super::super::state::State;
use super::table::insert;

/// A start, an end, an instant or a timed initial.
#[derive(Debug, Default)]
pub(super) struct Operator {
    pub(super) action: u32,
    pub(super) is_start: bool,
    pub(super) needs: Vec<usize>,
    pub(super) adds: Vec<usize>,
    /// Possible additions: conditional effects.
    pub(super) may_add: Vec<usize>,
    pub(super) deletes: Vec<usize>,
    pub(super) may_delete: Vec<usize>,
    /// Running actions whose over-all conditions it violates.
    pub(super) breaks: Vec<usize>,
    /// Atom of the running action that it ends.
    pub(super) ends: Option<usize>,
    /// `true` if the start is impossible while an instance is running.
    pub(super) excludes_itself: bool,
}

/// Assumed minimum number of evaluations of each operator, forward and backward together.
const MIN_ROUNDS: u64 = 8;

impl Operator {
    /// Returns the number of table rows that one evaluation reads and writes.
    fn size(&self) -> usize {
        2 + self.needs.len() + self.adds.len()
    }
}

/// The atoms and operators of a problem.
///
/// Atoms are facts, negated facts that occur in a condition, negated goals, and running actions. Derived facts are no
/// atoms. They are assumed to hold in all conditions.
#[derive(Debug)]
pub(super) struct Model {
    pub(super) atom_count: usize,
    fact_count: usize,
    /// Facts whose negation is an atom, in the order of these atoms.
    false_facts: Vec<u32>,
    /// Position in `false_facts`, by fact; [`NONE`] if there is none.
    falsehood_of: Vec<u32>,
    first_running: usize,
    is_derived: Vec<bool>,
    pub(super) operators: Vec<Operator>,
    start_of: Vec<u32>,
    pub(super) goal: Vec<usize>,
}

impl Model {
    /// Returns `None` if the fixpoints would exceed `most_work`.
    pub(super) fn of(compiled: &Compiled, most_work: u64) -> Option<Self> {
        let fact_count = compiled.facts.len();
        let mut model = Self {
            atom_count: 0,
            fact_count,
            false_facts: Vec::new(),
            falsehood_of: vec![NONE; fact_count],
            first_running: 0,
            is_derived: vec![false; fact_count],
            operators: Vec::new(),
            start_of: vec![NONE; compiled.actions.len()],
            goal: Vec::new(),
        };
        for &fact in compiled.derived.iter().flatten() {
            model.is_derived[fact as usize] = true;
        }
        model.number_falsehoods(compiled);
        model.first_running = fact_count + model.false_facts.len();
        model.atom_count = model.first_running + compiled.actions.len();
        model.goal = model.literals(&compiled.goal.literals);
        let mut watching = vec![Vec::new(); 2 * fact_count];
        for (number, action) in compiled.actions.iter().enumerate() {
            for literal in model.lasting(action) {
                watching[literal.index()].push(model.first_running + number);
            }
        }
        for (number, action) in (0..).zip(&compiled.actions) {
            model.add_action(compiled, number, action, &watching);
        }
        for timed in &compiled.timed {
            let snap = Snap {
                adds: timed.adds.clone(),
                deletes: timed.deletes.clone(),
                ..Snap::default()
            };
            let operator = model.operator(&snap, &watching);
            model.operators.push(operator);
        }
        let words = model.atom_count.div_ceil(64) as u64;
        let round: usize = model.operators.iter().map(Operator::size).sum();
        (words * round as u64 <= most_work / MIN_ROUNDS).then_some(model)
    }

    /// Returns the operator of an action's start.
    pub(super) fn start_of(&self, action: u32) -> Option<&Operator> {
        self.operators.get(self.start_of[action as usize] as usize)
    }

    /// Returns the atoms of a state.
    pub(super) fn atoms_of(&self, state: &State) -> Vec<u64> {
        let mut held = vec![0; self.atom_count.div_ceil(64)];
        let words = held.len().min(state.facts.len());
        held[..words].copy_from_slice(&state.facts[..words]);
        for (number, &fact) in self.false_facts.iter().enumerate() {
            if Literal::new(fact, false).holds(&state.facts) {
                insert(&mut held, self.fact_count + number);
            }
        }
        for open in &state.open {
            insert(&mut held, self.first_running + open.action as usize);
        }
        held
    }

    /// Returns the negation of a fact or negated fact, if it is an atom.
    pub(super) fn opposite(&self, atom: usize) -> Option<usize> {
        if atom < self.fact_count {
            let number = self.falsehood_of[atom];
            return (number != NONE).then(|| self.fact_count + number as usize);
        }
        let fact = self.false_facts.get(atom - self.fact_count);
        fact.map(|&fact| fact as usize)
    }

    /// Removes all running actions from a set.
    pub(super) fn clear_running(&self, set: &mut [u64]) {
        for atom in self.first_running..self.atom_count {
            super::table::remove(set, atom);
        }
    }

    fn number_falsehoods(&mut self, compiled: &Compiled) {
        let mut note = |literal: Literal, is_goal: bool| {
            let fact = literal.fact();
            let number = &mut self.falsehood_of[fact as usize];
            let is_atom = !literal.truth() || is_goal;
            if is_atom && *number == NONE && !self.is_derived[fact as usize] {
                *number = narrow(self.false_facts.len());
                self.false_facts.push(fact);
            }
        };
        let conditions = compiled.snaps.iter().map(|snap| &snap.condition);
        let lasting = compiled.actions.iter().map(|action| &action.over_all);
        for formula in conditions.chain(lasting) {
            for &literal in &formula.literals {
                note(literal, false);
            }
        }
        for &literal in &compiled.goal.literals {
            note(literal, true);
        }
    }

    fn atom(&self, literal: Literal) -> Option<usize> {
        let fact = literal.fact() as usize;
        if self.is_derived[fact] {
            None
        } else if literal.truth() {
            Some(fact)
        } else {
            let number = self.falsehood_of[fact];
            (number != NONE).then(|| self.fact_count + number as usize)
        }
    }

    fn literals(&self, literals: &[Literal]) -> Vec<usize> {
        let atoms = literals.iter().filter_map(|&literal| self.atom(literal));
        sorted(atoms.collect())
    }

    /// Returns the literals that hold while an action is running; none if its duration may be 0.
    fn lasting(&self, action: &Action) -> Vec<Literal> {
        let Formula { literals, .. } = &action.over_all;
        let lasts = action.end != NONE && action.duration.least.is_positive();
        let lasting = literals.iter().copied();
        let lasting = lasting.filter(|literal| !self.is_derived[literal.fact() as usize]);
        if lasts { lasting.collect() } else { Vec::new() }
    }

    fn add_action(
        &mut self,
        compiled: &Compiled,
        number: u32,
        action: &Action,
        watching: &[Vec<usize>],
    ) {
        let running = self.first_running + number as usize;
        let lasts = action.duration.least.is_positive();
        if action.start != NONE {
            let mut operator = self.operator(compiled.snap(action.start), watching);
            operator.action = number;
            operator.is_start = true;
            operator.excludes_itself = action.exclusion != NONE;
            if action.end != NONE {
                operator.adds.push(running);
                // A second instance is not excluded here.
                operator.breaks.retain(|&atom| atom != running);
                if lasts {
                    let before = compiled.needed_before_start(action);
                    operator.needs.extend(self.literals(&before.literals));
                }
            }
            operator.needs = sorted(operator.needs);
            self.start_of[number as usize] = narrow(self.operators.len());
            self.operators.push(operator);
        }
        if action.end != NONE {
            let mut operator = self.operator(compiled.snap(action.end), watching);
            operator.action = number;
            operator.ends = Some(running);
            operator.breaks.retain(|&atom| atom != running);
            operator.needs.push(running);
            operator.needs.extend(self.literals(&self.lasting(action)));
            operator.needs = sorted(operator.needs);
            self.operators.push(operator);
        }
    }

    fn operator(&self, snap: &Snap, watching: &[Vec<usize>]) -> Operator {
        let made_true = snap.adds.iter().map(|&fact| Literal::new(fact, true));
        // An addition wins over a deletion.
        let deletes = snap.deletes.iter().filter(|fact| !snap.adds.contains(fact));
        let made_false = deletes.map(|&fact| Literal::new(fact, false));
        let made: Vec<Literal> = made_true.chain(made_false).collect();
        let opposites = |made: &[Literal]| -> Vec<Literal> {
            let opposite = |literal: &Literal| Literal::new(literal.fact(), !literal.truth());
            made.iter().map(opposite).collect()
        };
        let conditional = snap.conditional.iter();
        let may_make: Vec<Literal> = conditional
            .filter_map(|effect| match effect.change {
                Change::Add(fact) => Some(Literal::new(fact, true)),
                Change::Delete(fact) => Some(Literal::new(fact, false)),
                Change::Update(_) | Change::Cost(_) => None,
            })
            .collect();
        // A conditional effect on the same fact makes an effect uncertain.
        let is_sure =
            |literal: &&Literal| !may_make.iter().any(|other| other.fact() == literal.fact());
        let sure: Vec<Literal> = made.iter().filter(is_sure).copied().collect();
        let unsure: Vec<Literal> = made.iter().filter(|l| !is_sure(l)).copied().collect();
        let may_make = [may_make, unsure].concat();
        let broken = opposites(&sure);
        let breaks = broken
            .iter()
            .flat_map(|literal| watching[literal.index()].iter());
        Operator {
            needs: self.literals(&snap.condition.literals),
            adds: self.literals(&sure),
            may_add: self.literals(&may_make),
            deletes: self.literals(&broken),
            may_delete: self.literals(&opposites(&may_make)),
            breaks: sorted(breaks.copied().collect()),
            ..Operator::default()
        }
    }
}

fn sorted(mut atoms: Vec<usize>) -> Vec<usize> {
    atoms.sort_unstable();
    atoms.dedup();
    atoms
}

fn narrow(number: usize) -> u32 {
    u32::try_from(number).expect("fewer than 2^32 entries")
}
