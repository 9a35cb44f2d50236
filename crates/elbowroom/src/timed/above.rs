//! The bound from above: the agent knows what this cell brings, and chooses the order.

use indexmap::IndexSet;

use super::chances::Chances;
use super::graph::{Choice, Expansion, Hopes, Nodes, Phase, State, Target};
use super::world::TimedWorld;

pub(super) struct Above<'a> {
    world: &'a TimedWorld,
    chances: &'a Chances,
}

/// A state within a cell, with the events that are still to happen in it.
type Moment = (State, u32);

/// What is being put together of one cell.
struct Cell<'c> {
    bound: &'c Above<'c>,
    /// Its number.
    number: usize,
    /// After the nodes of the cell's beginning.
    moments: IndexSet<Moment>,
    first: usize,
    next: &'c mut IndexSet<State>,
    hopes: &'c mut Hopes,
}

impl<'a> Above<'a> {
    pub(super) fn new(world: &'a TimedWorld, chances: &'a Chances) -> Self {
        Self { world, chances }
    }

    /// What the cell brings: which of the actions under way may end, and which events happen.
    fn revealed(&self, cell: usize, state: &State) -> Vec<(f64, Moment)> {
        let mut moments = vec![(1.0, (state.clone(), 0_u32))];
        for (place, running) in state.running.iter().enumerate() {
            let age = cell - usize::from(running.since);
            let (well, badly) = match running.phase {
                Phase::Goes => self.chances.ends[usize::from(running.act)][age],
                Phase::Ready(_) | Phase::Due(_) => continue,
            };
            moments = split(
                moments,
                &[
                    (well, Some(true)),
                    (badly, Some(false)),
                    (1.0 - well - badly, None),
                ],
                |moment, is_well| {
                    if let Some(is_well) = is_well {
                        moment.0.running[place].phase = Phase::Ready(*is_well);
                    }
                },
            );
        }
        for (event, hazards) in self.chances.events.iter().enumerate() {
            if state.happened & (1 << event) == 0 {
                let p = hazards[cell];
                moments = split(
                    moments,
                    &[(p, true), (1.0 - p, false)],
                    |moment, happens| {
                        moment.1 |= u32::from(*happens) << event;
                    },
                );
            }
        }
        moments
    }
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
        next: &mut IndexSet<State>,
        hopes: &mut Hopes,
    ) -> Nodes {
        let mut here = Cell {
            bound: self,
            number: cell,
            moments: IndexSet::new(),
            first: states.len(),
            next,
            hopes,
        };
        let mut nodes: Nodes = Vec::with_capacity(states.len());
        for state in states {
            let revealed = self.revealed(cell, state).into_iter();
            nodes.push(vec![
                revealed
                    .map(|(p, moment)| (p, vec![here.target(moment)]))
                    .collect(),
            ]);
        }
        let mut done = 0;
        while let Some(moment) = here.moments.get_index(done).cloned() {
            nodes.push(here.choices(&moment));
            done += 1;
        }
        nodes
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
        Target::Here(self.first + self.moments.insert_full(moment).0)
    }

    fn choices(&mut self, moment: &Moment) -> Vec<Choice> {
        let world = self.bound.world;
        let (state, pending) = moment;
        let startable = state.startable(world);
        if state.must_start(world, &startable) {
            return vec![self.start(state, *pending, startable[0])];
        }
        let mut choices: Vec<Choice> = Vec::new();
        for (place, running) in state.running.iter().enumerate() {
            if let Phase::Ready(is_well) | Phase::Due(is_well) = running.phase {
                let after = state.ended(world, place, is_well);
                choices.push(vec![(1.0, vec![self.target((after, *pending))])]);
            }
            if world.may_gain_by_cancelling(usize::from(running.act)) {
                let mut after = state.clone();
                after.running.remove(place);
                choices.push(vec![(1.0, vec![self.target((after, *pending))])]);
            }
        }
        let events = (0..world.events.len()).filter(|event| pending & (1 << event) != 0);
        for event in events.clone() {
            if !world.is_best_last(event) {
                let after = state.changed(world, event);
                choices.push(vec![(
                    1.0,
                    vec![self.target((after, pending & !(1 << event)))],
                )]);
            }
        }
        for act in startable {
            choices.push(self.start(state, *pending, act));
        }
        // Harm for good is best done last.
        let mut after = state.clone();
        for event in events.filter(|event| world.is_best_last(*event)) {
            after = after.changed(world, event);
        }
        let all_happened = after.happened & pending == *pending;
        let is_due = |phase: Phase| matches!(phase, Phase::Due(_));
        if all_happened && !after.running.iter().any(|running| is_due(running.phase)) {
            choices.push(vec![(1.0, vec![self.pass(after)])]);
        }
        choices
    }

    /// An action starts, which may end in the very cell.
    fn start(&mut self, state: &State, pending: u32, act: usize) -> Choice {
        let world = self.bound.world;
        let (well, badly) = match world.acts[act].rest {
            Some(_) => self.bound.chances.ends[act][0],
            None => (0.0, 0.0),
        };
        let ways = [
            (well, Phase::Ready(true)),
            (badly, Phase::Ready(false)),
            (1.0 - well - badly, Phase::Goes),
        ];
        let mut choice = Choice::new();
        for (p, phase) in ways.into_iter().filter(|(p, _)| *p > 0.0) {
            let after = state.started(world, act, self.number, phase);
            choice.push((p, vec![self.target((after, pending))]));
        }
        choice
    }

    fn pass(&mut self, mut state: State) -> Target {
        let world = self.bound.world;
        for running in &mut state.running {
            if let Phase::Ready(is_well) = running.phase {
                running.phase = Phase::Due(is_well);
            }
        }
        if !state.is_hopeful(world, self.hopes) {
            return Target::Lost;
        }
        Target::Next(self.next.insert_full(state).0)
    }
}

/// What is best done at once.
fn forced(world: &TimedWorld, mut moment: Moment) -> Moment {
    loop {
        let (state, pending) = &moment;
        let event = (0..world.events.len())
            .find(|event| pending & (1 << event) != 0 && world.is_best_at_once(*event));
        let end = || {
            let mut running = state.running.iter().enumerate();
            running.find_map(|(place, running)| {
                let (Phase::Ready(is_well) | Phase::Due(is_well)) = running.phase else {
                    return None;
                };
                let act = usize::from(running.act);
                let is_best = world.ends_best_at_once(act, is_well, state.facts);
                is_best.then_some((place, is_well))
            })
        };
        moment = if let Some(event) = event {
            (state.changed(world, event), pending & !(1 << event))
        } else if let Some((place, is_well)) = end() {
            (state.ended(world, place, is_well), *pending)
        } else {
            return moment;
        };
    }
}
