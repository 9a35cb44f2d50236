//! The lower bound: the agent decides at the boundaries of cells, and the happenings between them
//! have the worst order.

use indexmap::IndexSet;

use super::cell_probabilities::CellProbabilities;
use super::graph::{Choice, Expansion, Layers, Limits, MAX_WAYS, Nodes, Target};
use super::process::action_model::Ending;
use super::process::world::TimedWorld;
use super::settings::{Side, Stop};
use super::state::{Phase, ReachabilityCache, State};

/// Maximum number of happenings in one cell; beyond it, the state counts as lost.
const MAX_ORDERED: usize = 5;

/// Restrictions on the times and the moves of the agent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DecisionEpochs {
    /// Any move at every boundary.
    Always,
    /// Moves only after a happening, and at time 0. At these times, the agent must start all useful
    /// actions.
    AfterHappenings,
    /// The same for worlds where everything happens at [known times](super::discrete_events),
    /// without cancelling. The bits of this number are the actions that must be started.
    AtKnownTimes(u64),
}

pub(super) struct LowerBound<'a> {
    world: &'a TimedWorld,
    chances: &'a CellProbabilities,
    epochs: DecisionEpochs,
}

/// A happening within a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Happening {
    /// The end of an action, successful or not.
    End(u8, Ending),
    /// An event.
    Event(usize),
    /// Several occurrences of an event, with other happenings between them.
    Repeated,
}

/// A move of the agent at a boundary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Move {
    /// Starts this action.
    Start(usize),
    /// Cancels the running action at this position.
    Cancel(usize),
    /// Waits until the next boundary.
    Wait,
}

/// Returns the relevant moves in a state that does not satisfy the goal and is not hopeless.
fn moves(world: &TimedWorld, state: &State) -> Vec<Move> {
    if !state.may_act {
        return vec![Move::Wait];
    }
    let under_way = state.running_actions();
    let startable = state.startable(world, |act| under_way & (1 << act) == 0);
    if state.must_start(world, &startable) {
        return vec![Move::Start(startable[0])];
    }
    let running = state.running.iter().enumerate();
    let cancelled = running.filter_map(|(place, running)| {
        let act = &world.acts[usize::from(running.act)];
        // An action with a delayed failure may have failed already, and can then not be cancelled.
        (act.may_be_cancelled && !act.can_delay_its_failure()).then_some(Move::Cancel(place))
    });
    let started = startable.into_iter().map(Move::Start);
    cancelled.chain(started).chain([Move::Wait]).collect()
}

/// Restricts the moves of an agent that acts only after a happening. The agent starts only actions
/// that abort no running action and are not aborted at once. While it can start such an action, it
/// neither waits nor cancels. Actions outside `must` may be started, but need not be.
fn require_useful_starts(world: &TimedWorld, state: &State, must: u64, moves: &mut Vec<Move>) {
    let breaks_nothing = |choice: &Move| match choice {
        Move::Start(act) => {
            let under_way = usize::from(world.acts[*act].rest.is_some());
            let after = state.started(world, *act, (*act, 0, Phase::Open));
            after.running.len() == state.running.len() + under_way
        }
        Move::Cancel(_) | Move::Wait => false,
    };
    // The effects of an action may be true already.
    let is_wanted = |act: usize| {
        let end = world.acts[act].rest.as_ref();
        must & (1 << act) != 0 && end.is_none_or(|(_, end)| end.adds & !state.facts != 0)
    };
    let is_undone = |choice: &Move| {
        matches!(choice, Move::Start(act) if is_wanted(*act)) && breaks_nothing(choice)
    };
    if moves.iter().any(is_undone) {
        moves.retain(breaks_nothing);
    } else {
        moves.retain(|choice| !matches!(choice, Move::Start(_)) || breaks_nothing(choice));
    }
}

/// A cell during its expansion.
struct Cell<'c> {
    bound: &'c LowerBound<'c>,
    /// The number of the cell.
    number: usize,
    /// The decision states, those at the boundary first.
    moments: IndexSet<State>,
    later: &'c mut Layers,
    reachability: &'c mut ReachabilityCache,
}

impl<'a> LowerBound<'a> {
    /// Creates the bound. Each restriction (`epochs`) is a policy, so its value is a lower bound.
    pub(super) fn new(
        world: &'a TimedWorld,
        chances: &'a CellProbabilities,
        epochs: DecisionEpochs,
    ) -> Self {
        Self {
            world,
            chances,
            epochs,
        }
    }

