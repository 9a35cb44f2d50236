//! Goal test, and the steps that lead to a state.

use std::borrow::Cow;

use elbowroom_num::Rational;

use super::super::apply::{Step, Stepper};
use super::super::compile::Compiled;
use super::super::state::State;
use super::super::symbolic;
use super::{ROOT, Search};

/// Returns `true` if a plan can end in this state.
pub(crate) fn is_goal(compiled: &Compiled, state: &State) -> bool {
    if !state.open.is_empty() {
        return false;
    }
    // The goal is evaluated after all timed initials.
    let mut stepper = Stepper::new(compiled);
    let mut state = Cow::Borrowed(state);
    while state.timed < compiled.timed_until_goal {
        if stepper.advance(state.to_mut(), Step::Timed).is_none() {
            return false;
        }
    }
    if state.symbolic.is_some() {
        stepper.reach_goal(state.to_mut()).is_some()
    } else {
        let mut passes = |test| state.test_holds(compiled, test, None);
        compiled.goal.holds(&state.facts, &mut passes)
    }
}

/// Returns for each conjunct of the goal whether it holds: literals, then tests, then choices.
pub(super) fn conjuncts(compiled: &Compiled, state: &State) -> impl Iterator<Item = bool> {
    let goal = &compiled.goal;
    let passes = |test: u32| state.test_holds(compiled, test, None);
    let literals = goal.literals.iter().map(|l| l.holds(&state.facts));
    let tests = goal.tests.iter().map(move |&test| passes(test));
    let choices = goal.choices.iter().map(move |choice| {
        let mut passes = passes;
        choice
            .iter()
            .any(|part| part.holds(&state.facts, &mut passes))
    });
    literals.chain(tests).chain(choices)
}

/// Returns `true` if the numbers that remain after the ends of all running actions do not satisfy
/// the goal.
pub(super) fn misses_goal(compiled: &Compiled, state: &State) -> bool {
    let settled = |fluent| symbolic::settled_value(compiled, state, fluent);
    !compiled.goal.may_hold(&mut |test| {
        let test = &compiled.tests[test as usize];
        let mut values = state.values.clone();
        let mut is_known = true;
        test.difference.visit_fluents(&mut |fluent| {
            let value = settled(fluent);
            is_known &= value.is_some();
            values[fluent as usize] = value;
        });
        let difference = test.difference.value(&values, None);
        !is_known || difference.is_none_or(|value| test.comparison.holds(&value, &Rational::ZERO))
    })
}

impl Search<'_> {
    /// Returns the choices that lead to a state.
    pub(super) fn steps_to(&mut self, mut number: u32) -> Vec<Step> {
        let mut steps = Vec::new();
        loop {
            let origin = self.nodes[number as usize].origin;
            let Some(step) = origin.next().filter(|_| origin.parent != ROOT) else {
                break;
            };
            let parent = origin.parent;
            let before = self.states.get(parent);
            let single = step.parts(self.compiled, &before);
            steps.extend(single.into_iter().rev());
            number = parent;
        }
        steps.reverse();
        steps
    }

    /// Returns `true` if the metric of a goal state may be within the limit. For metrics that do
    /// not only grow, this avoids unnecessary validation.
    pub(super) fn may_be_better(&self, state: &State) -> bool {
        let (Some(limit), Some(metric)) = (&self.limit, &self.compiled.metric) else {
            return true;
        };
        let mut to_come = self.compiled.timed[state.timed as usize..].iter();
        if to_come.any(|timed| !timed.assigns.is_empty()) {
            // The metric also counts after all timed initials.
            return true;
        }
        let spent = state.spent(metric);
        !metric.time.is_zero() || spent.is_none_or(|spent| spent <= limit.value)
    }
}
