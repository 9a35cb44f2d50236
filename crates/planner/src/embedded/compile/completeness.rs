//! Obstacles to the completeness of a search over sequences of happenings.
//!
//! All happenings of one time form a group, and over-all conditions are checked only between
//! groups. The search puts the happenings of a group into a sequence. No plan is lost if some
//! sequence keeps every over-all condition: an addition precedes the starts that need it, and an
//! end precedes the deletions that would break its over-all condition. Such a sequence can be
//! missing only with cycles of starts, cycles of ends, and numbers or disjunctions that several
//! happenings keep together. These cases are rare; where they are possible, nothing is proved.

use super::own_start::Changes;
use super::{Action, Change, Conditional, NONE, Rule, Snap, Timed};
use crate::embedded::formula::{Formula, Literal, Test};

/// The compiled parts that determine whether a search over sequences may miss plans.
#[derive(Clone, Copy)]
pub(super) struct Parts<'a> {
    pub(super) actions: &'a [Action],
    pub(super) snaps: &'a [Snap],
    pub(super) timed: &'a [Timed],
    pub(super) tests: &'a [Test],
    pub(super) strata: &'a [Vec<Rule>],
    pub(super) fact_count: usize,
}

/// Returns `true` if several instances of the action that end together change the facts as one
/// instance does. This requires a constant duration, because instances that end together could
/// otherwise have started at different times.
fn is_idempotent(action: &Action, snaps: &[Snap]) -> bool {
    let end = snaps.get(action.end as usize);
    action.start != NONE
        && action.duration.most.as_ref() == Some(&action.duration.least)
        && end.is_none_or(|end| end.conditional.is_empty())
}

fn updates_numbers(snap: &Snap) -> bool {
    let is_update = |effect: &Conditional| matches!(effect.change, Change::Update(_));
    !snap.updates.is_empty() || snap.conditional.iter().any(is_update)
}

/// Returns `true` if an action changes numbers.
fn counts(action: &Action, snaps: &[Snap]) -> bool {
    !action.flows.is_empty()
        || [action.start, action.end]
            .iter()
            .any(|&snap| snaps.get(snap as usize).is_some_and(updates_numbers))
}

/// Returns `true` if an over-all condition reads numbers that several happenings of one moment may
/// change, possibly those of several instances of one action.
fn has_shared_test(parts: Parts<'_>) -> bool {
    let has_test = |action: &Action| {
        let mut has_test = false;
        action.over_all.visit_tests(&mut |_| has_test = true);
        has_test
    };
    if !parts.actions.iter().any(has_test) {
        return false;
    }
    let timed = parts.timed.iter().filter(|timed| !timed.assigns.is_empty());
    let mut writers = timed.count();
    for action in parts.actions.iter().filter(|a| counts(a, parts.snaps)) {
        writers += if action.excludes_itself { 1 } else { 2 };
    }
    writers > 1
}

