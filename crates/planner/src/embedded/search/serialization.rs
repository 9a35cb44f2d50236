//! Serialization of the goal: the conjuncts of the goal are achieved one after the other.
//!
//! Each part of a path works for a *subgoal*: the conjuncts achieved before, which it keeps or
//! restores, and one more, the cheapest of the candidates. So estimates are local: they reach for
//! one conjunct, and do not change with the others. When a state satisfies its subgoal, the next
//! one begins (SIW; Lipovetzky & Geffner, ECAI 2012; with estimates in place of novelty).
//!
//! Conjuncts that a relaxed plan for the whole goal makes false come last, such as vehicles that
//! return to the depot (goal agenda; Koehler & Hoffmann, JAIR 12, 2000).

use super::super::compile::{Action, Compiled, NONE};
use super::super::formula::{Literal, is_set, set};
use super::super::relaxed::{Estimate, OVERDRAWN, Subgoal};
use super::super::state::State;
use super::Search;
use super::goals::conjuncts;
use super::node;

/// A set of conjuncts of the goal, one bit for each.
type Conjuncts = Box<[u64]>;

/// The subgoal of a part of a path.
#[derive(Debug, PartialEq, Eq, Hash)]
pub(super) struct Agenda {
    /// The conjuncts of the goal that are kept, as a bit set.
    kept: Conjuncts,
    /// The conjuncts that may be achieved next, as a bit set.
    candidates: Conjuncts,
    /// The conjuncts that a relaxed plan made false on the path so far, as a bit set. They come
    /// last.
    postponed: Conjuncts,
    subgoal: Subgoal,
    /// `true` if the relaxed plan for the whole goal overdraws a consumable at the beginning of
    /// this part.
    is_overdrawn: bool,
}

impl Agenda {
    /// Returns `true` if a state satisfies the subgoal.
    fn is_reached(&self, compiled: &Compiled, state: &State) -> bool {
        let mut is_achieved = false;
        let is_kept = (0..)
            .zip(conjuncts(compiled, state))
            .all(|(number, holds)| {
                is_achieved |= holds && is_set(&self.candidates, number);
                holds || !is_set(&self.kept, number)
            });
        is_kept && is_achieved
    }

    /// Returns an estimate of the memory, in bytes.
    fn size(&self) -> usize {
        let words = 3 * self.kept.len();
        let Subgoal {
            kept,
            candidates,
            late_operators,
            costs,
        } = &self.subgoal;
        let numbers = kept.len() + candidates.len() + late_operators.len();
        size_of::<Self>() + 8 * words + 4 * numbers + costs.len()
    }
}

impl Search<'_> {
    /// Returns the estimate of a state, the number of its agenda, and the number of conjuncts that
    /// are not kept. Returns `None` for a dead end.
    pub(super) fn estimate_subgoal(
        &mut self,
        parent: u32,
        state: &State,
    ) -> Option<(Estimate, u32, u32)> {
        let parent = self.nodes.get(parent as usize);
        let before = parent.and_then(|parent| {
            let agenda = self.shared.agendas.get(parent.agenda)?;
            Some((agenda, parent))
        });
        let (number, left) = match before {
            Some((agenda, parent)) if !agenda.is_reached(self.compiled, state) => {
                (parent.agenda, parent.remaining)
            }
            _ => {
                let whole = self.relaxed.evaluate(state)?;
                let known =
                    before.map(|(agenda, _)| (agenda.kept.clone(), agenda.postponed.clone()));
                let agenda = self.next_agenda(state, known, &whole);
                let left = self.relaxed.graph().goal.len() - agenda.subgoal.kept.len();
                if agenda.subgoal.candidates.is_empty() {
                    return Some((whole, node::NONE, 0));
                }
                let size = agenda.size();
                let left = u32::try_from(left).unwrap_or(u32::MAX);
                if left < self.best.0
                    && let Some(novelty) = &mut self.novelty
                {
                    novelty.forget();
                }
                let (number, memory) = self.shared.agendas.number(agenda, size);
                self.memory += memory;
                (number, left)
            }
        };
        let agenda = self.shared.agendas.get(number)?;
        let mut estimate = self.relaxed.evaluate_subgoal(state, &agenda.subgoal)?;
        if agenda.is_overdrawn {
            estimate.steps += OVERDRAWN;
        }
        Some((estimate, number, left))
    }

    /// Returns the agenda after a state with a relaxed plan for the whole goal. `known` are the
    /// conjuncts kept and postponed so far.
    fn next_agenda(
        &mut self,
        state: &State,
        known: Option<(Conjuncts, Conjuncts)>,
        whole: &Estimate,
    ) -> Agenda {
        let (late_operators, costs) = self.relaxed.lateness(state, self.strategy.spreads_work);
        let goals = &self.relaxed.graph().goal;
        let words = goals.len().div_ceil(64);
        let empty = || vec![0; words].into_boxed_slice();
        let (mut kept, mut postponed) = known.unwrap_or_else(|| (empty(), empty()));
        for (number, is_undone) in (0..).zip(undone_literals(self.compiled, &whole.actions)) {
            // A tractor that unhitches early returns its plough to others, so the other search may
            // achieve a conjunct that is undone later.
            let stays = !self.strategy.spreads_work && is_set(&postponed, number);
            let is_last = is_undone || stays;
            set(&mut postponed, number, is_last);
        }
        let holds: Vec<bool> = conjuncts(self.compiled, state).collect();
        let mut open = (0..).zip(&holds).filter(|(_, holds)| !**holds);
        if open.all(|(number, _)| is_set(&postponed, number)) {
            // All others hold.
            postponed.fill(0);
        }
        let mut candidates = empty();
        for (number, holds) in (0..).zip(holds) {
            let is_last = is_set(&postponed, number);
            if holds {
                let is_kept = is_set(&kept, number) || !is_last;
                set(&mut kept, number, is_kept);
            } else {
                set(&mut candidates, number, !is_last);
            }
        }
        let propositions = |set: &[u64]| {
            let members = (0..).zip(goals).filter(|(number, _)| is_set(set, *number));
            members.map(|(_, &goal)| goal).collect()
        };
        Agenda {
            subgoal: Subgoal {
                kept: propositions(&kept),
                candidates: propositions(&candidates),
                late_operators,
                costs,
            },
            kept,
            postponed,
            candidates,
            is_overdrawn: whole.steps >= OVERDRAWN,
        }
    }
}

/// Returns for each literal of the goal whether one of the actions makes it false.
fn undone_literals(compiled: &Compiled, actions: &[u32]) -> Vec<bool> {
    let is_undone = |literal: &Literal| {
        let mut actions = actions.iter().map(|&action| compiled.action(action));
        actions.any(|action| makes_false(compiled, action, *literal))
    };
    compiled.goal.literals.iter().map(is_undone).collect()
}

/// Returns `true` if the literal is false after the action because of it.
fn makes_false(compiled: &Compiled, action: &Action, literal: Literal) -> bool {
    let fact = literal.fact();
    let written = [action.end, action.start].into_iter().find_map(|snap| {
        let snap = (snap != NONE).then(|| compiled.snap(snap))?;
        let adds = snap.adds.contains(&fact);
        (adds || snap.deletes.contains(&fact)).then_some(adds)
    });
    written.is_some_and(|truth| truth != literal.truth())
}
