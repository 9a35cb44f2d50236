//! Times before which two atoms are not true together (h² of temporal planning; Haslum & Geffner,
//! ECP 2001), in the order of time.
//!
//! An atom is a literal that something reads, the fact that an action is running, or the fact that
//! an action which was running initially has ended. There are three kinds of bounds ([`Key`]):
//!
//! - [`Key::Pair`]: two atoms do not become true together before this time.
//! - [`Key::Started`]: a running action, with an atom that has been true since its start, has
//!   started no earlier than this.
//! - [`Key::Meanwhile`]: an atom that has become true while an action is running has done so no
//!   earlier than this.
//!
//! [`Structure::earliest`] is the rule that derives bounds from others. The atoms that a happening
//! reads were true together just before it, and at least ε before if another happening made them
//! true. The atoms that it makes true are true together with those that were true before and that
//! it does not end. Take a list of bounds such that, for each happening that could violate a bound,
//! the bound follows from the list. Then all happenings, one after the other in the order of time,
//! preserve the list (`processes` shows that there is such an order).
//!
//! Facts that only timed initials make true are not atoms; the time windows of happenings cover
//! them. Derived facts, numbers that change, and disjunctions are assumed to have the needed
//! values.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::ground::{Change, Condition};
use elbowroom_num::Rational;

use super::ReachedFacts;
use super::earliest_times::{ConditionContext, EarliestTimes};
use super::instances::Instances;
use super::processes::{Literal, Process, Snap};
pub use rules::Claims;

mod names;
mod rules;

/// Lower bound on a time.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Earliest {
    /// Not before this time.
    From(Rational),
    /// Never.
    Never,
}

impl Earliest {
    /// Returns the bound, later by `delay`.
    #[must_use]
    pub fn plus(&self, delay: &Rational) -> Self {
        match self {
            Self::From(time) => Self::From(time + delay),
            Self::Never => Self::Never,
        }
    }
}

/// Proposition that is true or false at each time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Atom {
    Literal(Literal),
    /// The action with this number is running.
    Running(usize),
    /// The action with this number, which was running initially, has ended.
    Ended(usize),
}

/// Subject of a bound. Atoms and actions are given by number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Key {
    /// Two atoms, the smaller number first. A single atom is a pair with itself.
    Pair(usize, usize),
    /// An action, and an atom that was true when it started.
    Started(usize, usize),
    /// An action, and an atom that has become true since it started.
    Meanwhile(usize, usize),
}

impl Key {
    /// Returns the key of two atoms in any order.
    pub fn pair(one: usize, other: usize) -> Self {
        Self::Pair(one.min(other), one.max(other))
    }
}

/// Bounds that are known.
pub trait Bounds {
    /// Returns the bound. `None`: nothing but the initial time is claimed.
    fn get(&self, key: Key) -> Option<&Earliest>;

    /// Returns the earliest time of a happening, if it is known already.
    fn begin(&self, operator: usize) -> Option<&Earliest>;
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Start(usize),
    End(usize),
    Timed(usize),
}

/// A happening.
#[derive(Debug)]
pub(super) struct Operator {
    pub(super) kind: Kind,
    /// Atoms that it reads.
    reads: Vec<usize>,
    /// Further atoms that are true just before.
    holds: Vec<usize>,
    /// Atoms that it may make true.
    pub(super) adds: Vec<usize>,
    /// Atoms that are certainly not true after it.
    ends: Vec<usize>,
    /// `true` if it may have to wait for timed initials.
    has_windows: bool,
    is_possible: bool,
}

