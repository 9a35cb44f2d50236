//! What both bounds have in common: states, cell by cell, and their values backwards.

use std::collections::BTreeMap;

use elbowroom_num::work;
use indexmap::{IndexMap, IndexSet};

use super::Stop;
use super::state::State;
use super::world::Facts;

/// Where something leads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Target {
    /// To a state at the beginning of a later cell.
    Later {
        /// The cell.
        cell: u32,
        /// The place of the state among those of the cell.
        state: u32,
    },
    /// To another node of this cell.
    Here(u32),
    /// To the goal.
    Won,
    /// To where there is no hope.
    Lost,
}

/// Something that the agent can do: what then comes about, with which probability. Where there is
/// more than one target, the worst counts.
pub(super) type Choice = Vec<(f64, Vec<Target>)>;

/// The nodes of one cell, the states at its beginning first, with all choices of each. There are
/// millions of them, so they are kept one after the other.
#[derive(Debug, Default)]
pub(super) struct Nodes {
    /// The cell that they are of.
    cell: u32,
    /// By node: where its choices end.
    ends: Vec<u32>,
    /// By choice: where its ways end.
    choices: Vec<u32>,
    /// By way: how likely it is, and where its targets end.
    ways: Vec<(f64, u32)>,
    targets: Vec<Target>,
}

/// The states at the beginnings of cells; those of the end of the last cell come after it.
pub(super) type Layers = BTreeMap<u32, IndexSet<State>>;

/// One of the two bounds.
pub(super) trait Expansion {
    /// The number of cells.
    fn cells(&self) -> usize;

    /// The states at time 0, with their probabilities.
    fn initial(&self) -> Vec<(f64, State)>;

    /// The nodes of a cell, which depend on nothing but these states; those to which they lead are
    /// entered into the layers of later cells.
    ///
    /// # Errors
    /// Beyond the limits.
    fn expand(
        &self,
        cell: usize,
        states: &IndexSet<State>,
        later: &mut Layers,
        hopes: &mut Hopes,
        limits: &Limits<'_>,
    ) -> Result<Nodes, Stop>;

    /// What a state is worth when the last cell is over.
    fn last(&self, state: &State) -> f64;
}

/// Limits of an expansion.
pub(super) struct Limits<'l> {
    /// The number of nodes of a cell.
    pub(super) nodes: usize,
    /// Asked before each node.
    pub(super) goes_on: &'l dyn Fn() -> bool,
}

impl Limits<'static> {
    /// None.
    pub(super) const NONE: Self = Self {
        nodes: usize::MAX,
        goes_on: &|| true,
    };
}

impl Limits<'_> {
    /// Checks that one more node can be added.
    ///
    /// # Errors
    /// Otherwise, with the reason.
    pub(super) fn check(&self, nodes: &Nodes) -> Result<(), Stop> {
        if !(self.goes_on)() {
            return Err(Stop::Interrupted);
        }
        let ways = nodes.ways.len() / WAYS;
        if nodes.len().max(ways) >= self.nodes {
            return Err(Stop::TooManyStates);
        }
        Ok(())
    }
}

/// The average number of ways of a node at most, once there are as many nodes as there may be.
const WAYS: usize = 16;

/// Limit on the combinations of events of one state in a cell. It is needed because each running action
/// may end or not, so their number grows exponentially.
pub(super) const MOST_WAYS: usize = 1 << 16;

/// Work that is counted for each node and each of its ways, in units of [`elbowroom_num::work`].
const NODE_WORK: u64 = 500;
const WAY_WORK: u64 = 300;

/// Where there is hope, as far as that has been looked at.
pub(super) type Hopes = IndexMap<(Facts, u64, u32), bool>;

/// There are fewer than 2^32 of anything: that many have no room.
fn small(count: usize) -> u32 {
    u32::try_from(count).expect("fewer than 2^32")
}

impl Target {
    /// That node of this cell.
    pub(super) fn here(node: usize) -> Self {
        Self::Here(small(node))
    }

    /// A state at the beginning of a later cell, which is entered there.
    pub(super) fn later(layers: &mut Layers, cell: usize, state: State) -> Self {
        let cell = small(cell);
        let layer = layers.entry(cell).or_default();
        let state = small(layer.insert_full(state).0);
        Self::Later { cell, state }
    }
}

impl Nodes {
    pub(super) fn of(cell: usize) -> Self {
        Self {
            cell: small(cell),
            ..Self::default()
        }
    }

    pub(super) fn len(&self) -> usize {
        self.ends.len()
    }

    /// One more node, with its choices.
    pub(super) fn push(&mut self, choices: Vec<Choice>) {
        let ways: usize = choices.iter().map(Vec::len).sum();
        work::spend(NODE_WORK + WAY_WORK.saturating_mul(ways as u64));
        for choice in choices {
            for (p, targets) in choice {
                self.targets.extend(targets);
                self.ways.push((p, small(self.targets.len())));
            }
            self.choices.push(small(self.ways.len()));
        }
        self.ends.push(small(self.choices.len()));
    }

