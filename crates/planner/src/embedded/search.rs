//! Greedy best-first search with deferred evaluation: a successor waits in the queue under its
//! parent's estimate and is made only when its turn comes (Helmert 2006; Richter & Helmert 2009).
//!
//! Two queues take turns, one with all successors and one with the preferred ones only; whenever
//! a better estimate is found, the preferred ones get a long turn.
//!
//! A search for plans of a better metric weighs what a state has spent against what the relaxed
//! plan will still cost, and drops what cannot become better than the best plan (branch and bound).

mod dead_ends;
mod difference;
mod goals;
mod known;
mod landmarks;
mod node;
mod novelty;
mod queue;
mod runaway;
mod states;
mod strategy;
mod successors;
mod waiting;

use super::answer::Counts;
use super::apply::{Step, Stepper};
use super::bound::MetricBound;
use super::compile::Compiled;
use super::mutex_pairs::MutexPairs;
use super::relaxed::{Consumable, Relaxed, consumables};
use super::root::root;
use super::state::State;
use super::step_costs::StepCosts;
use super::symmetry::Symmetry;
use super::time::{NEVER, Ticks};
use super::tuning::Technique;
use dead_ends::DeadEnds;
pub(crate) use goals::is_goal;
use goals::misses_goal;
use known::Hashes;
use landmarks::SearchLandmarks;
use node::{DeadEnd, NONE, Node, Notes, SharedNotes};
use novelty::Novelty;
use queue::Queue;
use states::States;
use strategy::NoveltyOf;
pub(crate) use strategy::{Aim, Strategy};
use waiting::{Waiting, WaitingList};

/// A search in progress.
#[derive(Debug)]
pub(crate) struct Search<'a> {
    compiled: &'a Compiled,
    symmetry: &'a Symmetry,
    strategy: Strategy,
    stepper: Stepper<'a>,
    relaxed: Relaxed<'a>,
    dead_ends: DeadEnds<'a>,
    has_begun: bool,
    nodes: Vec<Node>,
    shared: SharedNotes,
    /// The states of the nodes.
    states: States,
    /// The nodes by the discrete hash of their states.
    known: Hashes,
    /// Buffer for known states, for comparison with a new one.
    compared: State,
    all: Queue,
    preferred: Queue,
    /// All successors, first come first served, in a search that has to come by everywhere.
    oldest: WaitingList,
    turns: [i64; 2],
    /// The best estimate, and the number of landmarks left where they count.
    best: (u32, u32),
    /// The estimate of the first state.
    first_estimate: u32,
    /// The propositions seen before, if novelty decides.
    novelty: Option<Novelty>,
    /// Mutex pairs, in an incomplete search.
    mutex_pairs: Option<&'a MutexPairs>,
    /// What is known of the landmarks, if they count.
    landmarks: SearchLandmarks,
    /// The consumable fluents, if they are to be spared.
    consumables: Vec<Consumable>,
    /// Whether times are irrelevant but for their distances.
    is_timeless: bool,
    /// The costs of steps, in a search for a better metric.
    step_costs: Option<StepCosts>,
    /// The bound that plans must stay below.
    limit: Option<MetricBound>,
    /// Nothing may happen later, whatever it costs.
    horizon: Ticks,
    /// Whether something was dropped that could have led to a plan.
    pub(crate) has_lost: bool,
    /// How much the last turn counts for.
    price: u64,
    /// What all turns took, in turns of states without an unsettled past.
    labour: u64,
    /// Number of successors that were made to compute their novelty.
    weighed: u64,
    /// What the turns since the last better estimate count for.
    idle: u64,
    /// The number of successors that had their turn.
    drawn: u64,
    pub(crate) expanded: u64,
    pub(crate) generated: u64,
    pub(crate) evaluated: u64,
    /// The states that were made again, in vain: see [`waste`](Search::waste).
    wasted: u64,
    pub(crate) memory: usize,
}

const ROOT: u32 = u32::MAX;

/// Number of lookups for a successor that is made to compute its novelty: some microseconds.
const SUCCESSOR_LOOKUPS: u64 = 1_500;

/// The result of one expansion step of the search.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Turn {
    /// The choices that lead to a state in which the goal holds.
    Goal(Vec<Step>),
    Nothing,
    /// There is nothing left to look at.
    Over,
}

