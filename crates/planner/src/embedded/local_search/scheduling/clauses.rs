//! Conflict-driven clause learning over orders (Marques-Silva & Sakallah, IEEE Transactions on
//! Computers 48, 1999; Moskewicz et al., "Chaff", DAC 2001), with [`Times`] as its theory: orders
//! that the bounds on times exclude are explained by paths and learnt (lazy clause generation;
//! Ohrimenko, Stuckey & Codish, Constraints 14, 2009).
//!
//! A literal is twice its variable, plus one for the negative literal.

mod learning;

use std::collections::BinaryHeap;

use super::super::super::time::Ticks;
use super::times::{Contradiction, Edge, NONE, Times};

/// A literal that is always true.
pub(super) const TRUE: u32 = u32::MAX - 1;
/// A literal that is never true.
pub(super) const FALSE: u32 = u32::MAX - 2;

/// Returns the negation of the literal.
pub(super) fn negated(literal: u32) -> u32 {
    match literal {
        TRUE => FALSE,
        FALSE => TRUE,
        literal => literal ^ 1,
    }
}

/// Conflicts in the shortest run between two restarts.
const RESTART: u64 = 64;
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reason {
    Decision,
    Clause(u32),
    /// The bounds on times at this clock value.
    Bounds(u32),
}

#[derive(Clone, Debug)]
struct Clause {
    literals: Vec<u32>,
    /// Number of levels of its literals when it was learnt (Audemard & Simon, IJCAI 2009).
    levels: u32,
}

/// Outcome of a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// All required variables are decided.
    Consistent,
    /// No order exists.
    Contradiction,
    /// No order reaches the current target.
    TooEarly,
    /// The limit on restarts was reached.
    TooHard,
    WorkDone,
}

/// CDCL solver over orders and times.
#[derive(Debug, Default)]
pub(super) struct Solver {
    pub(super) times: Times,
    /// The edge of each literal, if any.
    pub(super) edges: Vec<Option<Edge>>,
    /// For each position of times, the literals whose edges its value may exclude, with the other
    /// position and the distance.
    concerned: Vec<Vec<(u32, u32, Ticks)>>,
    clauses: Vec<Clause>,
    /// Number of learnt clauses, and the limit on it.
    learnt: (usize, usize),
    /// For each literal, the clauses that watch it, each with another of their literals.
    watches: Vec<Vec<(u32, u32)>>,
    /// For each literal, `true` if it is assigned true.
    is_true: Vec<bool>,
    levels: Vec<u32>,
    reasons: Vec<Reason>,
    phases: Vec<bool>,
    /// For each variable, `true` if the search branches on it. Other pairs are decided only if
    /// their times conflict.
    is_decided: Vec<bool>,
    activities: Vec<f64>,
    bump: f64,
    /// Variables by activity; entries may be outdated.
    heap: BinaryHeap<(u64, u32)>,
    trail: Vec<u32>,
    /// Beginning of each level in the trail, and the clock of times.
    limits: Vec<(usize, u32)>,
    /// Positions up to which clauses and times have propagated the trail.
    heads: (usize, usize),
    is_seen: Vec<bool>,
    is_contradictory: bool,
    conflicts: u64,
    /// Conflicts until the next restart, and the number of restarts for the current target.
    restart: (u64, u64),
    /// A literal which states that all happenings end by some time. It is assumed until the target
    /// changes.
    target: Option<(u32, Ticks)>,
    pub(super) work: u64,
}

impl Solver {
    pub(super) fn new() -> Self {
        Self {
            bump: 1.0,
            ..Self::default()
        }
    }

    /// Adds a variable; `phase` is the value that is tried first.
    pub(super) fn variable(&mut self, phase: bool, edges: [Option<Edge>; 2]) -> u32 {
        let variable = u32::try_from(self.levels.len()).unwrap_or(NONE / 4);
        self.levels.push(0);
        self.reasons.push(Reason::Decision);
        self.phases.push(phase);
        self.is_decided.push(false);
        self.activities.push(0.0);
        self.is_seen.push(false);
        for (literal, edge) in (2 * variable..).zip(edges) {
            self.edges.push(edge);
            self.watches.push(Vec::new());
            self.is_true.push(false);
            let Some(edge) = edge else { continue };
            let [from, to] = edge.places();
            for (place, other) in [(from, to), (to, from)] {
                let place = place as usize;
                if self.concerned.len() <= place {
                    self.concerned.resize(place + 1, Vec::new());
                }
                self.concerned[place].push((literal, other, edge.distance));
            }
        }
        2 * variable
    }

    pub(super) fn is_true(&self, literal: u32) -> bool {
        self.is_true[literal as usize]
    }

    /// Returns `true` if the literal is unassigned.
    pub(super) fn is_open(&self, literal: u32) -> bool {
        !self.is_true(literal) && !self.is_true(literal ^ 1)
    }

