//! The policy that attains the lower bound: [`Policy`].

use std::collections::BTreeMap;

use elbowroom_execution::{ActionValues, DecisionState, Move as Choice, RankedMoves};
use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_sim::{Side as Part, WorldModel};
use indexmap::{IndexMap, IndexSet};

use super::cell_probabilities::{CellProbabilities, cell_probabilities_of};
use super::discrete_events;
use super::graph::{Discounts, Expansion, Layers, Limits, Values, backward_induction, solve_cell};
use super::lower_bound::{DecisionEpochs, LowerBound, Move};
use super::process::action_model::Facts;
use super::process::value_intervals::Span;
use super::process::world::TimedWorld;
use super::refinement::{TimedOptimum, grid, refine_bounds};
use super::restricted_policy::{FIRST_STATES_DIVISOR, Search};
use super::settings::{Grid, NotTabulated, Settings, Side};
use super::state::{Phase, ReachabilityCache, Running, State};

/// Table of the values of all states on the grid of the lower bound, for evaluating each move.
///
/// An agent that always makes the most valuable move at the boundaries of cells succeeds with a
/// probability of at least [`TimedOptimum::lower`]. There are two deviations: the policy accepts a
/// loss of at most a ten-thousandth to succeed earlier, and the process ignores the separation of
/// happenings by ε.
#[derive(Debug)]
pub struct Policy {
    world: TimedWorld,
    chances: CellProbabilities,
    step: Rational,
    /// The values of states, by cell.
    values: BTreeMap<u32, IndexMap<State, f64>>,
    epochs: DecisionEpochs,
    discounts: Discounts,
    optimum: TimedOptimum,
}

/// Distance from 1 within which the bound of a plan's actions is good enough to end the search.
const CERTAINTY_TOLERANCE: f64 = 0.005;

/// Difference of the bounds within which the policy counts as optimal.
const OPTIMALITY_GAP: f64 = 0.02;

/// Maximum loss of success probability that the policy accepts to succeed earlier.
const EARLINESS_TOLERANCE: f64 = 1e-4;

/// Default growth of the number of states when cells are halved: twice as many cells, with twice as
/// many possible start cells of running actions.
const GROWTH: f64 = 4.0;

/// Divisor of the maximum number of states for the first grid. The first grid is rarely the last,
/// and detecting that refinement is hopeless takes longer with more states.
const FIRST_SHARE: usize = 32;

/// Returns the exact length of a cell.
fn exact_step(world: &TimedWorld, cells: usize) -> Rational {
    // The horizon is a number in a file, or a multiple of the resolution.
    let horizon = Rational::from_f64_as_written(world.horizon).unwrap_or_default();
    horizon / Rational::from(i64::try_from(cells).unwrap_or(i64::MAX))
}

/// Extrapolates whether the bounds become close before there are too many states: each further grid
/// halves their difference, and multiplies the number of states as the last one did.
fn can_converge(grids: &[Grid], most_states: usize) -> bool {
    #[allow(clippy::cast_precision_loss, reason = "far fewer than 2^52")]
    let states = |grid: &Grid| grid.states.max(1) as f64;
    let Some(last) = grids.last() else {
        return true;
    };
    let before = grids.len().checked_sub(2).map(|place| &grids[place]);
    let growth = before.map_or(GROWTH, |before| (states(last) / states(before)).max(2.0));
    #[allow(clippy::cast_precision_loss, reason = "far fewer than 2^52")]
    let most = most_states as f64;
    let (mut next, mut gap) = (states(last) * growth, last.upper - last.lower);
    while next <= most && gap > OPTIMALITY_GAP {
        next *= growth;
        gap /= 2.0;
    }
    gap <= OPTIMALITY_GAP
}

