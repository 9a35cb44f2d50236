//! Conditions that must hold at one moment, or while an action runs.

use elbowroom_num::Rational;

use super::super::compile::Action;
use super::super::expressions::Moment;
use super::super::formula::Formula;
use super::super::network::SETTLED;
use super::super::state::{OpenAction, State};
use super::super::symbolic::{self, Piece};
use super::{Stepper, duration_form};

/// Maximum number of alternatives of a goal that are tried one by one.
const MAX_GOALS: usize = 32;

/// Position of a moment relative to the open interval of an over-all condition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    /// Just after the start of the action.
    Beginning,
    /// Before anything changes at the moment.
    Arrival,
    /// After the changes of a moment between start and end.
    After,
}

impl Stepper<'_> {
    /// Demands the goal: adds the first of its alternatives that some times satisfy.
    pub(crate) fn reach_goal(&mut self, state: &mut State) -> Option<()> {
        let goal = &self.compiled.goal;
        let has_tests = |part: &Formula| {
            let mut has_tests = false;
            part.visit_tests(&mut |_| has_tests = true);
            has_tests
        };
        let alternatives = goal.alternatives(&has_tests, MAX_GOALS);
        let alternatives = alternatives.unwrap_or_else(|| vec![goal.clone()]);
        alternatives.iter().find_map(|goal| {
            let mut attempt = state.clone();
            self.demand(&mut attempt, goal, None, &Moment::default())?;
            let is_possible = if alternatives.len() > 1 {
                symbolic::is_possible(&mut attempt, self.compiled, None)
            } else {
                true
            };
            if !is_possible || !self.has_times(&mut attempt) {
                return None;
            }
            *state = attempt;
            Some(())
        })
    }

    /// Requires a condition now. If numbers depend on times, adds a demand on the times.
    pub(super) fn demand(
        &mut self,
        state: &mut State,
        condition: &Formula,
        duration: Option<&Rational>,
        moment: &Moment,
    ) -> Option<()> {
        if state.symbolic.is_none() {
            return self.require(state, condition, duration);
        }
        let lost = &mut self.has_rounded;
        symbolic::demand_formula(self.compiled, state, condition, moment, lost)
    }

    /// Demands the over-all condition of an action at some moment.
    pub(super) fn recheck_all(
        &mut self,
        state: &mut State,
        open: &mut OpenAction,
        (side, moment): (Side, &Moment),
    ) -> Option<()> {
        if state.symbolic.is_none() {
            return Some(());
        }
        let over_all = &self.compiled.action(open.action).over_all;
        let moment = Moment {
            time: moment.time.clone(),
            duration: (open.end != SETTLED || open.duration.is_some())
                .then(|| duration_form(open.duration.as_ref(), open.node, open.end)),
        };
        let lost = &mut self.has_rounded;
        let OpenAction {
            beginnings, chosen, ..
        } = open;
        let piece = match side {
            Side::Beginning => Piece::Begins(beginnings),
            Side::Arrival => Piece::Ends(beginnings),
            Side::After => {
                beginnings.clear();
                Piece::Within
            }
        };
        let at = (piece, &moment, chosen);
        symbolic::demand_over_all(self.compiled, state, over_all, at, lost)
    }

    /// Demands the over-all conditions of all running actions that read one of the fluents.
    pub(super) fn recheck_over_all(
        &mut self,
        state: &mut State,
        fluents: &[u32],
        (side, moment): (Side, &Moment),
    ) -> Option<()> {
        for place in 0..state.open.len() {
            let over_all = &self.compiled.action(state.open[place].action).over_all;
            let mut reads = false;
            over_all.visit_tests(&mut |test| {
                let difference = &self.compiled.tests[test as usize].difference;
                difference.visit_fluents(&mut |fluent| reads |= fluents.contains(&fluent));
            });
            if reads {
                let mut open = state.open[place].clone();
                self.recheck_all(state, &mut open, (side, moment))?;
                state.open[place] = open;
            }
        }
        Some(())
    }

    /// Requires a condition that does not depend on times.
    pub(super) fn require(
        &self,
        state: &State,
        condition: &Formula,
        duration: Option<&Rational>,
    ) -> Option<()> {
        condition
            .holds(&state.facts, &mut |test| {
                state.test_holds(self.compiled, test, duration)
            })
            .then_some(())
    }

    /// Returns `Some` if the over-all conditions of the running actions still hold.
    pub(super) fn preserves_conditions(&self, state: &State) -> Option<()> {
        if state.symbolic.is_some() {
            return self.preserves_facts(state);
        }
        state
            .open
            .iter()
            .all(|open| {
                let over_all = &self.compiled.action(open.action).over_all;
                self.require(state, over_all, open.duration.as_ref())
                    .is_some()
            })
            .then_some(())
    }

    /// Does the same as [`preserves_conditions`](Self::preserves_conditions) if numbers depend on
    /// times. Comparisons that read such numbers or durations count as true here, because they are
    /// checked when they change.
    fn preserves_facts(&self, state: &State) -> Option<()> {
        let symbolic = state.symbolic.as_ref()?;
        let may_pass = |test: u32, open: &OpenAction| {
            let mut is_governed = false;
            let difference = &self.compiled.tests[test as usize].difference;
            difference
                .visit_fluents(&mut |fluent| is_governed |= symbolic.is_time_dependent(fluent));
            is_governed
                || difference.reads_duration()
                || state.test_holds(self.compiled, test, open.duration.as_ref())
        };
        state
            .open
            .iter()
            .all(|open| {
                let over_all = &self.compiled.action(open.action).over_all;
                over_all.holds(&state.facts, &mut |test| may_pass(test, open))
            })
            .then_some(())
    }

    /// Returns the set of the action's guards that hold now, as a bit mask.
    pub(super) fn guards(
        &self,
        state: &State,
        action: &Action,
        duration: Option<&Rational>,
    ) -> u64 {
        let holds = |guard: &Formula| self.require(state, guard, duration).is_some();
        let guards = action.guards.iter().enumerate();
        guards.fold(0, |bits, (number, guard)| {
            bits | u64::from(holds(guard)) << number.min(63)
        })
    }
}
