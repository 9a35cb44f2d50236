//! Extraction of the relaxed plan from the cheapest achievers.

use elbowroom_num::Rational;

use super::super::apply::Step;
use super::super::compile::{Macro, NONE, Timed};
use super::super::formula::Literal;
use super::super::state::State;
use super::graph::Kind;
use super::{Estimate, Relaxed};

/// The additional cost of a relaxed plan that overdraws a consumable.
pub(crate) const OVERDRAWN: u32 = 1 << 20;

impl Relaxed<'_> {
    /// Counts the steps of a relaxed plan, and records its first steps.
    pub(super) fn extract(&mut self, state: &State, mut wanted: Vec<u32>, estimate: &mut Estimate) {
        let mut used: Vec<u32> = Vec::new();
        let mut touched: Vec<u32> = Vec::new();
        for open in &state.open {
            let end = self.graph.end_of[open.action as usize];
            Self::use_operator(&mut self.is_used, &mut used, end);
            let needs = self.graph.operators[end as usize].preconditions.clone();
            wanted.extend_from_slice(&self.graph.preconditions[needs]);
        }
        if !self.consumables.is_empty() {
            self.consumables.reset(state);
        }
        self.collect(&mut wanted, &mut used, &mut touched, estimate);
        if !self.consumables.is_empty() && self.consumables.are_overdrawn() {
            estimate.steps += OVERDRAWN;
        }
        let mut later = Vec::new();
        if !self.resources.is_empty() {
            later = self.add_replenishment(state, &mut wanted, &mut used, &mut touched, estimate);
        }
        for &operator in &used {
            let data = &self.graph.operators[operator as usize];
            let own = self.own_cost[operator as usize];
            estimate.steps += own;
            self.is_used[operator as usize] = false;
            if self.lists_actions {
                match data.kind {
                    Kind::Start(action) | Kind::Compressed(action) => estimate.actions.push(action),
                    Kind::Macro(number) => {
                        let Macro { envelope, content } = self.compiled.macros[number as usize];
                        estimate.actions.extend([envelope, content]);
                    }
                    Kind::End(_) | Kind::Timed(_) | Kind::Axiom => {}
                }
            }
            let is_next = self.operator_cost[operator as usize] == own;
            let is_next = is_next && !later.contains(&operator);
            if is_next || matches!(data.kind, Kind::Timed(_)) {
                push_steps(data.kind, state, &mut estimate.preferred);
            }
        }
        if self.lists_subgoals {
            let literals = 2 * self.compiled.facts.len();
            let subgoals = touched.iter().filter(|&&index| (index as usize) < literals);
            estimate.subgoals = subgoals.map(|&index| Literal(index)).collect();
        }
        for proposition in touched {
            self.is_wanted[proposition as usize] = false;
        }
        estimate.preferred.sort_unstable();
        estimate.preferred.dedup();
        estimate.actions.sort_unstable();
        estimate.actions.dedup();
    }

    /// Collects the operators of the relaxed plan for the wanted propositions.
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
            if self.consumables.is_empty() || !self.close_gap(proposition, wanted, used, estimate) {
                let operator = self.achiever[index];
                self.add_with_preconditions(operator, wanted, used);
                let more = self.repetitions[index] - 1;
                estimate.steps += more * self.graph.cost_of_repetition(operator);
            }
        }
    }

    /// Adds an operator to the plan unless it is part of it, and its preconditions to the wanted
    /// propositions. Returns `true` if it is new.
    fn add_with_preconditions(
        &mut self,
        operator: u32,
        wanted: &mut Vec<u32>,
        used: &mut Vec<u32>,
    ) -> bool {
        if !Self::use_operator(&mut self.is_used, used, operator) {
            return false;
        }
        self.consumables.draw(operator, 1);
        let data = &self.graph.operators[operator as usize];
        wanted.extend_from_slice(&self.graph.preconditions[data.preconditions.clone()]);
        if let Kind::Start(action) = data.kind {
            // A started action must end.
            let end = self.graph.end_of[action as usize];
            if end != NONE && self.missing[end as usize] == 0 {
                self.add_with_preconditions(end, wanted, used);
            }
        }
        true
    }

    /// Closes the gap of a test by steps that add to its difference, each as often as the
    /// consumables allow, beginning with the cheapest. Returns `false` if it is not such a test.
    fn close_gap(
        &mut self,
        proposition: u32,
        wanted: &mut Vec<u32>,
        used: &mut Vec<u32>,
        estimate: &mut Estimate,
    ) -> bool {
        let achiever = self.achiever[proposition as usize];
        let Some(test) = self.graph.test_of(proposition) else {
            return false;
        };
        let adders = self.consumables.adders(test);
        let Some(&(_, sign)) = adders.iter().find(|adder| adder.0 == achiever) else {
            return false;
        };
        let mut candidates: Vec<(bool, u32, u32, f64)> = adders
            .iter()
            .filter(|&&(step, gain)| {
                self.missing[step as usize] == 0 && (gain > 0.0) == (sign > 0.0)
            })
            .map(|&(step, gain)| {
                let cost = self.operator_cost[step as usize];
                (step != achiever, cost, step, gain.abs())
            })
            .collect();
        candidates.sort_unstable_by_key(|&(is_other, cost, step, _)| (is_other, cost, step));
        let mut gap = self.gaps[test as usize].abs();
        for (_, _, step, gain) in candidates {
            if gap < 1e-12 {
                break;
            }
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "clamped to a small positive range"
            )]
            let needed = (gap / gain).ceil().clamp(1.0, 1000.0) as u32;
            // One is already in the plan.
            let had = u32::from(self.is_used[step as usize]);
            let times = self.consumables.times(step, needed - had);
            if times > 0 {
                let more = times - u32::from(self.add_with_preconditions(step, wanted, used));
                self.consumables.draw(step, more);
                estimate.steps += more * self.graph.cost_of_repetition(step);
            }
            gap -= gain * f64::from(had + times);
        }
        if gap >= 1e-12 {
            self.add_with_preconditions(achiever, wanted, used);
            estimate.steps += OVERDRAWN;
        }
        true
    }

    /// Adds operators that replenish the resources used up by the relaxed plan. Returns the
    /// operators that are not worth a step before a resource is used up.
    fn add_replenishment(
        &mut self,
        state: &State,
        wanted: &mut Vec<u32>,
        used: &mut Vec<u32>,
        touched: &mut Vec<u32>,
        estimate: &mut Estimate,
    ) -> Vec<u32> {
        let mut later = Vec::new();
        self.resources.reset(self.compiled, state);
        let mut noted = 0;
        loop {
            for &operator in &used[noted..] {
                self.resources.note(operator, 1);
            }
            noted = used.len();
            if self.resources.is_short() {
                self.propagate_remaining_costs();
            }
            let (missing, costs) = (&self.missing, &self.operator_cost);
            let cost = |o: u32| (missing[o as usize] == 0).then(|| costs[o as usize]);
            let Some(shortage) = self.resources.shortage(cost) else {
                return later;
            };
            let data = &self.graph.operators[shortage.operator as usize];
            let is_new = Self::use_operator(&mut self.is_used, used, shortage.operator);
            if is_new && shortage.is_later {
                later.push(shortage.operator);
            }
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

    /// Counts the parts of the goal that future timed initials will make false, and a step for
    /// waiting. So the goal does not seem reached before they have happened.
    pub(super) fn await_timed(&self, state: &State, estimate: &mut Estimate) {
        let compiled = self.compiled;
        let due = &compiled.timed[state.timed as usize..compiled.timed_until_goal as usize];
        let is_lost = |literal: &&Literal| {
            let fact = literal.fact();
            let writes = due.iter().rev().find_map(|timed| {
                let adds = timed.adds.contains(&fact);
                (adds || timed.deletes.contains(&fact)).then_some(adds)
            });
            literal.holds(&state.facts) && writes.is_some_and(|truth| truth != literal.truth())
        };
        let mut undone = compiled.goal.literals.iter().filter(is_lost).count();
        undone += self.lost_tests(state, due);
        if undone == 0 && estimate.steps > 0 {
            return;
        }
        estimate.steps += u32::try_from(due.len() + undone).unwrap_or(u32::MAX >> 8);
        if !estimate.preferred.contains(&Step::Timed) {
            estimate.preferred.push(Step::Timed);
        }
    }

    /// Returns the number of tests of the goal that pass now, and fail with the values that timed
    /// initials will assign.
    fn lost_tests(&self, state: &State, due: &[Timed]) -> usize {
        let compiled = self.compiled;
        if compiled.goal.tests.is_empty() || due.iter().all(|timed| timed.assigns.is_empty()) {
            return 0;
        }
        let mut values = state.values.clone();
        for (fluent, value) in due.iter().flat_map(|timed| &timed.assigns) {
            values[*fluent as usize] = Some(value.clone());
        }
        let is_lost = |&&test: &&u32| {
            let data = &compiled.tests[test as usize];
            let after = data.difference.value(&values, None);
            state.test_holds(compiled, test, None)
                && after.is_some_and(|value| !data.comparison.holds(&value, &Rational::ZERO))
        };
        compiled.goal.tests.iter().filter(is_lost).count()
    }

    /// Lists the steps whose conditions hold in the state.
    pub(super) fn list_applicable(&mut self, state: &State, estimate: &mut Estimate) {
        for &operator in &self.applicable {
            let kind = self.graph.operators[operator as usize].kind;
            let is_possible = match kind {
                Kind::Timed(_) => false,
                Kind::Start(action) | Kind::Compressed(action) => {
                    !state.excludes(self.compiled, self.compiled.action(action))
                }
                Kind::Macro(number) => {
                    let Macro { envelope, content } = self.compiled.macros[number as usize];
                    [envelope, content]
                        .iter()
                        .all(|&a| !state.excludes(self.compiled, self.compiled.action(a)))
                }
                _ => true,
            };
            if is_possible {
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

/// Adds the steps that an operator represents.
fn push_steps(kind: Kind, state: &State, steps: &mut Vec<Step>) {
    match kind {
        Kind::Start(action) => steps.push(Step::Start(action)),
        Kind::Compressed(action) => steps.push(Step::Compressed(action)),
        Kind::Macro(number) => steps.push(Step::Macro(number)),
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