    /// What each choice of a node is worth, given the values of the cell's nodes and of later states.
    pub(super) fn worths<'n>(
        &'n self,
        node: usize,
        here: &'n [f64],
        later: &'n Values,
        tolls: Tolls,
    ) -> impl DoubleEndedIterator<Item = f64> + 'n {
        span(&self.ends, node).map(move |choice| {
            let ways = span(&self.choices, choice);
            let parts = ways.map(|way| {
                let first = way.checked_sub(1).map_or(0, |way| self.ways[way].1);
                let (p, end) = self.ways[way];
                let targets = &self.targets[first as usize..end as usize];
                let of = targets
                    .iter()
                    .map(|target| self.worth(*target, here, later, tolls));
                let worst = of.fold(f64::INFINITY, f64::min);
                p * if worst.is_finite() { worst } else { 0.0 }
            });
            parts.sum()
        })
    }

    fn worth(&self, target: Target, here: &[f64], later: &Values, tolls: Tolls) -> f64 {
        match target {
            Target::Later { cell, state } => {
                let values = later.0.get(&cell);
                let value = values.map_or(0.0, |values| values[state as usize]);
                value * tolls.of_cells(cell - self.cell)
            }
            Target::Here(node) => here[node as usize] * tolls.step,
            Target::Won => 1.0,
            Target::Lost => 0.0,
        }
    }
}

/// From where to where the parts of one thing are, if those are where the parts of each end.
fn span(ends: &[u32], place: usize) -> std::ops::Range<usize> {
    let first = place.checked_sub(1).map_or(0, |before| ends[before]);
    first as usize..ends[place] as usize
}

/// What states at the beginnings of cells are worth, by cell.
#[derive(Debug, Default)]
pub(super) struct Values(pub(super) BTreeMap<u32, Vec<f64>>);

/// The value at time 0. `left` is how many states there may still be.
pub(super) fn value(
    bound: &impl Expansion,
    left: &mut usize,
    goes_on: &dyn Fn() -> bool,
) -> Result<f64, Stop> {
    let (layers, values) = backwards(bound, left, Tolls::NONE, goes_on)?;
    let of = |state: &State| {
        let place = layers.get(&0)?.get_index_of(state)?;
        Some(values.0.get(&0)?[place])
    };
    let initial = bound.initial();
    let parts = initial
        .iter()
        .map(|(p, state)| p * of(state).unwrap_or(0.0));
    Ok(parts.sum())
}

/// All states, and what each is worth, from the last to the first.
pub(super) fn backwards(
    bound: &impl Expansion,
    left: &mut usize,
    tolls: Tolls,
    goes_on: &dyn Fn() -> bool,
) -> Result<(Layers, Values), Stop> {
    let mut hopes = Hopes::new();
    let mut layers = explored(bound, &mut hopes, left, goes_on)?;
    let mut found = Values::default();
    let cells: Vec<u32> = layers.keys().copied().collect();
    for cell in cells.into_iter().rev() {
        if !goes_on() {
            return Err(Stop::Interrupted);
        }
        let states = layers.remove(&cell).unwrap_or_default();
        let values = if cell as usize >= bound.cells() {
            states.iter().map(|state| bound.last(state)).collect()
        } else {
            let limits = Limits {
                goes_on,
                ..Limits::NONE
            };
            let nodes = bound.expand(cell as usize, &states, &mut layers, &mut hopes, &limits)?;
            let mut values = settled(&nodes, &found, tolls);
            values.truncate(states.len());
            values
        };
        layers.insert(cell, states);
        found.0.insert(cell, values);
    }
    Ok((layers, found))
}

/// A cell may have so many nodes for each state that there may be in all cells together: within a cell
/// much can happen in many orders.
const NODES: usize = 4;

/// The states at the beginning of each cell, and at the end of the last.
fn explored(
    bound: &impl Expansion,
    hopes: &mut Hopes,
    left: &mut usize,
    goes_on: &dyn Fn() -> bool,
) -> Result<Layers, Stop> {
    let initial = bound.initial().into_iter();
    let mut layers = Layers::from([(0, initial.map(|(_, state)| state).collect())]);
    let limits = Limits {
        nodes: left.saturating_mul(NODES),
        goes_on,
    };
    let mut cell = 0;
    loop {
        if !goes_on() {
            return Err(Stop::Interrupted);
        }
        let states = layers.remove(&cell).unwrap_or_default();
        bound.expand(cell as usize, &states, &mut layers, hopes, &limits)?;
        let new = layers.range(cell..).map(|(_, states)| states.len());
        if new.sum::<usize>() > *left {
            return Err(Stop::TooManyStates);
        }
        layers.insert(cell, states);
        let Some((next, states)) = layers.range(cell + 1..).next() else {
            return Ok(layers);
        };
        *left -= states.len();
        cell = *next;
        if cell as usize >= bound.cells() {
            return Ok(layers);
        }
    }
}

/// By which factors a value shrinks on the way, so that of two ways that are equally likely to
/// reach the goal the shorter one is worth more.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tolls {
    /// For each cell that passes.
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

    /// For so many cells.
    fn of_cells(self, cells: u32) -> f64 {
        match cells {
            1 => self.cell,
            _ => self.cell.powf(f64::from(cells)),
        }
    }
}

/// The values of a cell's nodes. Nodes lead to later ones, or back through instantaneous actions
/// and such as take less than a cell; so they are gone through from the last to the first, until
/// nothing changes any more.
pub(super) fn settled(nodes: &Nodes, later: &Values, tolls: Tolls) -> Vec<f64> {
    let mut values = vec![0.0_f64; nodes.len()];
    loop {
        let mut greatest: f64 = 0.0;
        for node in (0..nodes.len()).rev() {
            let worths = nodes.worths(node, &values, later, tolls);
            let best = worths.fold(0.0, f64::max);
            greatest = greatest.max(best - values[node]);
            values[node] = best;
        }
        if greatest < 1e-13 {
            return values;
        }
    }
}
