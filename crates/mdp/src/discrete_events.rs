//! Worlds where happenings take place at known times only: durations are known, and so are the
//! possible times of events. It is unknown whether events occur, whether actions fail, and which
//! amounts are drawn.
//!
//! In such a world, an agent loses nothing if it acts only when something happens or becomes ready
//! to happen. Take any policy, keep the order of its happenings, and let each happening come as
//! early as this order allows, where actions may last longer than their durations. Happenings after
//! an event at a known time stay after that time; happenings before it stay before. So each
//! happening comes at the time of an event, or when the duration of some action is over. No
//! happening is later than before, and the agent has the same knowledge at each decision.
//!
//! Therefore the upper bound has states only when something becomes ready, and an action that is
//! ready may end then or at any later such time. In the lower bound, the agent acts after
//! happenings, and actions end on time. All known times are multiples of the length of a cell;
//! there may be any number of cells between two states. In the upper bound, cells may be longer: an
//! action that starts in a cell and takes between n and n + 1 cells is ready n cells later, which
//! is no later than in reality, and may end at any time from then on. This needs far fewer states.

mod search;

use elbowroom_sim::Distribution;

use super::cell_probabilities::{CellProbabilities, NEVER};
use super::process::action_model::{Facts, Occurs};
use super::process::world::TimedWorld;
use super::restricted_policy::constant;
use super::settings::Side;
use super::state::{Phase, State};

pub(super) use search::{Effort, RestrictedAgent, bounds};

/// Returns the number of cells such that all known times are multiples of a cell; `None` if
/// something may happen at any time, or if there are too many cells.
pub(super) fn cells(world: &TimedWorld) -> Option<usize> {
    let resolution = world.model.resolution.to_f64();
    let whole = |time: f64| {
        let count = (time / resolution).round();
        let is_whole = (count * resolution - time).abs() <= 1e-6 * resolution;
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "it is a whole number below 2^53"
        )]
        let count = (is_whole && (0.0..9e15).contains(&count)).then_some(count as u64);
        count
    };
    let horizon = whole(world.horizon)?;
    let mut step = horizon;
    let mut divide = |time: u64| step = gcd(step, time);
    for act in &world.acts {
        if act.rest.is_some() {
            divide(whole(constant(world, act)?)?);
        }
        if act.midway_failure > 0.0 {
            return None;
        }
        for failed in &act.failures {
            divide(whole(failed.delay)?);
        }
    }
    for event in &world.events {
        match &event.occurs {
            Occurs::Once { time, .. } => match time.distribution {
                Distribution::Constant(time) => divide(whole(time)?),
                _ => return None,
            },
            Occurs::Rate(_) => return None,
        }
    }
    let cells = horizon.checked_div(step)?;
    (0 < cells && cells < u64::from(u16::MAX)).then_some(usize::try_from(cells).ok()?)
}

fn gcd(one: u64, other: u64) -> u64 {
    if other == 0 {
        one
    } else {
        gcd(other, one % other)
    }
}

impl CellProbabilities {
    /// Returns the first cell from `cell` on with a possible happening, or with an end that becomes
    /// ready.
    pub(super) fn next(&self, state: &State, cell: usize) -> Option<usize> {
        let ends = state.running.iter().filter_map(|running| {
            let age = cell - usize::from(running.since);
            let next = *self.next_end[usize::from(running.act)].get(age)?;
            let is_going = running.phase == Phase::Open;
            (is_going && next != NEVER).then_some(usize::from(running.since) + next as usize)
        });
        let events = self
            .next_event
            .iter()
            .enumerate()
            .filter_map(|(event, next)| {
                let next = *next.get(cell)?;
                let is_over = state.happened & (1 << event) != 0;
                (!is_over && next != NEVER).then_some(next as usize)
            });
        ends.chain(events).min().filter(|next| *next < self.cells)
    }