    /// Returns the moves of [`moves`] that the restriction allows.
    pub(super) fn moves(&self, state: &State) -> Vec<Move> {
        let mut moves = moves(self.world, state);
        let must = match self.epochs {
            DecisionEpochs::Always => return moves,
            DecisionEpochs::AfterHappenings => u64::MAX,
            DecisionEpochs::AtKnownTimes(must) => {
                moves.retain(|choice| !matches!(choice, Move::Cancel(_)));
                must
            }
        };
        require_useful_starts(self.world, state, must, &mut moves);
        moves
    }

    /// Returns the possible combinations of happenings in a cell, with their probabilities.
    ///
    /// # Errors
    /// When there are too many combinations.
    fn happenings(&self, cell: usize, state: &State) -> Result<Vec<(f64, Vec<Happening>)>, Stop> {
        let mut all = vec![(1.0, Vec::new())];
        let mut split = |ways: &[(f64, Option<Happening>)]| {
            if all.len() > MAX_WAYS {
                return;
            }
            let mut longer = Vec::new();
            for (weight, happenings) in &all {
                for (p, way) in ways.iter().filter(|(p, _)| *p > 0.0) {
                    let mut happenings: Vec<Happening> = happenings.clone();
                    happenings.extend(*way);
                    longer.push((weight * p, happenings));
                }
            }
            all = longer;
        };
        for running in &state.running {
            let age = cell - usize::from(running.since);
            let ends = &self.chances.ends[usize::from(running.act)][age];
            let act = &self.world.acts[usize::from(running.act)];
            let ways = ends.outcomes(act).map(|(p, ending)| {
                let end = ending.map(|ending| Happening::End(running.act, ending));
                (p, end)
            });
            split(&ways.collect::<Vec<_>>());
        }
        for (event, hazards) in self.chances.events.iter().enumerate() {
            if state.happened & (1 << event) == 0 {
                let p = hazards[cell];
                // In a monotone world, the worst case of a repeated event is a deletion both before
                // and after all other happenings, or a single addition.
                let often = if self.world.is_monotone {
                    0.0
                } else {
                    p * self.chances.repeated[event][cell]
                };
                split(&[
                    (p - often, Some(Happening::Event(event))),
                    (often, Some(Happening::Repeated)),
                    (1.0 - p, None),
                ]);
            }
        }
        if all.len() > MAX_WAYS {
            return Err(Stop::TooManyStates);
        }
        Ok(all)
    }

    /// Returns the possible states after these happenings in any order; `None` if there are too
    /// many orders.
    fn outcomes(&self, state: &State, happenings: &[Happening]) -> Option<Vec<State>> {
        let world = self.world;
        if happenings.contains(&Happening::Repeated) {
            return None;
        }
        if !world.is_monotone {
            return (happenings.len() <= MAX_ORDERED).then(|| {
                let mut outcomes = IndexSet::new();
                self.in_all_orders(state.clone(), happenings, &mut outcomes);
                outcomes.into_iter().collect()
            });
        }
        // In a monotone world, the worst case is a deletion both before and after all other
        // happenings.
        let is_harm = |happening: &Happening| match happening {
            Happening::Event(event) => world.events[*event].is_harmful(),
            Happening::End(..) | Happening::Repeated => false,
        };
        let (harm, rest): (Vec<_>, Vec<_>) = happenings.iter().copied().partition(is_harm);
        if rest.len() > MAX_ORDERED {
            return None;
        }
        let harmed = |state: State| {
            harm.iter()
                .fold(state, |state, event| self.after(&state, *event))
        };
        let mut outcomes = IndexSet::new();
        self.in_all_orders(harmed(state.clone()), &rest, &mut outcomes);
        let outcomes: IndexSet<State> = outcomes.into_iter().map(harmed).collect();
        Some(outcomes.into_iter().collect())
    }

    fn in_all_orders(
        &self,
        state: State,
        happenings: &[Happening],
        outcomes: &mut IndexSet<State>,
    ) {
        if happenings.is_empty() {
            outcomes.insert(state);
            return;
        }
        for place in 0..happenings.len() {
            let mut others = happenings.to_vec();
            let first = others.remove(place);
            self.in_all_orders(self.after(&state, first), &others, outcomes);
        }
    }

    /// Applies a happening. The end of an action that is no longer running has no effect.
    fn after(&self, state: &State, happening: Happening) -> State {
        match happening {
            Happening::Event(event) => state.changed(self.world, event),
            // Such a cell counts as lost anyway.
            Happening::Repeated => state.clone(),
            Happening::End(act, ending) => {
                match state.running.iter().position(|running| running.act == act) {
                    Some(place) => state.ended(self.world, place, ending),
                    None => state.clone(),
                }
            }
        }
    }
}