/// Atoms and happenings of a problem.
#[derive(Debug)]
pub struct Structure<'a> {
    earliest_times: EarliestTimes<'a>,
    epsilon: &'a Rational,
    pub(super) processes: Vec<Process>,
    pub(super) atoms: Vec<Atom>,
    pub(super) numbers: BTreeMap<Atom, usize>,
    pub(super) operators: Vec<Operator>,
    /// Operators that may make an atom true, by atom.
    adders: Vec<Vec<usize>>,
    start_of: Vec<Option<usize>>,
    times: Vec<Rational>,
    is_initial: Vec<bool>,
    /// Earliest time of each atom by the delete relaxation.
    relaxed_times: Vec<Earliest>,
    /// Time just before the beginning.
    before: Earliest,
    /// Atoms that each atom implies: the over-all literals of a running action.
    implied_atoms: Vec<Vec<usize>>,
    /// Literals of each atom.
    literals: Vec<Vec<Literal>>,
    /// Alternatives of the goal, each with its known atoms. One of them has to be true at the end.
    goals: Vec<Vec<usize>>,
}

/// Largest number of alternatives of a goal with disjunctions.
const MAX_GOALS: usize = 64;

impl<'a> Structure<'a> {
    /// Creates the structure of the instances that the list of facts allows.
    pub fn of(instances: &'a Instances, reached: &'a ReachedFacts) -> Self {
        let processes = instances.processes(reached);
        let moments = instances.earliest_times(reached);
        let beginning = &instances.initial;
        let mut structure = Self {
            earliest_times: moments,
            epsilon: instances.task.epsilon(),
            atoms: Vec::new(),
            numbers: BTreeMap::new(),
            operators: Vec::new(),
            adders: Vec::new(),
            start_of: vec![None; processes.len()],
            times: beginning.timed.iter().map(|own| own.time.clone()).collect(),
            is_initial: Vec::new(),
            relaxed_times: Vec::new(),
            before: Earliest::From(&beginning.now - instances.task.epsilon()),
            implied_atoms: Vec::new(),
            literals: Vec::new(),
            goals: Vec::new(),
            processes,
        };
        let goals = alternatives(instances);
        structure.number_atoms(instances, &goals);
        let timed: Vec<Snap> = beginning
            .timed
            .iter()
            .map(|happening| {
                let changes = happening.changes.iter();
                let sure: Vec<(&Change, bool)> = changes.map(|change| (change, true)).collect();
                Snap::changing(&sure)
            })
            .collect();
        structure.add_operators(&timed);
        structure.adders = vec![Vec::new(); structure.atoms.len()];
        for (number, operator) in structure.operators.iter().enumerate() {
            for &atom in &operator.adds {
                structure.adders[atom].push(number);
            }
        }
        let over = structure.atoms.iter().enumerate();
        let over: Vec<usize> = over
            .filter(|(_, atom)| matches!(atom, Atom::Ended(_)))
            .map(|(number, _)| number)
            .collect();
        for goal in goals {
            let mut atoms = structure.known(&goal);
            atoms.extend(&over);
            structure.goals.push(atoms);
        }
        structure
    }

