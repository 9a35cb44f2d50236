//! What must hold, now or throughout.

use elbowroom_num::Rational;

use super::super::compile::Action;
use super::super::expressions::Moment;
use super::super::formula::Formula;
use super::super::network::SETTLED;
use super::super::state::{Open, State};
use super::super::symbolic;
use super::{Stepper, duration_form};

impl Stepper<'_> {
    /// Demands the goal of the times.
    pub(crate) fn reach_goal(&mut self, state: &mut State) -> Option<()> {
        let goal = &self.compiled.goal;
        self.demand(state, goal, None, &Moment::default())?;
        self.has_times(state).then_some(())
    }

    /// Requires a condition, now or, where numbers depend on times, of the times.
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
    pub(super) fn watch_all(
        &mut self,
        state: &mut State,
        open: &Open,
        moment: &Moment,
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
        symbolic::demand_formula(self.compiled, state, over_all, &moment, lost)
    }

    /// Demands the over-all conditions that read one of the fluents, of all that is under way.
    pub(super) fn watch(
        &mut self,
        state: &mut State,
        fluents: &[u32],
        moment: &Moment,
    ) -> Option<()> {
        for place in 0..state.open.len() {
            let over_all = &self.compiled.action(state.open[place].action).over_all;
            let mut reads = false;
            over_all.visit_tests(&mut |test| {
                let difference = &self.compiled.tests[test as usize].difference;
                difference.visit_fluents(&mut |fluent| reads |= fluents.contains(&fluent));
            });
            if reads {
                let open = state.open[place].clone();
                self.watch_all(state, &open, moment)?;
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
                state.passes(self.compiled, test, duration)
            })
            .then_some(())
    }

    /// Whether the over-all conditions of the actions under way still hold.
    pub(super) fn keeps_conditions(&self, state: &State) -> Option<()> {
        if state.symbolic.is_some() {
            return self.keeps_facts(state);
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

    /// The same where numbers depend on times and are watched as they change.
    fn keeps_facts(&self, state: &State) -> Option<()> {
        let symbolic = state.symbolic.as_ref()?;
        let may_pass = |test: u32, open: &Open| {
            let mut is_governed = false;
            let difference = &self.compiled.tests[test as usize].difference;
            difference.visit_fluents(&mut |fluent| is_governed |= symbolic.governs(fluent));
            is_governed
                || difference.reads_duration()
                || state.passes(self.compiled, test, open.duration.as_ref())
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

    /// Which of the action's guards hold now, a bit each.
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