impl<'a> Search<'a> {
    /// Creates a search. A complete one ignores the mutex pairs.
    pub(crate) fn new(
        compiled: &'a Compiled,
        (symmetry, mutex_pairs): (&'a Symmetry, Option<&'a MutexPairs>),
        strategy: Strategy,
    ) -> Self {
        let mutex_pairs = mutex_pairs.filter(|_| !strategy.is_complete());
        let is_weighing = strategy.aim != Aim::Goal;
        let metric = compiled.metric.as_ref().filter(|_| is_weighing);
        let step_costs = metric.map(|metric| StepCosts::of(compiled, metric));
        let mut relaxed = strategy.relaxed(compiled);
        if let Some(mutex_pairs) = mutex_pairs {
            relaxed.leave_out(&mutex_pairs.is_spurious);
        }
        let mut stepper = Stepper::new(compiled);
        stepper.is_chronological = strategy.is_chronological;
        stepper.joins = strategy.joins;
        if let Some(step_costs) = &step_costs {
            relaxed.weigh(step_costs);
        }
        let is_timeless = compiled.timed.is_empty()
            && compiled.calendars.is_empty()
            && metric.is_none_or(MetricBound::is_timeless)
            && compiled
                .beginning
                .running
                .iter()
                .all(|running| running.most.is_none());
        Self {
            compiled,
            symmetry,
            strategy,
            stepper,
            dead_ends: DeadEnds::new(compiled, relaxed.size()),
            relaxed,
            has_begun: false,
            nodes: Vec::new(),
            shared: SharedNotes::default(),
            states: States::default(),
            known: Hashes::default(),
            compared: State::default(),
            all: Queue::default(),
            preferred: Queue::default(),
            oldest: WaitingList::default(),
            turns: [0, 0],
            best: (u32::MAX, u32::MAX),
            first_estimate: 0,
            novelty: strategy.novelty.map(|_| Novelty::new(compiled)),
            mutex_pairs,
            landmarks: SearchLandmarks::Unknown,
            consumables: if strategy.saves_consumables {
                consumables(compiled)
            } else {
                Vec::new()
            },
            is_timeless,
            step_costs,
            limit: None,
            horizon: NEVER,
            has_lost: strategy.is_chronological
                || strategy.replaces_starts(compiled)
                || mutex_pairs.is_some(),
            price: 1,
            labour: 0,
            weighed: 0,
            idle: 0,
            drawn: 0,
            expanded: 0,
            generated: 0,
            evaluated: 0,
            wasted: 0,
            memory: 0,
        }
    }

    /// From now on only plans count that end by then.
    pub(crate) fn set_horizon(&mut self, horizon: Ticks) {
        self.horizon = horizon;
        self.is_timeless = false;
    }

    /// From now on only plans count that are within the limit.
    pub(crate) fn set_limit(&mut self, limit: MetricBound) {
        if self.compiled.is_symbolic {
            self.stepper.limit = Some(limit.clone());
        }
        self.limit = Some(limit);
    }

    /// Whether the search claims more than it can: it has dropped or rounded something.
    pub(crate) fn is_incomplete(&self) -> bool {
        self.has_lost || self.stepper.has_rounded
    }

    /// Whether it loses plans for the sake of speed.
    pub(crate) fn prunes_unsafely(&self) -> bool {
        !self.strategy.is_complete()
    }

    /// Returns `true` if the search joins happenings of one moment.
    pub(crate) fn joins(&self) -> bool {
        self.strategy.joins
    }

    /// The aim of the search.
    pub(crate) fn aim(&self) -> Aim {
        self.strategy.aim
    }

    /// Statistics.
    pub(crate) fn counts(&self) -> Counts {
        Counts {
            actions: 0,
            expanded: self.expanded,
            generated: self.generated,
            evaluated: self.evaluated + self.wasted,
            work: 0,
            memory: self.memory,
        }
    }

    /// Counts a candidate that came to nothing: so many choices were taken again. Any number of such
    /// candidates may follow each other, each of them longer than the last one.
    pub(crate) fn waste(&mut self, choices: usize) {
        self.wasted += choices as u64;
    }

    /// How much there is to an estimate: the number of operators.
    pub(crate) fn size(&self) -> u64 {
        self.relaxed.size()
    }

    /// The same, with all that the operators change: what an estimate may take at most.
    pub(crate) fn weight(&self) -> u64 {
        self.relaxed.weight()
    }

    /// How many turns the last one counts for: more where much is unsettled.
    pub(crate) fn price(&self) -> u64 {
        self.price
    }

