//! The upper bound: the agent knows the happenings of the present cell, and chooses their order. If
//! everything happens at known times, states exist only at happenings
//! ([`UpperBound::at_known_times`]).

mod postponement;
mod relaxed_ends;

use indexmap::IndexSet;

use super::cell_probabilities::CellProbabilities;
use super::graph::{Choice, Expansion, Layers, Limits, MAX_WAYS, Nodes, Target};
use super::process::world::TimedWorld;
use super::settings::Stop;
use super::state::{Phase, ReachabilityCache, State};
use relaxed_ends::{EndClasses, WaitingCache};

pub(super) struct UpperBound<'a> {
    pub(super) world: &'a TimedWorld,
    pub(super) chances: &'a CellProbabilities,
    /// The classes of actions with equal ends, if everything happens at known times.
    pub(super) end_classes: Option<EndClasses>,
}

/// A state within a cell, with the events that are still to happen in it.
pub(super) type Moment = (State, PendingEvents);

/// The events of a cell, as bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct PendingEvents {
    /// Events that still have to happen.
    pub(super) must: u32,
    /// Events that may happen any number of times.
    may: u32,
}

/// Number of occurrences of an event in a cell.
#[derive(Clone, Copy, Debug)]
enum Occurrences {
    Never,
    Once,
    /// More than once: at least once, and as often as the agent chooses.
    Repeatedly,
}

impl PendingEvents {
    /// Returns the remaining events after one occurrence of `event`.
    pub(super) fn without(self, event: usize) -> Self {
        Self {
            must: self.must & !(1 << event),
            ..self
        }
    }
}

/// A cell during its expansion.
pub(super) struct Cell<'c> {
    pub(super) bound: &'c UpperBound<'c>,
    /// The number of the cell.
    pub(super) number: usize,
    /// The moments within the cell; their nodes follow those of the cell's beginning.
    moments: IndexSet<Moment>,
    first: usize,
    pub(super) later: &'c mut Layers,
    pub(super) reachability: &'c mut ReachabilityCache,
    pub(super) reasons: WaitingCache,
}

impl<'a> UpperBound<'a> {
    pub(super) fn new(world: &'a TimedWorld, chances: &'a CellProbabilities) -> Self {
        Self {
            world,
            chances,
            end_classes: None,
        }
    }

    /// Creates the bound for worlds where everything happens at [known
    /// times](super::discrete_events). In it, happenings may be early by less than a cell.
    pub(super) fn at_known_times(world: &'a TimedWorld, chances: &'a CellProbabilities) -> Self {
        Self {
            end_classes: Some(EndClasses::new(world, chances)),
            ..Self::new(world, chances)
        }
    }
}

/// Returns the possible happenings of the cell: the running actions that may end, and the events.
///
/// # Errors
/// When there are too many combinations.
fn revealed(
    world: &TimedWorld,
    chances: &CellProbabilities,
    cell: usize,
    state: &State,
) -> Result<Vec<(f64, Moment)>, Stop> {
    let mut moments = vec![(1.0, (state.clone(), PendingEvents::default()))];
    for (place, running) in state.running.iter().enumerate() {
        let age = cell - usize::from(running.since);
        let ends = match running.phase {
            Phase::Open => &chances.ends[usize::from(running.act)][age],
            Phase::Ready(_) | Phase::Due(_) => continue,
        };
        let act = &world.acts[usize::from(running.act)];
        let ways: Vec<_> = ends.outcomes(act).collect();
        moments = split(moments, &ways, |moment, ending| {
            if let Some(ending) = ending {
                moment.0.running[place].phase = Phase::Ready(*ending);
            }
        });
    }
    for (event, hazards) in chances.events.iter().enumerate() {
        if state.happened & (1 << event) == 0 {
            let p = hazards[cell];
            let often = p * chances.repeated[event][cell];
            let ways = [
                (p - often, Occurrences::Once),
                (often, Occurrences::Repeatedly),
                (1.0 - p, Occurrences::Never),
            ];
            moments = split(moments, &ways, |moment, times| {
                let (must, may) = match times {
                    Occurrences::Never => (0, 0),
                    Occurrences::Once => (1, 0),
                    Occurrences::Repeatedly => (1, 1),
                };
                moment.1.must |= must << event;
                moment.1.may |= may << event;
            });
        }
    }
    if moments.len() > MAX_WAYS {
        return Err(Stop::TooManyStates);
    }
    Ok(moments)
}