impl Policy {
    /// Computes the policy on the finest grid that [`optimum`](super::optimum) finishes; `None` if
    /// there is none, or if `may_continue` returns `false`.
    ///
    /// # Errors
    /// When the task or the world has a feature that the process does not support.
    pub fn new(
        task: &Task,
        model: &WorldModel,
        settings: &Settings,
        may_continue: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, NotTabulated> {
        let world = TimedWorld::new(task, model, settings)?;
        let optimum = refine_bounds(
            &world,
            TimedOptimum::unknown(),
            settings,
            &|_| true,
            may_continue,
        )?;
        Self::on_finest(world, optimum, settings, may_continue)
    }

    /// Computes the policy if the bounds are at most two percentage points apart. On a coarse grid,
    /// a policy loses much compared with other executors, because it decides only at the boundaries
    /// of cells. The computation stops early if finer grids are unlikely to bring the bounds this
    /// close.
    ///
    /// If an agent that uses only the actions of one of the [plans](Settings::plans) almost always
    /// succeeds, its policy is used: if it fails in at most half a percent before the whole process
    /// is examined, or in at most two percent if the whole process is too large.
    ///
    /// # Errors
    /// As for [`new`](Self::new).
    pub fn if_near_optimal(
        task: &Task,
        model: &WorldModel,
        settings: &Settings,
        may_continue: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, NotTabulated> {
        let world = TimedWorld::new(task, model, settings);
        let horizon = world.as_ref().ok().map(|world| world.horizon);
        let mut search = Search::new(task, model, settings, horizon);
        let sure = Settings {
            gap: CERTAINTY_TOLERANCE,
            ..settings.clone()
        };
        search.refine(
            1.0,
            settings.most_states / FIRST_STATES_DIVISOR,
            &sure,
            may_continue,
        );
        if 1.0 - search.lower() <= CERTAINTY_TOLERANCE {
            return Self::within(search, settings, may_continue);
        }
        let whole =
            world.and_then(
                |world| match Self::for_known_times(&world, settings, may_continue)? {
                    Some(policy) => Ok(Some(policy)),
                    None => Self::if_near_optimal_in_full_process(world, settings, may_continue),
                },
            );
        if !matches!(whole, Ok(Some(_))) && 1.0 - search.lower() <= OPTIMALITY_GAP {
            return Self::within(search, settings, may_continue);
        }
        whole
    }

    /// Computes the policy for worlds with known times, if the bounds are close.
    fn for_known_times(
        world: &TimedWorld,
        settings: &Settings,
        may_continue: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, NotTabulated> {
        let found = discrete_events::bounds(
            world,
            settings,
            discrete_events::Effort::QUICK,
            may_continue,
        )?;
        let Some(found) =
            found.filter(|found| found.grid.upper - found.grid.lower <= OPTIMALITY_GAP)
        else {
            return Ok(None);
        };
        let Some(within) = found.within else {
            return Ok(None);
        };
        let discrete_events::RestrictedAgent { world, epochs } = within;
        let chances = cell_probabilities_of(&world, found.cells, Side::Below)?;
        let step = exact_step(&world, found.cells);
        let optimum = TimedOptimum {
            lower: found.grid.lower,
            upper: found.grid.upper,
            grids: vec![found.grid],
            ..TimedOptimum::unknown()
        };
        let acts = (found.cells, epochs);
        Ok(Self::of(world, chances, optimum, step, acts).with_values(settings, may_continue))
    }

    /// Computes the policy in the whole process, if the bounds become close.
    fn if_near_optimal_in_full_process(
        world: TimedWorld,
        settings: &Settings,
        may_continue: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, NotTabulated> {
        let first = Settings {
            most_states: settings.most_states / FIRST_SHARE,
            ..settings.clone()
        };
        if grid(&world, settings.first_cells.max(1), &first, may_continue)?.is_err() {
            return Ok(None);
        }
        let is_promising = |grids: &[Grid]| can_converge(grids, settings.most_states);
        let optimum = refine_bounds(
            &world,
            TimedOptimum::unknown(),
            settings,
            &is_promising,
            may_continue,
        )?;
        if optimum.upper - optimum.lower > OPTIMALITY_GAP {
            return Ok(None);
        }
        Self::on_finest(world, optimum, settings, may_continue)
    }

    /// Computes the policy of the best agent that uses only a plan's actions and acts after
    /// happenings.
    fn within(
        search: Search,
        settings: &Settings,
        may_continue: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, NotTabulated> {
        let Some((world, fit, within)) = search.into_best() else {
            return Ok(None);
        };
        let Some(exact) = fit.exact_step() else {
            return Ok(None);
        };
        let chances = CellProbabilities::new(&world, fit.step(), fit.cells, Side::Below)?;
        let optimum = TimedOptimum {
            lower: within.lower,
            within: Some(within),
            ..TimedOptimum::unknown()
        };
        let acts = (fit.cells, DecisionEpochs::AfterHappenings);
        Ok(Self::of(world, chances, optimum, exact, acts).with_values(settings, may_continue))
    }

    fn on_finest(
        world: TimedWorld,
        optimum: TimedOptimum,
        settings: &Settings,
        may_continue: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, NotTabulated> {
        let finest = optimum.grids.len().checked_sub(1);
        let Some(cells) = finest.map(|halvings| settings.first_cells.max(1) << halvings) else {
            return Ok(None);
        };
        #[allow(clippy::cast_precision_loss, reason = "at most 65,535")]
        let step = world.horizon / cells as f64;
        let chances = CellProbabilities::new(&world, step, cells, Side::Below)?;
        let exact = exact_step(&world, cells);
        Ok(Self::of(
            world,
            chances,
            optimum,
            exact,
            (cells, DecisionEpochs::Always),
        )
        .with_values(settings, may_continue))
    }

    /// Creates the policy without the values of states.
    fn of(
        world: TimedWorld,
        chances: CellProbabilities,
        optimum: TimedOptimum,
        step: Rational,
        (cells, epochs): (usize, DecisionEpochs),
    ) -> Self {
        #[allow(clippy::cast_precision_loss, reason = "at most 65,535")]
        let count = cells as f64;
        Self {
            step,
            values: BTreeMap::new(),
            epochs,
            discounts: Discounts {
                cell: 1.0 - EARLINESS_TOLERANCE / count,
                step: 1.0 - EARLINESS_TOLERANCE / count,
            },
            optimum,
            world,
            chances,
        }
    }

    fn with_values(mut self, settings: &Settings, may_continue: &dyn Fn() -> bool) -> Option<Self> {
        let mut left = settings.most_states;
        let bound = LowerBound::new(&self.world, &self.chances, self.epochs);
        let (layers, values) =
            backward_induction(&bound, &mut left, self.discounts, may_continue).ok()?;
        let tables = layers.into_iter().zip(values.0.into_values());
        let tables =
            tables.map(|((cell, states), values)| (cell, states.into_iter().zip(values).collect()));
        self.values = tables.collect();
        Some(self)
    }

    /// Returns the bounds on the best value, and the grids that were examined.
    pub fn optimum(&self) -> &TimedOptimum {
        &self.optimum
    }

    /// Returns the moves in a state at the beginning of a cell, with their values.
    fn values(&self, cell: usize, state: &State) -> Vec<(Move, f64)> {
        let world = &self.world;
        let mut reachability = ReachabilityCache::new();
        if state.is_goal(world) || !state.can_reach_goal(world, &mut reachability) {
            return Vec::new();
        }
        let bound = LowerBound::new(world, &self.chances, self.epochs);
        let mut later = Layers::new();
        let only = IndexSet::from([state.clone()]);
        let nodes = bound.expand(cell, &only, &mut later, &mut reachability, &Limits::NONE);
        let nodes = nodes.unwrap_or_default();
        let after = later.into_iter().map(|(cell, states)| {
            let values = states.iter().map(|state| self.value(cell, state));
            (cell, values.collect())
        });
        let after = Values(after.collect());
        let here = solve_cell(&nodes, &after, self.discounts);
        let worths = nodes.choice_values(0, &here, &after, self.discounts);
        bound.moves(state).into_iter().zip(worths).collect()
    }

    /// Returns the value of a state at the beginning of a cell; 0 if the table does not contain it.
    fn value(&self, cell: u32, state: &State) -> f64 {
        let table = self.values.get(&cell);
        table
            .and_then(|table| table.get(state))
            .copied()
            .unwrap_or(0.0)
    }

    /// Converts the situation of an executor to a state with the past events `happened`.
    fn state(
        &self,
        standing: &DecisionState<'_>,
        (facts, numbers): (Facts, &[Span]),
        happened: u32,
    ) -> State {
        let act_of = |name: &str| self.world.acts.iter().position(|act| act.name == name);
        let mut running: Vec<Running> = Vec::new();
        for (name, since) in &standing.running {
            let Some(act) = act_of(name) else {
                continue;
            };
            running.push(Running {
                act: u8::try_from(act).unwrap_or(u8::MAX),
                since: u16::try_from(*since).unwrap_or(u16::MAX),
                phase: Phase::Open,
            });
        }
        running.sort_unstable();
        let state = State {
            facts: self.world.tested(facts, numbers),
            numbers: numbers.to_vec(),
            is_undecided: false,
            happened,
            running,
            may_act: true,
        };
        match standing.started.and_then(act_of) {
            Some(act) => state.started(&self.world, act, (act, standing.period, Phase::Open)),
            None => state,
        }
    }

    /// Returns the possible intervals of the numbers; `None` if a number has no value.
    fn spans(&self, standing: &DecisionState<'_>) -> Option<Vec<Vec<Span>>> {
        let numbers = self.world.numbers.iter();
        let values = numbers.map(|number| standing.belief.value(number.fluent).cloned());
        let values: Vec<Rational> = values.collect::<Option<_>>()?;
        self.world.spans_of(&values)
    }

    /// Returns the events that are certainly over, or that observed changes show to be over.
    fn happened(&self, standing: &DecisionState<'_>) -> u32 {
        let now =
            (&self.step * &Rational::from(i64::try_from(standing.period).unwrap_or(0))).to_f64();
        let resolution = self.world.model.resolution.to_f64();
        let share = |event: &super::process::action_model::Event| {
            let share = event.is_over_by(now, Part::AtMost, resolution);
            share.unwrap_or(0.0)
        };
        let mut happened = 0_u32;
        for (index, event) in self.world.events.iter().enumerate() {
            if share(event) >= 1.0 - 1e-12 {
                happened |= 1 << index;
            }
        }
        for (fact, truth) in standing.changed {
            let Ok(place) = self.world.facts.binary_search(fact) else {
                continue;
            };
            let bit: Facts = 1 << place;
            let events = self.world.events.iter().enumerate();
            let mut fitting = events.filter(|(index, event)| {
                let changed = if *truth { event.adds } else { event.deletes };
                happened & (1 << index) == 0 && changed & bit != 0 && !event.is_recurrent()
            });
            if let Some((index, _)) = fitting.next() {
                happened |= 1 << index;
            }
        }
        happened
    }

    /// Moves the starts of overdue actions to later times, just late enough that they can still be
    /// running. Returns `true` if there are overdue actions.
    fn postpone_overdue_starts(&self, cell: usize, state: &mut State) -> bool {
        let mut is_overdue = false;
        for running in &mut state.running {
            let ends = &self.chances.ends[usize::from(running.act)];
            let is_alive = |since: u16| {
                let age = cell.saturating_sub(usize::from(since));
                let mut later = ends.iter().skip(age);
                later.any(|ends| ends.total() > 0.0)
            };
            let here = u16::try_from(cell).unwrap_or(u16::MAX);
            running.since = running.since.min(here);
            while running.since < here && !is_alive(running.since) {
                running.since += 1;
                is_overdue = true;
            }
        }
        state.running.sort_unstable();
        is_overdue
    }
}

impl ActionValues for Policy {
    fn period(&self) -> &Rational {
        &self.step
    }

    fn evaluate(&self, standing: &DecisionState<'_>) -> Option<RankedMoves> {
        let cell = standing.period;
        if cell >= self.chances.cells {
            return None;
        }
        // The table knows nothing about actions outside the plan.
        let knows = |name: &str| self.world.acts.iter().any(|act| act.name == name);
        if self.epochs != DecisionEpochs::Always && !standing.started.is_none_or(knows) {
            return None;
        }
        let facts = self.world.facts.iter().enumerate();
        let facts = facts.fold(0, |all: Facts, (place, fact)| {
            all | (Facts::from(standing.belief.fact(*fact)) << place)
        });
        let happened = self.happened(standing);
        // An event without an effect on the present facts may have happened unobserved.
        let events = self.world.events.iter().enumerate();
        let silent = events.fold(0_u32, |all, (index, event)| {
            let changes_nothing = event.adds & !facts == 0 && event.deletes & facts == 0;
            let is_so = changes_nothing && !event.is_recurrent();
            all | (u32::from(is_so) << index)
        });
        let spans = self.spans(standing)?;
        let mut overdue = None;
        let ways = [happened, happened | silent].into_iter();
        let ways = ways.flat_map(|happened| spans.iter().map(move |spans| (happened, spans)));
        for (happened, spans) in ways {
            let mut state = self.state(standing, (facts, spans), happened);
            if state.is_goal(&self.world) {
                return Some(RankedMoves {
                    moves: vec![(Choice::Wait, 1.0)],
                    is_action_overdue: false,
                });
            }
            let is_overdue = self.postpone_overdue_starts(cell, &mut state);
            let mut values = self.values(cell, &state);
            // A stable sort: moves of equal value keep the order of the problem's actions.
            values.sort_by(|(_, a), (_, b)| b.total_cmp(a));
            if values.first().is_some_and(|(_, value)| *value > 0.0) {
                let choice = |(choice, value)| (self.choice(&state, choice), value);
                return Some(RankedMoves {
                    moves: values.into_iter().map(choice).collect(),
                    is_action_overdue: is_overdue,
                });
            }
            // The state may only lack the end of the overdue action.
            if is_overdue {
                overdue = Some(RankedMoves {
                    moves: Vec::new(),
                    is_action_overdue: is_overdue,
                });
            }
        }
        overdue
    }
}

impl Policy {
    fn choice(&self, state: &State, choice: Move) -> Choice {
        match choice {
            Move::Start(act) => {
                let act = &self.world.acts[act];
                let planned = act.rest.as_ref().map(|_| act.planned.clone());
                Choice::Start(act.action.clone(), planned)
            }
            Move::Cancel(place) => {
                let act = usize::from(state.running[place].act);
                Choice::Cancel(self.world.acts[act].name.clone())
            }
            Move::Wait => Choice::Wait,
        }
    }
}
