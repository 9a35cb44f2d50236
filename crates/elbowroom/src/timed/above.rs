//! The bound from above: the agent knows what this cell brings, and chooses the order.

use indexmap::IndexSet;

use super::chances::Chances;
use super::graph::{Choice, Expansion, Hopes, Layers, Nodes, Target};
use super::state::{Phase, State};
use super::world::TimedWorld;

pub(super) struct Above<'a> {
    world: &'a TimedWorld,
    chances: &'a Chances,
}

/// A state within a cell, with the events that are still to come in it.
type Moment = (State, Coming);

/// The events of a cell, as bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Coming {
    /// Those that still have to happen.
    pub(super) must: u32,
    /// Those that may happen as often as one likes.
    may: u32,
}

/// How often an event happens in a cell.
#[derive(Clone, Copy, Debug)]
enum Times {
    Never,
    Once,
    /// More than once: as often as the agent likes, but once.
    Often,
}

impl Coming {
    /// What is left when that event has happened once.
    pub(super) fn without(self, event: usize) -> Self {
        Self {
            must: self.must & !(1 << event),
            ..self
        }
    }
}

/// What is being put together of one cell.
struct Cell<'c> {
    bound: &'c Above<'c>,
    /// Its number.
    number: usize,
    /// After the nodes of the cell's beginning.
    moments: IndexSet<Moment>,
    first: usize,
    later: &'c mut Layers,
    hopes: &'c mut Hopes,
}

impl<'a> Above<'a> {
    pub(super) fn new(world: &'a TimedWorld, chances: &'a Chances) -> Self {
        Self { world, chances }
    }
}

/// What the cell brings: which of the actions under way may end, and which events happen.
pub(super) fn revealed(
    world: &TimedWorld,
    chances: &Chances,
    cell: usize,
    state: &State,
) -> Vec<(f64, Moment)> {
    let mut moments = vec![(1.0, (state.clone(), Coming::default()))];
    for (place, running) in state.running.iter().enumerate() {
        let age = cell - usize::from(running.since);
        let ends = match running.phase {
            Phase::Goes => &chances.ends[usize::from(running.act)][age],
            Phase::Ready(_) | Phase::Due(_) => continue,
        };
        let act = &world.acts[usize::from(running.act)];
        let ways: Vec<_> = ends.ways(act).collect();
        moments = split(moments, &ways, |moment, ending| {
            if let Some(ending) = ending {
                moment.0.running[place].phase = Phase::Ready(*ending);
            }
        });
    }
    for (event, hazards) in chances.events.iter().enumerate() {
        if state.happened & (1 << event) == 0 {
            let p = hazards[cell];
            let often = p * chances.again[event][cell];
            let ways = [
                (p - often, Times::Once),
                (often, Times::Often),
                (1.0 - p, Times::Never),
            ];
            moments = split(moments, &ways, |moment, times| {
                let (must, may) = match times {
                    Times::Never => (0, 0),
                    Times::Once => (1, 0),
                    Times::Often => (1, 1),
                };
                moment.1.must |= must << event;
                moment.1.may |= may << event;
            });
        }
    }
    moments
}

/// Each moment in each way, with what then is different.
fn split<T>(
    moments: Vec<(f64, Moment)>,
    ways: &[(f64, T)],
    change: impl Fn(&mut Moment, &T),
) -> Vec<(f64, Moment)> {
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

impl Expansion for Above<'_> {
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
        hopes: &mut Hopes,
        most: usize,
    ) -> Option<Nodes> {
        let mut here = Cell {
            bound: self,
            number: cell,
            moments: IndexSet::new(),
            first: states.len(),
            later,
            hopes,
        };
        let mut nodes = Nodes::of(cell);
        for state in states {
            let revealed = revealed(self.world, self.chances, cell, state).into_iter();
            nodes.push(vec![
                revealed
                    .map(|(p, moment)| (p, vec![here.target(moment)]))
                    .collect(),
            ]);
        }
        let mut done = 0;
        while let Some(moment) = here.moments.get_index(done).cloned() {
            if nodes.len() >= most {
                return None;
            }
            nodes.push(here.choices(&moment));
            done += 1;
        }
        Some(nodes)
    }

    fn last(&self, state: &State) -> f64 {
        // Whoever may still get there, does.
        f64::from(u8::from(self.world.is_hopeful(
            state.facts,
            state.under_way(),
            state.happened,
        )))
    }
}