    fn number_atoms(&mut self, instances: &Instances, goals: &[Vec<Literal>]) {
        let mut wanted: Vec<Literal> = goals.iter().flatten().copied().collect();
        for process in &self.processes {
            wanted.extend(&process.over_all);
            let snaps = process.start.iter().chain(&process.end);
            wanted.extend(snaps.flat_map(|snap| &snap.reads));
        }
        wanted.sort_unstable();
        wanted.dedup();
        // A fact that actions make false is an atom, even if no action makes it true.
        let snaps = self.processes.iter();
        let snaps = snaps.flat_map(|process| process.start.iter().chain(&process.end));
        let makes: BTreeSet<Literal> = snaps
            .flat_map(|snap| snap.may_make_true.iter().copied())
            .collect();
        let is_timed_only = |(fact, is_true): &Literal| {
            *is_true && !makes.contains(&(*fact, false)) && instances.is_timed_only(*fact)
        };
        wanted.retain(|own| !instances.task.is_derived(own.0) && !is_timed_only(own));
        let facts = &instances.task.initial().facts;
        for literal in wanted {
            let is_initial = facts.contains(&literal.0) == literal.1;
            let fact = instances.task.atom(literal.0);
            let spans = instances.static_facts.spans(&fact);
            let first = spans.map(|spans| spans.first().map(|span| &span.0));
            let from = first.unwrap_or_else(|| self.earliest_times.reached.get(&fact));
            let floor = match (literal.1, from) {
                _ if is_initial => self.before.clone(),
                (true, None) => Earliest::Never,
                (true, Some(from)) => Earliest::From(from.clone()),
                (false, _) => self.before.clone(),
            };
            self.add_atom(Atom::Literal(literal), is_initial, floor, vec![literal]);
        }
        for number in 0..self.processes.len() {
            let process = &self.processes[number];
            if process.end.is_none() {
                continue;
            }
            let over_all = process.over_all.clone();
            let is_begun = process.initial_start.is_some();
            self.add_atom(
                Atom::Running(number),
                is_begun,
                self.before.clone(),
                over_all,
            );
            if is_begun {
                self.add_atom(Atom::Ended(number), false, self.before.clone(), Vec::new());
            }
        }
        for number in 0..self.atoms.len() {
            let company = match self.atoms[number] {
                Atom::Running(process) => self.known(&self.processes[process].over_all),
                _ => Vec::new(),
            };
            self.implied_atoms.push(company);
        }
    }

    fn add_atom(&mut self, atom: Atom, is_initial: bool, floor: Earliest, literals: Vec<Literal>) {
        self.numbers.insert(atom, self.atoms.len());
        self.atoms.push(atom);
        self.is_initial.push(is_initial);
        self.relaxed_times.push(floor);
        self.literals.push(literals);
    }

    /// Returns the atoms of the literals that have one.
    fn known(&self, literals: &[Literal]) -> Vec<usize> {
        let atoms = literals.iter();
        atoms
            .filter_map(|&own| self.numbers.get(&Atom::Literal(own)).copied())
            .collect()
    }

    fn add_operators(&mut self, timed: &[Snap]) {
        for number in 0..self.processes.len() {
            let process = &self.processes[number];
            let running = self.numbers.get(&Atom::Running(number)).copied();
            let over_all = self.known(&process.over_all);
            let moments = &self.earliest_times;
            let now = moments.now;
            if let Some(start) = &process.start {
                let mut operator = self.operator(Kind::Start(number), start);
                let is_others = |atom: &usize| !operator.adds.contains(atom);
                operator.holds = over_all.iter().copied().filter(is_others).collect();
                operator.adds.extend(running);
                let first = if let Some(body) = process.durative() {
                    let first = moments.starts(
                        body,
                        now,
                        ConditionContext::StaticOnly,
                        ConditionContext::StaticOnly,
                    );
                    operator.has_windows = moments.is_timed(&body.start.condition)
                        || moments.is_timed(&body.over_all)
                        || moments.is_timed(&body.end.condition);
                    first.map(|own| own.0)
                } else {
                    let condition = process.instant();
                    operator.has_windows = moments.is_timed(condition);
                    moments.next(condition, now, ConditionContext::StaticOnly)
                };
                operator.is_possible = first.is_some();
                self.start_of[number] = Some(self.operators.len());
                self.operators.push(operator);
            }
            let process = &self.processes[number];
            if let (Some(end), Some(body)) = (&process.end, process.durative()) {
                let mut operator = self.operator(Kind::End(number), end);
                operator.holds = over_all;
                operator.holds.extend(running);
                if process.initial_start.is_some() {
                    operator.adds.extend(self.numbers.get(&Atom::Ended(number)));
                    operator.ends.extend(running);
                }
                let moments = &self.earliest_times;
                operator.has_windows =
                    moments.is_timed(&body.end.condition) || moments.is_timed(&body.over_all);
                self.operators.push(operator);
            }
        }
        for (number, snap) in timed.iter().enumerate() {
            let operator = self.operator(Kind::Timed(number), snap);
            self.operators.push(operator);
        }
    }

