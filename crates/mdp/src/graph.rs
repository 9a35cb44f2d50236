//! Backward induction for both bounds: states, cell by cell, and their values.

use std::collections::BTreeMap;

use elbowroom_num::work;
use indexmap::IndexSet;

use super::settings::Stop;
use super::state::{ReachabilityCache, State};

/// A target of a transition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Target {
    /// A state at the beginning of a later cell.
    Later {
        /// The cell.
        cell: u32,
        /// The position of the state among those of the cell.
        state: u32,
    },
    /// Another node of the same cell.
    Here(u32),
    /// The goal.
    Goal,
    /// A hopeless state: the goal is unreachable.
    DeadEnd,
}

/// A choice of the agent: the probabilities of its results, with their targets. If a result has
/// several targets, the worst one counts.
pub(super) type Choice = Vec<(f64, Vec<Target>)>;

/// The nodes of one cell, with all choices of each; the states at its beginning come first. There
/// may be millions of nodes, so they are stored in flat vectors.
#[derive(Debug, Default)]
pub(super) struct Nodes {
    /// The cell of the nodes.
    cell: u32,
    /// By node: the end of its choices.
    ends: Vec<u32>,
    /// By choice: the end of its results.
    choices: Vec<u32>,
    /// By result: its probability, and the end of its targets.
    ways: Vec<(f64, u32)>,
    targets: Vec<Target>,
}

/// The states at the beginnings of cells; those at the end of the last cell have its number plus
/// one.
pub(super) type Layers = BTreeMap<u32, IndexSet<State>>;

/// The expansion of states for one of the two bounds.
pub(super) trait Expansion {
    /// The number of cells.
    fn cells(&self) -> usize;

    /// The states at time 0, with their probabilities.
    fn initial(&self) -> Vec<(f64, State)>;

    /// Returns the nodes of a cell, which depend only on these states. Adds the target states to
    /// the layers of later cells.
    ///
    /// # Errors
    /// When a limit is exceeded.
    fn expand(
        &self,
        cell: usize,
        states: &IndexSet<State>,
        later: &mut Layers,
        reachability: &mut ReachabilityCache,
        limits: &Limits<'_>,
    ) -> Result<Nodes, Stop>;

    /// Returns the value of a state after the last cell.
    fn last(&self, state: &State) -> f64;
}

/// Limits of an expansion.
pub(super) struct Limits<'l> {
    /// Maximum number of nodes of a cell.
    pub(super) nodes: usize,
    /// Called before each node; returns `false` to stop the expansion.
    pub(super) may_continue: &'l dyn Fn() -> bool,
}

impl Limits<'static> {
    /// No limits.
    pub(super) const NONE: Self = Self {
        nodes: usize::MAX,
        may_continue: &|| true,
    };
}

impl Limits<'_> {
    /// Checks that one more node can be added.
    ///
    /// # Errors
    /// The reason, if it cannot.
    pub(super) fn check(&self, nodes: &Nodes) -> Result<(), Stop> {
        if !(self.may_continue)() {
            return Err(Stop::Interrupted);
        }
        let ways = nodes.ways.len() / WAYS;
        if nodes.len().max(ways) >= self.nodes {
            return Err(Stop::TooManyStates);
        }
        Ok(())
    }
}

/// Maximum average number of results of a node's choices, when the maximum number of nodes is
/// reached.
const WAYS: usize = 16;

/// Limit on the combinations of events of one state in a cell. It is needed because each running action
/// may end or not, so their number grows exponentially.
pub(super) const MAX_WAYS: usize = 1 << 16;

/// Work for each node and each result of its choices, in units of [`elbowroom_num::work`].
const NODE_WORK: u64 = 500;
const WAY_WORK: u64 = 300;

/// Converts a count; memory is too small for 2^32 elements.
fn small(count: usize) -> u32 {
    u32::try_from(count).expect("fewer than 2^32")
}

impl Target {
    /// Returns the target for a node of this cell.
    pub(super) fn here(node: usize) -> Self {
        Self::Here(small(node))
    }

    /// Returns the target for a state at the beginning of a later cell, and adds the state to its
    /// layer.
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

    /// Appends a node with its choices.
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

    /// Returns the value of each choice of a node, given the values of the cell's nodes and of
    /// later states.
    pub(super) fn choice_values<'n>(
        &'n self,
        node: usize,
        here: &'n [f64],
        later: &'n Values,
        tolls: Discounts,
    ) -> impl DoubleEndedIterator<Item = f64> + 'n {
        span(&self.ends, node).map(move |choice| {
            let ways = span(&self.choices, choice);
            let parts = ways.map(|way| {
                let first = way.checked_sub(1).map_or(0, |way| self.ways[way].1);
                let (p, end) = self.ways[way];
                let targets = &self.targets[first as usize..end as usize];
                let of = targets
                    .iter()
                    .map(|target| self.target_value(*target, here, later, tolls));
                let worst = of.fold(f64::INFINITY, f64::min);
                p * if worst.is_finite() { worst } else { 0.0 }
            });
            parts.sum()
        })
    }

    fn target_value(&self, target: Target, here: &[f64], later: &Values, tolls: Discounts) -> f64 {
        match target {
            Target::Later { cell, state } => {
                let values = later.0.get(&cell);
                let value = values.map_or(0.0, |values| values[state as usize]);
                value * tolls.of_cells(cell - self.cell)
            }
            Target::Here(node) => here[node as usize] * tolls.step,
            Target::Goal => 1.0,
            Target::DeadEnd => 0.0,
        }
    }
}

