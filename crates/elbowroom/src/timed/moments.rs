//! Worlds in which everything happens at known times, if it happens: durations are known, and so is when
//! something may happen by itself. What is not known is whether it does, whether actions fail, and
//! what they draw.
//!
//! There whoever acts only when something happens, or gets ready to happen, loses nothing. Take any way to
//! act, and keep the order of all that happens, but let each thing come as early as the order allows, where
//! an action may last longer than it has to. What is after something that happens at a known time is not before
//! that time; what is before it stays before. So everything comes at a time at which something
//! happens by itself, or some action has lasted as long as it has to; nothing comes later than
//! it did, and whoever decides knows as much as before.
//!
//! So the bound from above has a state only where something gets ready, and an action that is ready may end there
//! or at any later such time. The bound from below acts when something has happened, and nothing lasts longer
//! there. Cells are as long as all known times divide; between two states there may be any number of them.
//! From above they may be longer: what begins in a cell and takes n whole cells and something is ready n cells later,
//! which is no later than it is, and may end at any time from then on. There are far fewer states then.

mod stretched;
mod waiting;

use elbowroom_sim::Distribution;

use super::above::Above;
use super::act::Occurs;
use super::below::{Below, Manner};
use super::chances::{Chances, NEVER};
use super::state::{Phase, State};
use super::within::{constant, fitting};
use super::world::{Facts, TimedWorld};
use super::{Grid, NotTabulated, SLACK, Settings, Side, Stop, graph, step};

pub(super) use stretched::{Alike, Reasons};

/// Bounds from both sides where everything happens at known times.
pub(super) struct Found {
    pub(super) grid: Grid,
    /// How many cells there are, seen from below.
    pub(super) cells: usize,
    /// The world within which the bound from below is reached.
    pub(super) within: Option<TimedWorld>,
}

/// Bounds from both sides where everything happens at known times; `None` where it does not, or if `goes_on` says
/// so.
pub(super) fn bounds(
    world: &TimedWorld,
    settings: &Settings,
    effort: Effort,
    goes_on: &dyn Fn() -> bool,
) -> Result<Option<Found>, NotTabulated> {
    let Some(cells) = cells(world) else {
        return Ok(None);
    };
    let grid = Grid {
        step: step(world, cells),
        lower: 0.0,
        upper: 1.0,
        states: 0,
    };
    let mut search = Search {
        settings,
        goes_on,
        found: Found {
            grid,
            cells,
            within: None,
        },
        has: [false; 2],
    };
    let within = world.keeping_to(&settings.plans);
    // Of the worlds in which more is possible the one with the fewest states first.
    let above = world.seen_from(Side::Above);
    let freer = above.without_numbers_over_all()?;
    let chances = super::chances(&freer, cells, Side::Above)?;
    let leaner = freer.without_certainties(&chances);
    let kinder: Vec<TimedWorld> = leaner.into_iter().chain([freer, above]).collect();
    for share in effort.shares {
        let most_states = settings.most_states / share;
        // From either side in turn, as one does not know which is the harder one.
        for turn in 0..within.len().max(kinder.len()) {
            let mut goes_on = match within.get(turn) {
                Some(world) => search.look_from_below(world, most_states)?,
                None => true,
            };
            goes_on &= search.has[0] || !effort.gives_up;
            if let Some(world) = kinder.get(turn).filter(|_| goes_on) {
                goes_on = search.look_from_above(world, most_states)?;
            }
            if !goes_on {
                return Ok(None);
            }
        }
    }
    Ok(Some(search.found))
}

/// How much is tried for bounds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    /// Each bound may have one in so many of all states that there may be, one of these after the other until bounds
    /// are close.
    shares: &'static [usize],
    /// Whether nothing more is tried once the first world within plans has too many states.
    gives_up: bool,
}

impl Effort {
    /// For the yardstick.
    pub(super) const WHOLE: Self = Self {
        shares: &[16, 4],
        gives_up: false,
    };
    /// For a policy, for which a run waits.
    pub(super) const QUICK: Self = Self {
        shares: &[16],
        gives_up: true,
    };
}

struct Search<'a> {
    settings: &'a Settings,
    goes_on: &'a dyn Fn() -> bool,
    found: Found,
    /// Whether there are values from below, and from above.
    has: [bool; 2],
}

impl TimedWorld {
    /// How whoever keeps to plans acts.
    pub(super) fn by_moments(&self, settings: &Settings) -> Manner {
        Manner::ByMoments(self.in_plans(&settings.plans))
    }
}

