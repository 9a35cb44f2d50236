//! What both bounds have in common: states, cell by cell, and their values backwards.

use indexmap::{IndexMap, IndexSet};

use super::Stop;
use super::failures::Ending;
use super::world::{Facts, TimedWorld};

/// A state at the beginning of a cell.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct State {
    pub(super) facts: Facts,
    /// Which events have happened, as bits; not those that happen again and again.
    pub(super) happened: u32,
    /// Sorted by action.
    pub(super) running: Vec<Running>,
    /// Whether the agent may do something before anything more happens.
    pub(super) may_act: bool,
}

/// An action under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct Running {
    pub(super) act: u8,
    /// The cell in which it began.
    pub(super) since: u16,
    pub(super) phase: Phase,
}

/// What is known of an action's end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) enum Phase {
    /// Nothing yet.
    Goes,
    /// It may end in this cell, or in the next one.
    Ready(Ending),
    /// It ends in this cell.
    Due(Ending),
}

/// Where something leads.
#[derive(Clone, Copy, Debug)]
pub(super) enum Target {
    /// To a state at the beginning of the next cell.
    Next(usize),
    /// To another node of this cell.
    Here(usize),
    /// To the goal.
    Won,
    /// To where there is no hope.
    Lost,
}

/// Something that the agent can do: what then comes about, with which probability. Where there is
/// more than one target, the worst counts.
pub(super) type Choice = Vec<(f64, Vec<Target>)>;

/// The states of one cell, those at its beginning first, with all choices of each.
pub(super) type Nodes = Vec<Vec<Choice>>;

/// One of the two bounds.
pub(super) trait Expansion {
    /// The number of cells.
    fn cells(&self) -> usize;

    /// The states at time 0, with their probabilities.
    fn initial(&self) -> Vec<(f64, State)>;

    /// The nodes of a cell, which depend on nothing but these states; those to which they lead are
    /// entered into `next`. `None` if there are more nodes than `most`.
    fn expand(
        &self,
        cell: usize,
        states: &IndexSet<State>,
        next: &mut IndexSet<State>,
        hopes: &mut Hopes,
        most: usize,
    ) -> Option<Nodes>;

    /// What a state is worth when the last cell is over.
    fn last(&self, state: &State) -> f64;
}

/// Where there is hope, as far as that has been looked at.
pub(super) type Hopes = IndexMap<(Facts, u64, u32), bool>;

impl State {
    /// The state before anything has been done, or has happened by itself.
    pub(super) fn initial(world: &TimedWorld) -> Self {
        Self {
            facts: world.initial,
            happened: 0,
            running: Vec::new(),
            may_act: true,
        }
    }

    pub(super) fn under_way(&self) -> u64 {
        self.running
            .iter()
            .fold(0, |set, running| set | 1 << running.act)
    }

    pub(super) fn is_hopeful(&self, world: &TimedWorld, hopes: &mut Hopes) -> bool {
        let (facts, set, happened) = (self.facts, self.under_way(), self.happened);
        *hopes
            .entry((facts, set, happened))
            .or_insert_with(|| world.is_hopeful(facts, set, happened))
    }

    /// Actions whose condition over all no longer holds fail.
    pub(super) fn settle(&mut self, world: &TimedWorld) {
        let facts = self.facts;
        self.running.retain(|running| {
            let rest = world.acts[usize::from(running.act)].rest.as_ref();
            rest.is_some_and(|(over_all, _)| over_all.hold(facts))
        });
    }

    /// An action starts, in that cell, with what is known of its end; an instantaneous one is over.
    pub(super) fn started(
        &self,
        world: &TimedWorld,
        act: usize,
        since: usize,
        phase: Phase,
    ) -> Self {
        let mut after = self.clone();
        after.facts = world.acts[act].start.apply(after.facts);
        if world.acts[act].rest.is_some() {
            let running = Running {
                act: u8::try_from(act).expect("at most 64 actions"),
                since: u16::try_from(since).expect("fewer than 65,535 cells"),
                phase,
            };
            let place = after.running.partition_point(|other| *other < running);
            after.running.insert(place, running);
        }
        after.settle(world);
        after
    }

    /// Whether the goal is reached for good: it holds, and nothing is under way that nobody might be
    /// able to let go, and that could spoil it.
    pub(super) fn is_won(&self, world: &TimedWorld) -> bool {
        let holds_up = |running: &Running| world.acts[usize::from(running.act)].may_hold_up();
        world.goal.hold(self.facts) && !self.running.iter().any(holds_up)
    }

    /// The action at that place in the list ends, well or badly. It fails, too, if what its end
    /// needs does not hold; then nothing is left behind or undone, nor is it where it breaks off.
    pub(super) fn ended(&self, world: &TimedWorld, place: usize, ending: Ending) -> Self {
        let mut after = self.clone();
        let running = after.running.remove(place);
        let act = &world.acts[usize::from(running.act)];
        if let Some(failed) = act.failed(ending) {
            after.facts = failed.apply(after.facts);
            after.settle(world);
        } else if let Some((_, end)) = &act.rest
            && end.needs.hold(after.facts)
        {
            after.facts = end.apply(after.facts);
            after.settle(world);
        }
        after
    }

    /// An event happens.
    pub(super) fn changed(&self, world: &TimedWorld, event: usize) -> Self {
        let mut after = self.clone();
        if !world.events[event].is_recurrent() {
            after.happened |= 1 << event;
        }
        after.facts = world.events[event].apply(after.facts);
        after.settle(world);
        after
    }

