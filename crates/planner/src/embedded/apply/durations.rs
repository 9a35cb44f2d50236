//! Durations of actions.

use elbowroom_model::problem::Comparison;
use elbowroom_num::Rational;

use super::super::compile::Action;
use super::super::expressions::Moment;
use super::super::state::State;
use super::super::symbolic;
use super::super::time::{NEVER, Ticks};
use super::Stepper;

impl Stepper<'_> {
    /// Returns the duration bounds of an action that would start now, and the duration if only one
    /// is possible.
    pub(super) fn duration_bounds(
        &mut self,
        state: &State,
        action: &Action,
    ) -> Option<(Ticks, Ticks, Option<Rational>)> {
        let mut least = action.duration.least.clone();
        let mut most = action.duration.most.clone();
        for bound in action.duration.bounds.iter().filter(|bound| !bound.at_end) {
            let value = match bound.value.value(&state.values, None) {
                // The value depends on times; it becomes a demand.
                None if state.symbolic.is_some() => continue,
                value => value?,
            };
            let (raises, lowers) = sides(bound.comparison);
            if raises && value > least {
                least.clone_from(&value);
            }
            if lowers && most.as_ref().is_none_or(|most| value < *most) {
                most = Some(value);
            }
        }
        if most.as_ref().is_some_and(|most| *most < least) {
            return None;
        }
        let scale = self.compiled.scale;
        let duration = (most.as_ref() == Some(&least)).then(|| least.clone());
        let (up, is_exact) = scale.ceil(&least);
        self.has_rounded |= !is_exact;
        let down = match &most {
            None => NEVER,
            Some(most) => {
                let (down, is_exact) = scale.floor(most);
                self.has_rounded |= !is_exact;
                down
            }
        };
        // Between two ticks, use the lower one for both bounds.
        let least = if up > down { down } else { up };
        Some((least, down, duration))
    }

    pub(super) fn narrow(
        &mut self,
        least: &mut Ticks,
        most: &mut Ticks,
        comparison: Comparison,
        value: &Rational,
    ) {
        let (raises, lowers) = sides(comparison);
        let (down, is_exact) = self.compiled.scale.floor(value);
        self.has_rounded |= !is_exact;
        if raises {
            *least = (*least).max(down);
        }
        if lowers {
            *most = (*most).min(down);
        }
    }
}

/// Demands the duration constraints that depend on the state.
pub(super) fn demand_duration(
    state: &mut State,
    action: &Action,
    at_end: bool,
    moment: &Moment,
) -> Option<()> {
    for bound in action
        .duration
        .bounds
        .iter()
        .filter(|bound| bound.at_end == at_end)
    {
        let value = symbolic::value(state, &bound.value, moment)?;
        let duration = moment.duration.clone()?;
        let difference = duration.plus(&Rational::from(-1), &value);
        symbolic::demand(state, difference, bound.comparison)?;
    }
    Some(())
}

/// Returns whether a duration constraint is a lower bound, and whether it is an upper bound.
fn sides(comparison: Comparison) -> (bool, bool) {
    match comparison {
        Comparison::Less | Comparison::AtMost => (false, true),
        Comparison::Equal => (true, true),
        Comparison::AtLeast | Comparison::Greater => (true, false),
    }
}
