//! States of the process: [`State`].

use indexmap::IndexMap;

use super::process::action_model::{Ending, Facts, Snap};
use super::process::value_intervals::Span;
use super::process::world::TimedWorld;
use super::settings::Side;

/// Cache of reachability checks of the goal.
pub(super) type ReachabilityCache = IndexMap<(Facts, u64, u32), bool>;

/// A state at the beginning of a cell.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct State {
    /// The true facts, and the comparisons that hold.
    pub(super) facts: Facts,
    pub(super) numbers: Vec<Span>,
    /// `true` if it is undecided whether an action was aborted or has failed, because of an
    /// interval of a number. Such a state counts as lost in the lower bound.
    pub(super) is_undecided: bool,
    /// Past events, as bits, without recurrent ones.
    pub(super) happened: u32,
    /// The running actions, sorted by action.
    pub(super) running: Vec<Running>,
    /// `true` if the agent may act before the next happening.
    pub(super) may_act: bool,
}

/// A running action.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct Running {
    pub(super) act: u8,
    /// The cell of its start.
    pub(super) since: u16,
    pub(super) phase: Phase,
}

/// Knowledge about the end of a running action.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) enum Phase {
    /// The end is unknown.
    Open,
    /// It may end in this cell, or in the next one.
    Ready(Ending),
    /// It ends in this cell.
    Due(Ending),
}

impl State {
    /// Returns the initial state, before any move or event.
    pub(super) fn initial(world: &TimedWorld) -> Self {
        let numbers: Vec<Span> = world.numbers.iter().map(|number| number.initial).collect();
        Self {
            facts: world.tested(world.initial, &numbers),
            numbers,
            is_undecided: false,
            happened: 0,
            running: Vec::new(),
            may_act: true,
        }
    }

    pub(super) fn running_actions(&self) -> u64 {
        self.running
            .iter()
            .fold(0, |set, running| set | 1 << running.act)
    }

    pub(super) fn can_reach_goal(
        &self,
        world: &TimedWorld,
        reachability: &mut ReachabilityCache,
    ) -> bool {
        if self.is_undecided {
            return false;
        }
        let facts = self.facts | world.tested;
        let (set, happened) = (self.running_actions(), self.happened);
        *reachability
            .entry((facts, set, happened))
            .or_insert_with(|| world.can_reach_goal(facts, set, happened))
    }

    /// Aborts the actions whose over-all conditions no longer hold.
    pub(super) fn abort_invalid_actions(&mut self, world: &TimedWorld) {
        let facts = self.facts;
        let may_hold = self.may_hold(world);
        let mut is_doubtful = false;
        self.running.retain(|running| {
            let rest = world.acts[usize::from(running.act)].rest.as_ref();
            rest.is_some_and(|(over_all, _)| {
                let holds = over_all.holds(facts);
                is_doubtful |= !holds && over_all.holds(may_hold);
                holds
            })
        });
        self.is_undecided |= is_doubtful;
    }

    /// Returns the facts, and the comparisons that hold for some of the possible values of numbers.
    pub(super) fn may_hold(&self, world: &TimedWorld) -> Facts {
        if self.numbers.is_empty() {
            return self.facts;
        }
        world.with_tests(self.facts, &self.numbers, Side::Above)
    }

    /// Applies the effects of a happening, with the given draw.
    fn apply(&mut self, world: &TimedWorld, snap: &Snap, draw: usize) {
        self.facts = snap.apply(self.facts);
        if !snap.amounts.is_empty() {
            world.apply_changes(&mut self.numbers, snap, draw);
            self.facts = world.tested(self.facts, &self.numbers);
        }
    }