impl Cell<'_> {
    fn target(&mut self, moment: Moment) -> Target {
        let world = self.bound.world;
        let moment = forced(world, moment);
        if world.goal.hold(moment.0.facts) {
            return Target::Won;
        }
        if !moment.0.is_hopeful(world, self.hopes) {
            return Target::Lost;
        }
        Target::here(self.first + self.moments.insert_full(moment).0)
    }

    fn choices(&mut self, moment: &Moment) -> Vec<Choice> {
        let world = self.bound.world;
        let (state, coming) = moment;
        let startable = state.startable(world);
        if state.must_start(world, &startable) {
            return vec![self.start(state, *coming, startable[0])];
        }
        let mut choices: Vec<Choice> = Vec::new();
        for (place, running) in state.running.iter().enumerate() {
            if let Phase::Ready(ending) | Phase::Due(ending) = running.phase {
                let after = state.ended(world, place, ending);
                choices.push(vec![(1.0, vec![self.target((after, *coming))])]);
            }
            if world.may_gain_by_cancelling(usize::from(running.act)) {
                let mut after = state.clone();
                after.running.remove(place);
                choices.push(vec![(1.0, vec![self.target((after, *coming))])]);
            }
        }
        for event in 0..world.events.len() {
            let (must, may) = (coming.must & (1 << event), coming.may & (1 << event));
            if must | may == 0 || (must != 0 && world.is_best_last(event)) {
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
        // Harm for good is best done last.
        let (mut after, mut left) = (state.clone(), *coming);
        for event in 0..world.events.len() {
            if coming.must & (1 << event) != 0 && world.is_best_last(event) {
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

    /// An action starts, which may end in the very cell.
    fn start(&mut self, state: &State, coming: Coming, act: usize) -> Choice {
        let world = self.bound.world;
        let ways: Vec<_> = match world.acts[act].rest {
            Some(_) => self.bound.chances.ends[act][0]
                .ways(&world.acts[act])
                .collect(),
            None => vec![(1.0, None)],
        };
        let mut choice = Choice::new();
        for (p, ending) in ways.into_iter().filter(|(p, _)| *p > 0.0) {
            let phase = ending.map_or(Phase::Goes, Phase::Ready);
            let after = state.started(world, act, self.number, phase);
            choice.push((p, vec![self.target((after, coming))]));
        }
        choice
    }

    fn pass(&mut self, mut state: State) -> Target {
        let world = self.bound.world;
        for running in &mut state.running {
            if let Phase::Ready(ending) = running.phase {
                running.phase = Phase::Due(ending);
            }
        }
        if !state.is_hopeful(world, self.hopes) {
            return Target::Lost;
        }
        Target::later(self.later, self.number + 1, state)
    }
}

/// What is best done at once.
pub(super) fn forced(world: &TimedWorld, mut moment: Moment) -> Moment {
    loop {
        let (state, coming) = &moment;
        let event = (0..world.events.len())
            .find(|event| coming.must & (1 << event) != 0 && world.is_best_at_once(*event));
        let end = || {
            let mut running = state.running.iter().enumerate();
            running.find_map(|(place, running)| {
                let (Phase::Ready(ending) | Phase::Due(ending)) = running.phase else {
                    return None;
                };
                let act = usize::from(running.act);
                let is_best = world.ends_best_at_once(act, ending, state.facts);
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