    /// The actions that can start and may do any good; the only one that needs looking at, where
    /// nothing is ever better than to start it at once.
    pub(super) fn startable(&self, world: &TimedWorld) -> Vec<usize> {
        let under_way = self.under_way();
        let can_start = |act: &usize| {
            let is_idle = under_way & (1 << act) == 0;
            is_idle
                && world.acts[*act].start.needs.hold(self.facts)
                && world.is_useful(*act, self.facts)
        };
        let acts: Vec<usize> = (0..world.acts.len()).filter(can_start).collect();
        let is_eager = |act: &&usize| {
            let Some((over_all, _)) = &world.acts[**act].rest else {
                return false;
            };
            let facts = world.acts[**act].start.apply(self.facts);
            world.acts[**act].is_eager && over_all.hold(facts)
        };
        match acts.iter().find(is_eager) {
            Some(eager) => vec![*eager],
            None => acts,
        }
    }

    /// Whether the agent has nothing to think about but to start the first of these.
    pub(super) fn must_start(&self, world: &TimedWorld, startable: &[usize]) -> bool {
        matches!(startable, [only] if world.acts[*only].is_eager && {
            let facts = world.acts[*only].start.apply(self.facts);
            world.acts[*only].rest.as_ref().is_some_and(|(over_all, _)| over_all.hold(facts))
        })
    }
}

/// The value at time 0. `left` is how many states there may still be.
pub(super) fn value(
    bound: &impl Expansion,
    left: &mut usize,
    goes_on: &dyn Fn() -> bool,
) -> Result<f64, Stop> {
    let mut hopes = Hopes::new();
    let initial = bound.initial();
    let mut layers = explored(bound, &mut hopes, left, goes_on)?;
    let last = layers.pop().unwrap_or_default();
    let mut values: Vec<f64> = last.iter().map(|state| bound.last(state)).collect();
    for (cell, states) in layers.iter().enumerate().rev() {
        if !goes_on() {
            return Err(Stop::Interrupted);
        }
        let mut next = IndexSet::new();
        let nodes = bound.expand(cell, states, &mut next, &mut hopes, usize::MAX);
        let nodes = nodes.unwrap_or_default();
        let mut here = settled(&nodes, &values, Tolls::NONE);
        here.truncate(states.len());
        values = here;
    }
    let value = initial.iter().map(|(p, state)| {
        let place = layers.first().and_then(|layer| layer.get_index_of(state));
        p * place.map_or(0.0, |place| values[place])
    });
    Ok(value.sum())
}

/// A cell may have so many nodes for each state that there may be in all cells together: within a cell
/// much can happen in many orders.
const NODES: usize = 4;

/// The states at the beginning of each cell, and at the end of the last.
pub(super) fn explored(
    bound: &impl Expansion,
    hopes: &mut Hopes,
    left: &mut usize,
    goes_on: &dyn Fn() -> bool,
) -> Result<Vec<IndexSet<State>>, Stop> {
    let initial = bound.initial();
    let mut layers: Vec<IndexSet<State>> =
        vec![initial.iter().map(|(_, state)| state.clone()).collect()];
    let most_nodes = left.saturating_mul(NODES);
    for cell in 0..bound.cells() {
        if !goes_on() {
            return Err(Stop::Interrupted);
        }
        let mut next = IndexSet::new();
        let nodes = bound.expand(cell, &layers[cell], &mut next, hopes, most_nodes);
        nodes.ok_or(Stop::TooManyStates)?;
        *left = left.checked_sub(next.len()).ok_or(Stop::TooManyStates)?;
        layers.push(next);
    }
    Ok(layers)
}

/// By which factors a value shrinks on the way, so that of two ways that are equally likely to
/// reach the goal the shorter one is worth more.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tolls {
    /// From one cell to the next.
    pub(super) cell: f64,
    /// For each thing that the agent does.
    pub(super) step: f64,
}

impl Tolls {
    /// A value is a probability.
    pub(super) const NONE: Self = Self {
        cell: 1.0,
        step: 1.0,
    };
}

/// The values of a cell's nodes. Nodes lead to later ones, or back through instantaneous actions
/// and such as take less than a cell; so they are gone through from the last to the first, until
/// nothing changes any more.
pub(super) fn settled(nodes: &Nodes, next: &[f64], tolls: Tolls) -> Vec<f64> {
    let mut values = vec![0.0_f64; nodes.len()];
    loop {
        let mut greatest: f64 = 0.0;
        for (index, choices) in nodes.iter().enumerate().rev() {
            let of = |choice: &Choice| worth(choice, &values, next, tolls);
            let best = choices.iter().map(of).fold(0.0, f64::max);
            greatest = greatest.max(best - values[index]);
            values[index] = best;
        }
        if greatest < 1e-13 {
            return values;
        }
    }
}

/// The value of a choice, given those of the cell's nodes and of the next cell's states.
pub(super) fn worth(choice: &Choice, here: &[f64], next: &[f64], tolls: Tolls) -> f64 {
    let of = |target: &Target| match target {
        Target::Next(state) => next[*state] * tolls.cell,
        Target::Here(node) => here[*node] * tolls.step,
        Target::Won => 1.0,
        Target::Lost => 0.0,
    };
    let parts = choice.iter().map(|(p, targets)| {
        let worst = targets.iter().map(of).fold(f64::INFINITY, f64::min);
        p * if worst.is_finite() { worst } else { 0.0 }
    });
    parts.sum()
}
