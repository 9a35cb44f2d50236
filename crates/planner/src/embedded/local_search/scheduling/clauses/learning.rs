//! Conflict analysis and deletion of learnt clauses.

use super::super::times::NONE;
use super::{Clause, Reason, Solver};

/// Initial limit on the number of learnt clauses.
const LEARNT: usize = 2_000;
/// Increase of the weight of later conflicts.
const DECAY: f64 = 1.0 / 0.95;

impl Solver {
    /// Adds the true literals that imply a literal.
    fn reasons_of(&self, literal: u32, reasons: &mut Vec<u32>) {
        match self.reasons[literal as usize / 2] {
            Reason::Decision => {}
            Reason::Clause(number) => {
                let clause = &self.clauses[number as usize].literals;
                reasons.extend(clause.iter().filter(|&&l| l != literal).map(|l| l ^ 1));
            }
            Reason::Bounds(clock) => {
                let Some(edge) = self.edges[literal as usize ^ 1] else {
                    return;
                };
                let [from, to] = edge.places();
                let latest = self.times.value_at(to, clock);
                let needed = 1 - edge.distance - latest;
                self.times.explain(from, needed, clock, reasons);
                self.times.explain(to, latest, clock, reasons);
            }
        }
    }

    /// Learns a clause from a conflict, at the first unique implication point. Returns `false` if
    /// the problem is contradictory.
    pub(super) fn learn(&mut self, conflict: &[u32]) -> bool {
        let level_of = |levels: &[u32], literal: u32| levels[literal as usize / 2];
        let top = conflict.iter().map(|&l| level_of(&self.levels, l)).max();
        let top = top.unwrap_or(0);
        if top == 0 {
            self.is_contradictory = true;
            return false;
        }
        self.back_to(top);
        let mut learnt = vec![NONE];
        let mut seen: Vec<u32> = Vec::new();
        let mut reasons = conflict.to_vec();
        let (mut open, mut place) = (0_usize, self.trail.len());
        let last = loop {
            self.work += reasons.len() as u64;
            for &literal in &reasons {
                let variable = literal as usize / 2;
                if self.is_seen[variable] || self.levels[variable] == 0 {
                    continue;
                }
                self.is_seen[variable] = true;
                seen.push(literal);
                self.bump(literal / 2);
                if self.levels[variable] == top {
                    open += 1;
                } else {
                    learnt.push(literal ^ 1);
                }
            }
            loop {
                place -= 1;
                if self.is_seen[self.trail[place] as usize / 2] {
                    break;
                }
            }
            let literal = self.trail[place];
            open -= 1;
            if open == 0 {
                break literal;
            }
            reasons.clear();
            self.reasons_of(literal, &mut reasons);
        };
        learnt[0] = last ^ 1;
        self.leave_out_implied(&mut learnt);
        for literal in seen {
            self.is_seen[literal as usize / 2] = false;
        }
        self.bump *= DECAY;
        self.assert_learnt(learnt);
        true
    }

    /// Removes literals of a learnt clause that the others imply (Sörensson & Biere, SAT 2009).
    fn leave_out_implied(&mut self, learnt: &mut Vec<u32>) {
        let mut reasons = Vec::new();
        let mut place = 1;
        while place < learnt.len() {
            let literal = learnt[place] ^ 1;
            reasons.clear();
            self.reasons_of(literal, &mut reasons);
            let follows = self.reasons[literal as usize / 2] != Reason::Decision
                && reasons.iter().all(|&reason| {
                    let variable = reason as usize / 2;
                    self.is_seen[variable] || self.levels[variable] == 0
                });
            if follows {
                learnt.swap_remove(place);
            } else {
                place += 1;
            }
        }
    }

    /// Backtracks to the level at which the learnt clause implies a literal, and assigns it.
    fn assert_learnt(&mut self, mut learnt: Vec<u32>) {
        let level = |literal: u32| self.levels[literal as usize / 2];
        let mut levels: Vec<u32> = learnt.iter().map(|&l| level(l)).collect();
        let second = (1..learnt.len()).max_by_key(|&place| levels[place]);
        let target = second.map_or(0, |place| levels[place]);
        if let Some(place) = second {
            learnt.swap(1, place);
        }
        levels.sort_unstable();
        levels.dedup();
        self.back_to(target);
        let first = learnt[0];
        let reason = if learnt.len() > 1 {
            let levels = u32::try_from(levels.len()).unwrap_or(NONE);
            Reason::Clause(self.attach(learnt, levels))
        } else {
            Reason::Decision
        };
        self.enqueue(first, reason);
    }

    fn bump(&mut self, variable: u32) {
        let activity = &mut self.activities[variable as usize];
        *activity += self.bump;
        if *activity > 1e100 {
            self.activities.iter_mut().for_each(|a| *a *= 1e-100);
            self.bump *= 1e-100;
            self.heap.clear();
            for variable in (0..).take(self.activities.len()) {
                if self.is_decided[variable as usize] {
                    self.queue(variable);
                }
            }
        } else if self.is_decided[variable as usize] && self.is_open(2 * variable) {
            self.queue(variable);
        }
    }

    /// Deletes half of the learnt clauses, those with literals from many levels, if there are too
    /// many.
    pub(super) fn delete_learnt(&mut self) {
        let most = self.learnt.1.max(LEARNT);
        if self.learnt.0 <= most {
            return;
        }
        self.learnt.1 = most + most / 8;
        let learnt = self.clauses.iter().map(|clause| clause.levels);
        let mut levels: Vec<u32> = learnt.filter(|&levels| levels > 0).collect();
        levels.sort_unstable();
        let middle = levels[levels.len() / 2].max(3);
        let clauses = std::mem::take(&mut self.clauses);
        self.work += clauses.len() as u64;
        self.watches.iter_mut().for_each(Vec::clear);
        self.learnt.0 = 0;
        let mut units = Vec::new();
        for clause in clauses.into_iter().filter(|c| c.levels < middle) {
            let Clause { literals, levels } = clause;
            if literals.iter().any(|&literal| self.is_true(literal)) {
                continue;
            }
            let is_left = |literal: &u32| !self.is_true(*literal ^ 1);
            let literals: Vec<u32> = literals.into_iter().filter(is_left).collect();
            match literals[..] {
                [] => self.is_contradictory = true,
                [literal] => units.push(literal),
                _ => {
                    self.attach(literals, levels);
                }
            }
        }
        for literal in units {
            if self.is_open(literal) {
                self.enqueue(literal, Reason::Decision);
            } else {
                self.is_contradictory |= !self.is_true(literal);
            }
        }
    }
}