/// Splits each moment into these alternatives, applying the change of each. If there are too many
/// moments already, they are not split.
fn split<T>(
    moments: Vec<(f64, Moment)>,
    ways: &[(f64, T)],
    change: impl Fn(&mut Moment, &T),
) -> Vec<(f64, Moment)> {
    if moments.len() > MAX_WAYS {
        return moments;
    }
    let mut all = Vec::with_capacity(moments.len());
    for (weight, moment) in moments {
        for (p, way) in ways.iter().filter(|(p, _)| *p > 0.0) {
            let mut moment = moment.clone();
            change(&mut moment, way);
            all.push((weight * p, moment));
        }
    }
    all
}

impl Expansion for UpperBound<'_> {
    fn cells(&self) -> usize {
        self.chances.cells
    }

    fn initial(&self) -> Vec<(f64, State)> {
        let state = State::initial(self.world);
        vec![(1.0, state)]
    }

    fn expand(
        &self,
        cell: usize,
        states: &IndexSet<State>,
        later: &mut Layers,
        reachability: &mut ReachabilityCache,
        limits: &Limits<'_>,
    ) -> Result<Nodes, Stop> {
        let mut here = Cell {
            bound: self,
            number: cell,
            moments: IndexSet::new(),
            first: states.len(),
            later,
            reachability,
            reasons: WaitingCache::new(),
        };
        let mut nodes = Nodes::of(cell);
        for state in states {
            limits.check(&nodes)?;
            let revealed = revealed(self.world, self.chances, cell, state)?.into_iter();
            nodes.push(vec![
                revealed
                    .map(|(p, moment)| (p, vec![here.target(moment)]))
                    .collect(),
            ]);
        }
        let mut done = 0;
        while let Some(moment) = here.moments.get_index(done).cloned() {
            limits.check(&nodes)?;
            nodes.push(here.choices(&moment));
            done += 1;
        }
        Ok(nodes)
    }

    fn last(&self, state: &State) -> f64 {
        // The goal counts as reached if it may still be reachable.
        f64::from(u8::from(self.world.can_reach_goal(
            state.facts,
            state.running_actions(),
            state.happened,
        )))
    }
}

