//! Conditions on facts: causal links and threats.

use super::super::super::formula::{Literal, is_set};
use super::super::WorkMeter;
use super::clauses::{FALSE, TRUE, negated};
use super::model::{MOST, Model, Need, snap_of};

/// Maximum number of pairs of makers and breakers of one condition.
const MAX_OF_ONE: usize = 20_000;

impl Model<'_> {
    /// Finds the happenings that change each fact.
    pub(super) fn note_changers(&mut self) {
        let mut timed = 0;
        for (node, item) in (0..).zip(&self.items) {
            let (adds, deletes) = if let Some(snap) = snap_of(self.compiled, *item) {
                let snap = self.compiled.snap(snap);
                (&snap.adds, &snap.deletes)
            } else {
                timed += 1;
                let timed = &self.compiled.timed[timed - 1];
                (&timed.adds, &timed.deletes)
            };
            for &fact in adds {
                self.changers.entry(fact).or_default()[0].push(node);
            }
            for &fact in deletes.iter().filter(|fact| !adds.contains(fact)) {
                self.changers.entry(fact).or_default()[1].push(node);
            }
        }
    }

    /// Adds the clauses that every condition on facts has a supporter.
    pub(super) fn support_all(&mut self, ticker: &mut WorkMeter<'_>) -> Option<()> {
        let mut spent = 0;
        self.visit_needs(ticker, &mut |model, need, formula| {
            spent = model.size;
            if !formula.choices.is_empty() {
                return None;
            }
            let literals = formula.literals.iter();
            literals
                .map(|&literal| model.support(need, literal))
                .collect()
        })?;
        ticker.work += spent as u64;
        Some(())
    }

    /// Adds the clauses that some happening makes the literal true, and no happening breaks it
    /// before the need.
    fn support(&mut self, need: Need, literal: Literal) -> Option<()> {
        let fact = literal.fact();
        let [adding, deleting] = self.changers.get(&fact).cloned().unwrap_or_default();
        let (makers, breakers) = if literal.truth() {
            (adding, deleting)
        } else {
            (deleting, adding)
        };
        let (begin, end) = match need {
            Need::At(node) => (Some(node), Some(node)),
            Need::Throughout(begin, end) => (begin, Some(end)),
            Need::Goal => (None, None),
        };
        let holds_at_first = is_set(&self.root.facts, fact) == literal.truth();
        let is_breaker = |node: &u32| Some(*node) != end;
        let breakers: Vec<u32> = breakers.into_iter().filter(is_breaker).collect();
        if breakers.is_empty() && holds_at_first {
            return Some(());
        }
        let size = 1 + makers.len() * (1 + breakers.len());
        self.size += size;
        if size > MAX_OF_ONE || self.size > MOST {
            return None;
        }
        // In the plan itself, the last maker before the need is the supporter.
        let is_before = |node: u32| begin.is_none_or(|begin| node < begin);
        let mut own = makers.iter().copied().filter(|&node| is_before(node)).max();
        let mut supporters: Vec<(Option<u32>, u32)> = Vec::new();
        if holds_at_first {
            supporters.push((None, TRUE));
        }
        for &maker in &makers {
            let in_time = match need {
                Need::At(node) => self.before(maker, node),
                Need::Throughout(Some(start), _) if maker == start => {
                    own = Some(start);
                    TRUE
                }
                Need::Throughout(Some(start), _) => self.before(maker, start),
                Need::Throughout(None, _) => FALSE,
                Need::Goal => TRUE,
            };
            if in_time != FALSE {
                supporters.push((Some(maker), in_time));
            }
        }
        let is_alone = supporters.len() == 1;
        let mut all = Vec::new();
        for (maker, in_time) in supporters {
            let mut clauses = vec![vec![in_time]];
            for &breaker in &breakers {
                let earlier = maker.map_or(FALSE, |maker| self.before(breaker, maker));
                let later = end.map_or(FALSE, |end| self.before(end, breaker));
                clauses.push(vec![earlier, later]);
            }
            if clauses
                .iter()
                .any(|c| c.iter().all(|&literal| literal == FALSE))
            {
                continue;
            }
            let chosen = if is_alone {
                TRUE
            } else {
                self.solver.variable(maker == own, [None, None])
            };
            all.push(chosen);
            for mut clause in clauses {
                clause.push(negated(chosen));
                self.solver.add(&clause);
            }
        }
        self.solver.add(&all);
        (!all.is_empty()).then_some(())
    }
}
