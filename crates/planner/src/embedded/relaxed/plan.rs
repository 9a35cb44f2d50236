//! The relaxed plan: what is read off the cheapest achievers.

use super::super::apply::Step;
use super::super::compile::NONE;
use super::super::state::State;
use super::graph::Kind;
use super::{Estimate, Relaxed};

impl Relaxed<'_> {
    /// Counts the steps of a relaxed plan, and notes its first steps.
    pub(super) fn extract(&mut self, state: &State, estimate: &mut Estimate) {
        let mut wanted: Vec<u32> = self.graph.goal.clone();
        let mut used: Vec<u32> = Vec::new();
        let mut touched: Vec<u32> = Vec::new();
        for open in &state.open {
            let end = self.graph.end_of[open.action as usize];
            Self::use_operator(&mut self.is_used, &mut used, end);
            let needs = self.graph.operators[end as usize].preconditions.clone();
            wanted.extend_from_slice(&self.graph.preconditions[needs]);
        }
        self.collect(&mut wanted, &mut used, &mut touched, estimate);
        if !self.resources.is_empty() {
            self.fill_up(state, &mut wanted, &mut used, &mut touched, estimate);
        }
        for &operator in &used {
            let data = &self.graph.operators[operator as usize];
            estimate.steps += data.cost;
            self.is_used[operator as usize] = false;
            let is_next = self.operator_cost[operator as usize] == data.cost;
            if is_next || matches!(data.kind, Kind::Timed(_)) {
                push_steps(data.kind, state, &mut estimate.preferred);
            }
        }
        for proposition in touched {
            self.is_wanted[proposition as usize] = false;
        }
        estimate.preferred.sort_unstable();
        estimate.preferred.dedup();
    }

    /// Collects the operators of the relaxed plan for what is wanted.
    fn collect(
        &mut self,
        wanted: &mut Vec<u32>,
        used: &mut Vec<u32>,
        touched: &mut Vec<u32>,
        estimate: &mut Estimate,
    ) {
        while let Some(proposition) = wanted.pop() {
            let index = proposition as usize;
            if self.cost[index] == 0 || std::mem::replace(&mut self.is_wanted[index], true) {
                continue;
            }
            touched.push(proposition);
            let operator = self.achiever[index];
            let data = &self.graph.operators[operator as usize];
            estimate.steps += (self.repetitions[index] - 1) * data.cost;
            if Self::use_operator(&mut self.is_used, used, operator) {
                wanted.extend_from_slice(&self.graph.preconditions[data.preconditions.clone()]);
                if let Kind::Start(action) = data.kind {
                    // What starts must end.
                    let end = self.graph.end_of[action as usize];
                    if end != NONE
                        && self.missing[end as usize] == 0
                        && Self::use_operator(&mut self.is_used, used, end)
                    {
                        let needs = self.graph.operators[end as usize].preconditions.clone();
                        wanted.extend_from_slice(&self.graph.preconditions[needs]);
                    }
                }
            }
        }
    }

    /// Adds what fills up the resources that the relaxed plan uses up.
    fn fill_up(
        &mut self,
        state: &State,
        wanted: &mut Vec<u32>,
        used: &mut Vec<u32>,
        touched: &mut Vec<u32>,
        estimate: &mut Estimate,
    ) {
        self.resources.begin(state);
        let mut noted = 0;
        loop {
            for &operator in &used[noted..] {
                self.resources.note(operator, 1);
            }
            noted = used.len();
            let (missing, costs) = (&self.missing, &self.operator_cost);
            let cost = |o: u32| (missing[o as usize] == 0).then(|| costs[o as usize]);
            let Some(shortage) = self.resources.shortage(cost) else {
                break;
            };
            let data = &self.graph.operators[shortage.operator as usize];
            let is_new = Self::use_operator(&mut self.is_used, used, shortage.operator);
            let more = shortage.times - u32::from(is_new);
            self.resources.note(shortage.operator, more);
            estimate.steps += more * data.cost;
            wanted.extend_from_slice(&self.graph.preconditions[data.preconditions.clone()]);
            self.collect(wanted, used, touched, estimate);
        }
    }

    fn use_operator(is_used: &mut [bool], used: &mut Vec<u32>, operator: u32) -> bool {
        let is_new = !std::mem::replace(&mut is_used[operator as usize], true);
        if is_new {
            used.push(operator);
        }
        is_new
    }

    /// Lists the steps whose conditions hold in the state.
    pub(super) fn list_applicable(&mut self, state: &State, estimate: &mut Estimate) {
        for &operator in &self.applicable {
            let kind = self.graph.operators[operator as usize].kind;
            if !matches!(kind, Kind::Timed(_)) {
                push_steps(kind, state, &mut estimate.applicable);
            }
        }
        if (state.timed as usize) < self.compiled.timed.len() {
            estimate.applicable.push(Step::Timed);
        }
        estimate.applicable.sort_unstable();
        estimate.applicable.dedup();
    }
}

/// The steps that an operator stands for.
fn push_steps(kind: Kind, state: &State, steps: &mut Vec<Step>) {
    match kind {
        Kind::Start(action) => steps.push(Step::Start(action)),
        Kind::Whole(action) => steps.push(Step::Whole(action)),
        Kind::End(action) => {
            for (place, open) in (0..).zip(&state.open) {
                if open.action == action {
                    steps.push(Step::End(place));
                }
            }
        }
        Kind::Timed(_) => steps.push(Step::Timed),
        Kind::Axiom => {}
    }
}