/// Returns the range of the parts of an element, given the ends of all elements.
fn span(ends: &[u32], place: usize) -> std::ops::Range<usize> {
    let first = place.checked_sub(1).map_or(0, |before| ends[before]);
    first as usize..ends[place] as usize
}

/// Values of states at the beginnings of cells, by cell.
#[derive(Debug, Default)]
pub(super) struct Values(pub(super) BTreeMap<u32, Vec<f64>>);

/// Computes the value at time 0. `left` is the remaining number of states.
pub(super) fn value(
    bound: &impl Expansion,
    left: &mut usize,
    may_continue: &dyn Fn() -> bool,
) -> Result<f64, Stop> {
    let (layers, values) = backward_induction(bound, left, Discounts::NONE, may_continue)?;
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

/// Computes all states and their values, from the last cell to the first.
pub(super) fn backward_induction(
    bound: &impl Expansion,
    left: &mut usize,
    tolls: Discounts,
    may_continue: &dyn Fn() -> bool,
) -> Result<(Layers, Values), Stop> {
    let mut reachability = ReachabilityCache::new();
    let mut layers = explore_forward(bound, &mut reachability, left, may_continue)?;
    let mut found = Values::default();
    let cells: Vec<u32> = layers.keys().copied().collect();
    for cell in cells.into_iter().rev() {
        if !may_continue() {
            return Err(Stop::Interrupted);
        }
        let states = layers.remove(&cell).unwrap_or_default();
        let values = if cell as usize >= bound.cells() {
            states.iter().map(|state| bound.last(state)).collect()
        } else {
            let limits = Limits {
                may_continue,
                ..Limits::NONE
            };
            let nodes = bound.expand(
                cell as usize,
                &states,
                &mut layers,
                &mut reachability,
                &limits,
            )?;
            let mut values = solve_cell(&nodes, &found, tolls);
            values.truncate(states.len());
            values
        };
        layers.insert(cell, states);
        found.0.insert(cell, values);
    }
    Ok((layers, found))
}

/// A cell may have this many times as many nodes as the remaining number of states, because its
/// happenings may have many orders.
const NODES: usize = 4;

/// Returns the states at the beginning of each cell, and at the end of the last.
fn explore_forward(
    bound: &impl Expansion,
    reachability: &mut ReachabilityCache,
    left: &mut usize,
    may_continue: &dyn Fn() -> bool,
) -> Result<Layers, Stop> {
    let initial = bound.initial().into_iter();
    let mut layers = Layers::from([(0, initial.map(|(_, state)| state).collect())]);
    let limits = Limits {
        nodes: left.saturating_mul(NODES),
        may_continue,
    };
    let mut cell = 0;
    loop {
        if !may_continue() {
            return Err(Stop::Interrupted);
        }
        let states = layers.remove(&cell).unwrap_or_default();
        bound.expand(cell as usize, &states, &mut layers, reachability, &limits)?;
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

/// Discount factors. They make the shorter of two equally likely paths to the goal more valuable.
#[derive(Clone, Copy, Debug)]
pub(super) struct Discounts {
    /// Factor per cell.
    pub(super) cell: f64,
    /// Factor per move of the agent.
    pub(super) step: f64,
}

impl Discounts {
    /// No discount: values are probabilities.
    pub(super) const NONE: Self = Self {
        cell: 1.0,
        step: 1.0,
    };

    /// Returns the factor for `cells` cells.
    fn of_cells(self, cells: u32) -> f64 {
        match cells {
            1 => self.cell,
            _ => self.cell.powf(f64::from(cells)),
        }
    }
}

/// Computes the values of a cell's nodes. Nodes lead to later ones, or back through instantaneous
/// actions and actions shorter than a cell. So they are processed from the last to the first, until
/// no value changes any more.
pub(super) fn solve_cell(nodes: &Nodes, later: &Values, tolls: Discounts) -> Vec<f64> {
    let mut values = vec![0.0_f64; nodes.len()];
    loop {
        let mut greatest: f64 = 0.0;
        for node in (0..nodes.len()).rev() {
            let worths = nodes.choice_values(node, &values, later, tolls);
            let best = worths.fold(0.0, f64::max);
            greatest = greatest.max(best - values[node]);
            values[node] = best;
        }
        if greatest < 1e-13 {
            return values;
        }
    }
}