    fn operator(&self, kind: Kind, snap: &Snap) -> Operator {
        let is_ended = |atom: &usize| self.literals[*atom].iter().any(|own| snap.ends(*own));
        Operator {
            kind,
            reads: self.known(&snap.reads),
            holds: Vec::new(),
            adds: self.known(&snap.may_make_true),
            ends: (0..self.atoms.len()).filter(is_ended).collect(),
            has_windows: false,
            is_possible: true,
        }
    }
}

impl Structure<'_> {
    /// Returns the number of atoms.
    pub fn atom_count(&self) -> usize {
        self.atoms.len()
    }

    /// Returns the number of actions, including those running initially.
    pub fn action_count(&self) -> usize {
        self.processes.len()
    }

    /// Returns the number of happenings.
    pub fn happening_count(&self) -> usize {
        self.operators.len()
    }

    /// Returns the atoms that a happening may make true.
    pub fn made_by(&self, happening: usize) -> &[usize] {
        &self.operators[happening].adds
    }

    /// Returns the atoms that are true just before a happening.
    pub fn needed_by(&self, happening: usize) -> impl Iterator<Item = usize> + '_ {
        let operator = &self.operators[happening];
        operator.reads.iter().chain(&operator.holds).copied()
    }

    /// Returns the action that a happening starts, and the one that it ends.
    pub fn start_or_end(&self, happening: usize) -> [Option<usize>; 2] {
        match self.operators[happening].kind {
            Kind::Start(action) => [Some(action), None],
            Kind::End(action) => [None, Some(action)],
            Kind::Timed(_) => [None, None],
        }
    }

    /// Returns the start of an action, or `None` if the action was running initially.
    pub fn start_of(&self, action: usize) -> Option<usize> {
        self.start_of[action]
    }

    /// Returns the action whose running the atom states.
    pub fn runs(&self, atom: usize) -> Option<usize> {
        match self.atoms[atom] {
            Atom::Running(action) => Some(action),
            _ => None,
        }
    }

    /// Returns the least duration of an action.
    pub fn least(&self, action: usize) -> &Rational {
        &self.processes[action].least
    }

    /// Returns the time just before the beginning, if the atom is true then.
    pub fn initial(&self, atom: usize) -> Option<&Earliest> {
        self.is_initial[atom].then_some(&self.before)
    }
}

/// Returns the goal as a disjunction of conjunctions of literals. All other conditions are ignored.
fn alternatives(instances: &Instances) -> Vec<Vec<Literal>> {
    let mut goals = split(instances.task.goal(), true);
    for goal in &mut goals {
        goal.sort_unstable();
        goal.dedup();
    }
    goals
}

fn split(condition: &Condition, truth: bool) -> Vec<Vec<Literal>> {
    match (condition, truth) {
        (Condition::Fact(fact), _) => vec![vec![(*fact, truth)]],
        (Condition::Compare(..), _) => vec![Vec::new()],
        (Condition::Not(part), _) => split(part, !truth),
        (Condition::And(parts), true) | (Condition::Or(parts), false) => {
            let mut all: Vec<Vec<Literal>> = vec![Vec::new()];
            for part in parts {
                let own = split(part, truth);
                if all.len() * own.len() > MAX_GOALS {
                    continue;
                }
                let both = all
                    .iter()
                    .flat_map(|one| own.iter().map(move |other| [&one[..], &other[..]].concat()));
                all = both.collect();
            }
            all
        }
        (Condition::Or(parts), true) | (Condition::And(parts), false) => {
            let all: Vec<_> = parts.iter().flat_map(|part| split(part, truth)).collect();
            if all.len() > MAX_GOALS {
                vec![Vec::new()]
            } else {
                all
            }
        }
    }
}
