//! Atoms of the pairs, and the operators that make them true.

use super::super::compile::{Action, Change, Compiled, NONE, Snap};
use super::super::formula::{Formula, Literal};
use super::super::relaxed::Graph;
use super::super::time::Ticks;

/// The happening that an operator represents.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// The start of an action, or the instantaneous action.
    Start(u32),
    End(u32),
    Timed(u32),
}

/// A start, an end, an instant, or timed initials.
#[derive(Clone, Debug)]
pub(super) struct Operator {
    pub(super) kind: Kind,
    /// Propositions that hold just before, and were made true by then.
    pub(super) needs: Vec<usize>,
    /// Further propositions that hold just before, but may have been made true again at any time.
    pub(super) keeps: Vec<usize>,
    /// Propositions that may hold afterwards because of the operator.
    pub(super) adds: Vec<usize>,
    /// For each atom, `true` if it certainly does not hold both before and afterwards.
    pub(super) ends: Vec<bool>,
    /// For each atom, `true` if a happening that makes it true comes earlier in time whenever it
    /// comes earlier in the order of choices.
    pub(super) comes_after: Vec<bool>,
    /// The corresponding operator of the relaxed problem, which has the windows; [`NONE`] for timed
    /// initials.
    pub(super) relaxed: u32,
}

/// The atoms and operators of a problem.
///
/// An atom is a literal that some condition needs, or the statement that an action is running.
/// Literals that only timed initials change are not atoms, since the windows of operators represent
/// them. Derived facts, numbers, and choices are not atoms either: they are assumed to hold
/// whenever they are needed.
#[derive(Debug)]
pub(super) struct Model {
    /// The atom of each literal; [`usize::MAX`] if there is none.
    pub(super) of_literal: Vec<usize>,
    /// For each action, the atom which states that it is running; [`usize::MAX`] for instantaneous
    /// actions.
    pub(super) running: Vec<usize>,
    pub(super) atom_count: usize,
    /// The literals that are atoms.
    pub(super) literals: Vec<Literal>,
    /// The actions of the atoms for running actions, in the order of the atoms.
    actions: Vec<u32>,
    pub(super) operators: Vec<Operator>,
    /// By action; [`NONE`] if there is none.
    pub(super) start_of: Vec<u32>,
    pub(super) end_of: Vec<u32>,
    /// The operators that would break the action's over-all condition, by action.
    pub(super) breakers: Vec<Vec<u32>>,
    /// For each atom, `true` if timed initials make it true.
    pub(super) is_timed: Vec<bool>,
    /// Pairs of atoms that are true together in no state; by row.
    pub(super) excludes: Vec<bool>,
    /// The literals of the goal that are atoms.
    pub(super) goal: Vec<usize>,
    /// The least duration of each action, as far as it does not depend on the state.
    pub(super) least: Vec<Ticks>,
}

const NO_ATOM: usize = usize::MAX;

impl Model {
    /// Returns `None` if the model is too large.
    pub(super) fn of(compiled: &Compiled, graph: &Graph) -> Option<Self> {
        let mut model = Self {
            of_literal: vec![NO_ATOM; 2 * compiled.facts.len()],
            running: vec![NO_ATOM; compiled.actions.len()],
            atom_count: 0,
            literals: Vec::new(),
            actions: Vec::new(),
            operators: Vec::new(),
            start_of: vec![NONE; compiled.actions.len()],
            end_of: vec![NONE; compiled.actions.len()],
            breakers: vec![Vec::new(); compiled.actions.len()],
            is_timed: Vec::new(),
            excludes: Vec::new(),
            goal: Vec::new(),
            least: Vec::new(),
        };
        model.number_atoms(compiled, graph);
        if model.atom_count > compiled.tuning.most_pair_atoms {
            return None;
        }
        model.least = compiled
            .actions
            .iter()
            .map(|action| compiled.scale.floor(&action.duration.least).0)
            .collect();
        model.goal = model.atoms(&compiled.goal);
        for (number, action) in (0..).zip(&compiled.actions) {
            model.add_action(compiled, graph, number, action);
        }
        model.is_timed = vec![false; model.atom_count];
        for (number, timed) in (0..).zip(&compiled.timed) {
            let adds = timed.adds.iter().map(|&fact| Literal::new(fact, true));
            let deletes = timed.deletes.iter().map(|&fact| Literal::new(fact, false));
            let adds = model.known(adds.chain(deletes));
            for &atom in &adds {
                model.is_timed[atom] = true;
            }
            let mut ends = vec![false; model.atom_count];
            for &fact in &timed.deletes {
                model.end_literal(Literal::new(fact, true), &mut ends);
            }
            for &fact in &timed.adds {
                model.end_literal(Literal::new(fact, false), &mut ends);
            }
            model.operators.push(Operator {
                kind: Kind::Timed(number),
                needs: Vec::new(),
                keeps: Vec::new(),
                adds,
                ends,
                comes_after: Vec::new(),
                relaxed: NONE,
            });
        }
        model.find_exclusions(compiled);
        model.find_orders(compiled);
        let work: usize = model.operators.iter().map(|o| 1 + o.needs.len()).sum();
        (work * model.atom_count <= compiled.tuning.most_pair_lookups).then_some(model)
    }

