//! The upper bound for worlds with [known times](super): an action that is ready to end may end at
//! any time of a happening, or when something becomes ready.
//!
//! Usually, it is best to end at once. A delayed end comes right before a happening that the end
//! would prevent, or it never comes. So if no such happening is possible while the action is
//! running, the agent ends or cancels the action before any other move.

use indexmap::IndexMap;

use super::postponement::may_be_better_later;
use crate::cell_probabilities::CellProbabilities;
use crate::graph::{Choice, Target};
use crate::process::action_model::{ActionModel, Ending, Facts};
use crate::process::world::TimedWorld;
use crate::settings::Side;
use crate::state::{Phase, State};
use crate::upper_bound::{Cell, Moment};

/// Cache of [`may_be_better_later`], by facts, running actions, past events, and the end.
pub(crate) type WaitingCache = IndexMap<(Facts, u64, u32, usize, Ending), bool>;

/// Classes of actions that differ only in their starts. While they are running, they are
/// interchangeable.
pub(crate) struct EndClasses {
    /// By action: the actions of its class, as bits.
    of: Vec<u64>,
}

impl EndClasses {
    pub(crate) fn new(world: &TimedWorld, chances: &CellProbabilities) -> Self {
        let end_alike = |one: usize, other: usize| {
            one == other
                || (chances.ends[one] == chances.ends[other]
                    && has_same_end(&world.acts[one], &world.acts[other])
                    && world.can_gain_by_cancelling(one) == world.can_gain_by_cancelling(other))
        };
        let acts = 0..world.acts.len();
        let of = acts.clone().map(|one| {
            let others = acts.clone().filter(|other| end_alike(one, *other));
            others.fold(0, |all, other| all | 1 << other)
        });
        Self { of: of.collect() }
    }

    /// Returns the action that represents `act` while it is running: the first one of its class
    /// that is not running.
    pub(crate) fn representative(&self, state: &State, act: usize) -> Option<usize> {
        let free = self.of[act] & !state.running_actions();
        (free != 0).then(|| free.trailing_zeros() as usize)
    }
}

/// Returns `true` if two actions cannot fail, change no numbers at their ends, and have equal ends.
fn has_same_end(one: &ActionModel, other: &ActionModel) -> bool {
    let (Some((one_over_all, one_end)), Some((other_over_all, other_end))) =
        (&one.rest, &other.rest)
    else {
        return false;
    };
    let can_fail = one.can_fail() || other.can_fail();
    let about_numbers = !one_end.amounts.is_empty() || !other_end.amounts.is_empty();
    !can_fail
        && !about_numbers
        && one_over_all == other_over_all
        && one_end.needs == other_end.needs
        && (one_end.adds, one_end.deletes) == (other_end.adds, other_end.deletes)
}

impl Cell<'_> {
    /// Returns the choices of the move that is optimal to make first, if there is one.
    pub(crate) fn dominant_choices(
        &mut self,
        moment: &Moment,
        startable: &[usize],
    ) -> Option<Vec<Choice>> {
        let world = self.bound.world;
        let (state, coming) = moment;
        // An action may end as late as the agent likes and can be cancelled, so a start without
        // effects is never harmful.
        let for_nothing = startable.iter().find(|act| {
            let act = &world.acts[**act];
            let rest = act.rest.as_ref();
            act.start.does_nothing()
                && rest.is_some_and(|(over_all, _)| over_all.holds(state.facts))
        });
        if let Some(act) = for_nothing {
            return Some(vec![self.start(state, *coming, *act)]);
        }
        for (place, running) in state.running.iter().enumerate() {
            let act = usize::from(running.act);
            let Phase::Ready(ending) = running.phase else {
                continue;
            };
            if !self.has_reason_to_wait(state, act, ending) {
                let after = state.ended(world, place, ending);
                let mut only = vec![vec![(1.0, vec![self.target((after, *coming))])]];
                if world.can_gain_by_cancelling(act) {
                    only.push(self.cancel(moment, place));
                }
                return Some(only);
            }
        }
        None
    }

    /// Returns the choices to restart a running action, or to start an action of the same class
    /// instead. There is no other use of cancelling, because actions need not end.
    pub(crate) fn restart_choices(&mut self, moment: &Moment, place: usize) -> Vec<Choice> {
        let bound = self.bound;
        let world = bound.world;
        let (state, coming) = moment;
        let own = usize::from(state.running[place].act);
        let Some(alike) = &bound.end_classes else {
            return Vec::new();
        };
        if alike.representative(state, own).is_some() || !world.can_gain_by_cancelling(own) {
            return Vec::new();
        }
        let mut without = state.clone();
        without.running.remove(place);
        let is_of_use = |act: &usize| {
            let (bit, act) = (1 << act, &world.acts[*act]);
            alike.of[own] & bit != 0
                && (!act.start.does_nothing() || act.has_random_ends())
                && act.start.needs.holds(state.facts)
        };
        let acts: Vec<usize> = (0..world.acts.len()).filter(is_of_use).collect();
        acts.into_iter()
            .map(|act| self.start(&without, *coming, act))
            .collect()
    }

    /// Returns the target of waiting until the next possible happening.
    pub(crate) fn advance_to_next_happening(&mut self, mut state: State) -> Target {
        // The start of an action that is ready is irrelevant.
        for running in &mut state.running {
            if running.phase != Phase::Open {
                running.since = 0;
            }
        }
        state.running.sort_unstable();
        let (world, chances) = (self.bound.world, self.bound.chances);
        let Some(cell) = chances.next(&state, self.number + 1) else {
            return Target::DeadEnd;
        };
        let has_hope = state.can_reach_goal(world, self.reachability)
            && chances.can_reach_goal_in_time(world, &state, cell, Side::Above);
        if has_hope {
            Target::later(self.later, cell, state)
        } else {
            Target::DeadEnd
        }
    }

    /// Returns `true` if an end may be better after a happening that is possible while its action
    /// is running.
    fn has_reason_to_wait(&mut self, state: &State, act: usize, ending: Ending) -> bool {
        let world = self.bound.world;
        let (facts, under_way) = (state.facts | world.tested, state.running_actions());
        let key = (facts, under_way, state.happened, act, ending);
        let alike = self.bound.end_classes.as_ref();
        let is_alone = alike.is_some_and(|alike| alike.of[act] == 1 << act);
        *self
            .reasons
            .entry(key)
            .or_insert_with(|| may_be_better_later(world, key, is_alone))
    }
}
