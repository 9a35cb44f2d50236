//! What a search over sequences of happenings cannot express.
//!
//! All that happens at one time forms a group, and over-all conditions are looked at between
//! groups only. The search puts the happenings of a group into some order. That loses nothing
//! where one order keeps every over-all condition: an addition comes before the starts that need
//! it from then on, and an end before the deletions that it no longer minds. Only circles of
//! starts, circles of ends, and numbers or disjunctions that several happenings repair together
//! have no such order. They are rare; where they are possible, nothing is proved.

use super::{Action, NONE, Snap};
use crate::embedded::formula::Literal;

/// Why a search over sequences may miss plans, if so.
pub(super) fn gap(actions: &[Action], snaps: &[Snap], fact_count: usize) -> Option<&'static str> {
    let has_tests = actions
        .iter()
        .any(|action| !action.over_all.tests.is_empty());
    let has_shared_test =
        has_tests && snaps.iter().filter(|snap| !snap.updates.is_empty()).count() > 1;
    if has_shared_test {
        return Some(
            "several happenings of one time may keep a numeric over-all condition together",
        );
    }
    if actions
        .iter()
        .any(|action| !action.over_all.choices.is_empty())
    {
        return Some(
            "several happenings of one time may keep a disjunctive over-all condition together",
        );
    }
    let starts = Circles::of(actions, fact_count, |action, uses| {
        if action.start == NONE {
            return;
        }
        let start = &snaps[action.start as usize];
        let own = literals_after(start);
        for literal in &action.over_all.literals {
            if !own.contains(literal) && !start.condition.literals.contains(literal) {
                uses.needs.push(*literal);
            }
        }
        uses.gives = own;
    });
    if starts.exist() {
        return Some("actions may need each other's start effects from the same moment on");
    }
    let ends = Circles::of(actions, fact_count, |action, uses| {
        if action.end == NONE {
            return;
        }
        // An end must come before what destroys its over-all condition.
        uses.needs = literals_after(&snaps[action.end as usize]);
        let lasting = &action.over_all.literals;
        uses.gives = lasting.iter().map(|literal| opposite(*literal)).collect();
    });
    if ends.exist() {
        return Some(
            "actions may destroy each other's over-all conditions by ending at the same moment",
        );
    }
    None
}

/// The literals that a happening makes true.
fn literals_after(snap: &Snap) -> Vec<Literal> {
    let adds = snap.adds.iter().map(|&fact| Literal::new(fact, true));
    let deletes = snap.deletes.iter().map(|&fact| Literal::new(fact, false));
    adds.chain(deletes).collect()
}

fn opposite(literal: Literal) -> Literal {
    Literal::new(literal.fact(), !literal.truth())
}

/// What one action contributes to the graph: it follows what it needs, and comes before what it
/// gives.
#[derive(Clone, Debug, Default)]
struct Uses {
    needs: Vec<Literal>,
    gives: Vec<Literal>,
}

/// A graph of actions and literals, in which circles are looked for.
struct Circles {
    uses: Vec<Uses>,
    literal_count: usize,
}

impl Circles {
    fn of(actions: &[Action], fact_count: usize, look: impl Fn(&Action, &mut Uses)) -> Self {
        let uses = actions.iter().map(|action| {
            let mut uses = Uses::default();
            look(action, &mut uses);
            uses
        });
        Self {
            uses: uses.collect(),
            literal_count: 2 * fact_count,
        }
    }

    /// Whether the graph has a circle: what is left when all without predecessors are taken away,
    /// one after the other (Kahn 1962).
    fn exist(&self) -> bool {
        let mut needed_by: Vec<Vec<usize>> = vec![Vec::new(); self.literal_count];
        let mut givers = vec![0_usize; self.literal_count];
        let mut waits = vec![0_usize; self.uses.len()];
        for (action, uses) in self.uses.iter().enumerate() {
            waits[action] = uses.needs.len();
            for literal in &uses.needs {
                needed_by[literal.index()].push(action);
            }
            for literal in &uses.gives {
                givers[literal.index()] += 1;
            }
        }
        let mut literals: Vec<usize> = (0..self.literal_count)
            .filter(|&literal| givers[literal] == 0)
            .collect();
        let mut actions: Vec<usize> = (0..waits.len()).filter(|&a| waits[a] == 0).collect();
        let mut left = self.uses.len();
        loop {
            if let Some(action) = actions.pop() {
                left -= 1;
                for literal in &self.uses[action].gives {
                    givers[literal.index()] -= 1;
                    if givers[literal.index()] == 0 {
                        literals.push(literal.index());
                    }
                }
            } else if let Some(literal) = literals.pop() {
                for &action in &needed_by[literal] {
                    waits[action] -= 1;
                    if waits[action] == 0 {
                        actions.push(action);
                    }
                }
            } else {
                return left > 0;
            }
        }
    }
}
