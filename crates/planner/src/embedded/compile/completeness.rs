//! What a search over sequences of happenings cannot express.
//!
//! All that happens at one time forms a group, and over-all conditions are looked at between
//! groups only. The search puts the happenings of a group into some order. That loses nothing
//! where one order keeps every over-all condition: an addition comes before the starts that need
//! it from then on, and an end before the deletions that it no longer minds. Only circles of
//! starts, circles of ends, and numbers or disjunctions that several happenings repair together
//! have no such order. They are rare; where they are possible, nothing is proved.

use super::{Action, Change, Conditional, NONE, Snap};
use crate::embedded::formula::Literal;

/// Whether two instances of the action that end together are one and the same but for their
/// number, and so leave the facts as one of them does. Where the duration depends on the state, they
/// can have started one after the other.
fn is_idempotent(action: &Action) -> bool {
    action.start != NONE && action.duration.most.as_ref() == Some(&action.duration.least)
}

/// Whether an action changes numbers.
fn counts(action: &Action, snaps: &[Snap]) -> bool {
    let updates = |snap: &Snap| {
        let is_update = |effect: &Conditional| matches!(effect.change, Change::Update(_));
        !snap.updates.is_empty() || snap.conditional.iter().any(is_update)
    };
    !action.flows.is_empty()
        || [action.start, action.end]
            .iter()
            .any(|&snap| snaps.get(snap as usize).is_some_and(updates))
}

/// Why a search over sequences may miss plans on account of numbers, if so.
pub(super) fn obstacle_among_numbers(
    actions: &[Action],
    snaps: &[Snap],
    fact_count: usize,
) -> Option<&'static str> {
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
    let ends = Circles::of(actions, fact_count, |action, uses| {
        end_uses(action, snaps, uses);
        uses.may_wait_for_itself = is_idempotent(action) && !counts(action, snaps);
    });
    ends.exist().then_some(TOGETHER)
}

/// Why it may miss plans even if numbers do not count, if so.
pub(super) fn obstacle_among_facts(
    actions: &[Action],
    snaps: &[Snap],
    fact_count: usize,
) -> Option<&'static str> {
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
        end_uses(action, snaps, uses);
        uses.may_wait_for_itself = is_idempotent(action);
    });
    ends.exist().then_some(TOGETHER)
}

const TOGETHER: &str =
    "actions may destroy each other's over-all conditions by ending at the same moment";

/// An end must come before what destroys its over-all condition.
fn end_uses(action: &Action, snaps: &[Snap], uses: &mut Uses) {
    if action.end != NONE {
        uses.needs = literals_after(&snaps[action.end as usize]);
        let lasting = &action.over_all.literals;
        uses.gives = lasting.iter().map(|literal| opposite(*literal)).collect();
    }
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

/// The edges of one action in the graph: it follows what it needs, and comes before what it gives.
#[derive(Clone, Debug, Default)]
struct Uses {
    needs: Vec<Literal>,
    gives: Vec<Literal>,
    /// Whether a circle of this action alone does not count.
    may_wait_for_itself: bool,
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
        let mut givers = vec![0_usize; self.literal_count];
        for literal in self.uses.iter().flat_map(|uses| &uses.gives) {
            givers[literal.index()] += 1;
        }
        let mut needed_by: Vec<Vec<usize>> = vec![Vec::new(); self.literal_count];
        // Those that wait for all other givers, not for the literal.
        let mut rivals: Vec<Vec<usize>> = vec![Vec::new(); self.literal_count];
        let mut waits = vec![0_usize; self.uses.len()];
        for (action, uses) in self.uses.iter().enumerate() {
            for literal in &uses.needs {
                if uses.may_wait_for_itself && uses.gives.contains(literal) {
                    waits[action] += givers[literal.index()] - 1;
                    rivals[literal.index()].push(action);
                } else {
                    waits[action] += 1;
                    needed_by[literal.index()].push(action);
                }
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
                    for &rival in rivals[literal.index()].iter().filter(|&&r| r != action) {
                        waits[rival] -= 1;
                        if waits[rival] == 0 {
                            actions.push(rival);
                        }
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