impl Expansion for LowerBound<'_> {
    fn cells(&self) -> usize {
        self.chances.cells
    }

    fn initial(&self) -> Vec<(f64, State)> {
        let events = &self.world.events;
        // States after the events at time 0, whose order is unknown.
        let mut states = vec![(1.0, State::initial(self.world), Vec::<usize>::new())];
        for (event, p) in self.chances.initial.iter().enumerate() {
            if *p <= 0.0 {
                continue;
            }
            let clashes = |other: &usize| {
                let (own, other) = (&events[event], &events[*other]);
                let is_opposed = own.adds & other.deletes | own.deletes & other.adds != 0;
                is_opposed && (own.is_recurrent() || other.is_recurrent())
            };
            // Combinations whose order matters count as lost.
            let able = states
                .iter()
                .filter(|(_, _, with)| !with.iter().any(clashes));
            let happened = able.map(|(weight, state, with)| {
                let with = with.iter().copied().chain([event]).collect();
                (weight * p, state.changed(self.world, event), with)
            });
            let happened: Vec<_> = happened.collect();
            let not = states
                .into_iter()
                .map(|(weight, state, with)| (weight * (1.0 - p), state, with));
            states = not
                .chain(happened)
                .filter(|(weight, _, _)| *weight > 0.0)
                .collect();
        }
        let states = states.into_iter();
        states.map(|(weight, state, _)| (weight, state)).collect()
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
            moments: states.clone(),
            later,
            reachability,
        };
        let mut nodes = Nodes::of(cell);
        while let Some(state) = here.moments.get_index(nodes.len()).cloned() {
            limits.check(&nodes)?;
            nodes.push(here.choices(&state)?);
        }
        Ok(nodes)
    }

    fn last(&self, state: &State) -> f64 {
        f64::from(u8::from(state.is_goal(self.world)))
    }
}

impl Cell<'_> {
    fn target(&mut self, state: State) -> Target {
        let world = self.bound.world;
        if state.is_goal(world) {
            return Target::Goal;
        }
        if !state.can_reach_goal(world, self.reachability) {
            return Target::DeadEnd;
        }
        Target::here(self.moments.insert_full(state).0)
    }

    fn choices(&mut self, state: &State) -> Result<Vec<Choice>, Stop> {
        let world = self.bound.world;
        if state.is_goal(world) {
            return Ok(vec![vec![(1.0, vec![Target::Goal])]]);
        }
        if !state.can_reach_goal(world, self.reachability) {
            return Ok(Vec::new());
        }
        let moves = self.bound.moves(state).into_iter();
        moves.map(|choice| self.choice(state, choice)).collect()
    }

    /// Returns the possible results of a move.
    fn choice(&mut self, state: &State, choice: Move) -> Result<Choice, Stop> {
        let world = self.bound.world;
        let after = match choice {
            Move::Cancel(place) => {
                let mut after = state.clone();
                after.running.remove(place);
                after
            }
            Move::Start(act) => state.started(world, act, (act, self.number, Phase::Open)),
            Move::Wait => return self.wait(state),
        };
        Ok(vec![(1.0, vec![self.target(after)])])
    }

    /// Returns the possible results of waiting until the next boundary, or until the next
    /// happening.
    fn wait(&mut self, state: &State) -> Result<Choice, Stop> {
        let world = self.bound.world;
        let chances = self.bound.chances;
        let is_always = self.bound.epochs == DecisionEpochs::Always;
        let cell = if is_always {
            self.number
        } else {
            match chances.next(state, self.number) {
                Some(cell) => cell,
                None => return Ok(vec![(1.0, vec![Target::DeadEnd])]),
            }
        };
        let mut choice = Choice::new();
        for (p, happenings) in self.bound.happenings(cell, state)? {
            let outcomes = self.bound.outcomes(state, &happenings).unwrap_or_default();
            let may_act = is_always || !happenings.is_empty();
            let targets = outcomes.into_iter().map(|mut outcome| {
                outcome.may_act = may_act;
                if outcome.is_goal(world) {
                    return Target::Goal;
                }
                let is_hopeful = outcome.can_reach_goal(world, self.reachability)
                    && (!matches!(self.bound.epochs, DecisionEpochs::AtKnownTimes(_))
                        || chances.can_reach_goal_in_time(world, &outcome, cell + 1, Side::Below));
                if is_hopeful {
                    Target::later(self.later, cell + 1, outcome)
                } else {
                    Target::DeadEnd
                }
            });
            choice.push((p, targets.collect()));
        }
        Ok(choice)
    }
}