    /// Returns the state after the start of an action. A durative action is then running as
    /// `as_act`, since the cell `since`, with the given phase.
    pub(super) fn started(
        &self,
        world: &TimedWorld,
        act: usize,
        (as_act, since, phase): (usize, usize, Phase),
    ) -> Self {
        let mut after = self.clone();
        after.apply(world, &world.acts[act].start, 0);
        if world.acts[act].rest.is_some() {
            let running = Running {
                act: u8::try_from(as_act).expect("at most 64 actions"),
                since: u16::try_from(since).expect("fewer than 65,535 cells"),
                phase,
            };
            let place = after.running.partition_point(|other| *other < running);
            after.running.insert(place, running);
        }
        after.abort_invalid_actions(world);
        after
    }

    /// Returns `true` if the goal is reached: it holds, and no action is running whose delayed
    /// failure could still violate it.
    pub(super) fn is_goal(&self, world: &TimedWorld) -> bool {
        let holds_up =
            |running: &Running| world.acts[usize::from(running.act)].can_delay_its_failure();
        world.goal.holds(self.facts) && !self.is_undecided && !self.running.iter().any(holds_up)
    }

    /// Returns the state after the end of the running action at `place`. An end whose condition
    /// does not hold fails without any effect, as does an aborted action.
    pub(super) fn ended(&self, world: &TimedWorld, place: usize, ending: Ending) -> Self {
        let mut after = self.clone();
        let running = after.running.remove(place);
        let act = &world.acts[usize::from(running.act)];
        if let Some(failed) = act.failed(ending) {
            after.facts = failed.apply(after.facts);
            after.abort_invalid_actions(world);
        } else if let (Some((_, end)), Ending::Success(draw)) = (&act.rest, ending) {
            if end.needs.holds(after.facts) {
                after.apply(world, end, usize::from(draw));
                after.abort_invalid_actions(world);
            } else {
                after.is_undecided |= end.needs.holds(after.may_hold(world));
            }
        }
        after
    }

    /// Returns the state after an event.
    pub(super) fn changed(&self, world: &TimedWorld, event: usize) -> Self {
        let mut after = self.clone();
        if !world.events[event].is_recurrent() {
            after.happened |= 1 << event;
        }
        after.facts = world.events[event].apply(after.facts);
        after.abort_invalid_actions(world);
        after
    }

    /// Returns the useful actions that can start; only one action if starting it at once is always
    /// optimal.
    pub(super) fn startable(
        &self,
        world: &TimedWorld,
        is_idle: impl Fn(usize) -> bool,
    ) -> Vec<usize> {
        let can_start = |act: &usize| {
            is_idle(*act)
                && world.acts[*act].start.needs.holds(self.facts)
                && world.is_useful(*act, self.facts)
                && !self.aborts_at_once(world, *act)
        };
        let acts: Vec<usize> = (0..world.acts.len()).filter(can_start).collect();
        let is_eager = |act: &&usize| {
            let Some((over_all, _)) = &world.acts[**act].rest else {
                return false;
            };
            let facts = world.acts[**act].start.apply(self.facts);
            world.acts[**act].is_eager && over_all.holds(facts)
        };
        match acts.iter().find(is_eager) {
            Some(eager) => vec![*eager],
            None => acts,
        }
    }

    /// Returns `true` if the over-all condition of an action fails right after its start, which
    /// makes the start useless.
    fn aborts_at_once(&self, world: &TimedWorld, act: usize) -> bool {
        let act = &world.acts[act];
        let Some((over_all, _)) = &act.rest else {
            return false;
        };
        if act.start.amounts.is_empty() {
            return !over_all.holds(act.start.apply(self.facts));
        }
        let mut after = self.clone();
        after.apply(world, &act.start, 0);
        !over_all.holds(after.facts)
    }

    /// Returns `true` if the only startable action is optimal to start at once.
    pub(super) fn must_start(&self, world: &TimedWorld, startable: &[usize]) -> bool {
        matches!(startable, [only] if world.acts[*only].is_eager && {
            let facts = world.acts[*only].start.apply(self.facts);
            world.acts[*only].rest.as_ref().is_some_and(|(over_all, _)| over_all.holds(facts))
        })
    }
}
