//! Fact landmarks of each proposition in the delete relaxation, as labels.
//!
//! The label of a proposition is the set of all propositions that each relaxed plan for it goes
//! through, including itself. An operator's label is the union of the labels of its preconditions,
//! a proposition's label the intersection of those of its achievers. Labels shrink from the first
//! ones found, down to the greatest fixpoint, which is exact (Zhu & Givan, "Landmark extraction via
//! planning graph propagation", ICAPS 2003 doctoral consortium; Keyder, Richter & Helmert, ECAI
//! 2010).
//!
//! A label lists literals and numeric tests that do not hold yet. Propositions that hold have an
//! empty label. Propositions for running actions and for alternatives are processed, but not
//! listed.

use std::collections::VecDeque;

use super::super::state::State;
use super::graph::{Graph, Kind};
use super::{Relaxed, UNREACHED};

/// The labels of all propositions during the propagation.
#[derive(Debug)]
pub(crate) struct Labels {
    /// In ascending order; `None` as long as the proposition is not reached.
    of: Vec<Option<Vec<u32>>>,
    /// Number of preconditions that each operator waits for; more than it has if it is excluded.
    missing: Vec<u32>,
    holds: Vec<bool>,
    gaps: Vec<f64>,
    pending: VecDeque<u32>,
    is_pending: Vec<bool>,
    union: Vec<u32>,
    spare: Vec<u32>,
}

impl Relaxed<'_> {
    /// Returns initial labels for a state, before the propagation. Returns `None` if the running
    /// actions cannot end in time.
    pub(crate) fn labels(&mut self, state: &State) -> Option<Labels> {
        let is_in_time = self.prepare(state, None);
        self.buckets.iter_mut().for_each(Vec::clear);
        if !is_in_time {
            return None;
        }
        let graph = &self.graph;
        let mut labels = Labels {
            of: vec![None; graph.proposition_count],
            missing: self.missing.clone(),
            holds: self.cost.iter().map(|&cost| cost != UNREACHED).collect(),
            gaps: self.gaps.clone(),
            pending: VecDeque::new(),
            is_pending: vec![false; graph.operators.len()],
            union: Vec::new(),
            spare: Vec::new(),
        };
        for &operator in &graph.sources {
            let kind = graph.operators[operator as usize].kind;
            let is_past = matches!(kind, Kind::Timed(timed) if timed < state.timed);
            if is_past {
                labels.missing[operator as usize] += 1;
            } else if labels.missing[operator as usize] == 0 {
                labels.enqueue(operator);
            }
        }
        for proposition in 0..graph.proposition_count {
            if labels.holds[proposition] {
                labels.of[proposition] = Some(Vec::new());
                labels.reach(graph, narrow(proposition));
            }
        }
        Some(labels)
    }

    /// Propagates labels for about `most` work. Returns the work done, and whether the propagation
    /// is complete.
    pub(crate) fn propagate(&self, labels: &mut Labels, most: u64) -> (u64, bool) {
        let mut work = 0;
        while work < most {
            let Some(operator) = labels.pending.pop_front() else {
                return (work, true);
            };
            labels.is_pending[operator as usize] = false;
            work += labels.fire(&self.graph, operator);
        }
        (work, false)
    }

    /// Returns the relaxed problem.
    pub(crate) fn graph(&self) -> &Graph {
        &self.graph
    }
}

impl Labels {
    /// Returns the label of a proposition, or `None` if it is unreachable.
    pub(crate) fn of(&self, proposition: u32) -> Option<&[u32]> {
        self.of[proposition as usize].as_deref()
    }

    /// Returns `true` if the proposition held from the beginning.
    pub(crate) fn held_initially(&self, proposition: u32) -> bool {
        self.holds[proposition as usize]
    }

    /// Returns the union of the labels, or `None` if one of the propositions is unreachable.
    pub(crate) fn of_all(&self, propositions: &[u32]) -> Option<Vec<u32>> {
        let mut all = Vec::new();
        for &proposition in propositions {
            all.extend_from_slice(self.of(proposition)?);
        }
        all.sort_unstable();
        all.dedup();
        Some(all)
    }

    /// Calls `visit` with each reachable operator and each proposition that it achieves.
    pub(crate) fn visit_achievers(&self, graph: &Graph, visit: &mut dyn FnMut(u32, u32)) {
        for (number, operator) in graph.operators.iter().enumerate() {
            if self.missing[number] > 0 {
                continue;
            }
            for &effect in &graph.effects[operator.effects.clone()] {
                visit(narrow(number), effect);
            }
            for &(test, gain) in &graph.gains[operator.gains.clone()] {
                if gain.repetitions(self.gaps[test as usize]).is_some() {
                    visit(narrow(number), graph.test(test));
                }
            }
        }
    }

    /// Processes a proposition that is reached for the first time.
    fn reach(&mut self, graph: &Graph, proposition: u32) {
        for position in graph.dependents(proposition) {
            let operator = graph.needing_list[position];
            let missing = &mut self.missing[operator as usize];
            *missing -= 1;
            if *missing == 0 {
                self.enqueue(operator);
            }
        }
    }

    fn enqueue(&mut self, operator: u32) {
        if !std::mem::replace(&mut self.is_pending[operator as usize], true) {
            self.pending.push_back(operator);
        }
    }

    /// Restricts the labels of an operator's effects to those that its own label allows. Returns
    /// the work done.
    fn fire(&mut self, graph: &Graph, operator: u32) -> u64 {
        let data = &graph.operators[operator as usize];
        let mut union = std::mem::take(&mut self.union);
        union.clear();
        for need in &graph.preconditions[data.preconditions.clone()] {
            union.extend_from_slice(self.of[*need as usize].as_deref().unwrap_or_default());
        }
        union.sort_unstable();
        union.dedup();
        let mut work = 1 + 2 * union.len() as u64;
        for &effect in &graph.effects[data.effects.clone()] {
            work += self.lower(graph, effect, &union);
        }
        for &(test, gain) in &graph.gains[data.gains.clone()] {
            if gain.repetitions(self.gaps[test as usize]).is_some() {
                work += self.lower(graph, graph.test(test), &union);
            }
        }
        self.union = union;
        work
    }

    /// Intersects the label of a proposition with that of an achiever. Returns the work done.
    fn lower(&mut self, graph: &Graph, proposition: u32, union: &[u32]) -> u64 {
        if self.holds[proposition as usize] {
            return 1;
        }
        let is_listed = graph.is_listed(proposition);
        let Some(label) = &mut self.of[proposition as usize] else {
            let mut label = union.to_vec();
            if let (true, Err(place)) = (is_listed, label.binary_search(&proposition)) {
                label.insert(place, proposition);
            }
            let work = 1 + label.len() as u64;
            self.of[proposition as usize] = Some(label);
            self.reach(graph, proposition);
            return work;
        };
        let before = label.len();
        self.spare.clear();
        let mut others = union.iter().copied().peekable();
        for &own in label.iter() {
            while others.next_if(|&other| other < own).is_some() {}
            if others.peek() == Some(&own) || own == proposition {
                self.spare.push(own);
            }
        }
        if self.spare.len() < before {
            label.clone_from(&self.spare);
            for position in graph.dependents(proposition) {
                let operator = graph.needing_list[position];
                if self.missing[operator as usize] == 0 {
                    self.enqueue(operator);
                }
            }
        }
        1 + before as u64
    }
}

fn narrow(number: usize) -> u32 {
    u32::try_from(number).expect("fewer than 2^32 entries")
}