    /// Returns `true` if the goal may be reachable in time from a state at the beginning of a cell,
    /// by the relaxation of [`earliest_goal_cell`](Self::earliest_goal_cell).
    pub(super) fn can_reach_goal_in_time(
        &self,
        world: &TimedWorld,
        state: &State,
        cell: usize,
        side: Side,
    ) -> bool {
        self.earliest_goal_cell(world, state, cell, side).is_some()
    }

    /// Returns the first cell at whose beginning the goal may hold, from a state at the beginning
    /// of `cell`, in a relaxation: facts become false only by certain events, and only if they
    /// never become true again. `None` if the goal is unreachable.
    pub(super) fn earliest_goal_cell(
        &self,
        world: &TimedWorld,
        state: &State,
        cell: usize,
        side: Side,
    ) -> Option<usize> {
        // An end in a cell takes effect at the cell's beginning in the upper bound, and at its end
        // in the lower bound.
        let wait = usize::from(side == Side::Below);
        let mut now = cell;
        let mut facts = state.may_hold(world);
        let mut started: u64 = 0;
        let mut coming: Vec<(usize, FutureHappening)> = Vec::new();
        for running in &state.running {
            let act = usize::from(running.act);
            facts |= world.acts[act].adds_by_failing();
            let age = cell - usize::from(running.since);
            let ready = match running.phase {
                Phase::Open => match self.next_end[act].get(age) {
                    Some(next) if *next != NEVER => {
                        usize::from(running.since) + *next as usize + wait
                    }
                    _ => continue,
                },
                Phase::Ready(_) | Phase::Due(_) => cell,
            };
            coming.push((ready, FutureHappening::End(act)));
        }
        for (event, next) in self.next_event.iter().enumerate() {
            if state.happened & (1 << event) == 0
                && let Some(next) = next.get(cell)
                && *next != NEVER
            {
                coming.push((*next as usize + wait, FutureHappening::Event(event)));
            }
        }
        loop {
            // Apply everything that is possible by now.
            loop {
                let before = (facts, started);
                coming.retain(|(ready, what)| match what {
                    FutureHappening::End(act) if *ready <= now => {
                        let Some((_, end)) = &world.acts[*act].rest else {
                            return false;
                        };
                        let can_end = end.needs.is_possible(facts);
                        if can_end {
                            facts |= end.adds | end.helped_tests;
                        }
                        !can_end
                    }
                    FutureHappening::Event(event) if *ready <= now => {
                        facts |= world.events[*event].adds;
                        true
                    }
                    _ => true,
                });
                for (index, act) in world.acts.iter().enumerate() {
                    if started & (1 << index) != 0 || !act.start.needs.is_possible(facts) {
                        continue;
                    }
                    facts |= act.start.adds | act.start.helped_tests;
                    let Some((over_all, _)) = &act.rest else {
                        started |= 1 << index;
                        continue;
                    };
                    if over_all.is_possible(facts) {
                        started |= 1 << index;
                        facts |= act.adds_by_failing();
                        if let Some(next) = self.next_end[index].first()
                            && *next != NEVER
                        {
                            coming.push((now + *next as usize + wait, FutureHappening::End(index)));
                        }
                    }
                }
                if world.goal.is_possible(facts) {
                    return Some(now);
                }
                if (facts, started) == before {
                    break;
                }
            }
            // Deletions come last at this time.
            let mut lost: Facts = 0;
            coming.retain(|(ready, what)| match what {
                FutureHappening::Event(event) if *ready <= now => {
                    lost |= world.permanently_deleted(*event);
                    false
                }
                _ => true,
            });
            facts &= !lost;
            let later = coming.iter().map(|(ready, _)| *ready);
            now = later.filter(|ready| *ready > now).min()?;
        }
    }
}

/// A future happening.
#[derive(Clone, Copy, Debug)]
enum FutureHappening {
    End(usize),
    Event(usize),
}