    /// Returns the action of an atom which states that an action is running.
    pub(super) fn action_of(&self, atom: usize) -> u32 {
        self.actions[atom - self.literals.len()]
    }

    fn number_atoms(&mut self, compiled: &Compiled, graph: &Graph) {
        let mut is_derived = vec![false; compiled.facts.len()];
        for &fact in compiled.derived.iter().flatten() {
            is_derived[fact as usize] = true;
        }
        let mut note = |formula: &Formula| {
            for &literal in &formula.literals {
                let known = &mut self.of_literal[literal.index()];
                let is_atom = !is_derived[literal.fact() as usize] && !graph.has_timetable(literal);
                if *known == NO_ATOM && is_atom {
                    *known = self.literals.len();
                    self.literals.push(literal);
                }
            }
        };
        for snap in &compiled.snaps {
            note(&snap.condition);
        }
        for action in &compiled.actions {
            note(&action.over_all);
        }
        note(&compiled.goal);
        self.atom_count = self.literals.len();
        for (number, action) in (0..).zip(&compiled.actions) {
            if action.end != NONE {
                self.running[number as usize] = self.atom_count;
                self.actions.push(number);
                self.atom_count += 1;
            }
        }
    }

    fn known(&self, literals: impl Iterator<Item = Literal>) -> Vec<usize> {
        let mut atoms: Vec<usize> = literals
            .map(|literal| self.of_literal[literal.index()])
            .filter(|&atom| atom != NO_ATOM)
            .collect();
        atoms.sort_unstable();
        atoms.dedup();
        atoms
    }

    fn atoms(&self, formula: &Formula) -> Vec<usize> {
        self.known(formula.literals.iter().copied())
    }

    fn end_literal(&self, literal: Literal, ends: &mut [bool]) {
        let atom = self.of_literal[literal.index()];
        if atom != NO_ATOM {
            ends[atom] = true;
        }
    }

    fn add_action(&mut self, compiled: &Compiled, graph: &Graph, number: u32, action: &Action) {
        let place = number as usize;
        let (relaxed_start, relaxed_end) = graph.operators_of(number);
        if action.start != NONE {
            let snap = compiled.snap(action.start);
            let mut needs = self.atoms(&snap.condition);
            let mut adds = self.made_by(snap);
            let ends = self.ended_by(snap);
            // Literals that must hold from the start on, and that the start does not add.
            needs.extend(
                self.atoms(&action.over_all)
                    .into_iter()
                    .filter(|atom| !adds.contains(atom)),
            );
            needs.sort_unstable();
            needs.dedup();
            if action.end != NONE {
                adds.push(self.running[place]);
            }
            self.start_of[place] = narrow(self.operators.len());
            self.operators.push(Operator {
                kind: Kind::Start(number),
                needs,
                keeps: Vec::new(),
                adds,
                ends,
                comes_after: Vec::new(),
                relaxed: relaxed_start,
            });
        }
        if action.end != NONE {
            let snap = compiled.snap(action.end);
            let mut needs = self.atoms(&snap.condition);
            needs.push(self.running[place]);
            needs.sort_unstable();
            needs.dedup();
            let mut ends = self.ended_by(snap);
            if action.start == NONE {
                // No second instance of it is running.
                ends[self.running[place]] = true;
            }
            self.end_of[place] = narrow(self.operators.len());
            self.operators.push(Operator {
                kind: Kind::End(number),
                needs,
                keeps: self.atoms(&action.over_all),
                adds: self.made_by(snap),
                ends,
                comes_after: Vec::new(),
                relaxed: relaxed_end,
            });
        }
    }

    /// Returns the propositions that may hold because of the snap action. Conditional effects count
    /// as possible.
    fn made_by(&self, snap: &Snap) -> Vec<usize> {
        let adds = snap.adds.iter().map(|&fact| Literal::new(fact, true));
        let deletes = snap.deletes.iter().map(|&fact| Literal::new(fact, false));
        let conditional = snap
            .conditional
            .iter()
            .filter_map(|effect| match effect.change {
                Change::Add(fact) => Some(Literal::new(fact, true)),
                Change::Delete(fact) => Some(Literal::new(fact, false)),
                Change::Update(_) | Change::Cost(_) => None,
            });
        self.known(adds.chain(deletes).chain(conditional))
    }