impl Search<'_> {
    fn is_close(&self) -> bool {
        let gap = self.found.grid.upper - self.found.grid.lower;
        self.has == [true; 2] && gap <= self.settings.gap
    }

    /// Whether to go on.
    fn look_from_below(
        &mut self,
        world: &TimedWorld,
        most_states: usize,
    ) -> Result<bool, NotTabulated> {
        if self.is_close() {
            return Ok(true);
        }
        let mut left = most_states;
        let chances = super::chances(world, self.found.cells, Side::Below)?;
        let below = Below::new(world, &chances, world.by_moments(self.settings));
        let value = graph::value(&below, &mut left, self.goes_on);
        self.has[0] |= value.is_ok();
        self.found.grid.states += most_states - left;
        match value {
            Ok(lower) if lower - SLACK > self.found.grid.lower => {
                self.found.grid.lower = lower - SLACK;
                self.found.within = Some(world.clone());
            }
            Err(Stop::Interrupted) => return Ok(false),
            Ok(_) | Err(_) => {}
        }
        Ok(true)
    }

    /// Whether to go on.
    fn look_from_above(
        &mut self,
        world: &TimedWorld,
        most_states: usize,
    ) -> Result<bool, NotTabulated> {
        let mut wanted = self.settings.first_cells.max(1);
        while !self.is_close() {
            // The last grid is the one on which nothing is given away.
            let (step, cells) = match fitting(world, wanted, Side::Above) {
                Some(fit) if fit.cells < self.found.cells => (fit.step(), fit.cells),
                _ => (step(world, self.found.cells), self.found.cells),
            };
            let mut left = most_states;
            let chances = Chances::new(world, step, cells + 1, Side::Above)?;
            let value = graph::value(&Above::by_moments(world, &chances), &mut left, self.goes_on);
            self.has[1] |= value.is_ok();
            self.found.grid.states += most_states - left;
            match value {
                Ok(value) => self.found.grid.upper = self.found.grid.upper.min(value + SLACK),
                Err(Stop::Interrupted) => return Ok(false),
                Err(_) => break,
            }
            if cells == self.found.cells {
                break;
            }
            wanted *= 2;
        }
        Ok(true)
    }
}

/// How many cells there are if all known times are whole numbers of cells; `None` if something may
/// happen at any time, or if that takes too many.
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
        if act.midway > 0.0 {
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

impl Chances {
    /// The first cell from that one on in which something may happen, or get ready to.
    pub(super) fn next(&self, state: &State, cell: usize) -> Option<usize> {
        let ends = state.running.iter().filter_map(|running| {
            let age = cell - usize::from(running.since);
            let next = *self.next_end[usize::from(running.act)].get(age)?;
            let is_going = running.phase == Phase::Goes;
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

    /// Whether the goal can be reached in time from a state at the beginning of a cell, as far as that is
    /// [easily seen](Self::soonest).
    pub(super) fn is_in_time(
        &self,
        world: &TimedWorld,
        state: &State,
        cell: usize,
        side: Side,
    ) -> bool {
        self.soonest(world, state, cell, side).is_some()
    }

    /// The first cell at whose beginning the goal may hold, from a state at the beginning of one, if nothing is made
    /// false but by what happens for certain, and is never made true again; `None` if it is
    /// never.
    pub(super) fn soonest(
        &self,
        world: &TimedWorld,
        state: &State,
        cell: usize,
        side: Side,
    ) -> Option<usize> {
        // What ends in a cell is over at its beginning, seen from above, and at its end, seen from below.
        let wait = usize::from(side == Side::Below);
        let mut now = cell;
        let mut facts = state.may_hold(world);
        let mut started: u64 = 0;
        let mut coming: Vec<(usize, Coming)> = Vec::new();
        for running in &state.running {
            let act = usize::from(running.act);
            facts |= world.acts[act].adds_by_failing();
            let age = cell - usize::from(running.since);
            let ready = match running.phase {
                Phase::Goes => match self.next_end[act].get(age) {
                    Some(next) if *next != NEVER => {
                        usize::from(running.since) + *next as usize + wait
                    }
                    _ => continue,
                },
                Phase::Ready(_) | Phase::Due(_) => cell,
            };
            coming.push((ready, Coming::End(act)));
        }
        for (event, next) in self.next_event.iter().enumerate() {
            if state.happened & (1 << event) == 0
                && let Some(next) = next.get(cell)
                && *next != NEVER
            {
                coming.push((*next as usize + wait, Coming::Event(event)));
            }
        }
        loop {
            // All that can be done by now.
            loop {
                let before = (facts, started);
                coming.retain(|(ready, what)| match what {
                    Coming::End(act) if *ready <= now => {
                        let Some((_, end)) = &world.acts[*act].rest else {
                            return false;
                        };
                        let can_end = end.needs.is_possible(facts);
                        if can_end {
                            facts |= end.adds | end.helps;
                        }
                        !can_end
                    }
                    Coming::Event(event) if *ready <= now => {
                        facts |= world.events[*event].adds;
                        true
                    }
                    _ => true,
                });
                for (index, act) in world.acts.iter().enumerate() {
                    if started & (1 << index) != 0 || !act.start.needs.is_possible(facts) {
                        continue;
                    }
                    facts |= act.start.adds | act.start.helps;
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
                            coming.push((now + *next as usize + wait, Coming::End(index)));
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
            // What happens last at this time.
            let mut lost: Facts = 0;
            coming.retain(|(ready, what)| match what {
                Coming::Event(event) if *ready <= now => {
                    lost |= world.lost_for_good(*event);
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

/// What will come about.
#[derive(Clone, Copy, Debug)]
enum Coming {
    End(usize),
    Event(usize),
}