    /// What all turns took so far, those included in which no state was made.
    pub(crate) fn labour(&self) -> u64 {
        self.labour
    }

    /// Whether it compresses: its states take less time than those of others where actions are many.
    pub(crate) fn compresses(&self) -> bool {
        self.strategy.compresses.is_some()
    }

    /// Whether a better estimate was found lately: see
    /// [`Tuning::patience`](super::tuning::Tuning::patience). A search that only looks for what is
    /// new has no estimates.
    pub(crate) fn has_come_nearer(&self) -> bool {
        self.strategy.novelty != Some(NoveltyOf::Successors)
            && self.idle < self.compiled.tuning.patience
    }

    /// Work except turns and estimates, in lookups of the stronger bound. Words of known facts, and successors that
    /// are made to compute their novelty, count for some lookups.
    pub(crate) fn lookups(&self) -> u64 {
        let words = self.novelty.as_ref().map_or(0, Novelty::words);
        self.dead_ends.lookups() + words + SUCCESSOR_LOOKUPS * self.weighed
    }

    /// Looks at one more state.
    pub(crate) fn turn(&mut self) -> Turn {
        self.price = 1;
        self.labour += 1;
        if !self.has_begun {
            let initial = root(self.compiled);
            if let Some(turn) = self.find_landmarks(&initial) {
                return turn;
            }
            self.has_begun = true;
            if initial.earliest_end() > self.horizon {
                return Turn::Over;
            }
            return self.visit(ROOT, Step::Timed, initial);
        }
        let entry = self.next_entry();
        let Some((parent, step)) = entry else {
            return Turn::Over;
        };
        let before = self.states.get(parent);
        let latest_end = self.latest_end(&before);
        if !self.looks_no_later_than(latest_end) || self.is_cut(parent, &before) {
            return Turn::Nothing;
        }
        let unsettled = before.network.node_count() as u64;
        self.labour += unsettled * unsettled / (1 + self.size());
        let Some((step, state)) = self.make(&before, step) else {
            return Turn::Nothing;
        };
        self.visit(parent, step, state)
    }

    /// Whose turn it is.
    fn next_entry(&mut self) -> Option<(u32, Step)> {
        self.drawn += 1;
        if self
            .drawn
            .is_multiple_of(self.compiled.tuning.exploration_interval)
            && !self.all.is_empty()
            && let Some(oldest) = self.pop_oldest()
        {
            return Some(oldest);
        }
        let is_preferred_turn = self.turns[0] <= self.turns[1]
            && !self.preferred.is_empty()
            && self.compiled.tuning.uses(Technique::PreferredOperators);
        let queue = usize::from(!is_preferred_turn);
        self.turns[queue] += 1;
        if queue == 1
            && let Some(next) = self.pop_any()
        {
            return Some(next);
        }
        let (_, waiting) = if queue == 0 && self.is_on_plateau() {
            self.preferred.pop_alternately()
        } else {
            self.preferred.pop()
        }?;
        Some((waiting.parent, waiting.next()?))
    }

    /// Whether no better estimate was found for a while, in a search where only that decides.
    fn is_on_plateau(&self) -> bool {
        let tuning = &self.compiled.tuning;
        self.strategy.alternates()
            && tuning.uses(Technique::Alternation)
            && self.idle >= tuning.alternation_after
    }

