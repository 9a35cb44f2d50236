//! Projections of a world: facts are omitted as if they always had the best values. Every agent
//! that succeeds in the world also succeeds in its projection, which has fewer states.
//!
//! Omitted are facts that can be made true for certain without a delay of the goal. Such a fact is
//! read only by conditions at starts and ends. It is added only by starts, and by certain ends of
//! actions that delete only such facts. Without it, the earliest time of the goal is the same.

use super::cell_probabilities::CellProbabilities;
use super::process::action_model::{ActionModel, Event, Facts};
use super::process::world::TimedWorld;
use super::settings::Side;
use super::state::State;

impl TimedWorld {
    /// Returns the projection without facts that can be made true for certain without a delay of
    /// the goal. `None` if there are none, or if fewer facts may be better.
    ///
    /// `chances` are those of this world for the upper bound, on a grid with [known
    /// times](super::discrete_events).
    pub(super) fn without_certainties(&self, chances: &CellProbabilities) -> Option<Self> {
        if !self.is_monotone {
            return None;
        }
        let soonest = |world: &Self| {
            let state = State::initial(world);
            chances.earliest_goal_cell(world, &state, 0, Side::Above)
        };
        let first = soonest(self)?;
        let certain = self.certain_facts();
        let mut left_out: Facts = 0;
        for bit in (0..self.facts.len()).map(|place| 1 << place) {
            let more = left_out | bit;
            if certain & bit != 0 && soonest(&self.without_facts(more)) == Some(first) {
                left_out = more;
            }
        }
        let mut leaner = self.without_facts(left_out);
        leaner.acts.retain(|act| act.adds() != 0 || act.can_help());
        if leaner.acts.len() == self.acts.len() {
            return None;
        }
        leaner.cut().ok()?;
        leaner.compute_changes();
        Some(leaner)
    }

    /// Returns the facts that an agent can make true for certain.
    fn certain_facts(&self) -> Facts {
        let by_chance = |event: &Event| event.adds | event.deletes;
        let events = self
            .events
            .iter()
            .fold(0, |all, event| all | by_chance(event));
        let all: Facts = (0..self.facts.len()).fold(0, |all, place| all | 1 << place);
        let mut certain =
            all & !events & !self.goal.mentions() & !self.facts_before_random_results();
        for act in &self.acts {
            if act.can_fail() {
                certain &= !act.adds();
            } else if let Some((_, end)) = &act.rest
                && act.has_random_ends()
            {
                certain &= !end.adds;
            }
            // Over-all conditions exclude actions that delete their facts.
            if let Some((over_all, _)) = &act.rest {
                certain &= !over_all.mentions();
            }
        }
        loop {
            let before = certain;
            for act in &self.acts {
                if act.deletes() & !certain != 0 {
                    certain &= !act.rest.as_ref().map_or(0, |(_, end)| end.adds);
                }
            }
            if certain == before {
                return certain;
            }
        }
    }

    /// Returns the facts in the start conditions of actions with random results, and of actions
    /// that lead to these. Omitting them would allow more attempts. Actions that reach the goal are
    /// ignored.
    fn facts_before_random_results(&self) -> Facts {
        let mut leading: Facts = 0;
        loop {
            let leads = |act: &&ActionModel| {
                let leads = act.has_random_ends() || act.adds() & leading != 0;
                leads && !act.achieves_goal(&self.goal)
            };
            let acts = self.acts.iter().filter(leads);
            let more = acts.fold(leading, |all, act| all | act.start.needs.mentions());
            if more == leading {
                return leading;
            }
            leading = more;
        }
    }

    /// Returns the world where these facts always have the best values.
    fn without_facts(&self, facts: Facts) -> Self {
        let mut leaner = self.clone();
        let snaps = leaner.acts.iter_mut().flat_map(|act| {
            let end = act.rest.iter_mut().map(|(over_all, end)| {
                *over_all = over_all.without(facts, true);
                end
            });
            end.chain([&mut act.start])
        });
        for snap in snaps {
            snap.needs = snap.needs.without(facts, true);
            snap.adds &= !facts;
            snap.deletes &= !facts;
        }
        let failures = leaner.acts.iter_mut().flat_map(|act| &mut act.failures);
        for failed in failures {
            failed.adds &= !facts;
            failed.deletes &= !facts;
        }
        leaner.initial &= !facts;
        leaner
    }
}