/// Returns the reason why a search over sequences may miss plans because of numbers, if there is
/// one.
pub(super) fn obstacle_among_numbers(parts: Parts<'_>) -> Option<&'static str> {
    if has_shared_test(parts) {
        return Some(
            "several happenings of one time may keep a numeric over-all condition together",
        );
    }
    let ends = DependencyGraph::of(parts, |action, uses| {
        end_uses(action, parts, uses);
        uses.ignores_self_cycle =
            is_idempotent(action, parts.snaps) && !counts(action, parts.snaps);
    });
    ends.has_cycle().then_some(TOGETHER)
}

/// Returns the reason why it may miss plans even without numbers, if there is one.
pub(super) fn obstacle_among_facts(parts: Parts<'_>) -> Option<&'static str> {
    if parts
        .actions
        .iter()
        .any(|action| !action.over_all.choices.is_empty())
    {
        return Some(
            "several happenings of one time may keep a disjunctive over-all condition together",
        );
    }
    let starts = DependencyGraph::of(parts, |action, uses| {
        let Some(start) = parts.snaps.get(action.start as usize) else {
            return;
        };
        let own = literals_after(start);
        for literal in &action.over_all.literals {
            if !own.contains(literal) && !start.condition.literals.contains(literal) {
                uses.needs.push(*literal);
            }
        }
        record_start_literals(action, parts, uses);
    });
    if starts.has_cycle() {
        return Some("actions may need each other's start effects from the same moment on");
    }
    let ends = DependencyGraph::of(parts, |action, uses| {
        end_uses(action, parts, uses);
        uses.ignores_self_cycle = is_idempotent(action, parts.snaps);
    });
    ends.has_cycle().then_some(TOGETHER)
}

/// Returns `true` if actions may need start effects of each other, so that no order of their starts
/// keeps all over-all conditions.
pub(super) fn do_starts_depend_on_each_other(parts: Parts<'_>) -> bool {
    let starts = DependencyGraph::of(parts, |action, uses| {
        let Some(start) = parts.snaps.get(action.start as usize) else {
            return;
        };
        let Parts {
            snaps,
            tests,
            strata,
            ..
        } = parts;
        let changes = Changes::of_start(action, snaps, tests, strata);
        let needs: Formula = changes.unsatisfied_part(&action.over_all, tests);
        needs.visit_literals(&mut |literal| {
            if !start.condition.literals.contains(&literal) {
                uses.needs.push(literal);
            }
        });
        record_start_literals(action, parts, uses);
    });
    starts.has_cycle()
}

const TOGETHER: &str =
    "actions may destroy each other's over-all conditions by ending at the same moment";

/// Records the literals that a start may make true. Starts that need one of them come later.
fn record_start_literals(action: &Action, parts: Parts<'_>, uses: &mut Uses) {
    let changes = Changes::of_start(action, parts.snaps, parts.tests, parts.strata);
    uses.provides = changes.literals.into_iter().collect();
}

/// Records that an end must precede the happenings that break its over-all condition.
fn end_uses(action: &Action, parts: Parts<'_>, uses: &mut Uses) {
    if let Some(end) = parts.snaps.get(action.end as usize) {
        let changes = Changes::of_happening(end, parts.tests, parts.strata);
        uses.needs = changes.literals.into_iter().collect();
        let lasting = &action.over_all.literals;
        uses.provides = lasting.iter().map(|literal| opposite(*literal)).collect();
    }
}

/// Returns the literals that a happening makes true.
fn literals_after(snap: &Snap) -> Vec<Literal> {
    let adds = snap.adds.iter().map(|&fact| Literal::new(fact, true));
    let deletes = snap.deletes.iter().map(|&fact| Literal::new(fact, false));
    adds.chain(deletes).collect()
}

fn opposite(literal: Literal) -> Literal {
    Literal::new(literal.fact(), !literal.truth())
}

/// The edges of one action in the graph: from the literals that it needs, to the literals that it
/// gives.
#[derive(Clone, Debug, Default)]
struct Uses {
    needs: Vec<Literal>,
    provides: Vec<Literal>,
    /// `true` if a cycle of this action alone does not count.
    ignores_self_cycle: bool,
}

/// Graph of actions and literals, for the detection of cycles.
struct DependencyGraph {
    uses: Vec<Uses>,
    literal_count: usize,
}

impl DependencyGraph {
    fn of(parts: Parts<'_>, look: impl Fn(&Action, &mut Uses)) -> Self {
        let uses = parts.actions.iter().map(|action| {
            let mut uses = Uses::default();
            look(action, &mut uses);
            uses
        });
        Self {
            uses: uses.collect(),
            literal_count: 2 * parts.fact_count,
        }
    }

    /// Returns `true` if the graph has a cycle: if nodes remain after repeatedly removing those
    /// without predecessors (Kahn 1962).
    fn has_cycle(&self) -> bool {
        let mut givers = vec![0_usize; self.literal_count];
        for literal in self.uses.iter().flat_map(|uses| &uses.provides) {
            givers[literal.index()] += 1;
        }
        let mut needed_by: Vec<Vec<usize>> = vec![Vec::new(); self.literal_count];
        // Actions that wait for all other givers, not for the literal.
        let mut rivals: Vec<Vec<usize>> = vec![Vec::new(); self.literal_count];
        let mut waits = vec![0_usize; self.uses.len()];
        for (action, uses) in self.uses.iter().enumerate() {
            for literal in &uses.needs {
                if uses.ignores_self_cycle && uses.provides.contains(literal) {
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
                for literal in &self.uses[action].provides {
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