    fn visit(&mut self, parent: u32, step: Step, state: State) -> Turn {
        let unsettled = state.network.node_count() as u64;
        self.price += unsettled * unsettled / (8 * (1 + self.size()));
        self.idle += self.price;
        if self.strategy.is_chronological && unsettled > self.compiled.tuning.most_unsettled {
            return Turn::Nothing;
        }
        let latest_end = self.latest_end(&state);
        let is_in_time = latest_end.is_some_and(|latest| state.earliest_end() <= latest);
        if !is_in_time || !self.looks_no_later_than(latest_end) {
            return Turn::Nothing;
        }
        let hash = state.discrete_hash();
        let projection = (self.strategy.compresses.is_none() && !state.network.is_empty())
            .then(|| Box::new(state.projection()));
        if self.is_known(hash, &state, projection.as_deref()) {
            return Turn::Nothing;
        }
        if self
            .mutex_pairs
            .is_some_and(|known| known.is_dead_end(&state))
        {
            return Turn::Nothing;
        }
        self.evaluated += 1;
        let (accepted, left) = self.left(parent, &state);
        let estimate = if self.needs_estimate(parent, left) {
            self.relaxed.evaluate(&state)
        } else {
            self.relaxed.list(&state)
        };
        let Some(mut estimate) = estimate else {
            // Where actions are compressed, what the relaxed plan does without may be what a plan
            // needs.
            self.has_lost |= self.strategy.compresses.is_some();
            return Turn::Nothing;
        };
        let steps = (&mut estimate.applicable, &mut estimate.preferred);
        self.symmetry.thin_out(&state, self.is_timeless, steps);
        let is_goal = is_goal(self.compiled, &state);
        let due = self.compiled.timed_until_goal.saturating_sub(state.timed);
        if state.symbolic.is_some() && !is_goal {
            // The estimate takes tests that depend on times for granted. Where only ends are to come, no times
            // may meet them.
            let ends = u32::try_from(state.open.len()).unwrap_or(u32::MAX);
            let least = due.saturating_add(ends);
            if estimate.steps <= least && (ends == 0 || misses_goal(self.compiled, &state)) {
                estimate.steps = self.first_estimate.saturating_add(least).saturating_add(1);
            }
        }
        let drift = self.drift(parent, &state, estimate.steps);
        let may_be_better = is_goal && self.may_be_better(&state);
        let notes = Notes { projection, drift };
        let number = self.add(Waiting::step(parent, step), (accepted, left), state, notes);
        self.known.push(hash);
        // A state in which the goal holds may still have successors worth looking at: the judge can
        // refuse the plan, and another one can be better.
        self.expand(number, &estimate);
        if may_be_better {
            return Turn::Goal(self.steps_to(number));
        }
        Turn::Nothing
    }

    /// Adds a node, and returns its number. `left`: the accepted landmarks, and the number of those left.
    fn add(&mut self, origin: Waiting, left: (Vec<u64>, u32), state: State, notes: Notes) -> u32 {
        let number = u32::try_from(self.nodes.len()).expect("memory is used up long before");
        let (accepted, left) = left;
        let (accepted, memory) = if accepted.is_empty() {
            (NONE, 0)
        } else {
            let size = size_of_val(&accepted[..]);
            self.shared.accepted.number(accepted.into(), size)
        };
        let notes = notes.has_any(self.compiled).then(|| Box::new(notes));
        self.memory += size_of::<Node>() + Hashes::MEMORY_OF_STATE + memory;
        self.memory += notes.as_ref().map_or(0, |notes| notes.size());
        let parent = Some(origin.parent).filter(|&parent| parent != ROOT);
        self.memory += self.states.push(parent, state);
        self.nodes.push(Node {
            origin,
            left,
            accepted,
            progress: NONE,
            dead_end: DeadEnd::Unchecked,
            notes,
        });
        number
    }

    /// Whether the stronger bound shows that no plan begins like this. It is asked when the first
    /// successor of a state has its turn.
    fn is_cut(&mut self, number: u32, state: &State) -> bool {
        let node = &mut self.nodes[number as usize];
        match node.dead_end {
            DeadEnd::Unproved => return false,
            DeadEnd::Proved => return true,
            DeadEnd::Unchecked => {}
        }
        if self.is_timeless
            || self.strategy.joins
            || !self.compiled.tuning.uses(Technique::DeadEnds)
            || self.evaluated < self.compiled.tuning.dead_end_checks_after
        {
            return false;
        }
        self.dead_ends.evaluated = self.evaluated;
        self.dead_ends.horizon = self.stepper.horizon;
        let is_dead_end = self.dead_ends.is_dead_end(state);
        node.dead_end = if is_dead_end {
            DeadEnd::Proved
        } else {
            DeadEnd::Unproved
        };
        is_dead_end
    }

    /// The latest time at which a plan may end that begins like this; `None` if there is none.
    fn latest_end(&self, state: &State) -> Option<Ticks> {
        let (Some(limit), Some(metric)) = (&self.limit, &self.compiled.metric) else {
            return Some(self.horizon);
        };
        let latest = limit.latest_end(metric, self.compiled.scale, state)?;
        Some(latest.min(self.horizon))
    }

    /// Sets the horizon for what follows a state. Whether anything can follow it.
    fn looks_no_later_than(&mut self, latest_end: Option<Ticks>) -> bool {
        let Some(horizon) = latest_end else {
            return false;
        };
        self.stepper.horizon = horizon;
        self.relaxed.horizon = horizon;
        true
    }
}