    /// Returns all literals with an edge, and the edges.
    pub(super) fn all_edges(&self) -> impl Iterator<Item = (u32, Edge)> + '_ {
        let edges = (0..).zip(&self.edges);
        edges.filter_map(|(literal, edge)| Some((literal, (*edge)?)))
    }

    /// Adds an edge that always holds. Must be called before all decisions.
    pub(super) fn always(&mut self, edge: Edge) {
        self.is_contradictory |= self.times.assert(edge, NONE).is_err();
    }

    /// Requires that all happenings end by `latest`.
    pub(super) fn limit_end(&mut self, latest: Ticks) {
        self.back_to(0);
        self.is_contradictory |= self.times.limit_end(latest, NONE).is_err();
        self.exclude_by_bounds();
    }

    /// Sets a temporary target: orders must end by `latest`. Learnt clauses include the literal of
    /// the target.
    pub(super) fn aim(&mut self, latest: Ticks) {
        self.back_to(0);
        if let Some((literal, _)) = self.target
            && self.is_open(literal)
        {
            self.enqueue(literal ^ 1, Reason::Decision);
        }
        self.target = Some((self.variable(true, [None, None]), latest));
        self.restart = (0, 0);
    }

    /// Returns the current target.
    pub(super) fn target(&self) -> Option<Ticks> {
        self.target.map(|target| target.1)
    }

    /// Sets the preferred value of the literal's variable.
    pub(super) fn prefer(&mut self, literal: u32) {
        self.phases[literal as usize / 2] = literal.is_multiple_of(2);
    }

    /// Adds a clause and reverts all decisions.
    pub(super) fn add(&mut self, literals: &[u32]) {
        self.back_to(0);
        if literals.contains(&TRUE) {
            return;
        }
        let mut kept: Vec<u32> = literals.iter().copied().filter(|&l| l != FALSE).collect();
        kept.sort_unstable();
        kept.dedup();
        if kept.windows(2).any(|pair| pair[0] ^ 1 == pair[1])
            || kept.iter().any(|&literal| self.is_true(literal))
        {
            return;
        }
        kept.retain(|&literal| !self.is_true(literal ^ 1));
        for &literal in &kept {
            let variable = literal / 2;
            if !std::mem::replace(&mut self.is_decided[variable as usize], true) {
                self.queue(variable);
            }
        }
        match kept[..] {
            [] => self.is_contradictory = true,
            [literal] => self.enqueue(literal, Reason::Decision),
            _ => {
                self.attach(kept, 0);
            }
        }
    }

    fn attach(&mut self, literals: Vec<u32>, levels: u32) -> u32 {
        let number = u32::try_from(self.clauses.len()).unwrap_or(NONE);
        self.watches[literals[0] as usize].push((number, literals[1]));
        self.watches[literals[1] as usize].push((number, literals[0]));
        self.learnt.0 += usize::from(levels > 0);
        self.clauses.push(Clause { literals, levels });
        number
    }

    fn level(&self) -> u32 {
        u32::try_from(self.limits.len()).unwrap_or(NONE)
    }

    fn enqueue(&mut self, literal: u32, reason: Reason) {
        let variable = literal as usize / 2;
        self.is_true[literal as usize] = true;
        self.levels[variable] = self.level();
        self.reasons[variable] = reason;
        self.trail.push(literal);
    }

    /// Reverts all decisions after that level.
    fn back_to(&mut self, level: u32) {
        let Some(&(begin, clock)) = self.limits.get(level as usize) else {
            return;
        };
        for place in (begin..self.trail.len()).rev() {
            let literal = self.trail[place];
            if place < self.heads.1
                && let Some(edge) = self.edges[literal as usize]
            {
                self.times.retract(edge);
            }
            self.is_true[literal as usize] = false;
            self.phases[literal as usize / 2] = literal.is_multiple_of(2);
            if self.is_decided[literal as usize / 2] {
                self.queue(literal / 2);
            }
        }
        self.trail.truncate(begin);
        self.limits.truncate(level as usize);
        self.times.undo(clock);
        self.heads = (self.heads.0.min(begin), self.heads.1.min(begin));
    }

    fn queue(&mut self, variable: u32) {
        let activity = self.activities[variable as usize].to_bits();
        self.heap.push((activity, NONE - variable));
    }

    /// Propagates all consequences. Returns the literals that cannot all be true if there is a
    /// conflict.
    fn propagate(&mut self) -> Result<(), Contradiction> {
        loop {
            while let Some(&literal) = self.trail.get(self.heads.0) {
                self.heads.0 += 1;
                self.visit_clauses(literal ^ 1)?;
            }
            let Some(&literal) = self.trail.get(self.heads.1) else {
                return Ok(());
            };
            self.heads.1 += 1;
            if let Some(edge) = self.edges[literal as usize] {
                self.times.assert(edge, literal)?;
                self.exclude_by_bounds();
            } else if let Some((target, latest)) = self.target
                && target == literal
            {
                self.times.limit_end(latest, literal)?;
                self.exclude_by_bounds();
            }
        }
    }

    /// Visits the clauses that watch a literal which has become false.
    fn visit_clauses(&mut self, literal: u32) -> Result<(), Contradiction> {
        let mut watching = std::mem::take(&mut self.watches[literal as usize]);
        let mut conflict = None;
        watching.retain_mut(|watch| {
            if conflict.is_some() || self.is_true[watch.1 as usize] {
                return true;
            }
            self.work += 1;
            let clause = &mut self.clauses[watch.0 as usize].literals;
            if clause[0] == literal {
                clause.swap(0, 1);
            }
            let first = clause[0];
            if self.is_true[first as usize] {
                watch.1 = first;
                return true;
            }
            let is_true = &self.is_true;
            let is_free = |other: &u32| !is_true[(*other ^ 1) as usize];
            if let Some(place) = clause[2..].iter().position(is_free) {
                clause.swap(1, place + 2);
                self.watches[clause[1] as usize].push((watch.0, first));
                return false;
            }
            if self.is_true[first as usize ^ 1] {
                conflict = Some(watch.0);
            } else {
                let variable = first as usize / 2;
                self.is_true[first as usize] = true;
                self.levels[variable] = u32::try_from(self.limits.len()).unwrap_or(NONE);
                self.reasons[variable] = Reason::Clause(watch.0);
                self.trail.push(first);
            }
            true
        });
        self.watches[literal as usize] = watching;
        let Some(clause) = conflict else {
            return Ok(());
        };
        let literals = self.clauses[clause as usize].literals.iter();
        Err(literals.map(|literal| literal ^ 1).collect())
    }

    /// Finds the orders that the bounds on times exclude.
    fn exclude_by_bounds(&mut self) {
        let mut changed = std::mem::take(&mut self.times.changed);
        changed.sort_unstable();
        changed.dedup();
        let clock = self.times.clock();
        for &place in &changed {
            let Some(concerned) = self.concerned.get_mut(place as usize) else {
                continue;
            };
            let concerned = std::mem::take(concerned);
            self.work += 1 + concerned.len() as u64 / 8;
            let value = self.times.value(place);
            for &(literal, other, distance) in &concerned {
                if value + distance + self.times.value(other) > 0 && self.is_open(literal) {
                    self.enqueue(literal ^ 1, Reason::Bounds(clock));
                }
            }
            self.concerned[place as usize] = concerned;
        }
        self.times.changed = changed;
        self.times.changed.clear();
    }

    /// Decides on a literal.
    pub(super) fn decide(&mut self, literal: u32) {
        self.limits.push((self.trail.len(), self.times.clock()));
        self.enqueue(literal, Reason::Decision);
    }

    /// Returns the undecided variable with the highest conflict activity.
    fn next(&mut self) -> Option<u32> {
        while let Some((activity, variable)) = self.heap.pop() {
            let variable = NONE - variable;
            let is_current = self.activities[variable as usize].to_bits() == activity;
            if is_current && self.is_open(2 * variable) {
                return Some(variable);
            }
        }
        None
    }

    /// Runs until `most` work is done, all variables are decided, or `restarts` restarts were made.
    pub(super) fn run(&mut self, most: u64, restarts: u64) -> Outcome {
        let end = self.spent() + most;
        while !self.is_contradictory {
            if let Err(conflict) = self.propagate() {
                self.times.changed.clear();
                if !self.learn(&conflict) {
                    break;
                }
                self.conflicts += 1;
                self.restart.0 = self.restart.0.saturating_sub(1);
                continue;
            }
            if self.spent() >= end {
                return Outcome::WorkDone;
            }
            if self.restart.0 == 0 {
                if self.restart.1 >= restarts {
                    return Outcome::TooHard;
                }
                self.restart.1 += 1;
                self.restart.0 = RESTART * luby(self.restart.1);
                self.back_to(0);
                self.delete_learnt();
                continue;
            }
            if let Some((target, _)) = self.target
                && !self.is_true(target)
            {
                if !self.is_open(target) {
                    return Outcome::TooEarly;
                }
                self.decide(target);
                continue;
            }
            let Some(variable) = self.next() else {
                return Outcome::Consistent;
            };
            let is_positive = self.phases[variable as usize];
            self.decide(2 * variable + u32::from(!is_positive));
        }
        Outcome::Contradiction
    }

    /// Returns the work so far.
    pub(super) fn spent(&self) -> u64 {
        self.work + self.times.work
    }
}

/// Returns an element of the sequence 1, 1, 2, 1, 1, 2, 4, … (Luby, Sinclair & Zuckerman, 1993).
fn luby(number: u64) -> u64 {
    let mut number = number;
    loop {
        let size = (number + 1).next_power_of_two();
        if size == number + 1 {
            return size / 2;
        }
        number -= size / 2 - 1;
    }
}
