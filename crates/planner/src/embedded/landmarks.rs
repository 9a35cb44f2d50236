//! Landmarks: propositions that every plan must make true at some time, their order, and the number
//! of them that a sequence of choices still lacks. They decompose the goal into consecutive
//! subgoals.
//!
//! They are the facts and numeric tests that each relaxed plan goes through (see
//! `relaxed::labels`). Of two landmarks, one is ordered before the other
//!
//! - *naturally*, if each relaxed plan for the other goes through it,
//! - *greedy-necessarily*, if every operator that makes the other true for the first time also
//!   needs it (Hoffmann, Porteous & Sebastia, JAIR 22, 2004).
//!
//! A landmark is *accepted* when it is true and all landmarks ordered before it were accepted. The
//! remaining landmarks are those not accepted, and those needed again: they are false, although the
//! goal or a remaining landmark needs them (the landmark-counting heuristic of LAMA; Richter &
//! Westphal, JAIR 39, 2010).

#[cfg(test)]
mod tests;

use super::compile::{Compiled, NONE};
use super::formula::{Literal, is_set, set};
use super::relaxed::{Graph, Labels};
use super::state::{OpenAction, State};

/// A proposition that must be true at some time.
#[derive(Clone, Debug)]
pub(crate) struct Landmark {
    /// A literal or a test, by its number in the relaxed problem.
    pub(crate) proposition: u32,
    /// `true` if the proposition is part of the goal.
    pub(crate) is_goal: bool,
    /// The landmarks that come before it, as a bit set.
    after: Vec<u64>,
    /// The landmarks that need it just before they become true.
    needed_by: Vec<u32>,
}

/// The landmarks of a problem, in an order that extends the natural order.
#[derive(Clone, Debug, Default)]
pub(crate) struct Landmarks {
    pub(crate) list: Vec<Landmark>,
    first_test: u32,
    /// Number of landmarks that are not goals and did not hold in the initial state.
    pub(crate) intermediate_count: usize,
}

impl Landmarks {
    /// Returns the landmarks from a state for the goal and for the ends of the running actions,
    /// given the labels of the state. Returns `None` if they are unreachable.
    pub(crate) fn of(graph: &Graph, labels: &Labels, open: &[OpenAction]) -> Option<Self> {
        let mut wanted = graph.goal.clone();
        for open in open {
            let end = &graph.operators[graph.end_of[open.action as usize] as usize];
            wanted.extend_from_slice(&graph.preconditions[end.preconditions.clone()]);
        }
        let to_reach = labels.of_all(&wanted)?;
        let needs = first_needs(graph, labels, &to_reach);
        // In the natural order, earlier landmarks have smaller labels.
        let size = |&proposition: &u32| labels.of(proposition).map_or(0, <[u32]>::len);
        let goals = graph.goal.iter().copied();
        let held = goals.chain(needs.iter().flatten().copied());
        let mut all: Vec<u32> = held
            .filter(|&held| graph.is_listed(held) && labels.held_initially(held))
            .chain(to_reach.iter().copied())
            .collect();
        all.sort_unstable();
        all.dedup();
        all.sort_by_key(size);
        let mut place = vec![NONE; graph.proposition_count];
        for (number, &proposition) in (0..).zip(&all) {
            place[proposition as usize] = number;
        }
        let mut list: Vec<Landmark> = all
            .iter()
            .map(|&proposition| {
                let mut after = vec![0; all.len().div_ceil(64)];
                for &before in labels.of(proposition).unwrap_or_default() {
                    set(&mut after, place[before as usize], before != proposition);
                }
                Landmark {
                    proposition,
                    is_goal: graph.goal.contains(&proposition),
                    after,
                    needed_by: Vec::new(),
                }
            })
            .collect();
        for (&proposition, needs) in to_reach.iter().zip(&needs) {
            let needed_by = place[proposition as usize];
            for &need in needs {
                let need = place[need as usize];
                list[need as usize].needed_by.push(needed_by);
                set(&mut list[needed_by as usize].after, need, true);
            }
        }
        let first_test = graph.test(0);
        let is_goal = |proposition: &&u32| graph.goal.contains(proposition);
        let on_the_way = to_reach.len() - to_reach.iter().filter(is_goal).count();
        Some(Self {
            list,
            first_test,
            intermediate_count: on_the_way,
        })
    }

    /// Returns the accepted landmarks of a state, given those of its predecessor (`None` for the
    /// first state), and the number of remaining landmarks.
    pub(crate) fn progress(
        &self,
        compiled: &Compiled,
        before: Option<&[u64]>,
        state: &State,
    ) -> (Vec<u64>, u32) {
        let mut accepted = match before {
            Some(before) => before.to_vec(),
            None => vec![0; self.list.len().div_ceil(64)],
        };
        let mut is_false = Vec::with_capacity(self.list.len());
        for (number, landmark) in (0..).zip(&self.list) {
            let is_true = self.is_true(compiled, state, landmark.proposition);
            is_false.push(!is_true);
            let mut comes_after = landmark.after.iter().zip(&accepted);
            if is_true && comes_after.all(|(after, accepted)| after & !accepted == 0) {
                set(&mut accepted, number, true);
            }
        }
        let is_accepted = |number: u32| is_set(&accepted, number);
        let is_left = |(number, landmark): &(u32, &Landmark)| {
            !is_accepted(*number)
                || is_false[*number as usize]
                    && (landmark.is_goal || !landmark.needed_by.iter().all(|&by| is_accepted(by)))
        };
        let left = (0..).zip(&self.list).filter(is_left).count();
        let left = u32::try_from(left).unwrap_or(u32::MAX);
        (accepted, left)
    }

    fn is_true(&self, compiled: &Compiled, state: &State, proposition: u32) -> bool {
        match proposition.checked_sub(self.first_test) {
            None => Literal(proposition).holds(&state.facts),
            Some(test) => state.test_holds(compiled, test, None),
        }
    }
}

/// Returns for each of these propositions the preconditions common to all operators that can make
/// it true for the first time.
fn first_needs(graph: &Graph, labels: &Labels, to_reach: &[u32]) -> Vec<Vec<u32>> {
    let mut needs: Vec<Option<Vec<u32>>> = vec![None; to_reach.len()];
    labels.visit_achievers(graph, &mut |operator, proposition| {
        let Ok(place) = to_reach.binary_search(&proposition) else {
            return;
        };
        let preconditions = graph.operators[operator as usize].preconditions.clone();
        let own = &graph.preconditions[preconditions];
        let goes_through = |need: &u32| {
            let label = labels.of(*need).unwrap_or_default();
            label.binary_search(&proposition).is_ok()
        };
        if own.iter().any(goes_through) {
            return;
        }
        let is_listed = |need: &u32| graph.is_listed(*need);
        match &mut needs[place] {
            Some(needs) => needs.retain(|need| own.binary_search(need).is_ok()),
            none => *none = Some(own.iter().copied().filter(is_listed).collect()),
        }
    });
    needs.into_iter().map(Option::unwrap_or_default).collect()
}