    /// Returns for each proposition whether it certainly does not persist. An addition wins over a
    /// deletion.
    fn ended_by(&self, snap: &Snap) -> Vec<bool> {
        let mut ends = vec![false; self.atom_count];
        for &fact in &snap.deletes {
            self.end_literal(Literal::new(fact, true), &mut ends);
        }
        for &fact in &snap.adds {
            self.end_literal(Literal::new(fact, false), &mut ends);
        }
        ends
    }

    /// Finds the pairs of atoms that no state contains: opposite literals, and literals that a
    /// running action excludes. No happening breaks the over-all condition of a running action.
    fn find_exclusions(&mut self, compiled: &Compiled) {
        let count = self.atom_count;
        self.excludes = vec![false; count * count];
        let mut lasting: Vec<(usize, Vec<Literal>)> = self
            .literals
            .iter()
            .enumerate()
            .map(|(atom, &literal)| (atom, vec![literal]))
            .collect();
        for (action, &running) in compiled.actions.iter().zip(&self.running) {
            if running != NO_ATOM {
                lasting.push((running, action.over_all.literals.clone()));
            }
        }
        let mut holders: Vec<Vec<usize>> = vec![Vec::new(); self.of_literal.len()];
        for (atom, literals) in &lasting {
            for literal in literals {
                holders[literal.index()].push(*atom);
            }
        }
        for pair in holders.chunks(2) {
            let [truths, falsehoods] = pair else { continue };
            for &one in truths {
                for &other in falsehoods {
                    self.excludes[one * count + other] = true;
                    self.excludes[other * count + one] = true;
                }
            }
        }
        for number in 0..self.operators.len() {
            let operator = &self.operators[number];
            let (snap, own) = match operator.kind {
                Kind::Start(action) => (compiled.action(action).start, NONE),
                Kind::End(action) => (compiled.action(action).end, action),
                Kind::Timed(_) => (NONE, NONE),
            };
            let (adds, deletes): (&[u32], &[u32]) = match operator.kind {
                Kind::Timed(timed) => {
                    let timed = &compiled.timed[timed as usize];
                    (&timed.adds, &timed.deletes)
                }
                _ => (&compiled.snap(snap).adds, &compiled.snap(snap).deletes),
            };
            let broken = adds.iter().map(|&fact| Literal::new(fact, false));
            let broken = broken.chain(deletes.iter().map(|&fact| Literal::new(fact, true)));
            let mut stopped: Vec<usize> = broken
                .flat_map(|literal| holders[literal.index()].iter().copied())
                .filter(|&atom| atom >= self.literals.len())
                .collect();
            stopped.sort_unstable();
            stopped.dedup();
            for atom in stopped {
                self.operators[number].ends[atom] = true;
                let action = self.action_of(atom);
                if action != own {
                    self.breakers[action as usize].push(narrow(number));
                }
            }
        }
    }

    /// Finds the atoms and operators whose order is kept in time: an operator comes after an atom
    /// if each happening that makes the atom true sets an annotation from which the operator must
    /// be separated.
    fn find_orders(&mut self, compiled: &Compiled) {
        let marks: Vec<&[u32]> = self
            .operators
            .iter()
            .map(|operator| match operator.kind {
                Kind::Start(action) => &compiled.snap(compiled.action(action).start).marks[..],
                Kind::End(action) => &compiled.snap(compiled.action(action).end).marks[..],
                Kind::Timed(timed) => &compiled.timed[timed as usize].marks[..],
            })
            .collect();
        let mut achievers: Vec<Vec<usize>> = vec![Vec::new(); self.atom_count];
        for (number, operator) in self.operators.iter().enumerate() {
            for &atom in &operator.adds {
                achievers[atom].push(number);
            }
        }
        let mut is_kept_away = vec![false; compiled.annotation_count];
        let orders: Vec<Vec<bool>> = self
            .operators
            .iter()
            .map(|operator| {
                let after: &[(u32, Ticks)] = match operator.kind {
                    Kind::Start(action) => &compiled.snap(compiled.action(action).start).after,
                    Kind::End(action) => &compiled.snap(compiled.action(action).end).after,
                    Kind::Timed(_) => return vec![false; achievers.len()],
                };
                for &(annotation, _) in after {
                    is_kept_away[annotation as usize] = true;
                }
                let comes_after = achievers.iter().map(|achievers| {
                    achievers.iter().all(|&by| {
                        marks[by]
                            .iter()
                            .any(|&annotation| is_kept_away[annotation as usize])
                    })
                });
                let comes_after = comes_after.collect();
                for &(annotation, _) in after {
                    is_kept_away[annotation as usize] = false;
                }
                comes_after
            })
            .collect();
        for (operator, comes_after) in self.operators.iter_mut().zip(orders) {
            operator.comes_after = comes_after;
        }
    }
}

fn narrow(number: usize) -> u32 {
    u32::try_from(number).expect("far below 2^32")
}