impl Cell<'_> {
    pub(super) fn target(&mut self, moment: Moment) -> Target {
        let world = self.bound.world;
        let moment = apply_forced(world, moment);
        if world.goal.holds(moment.0.facts) {
            return Target::Goal;
        }
        if !moment.0.can_reach_goal(world, self.reachability) {
            return Target::DeadEnd;
        }
        Target::here(self.first + self.moments.insert_full(moment).0)
    }

    fn choices(&mut self, moment: &Moment) -> Vec<Choice> {
        let world = self.bound.world;
        let (state, coming) = moment;
        let startable = if let Some(alike) = &self.bound.end_classes {
            state.startable(world, |act| alike.representative(state, act).is_some())
        } else {
            let under_way = state.running_actions();
            state.startable(world, |act| under_way & (1 << act) == 0)
        };
        if state.must_start(world, &startable) {
            return vec![self.start(state, *coming, startable[0])];
        }
        if self.bound.end_classes.is_some()
            && let Some(only) = self.dominant_choices(moment, &startable)
        {
            return only;
        }
        let mut choices: Vec<Choice> = Vec::new();
        for (place, running) in state.running.iter().enumerate() {
            if let Phase::Ready(ending) | Phase::Due(ending) = running.phase {
                let after = state.ended(world, place, ending);
                choices.push(vec![(1.0, vec![self.target((after, *coming))])]);
            }
            if self.bound.end_classes.is_some() {
                choices.extend(self.restart_choices(moment, place));
            } else if world.can_gain_by_cancelling(usize::from(running.act)) {
                choices.push(self.cancel(moment, place));
            }
        }
        for event in 0..world.events.len() {
            let (must, may) = (coming.must & (1 << event), coming.may & (1 << event));
            if must | may == 0 || (must != 0 && world.is_optimal_last(event)) {
                continue;
            }
            let after = state.changed(world, event);
            if must != 0 || after != *state {
                let left = coming.without(event);
                choices.push(vec![(1.0, vec![self.target((after, left))])]);
            }
        }
        for act in startable {
            choices.push(self.start(state, *coming, act));
        }
        // Permanent deletions are best applied last.
        let (mut after, mut left) = (state.clone(), *coming);
        for event in 0..world.events.len() {
            if coming.must & (1 << event) != 0 && world.is_optimal_last(event) {
                after = after.changed(world, event);
                left = left.without(event);
            }
        }
        let all_happened = left.must == 0;
        let is_due = |phase: Phase| matches!(phase, Phase::Due(_));
        if all_happened && !after.running.iter().any(|running| is_due(running.phase)) {
            choices.push(vec![(1.0, vec![self.pass(after)])]);
        }
        choices
    }

    pub(super) fn cancel(&mut self, (state, coming): &Moment, place: usize) -> Choice {
        let mut after = state.clone();
        after.running.remove(place);
        vec![(1.0, vec![self.target((after, *coming))])]
    }

    /// Returns the start of an action, which may end in the same cell.
    pub(super) fn start(&mut self, state: &State, coming: PendingEvents, act: usize) -> Choice {
        let world = self.bound.world;
        let ways: Vec<_> = match world.acts[act].rest {
            Some(_) => self.bound.chances.ends[act][0]
                .outcomes(&world.acts[act])
                .collect(),
            None => vec![(1.0, None)],
        };
        let alike = self.bound.end_classes.as_ref();
        let as_act = alike.and_then(|alike| alike.representative(state, act));
        let mut choice = Choice::new();
        for (p, ending) in ways.into_iter().filter(|(p, _)| *p > 0.0) {
            let phase = ending.map_or(Phase::Open, Phase::Ready);
            let under_way = (as_act.unwrap_or(act), self.number, phase);
            let after = state.started(world, act, under_way);
            choice.push((p, vec![self.target((after, coming))]));
        }
        choice
    }

    fn pass(&mut self, mut state: State) -> Target {
        if self.bound.end_classes.is_some() {
            return self.advance_to_next_happening(state);
        }
        let world = self.bound.world;
        for running in &mut state.running {
            if let Phase::Ready(ending) = running.phase {
                running.phase = Phase::Due(ending);
            }
        }
        if !state.can_reach_goal(world, self.reachability) {
            return Target::DeadEnd;
        }
        Target::later(self.later, self.number + 1, state)
    }
}

/// Applies the happenings that are best at once.
fn apply_forced(world: &TimedWorld, mut moment: Moment) -> Moment {
    loop {
        let (state, coming) = &moment;
        let event = (0..world.events.len())
            .find(|event| coming.must & (1 << event) != 0 && world.is_optimal_at_once(*event));
        let end = || {
            let mut running = state.running.iter().enumerate();
            running.find_map(|(place, running)| {
                let (Phase::Ready(ending) | Phase::Due(ending)) = running.phase else {
                    return None;
                };
                let act = usize::from(running.act);
                let is_best = world.end_is_optimal_at_once(act, ending, state.facts);
                is_best.then_some((place, ending))
            })
        };
        moment = if let Some(event) = event {
            (state.changed(world, event), coming.without(event))
        } else if let Some((place, ending)) = end() {
            (state.ended(world, place, ending), *coming)
        } else {
            return moment;
        };
    }
}
