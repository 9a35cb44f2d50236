//! Greedy best-first search with deferred evaluation: a successor is queued with its parent's
//! estimate and is generated only when it is removed from the queue (Helmert 2006; Richter &
//! Helmert 2009).
//!
//! Two queues alternate, one with all successors and one with the preferred ones only. After each
//! better estimate, the preferred ones get a long turn.
//!
//! A search for plans with a better metric weighs the cost so far against the remaining cost of the
//! relaxed plan, and prunes states that cannot become better than the best plan (branch and bound).

mod closed_list;
mod dead_ends;
mod difference;
mod goals;
mod landmarks;
mod node;
mod novelty;
mod open_list;
mod runaway;
mod serialization;
mod states;
mod strategy;
mod successor_list;
mod successors;

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
use closed_list::Hashes;
use dead_ends::DeadEnds;
pub(crate) use goals::is_goal;
use goals::misses_goal;
use landmarks::SearchLandmarks;
use node::{DeadEnd, NONE, Node, Notes, SharedNotes};
use novelty::Novelty;
use open_list::OpenList;
use states::States;
use strategy::NoveltyOf;
pub(crate) use strategy::{Aim, Strategy};
use successor_list::{QueuedSuccessor, SuccessorList};

/// A search in progress.
#[derive(Debug)]
pub(crate) struct Search<'a> {
    compiled: &'a Compiled,
    symmetry: &'a Symmetry,
    strategy: Strategy,
    stepper: Stepper<'a>,
    relaxed: Relaxed<'a>,
    dead_ends: DeadEnds<'a>,
    is_started: bool,
    nodes: Vec<Node>,
    shared: SharedNotes,
    /// The states of the nodes.
    states: States,
    /// The nodes by the discrete hash of their states.
    closed_list: Hashes,
    /// Buffer for known states, for the comparison with a new one.
    comparison_buffer: State,
    all: OpenList,
    preferred: OpenList,
    /// All successors in order of insertion, for a search that must not starve any of them.
    oldest: SuccessorList,
    turns: [i64; 2],
    /// The best estimate, and the number of remaining landmarks where they count.
    best: (u32, u32),
    /// The estimate of the first state.
    first_estimate: u32,
    /// The propositions seen before, if novelty is used.
    novelty: Option<Novelty>,
    /// Mutex pairs, in an incomplete search.
    mutex_pairs: Option<&'a MutexPairs>,
    /// The landmarks, if they count.
    landmarks: SearchLandmarks,
    /// The consumable fluents, if they are to be saved.
    consumables: Vec<Consumable>,
    /// `true` if times matter only by their distances.
    is_timeless: bool,
    /// The costs of steps, in a search for a better metric.
    step_costs: Option<StepCosts>,
    /// The bound that plans must stay below.
    limit: Option<MetricBound>,
    /// Latest time of a happening, regardless of the metric.
    horizon: Ticks,
    /// `true` if a state or step was dropped that could have led to a plan.
    pub(crate) is_lossy: bool,
    /// Cost of the last turn, in turns.
    last_turn_cost: u64,
    /// Work of all turns, in turns of states without unsettled happenings.
    total_work: u64,
    /// Number of successors generated to compute their novelty.
    novelty_evaluations: u64,
    /// Cost of the turns since the last better estimate, in turns.
    idle: u64,
    /// Number of successors taken from the queues.
    dequeued: u64,
    pub(crate) expanded: u64,
    pub(crate) generated: u64,
    pub(crate) evaluated: u64,
    /// Number of states regenerated for rejected candidates: see
    /// [`count_rejected`](Search::count_rejected).
    rejected_work: u64,
    pub(crate) memory: usize,
}

const ROOT: u32 = u32::MAX;

/// Cost, in lookups, of a successor that is generated to compute its novelty: some microseconds.
const SUCCESSOR_LOOKUPS: u64 = 1_500;

/// The result of one expansion step of the search.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Expansion {
    /// The choices that lead to a goal state.
    Goal(Vec<Step>),
    Nothing,
    /// The search space is exhausted.
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
            relaxed.exclude_starts(&mutex_pairs.is_spurious);
        }
        let mut stepper = Stepper::new(compiled);
        stepper.is_chronological = strategy.is_chronological;
        stepper.joins = strategy.joins;
        if let Some(step_costs) = &step_costs {
            relaxed.set_step_costs(step_costs);
        }
        let is_timeless = compiled.timed.is_empty()
            && compiled.calendars.is_empty()
            && metric.is_none_or(MetricBound::is_timeless)
            && compiled
                .initial
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
            is_started: false,
            nodes: Vec::new(),
            shared: SharedNotes::default(),
            states: States::default(),
            closed_list: Hashes::default(),
            comparison_buffer: State::default(),
            all: OpenList::default(),
            preferred: OpenList::default(),
            oldest: SuccessorList::default(),
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
            is_lossy: strategy.is_chronological
                || strategy.replaces_starts(compiled)
                || mutex_pairs.is_some(),
            last_turn_cost: 1,
            total_work: 0,
            novelty_evaluations: 0,
            idle: 0,
            dequeued: 0,
            expanded: 0,
            generated: 0,
            evaluated: 0,
            rejected_work: 0,
            memory: 0,
        }
    }

    /// Restricts the search to plans that end by `horizon`.
    pub(crate) fn set_horizon(&mut self, horizon: Ticks) {
        self.horizon = horizon;
        self.is_timeless = false;
    }

    /// Restricts the search to plans within the limit.
    pub(crate) fn set_limit(&mut self, limit: MetricBound) {
        if self.compiled.is_symbolic {
            self.stepper.limit = Some(limit.clone());
        }
        self.limit = Some(limit);
    }

    /// Returns `true` if an exhausted search proves nothing, because it has dropped or rounded
    /// something.
    pub(crate) fn is_incomplete(&self) -> bool {
        self.is_lossy || self.stepper.has_rounded
    }

    /// Returns `true` if it drops states that may lead to plans, for speed.
    pub(crate) fn prunes_unsafely(&self) -> bool {
        !self.strategy.is_complete()
    }

    /// Returns `true` if the search joins happenings of one moment.
    pub(crate) fn joins(&self) -> bool {
        self.strategy.joins
    }

    /// Returns the aim of the search.
    pub(crate) fn aim(&self) -> Aim {
        self.strategy.aim
    }

    /// Returns the statistics.
    pub(crate) fn counts(&self) -> Counts {
        Counts {
            actions: 0,
            expanded: self.expanded,
            generated: self.generated,
            evaluated: self.evaluated + self.rejected_work,
            work: 0,
            memory: self.memory,
        }
    }

    /// Counts a rejected candidate, for which `choices` steps were replayed. Any number of such
    /// candidates may follow each other, each of them longer than the last one.
    pub(crate) fn count_rejected(&mut self, choices: usize) {
        self.rejected_work += choices as u64;
    }

    /// Returns the size of an estimate: the number of operators.
    pub(crate) fn size(&self) -> u64 {
        self.relaxed.size()
    }

    /// Returns the maximum work of an estimate: the number of operators and of their effects.
    pub(crate) fn weight(&self) -> u64 {
        self.relaxed.weight()
    }

    /// Returns the cost of the last turn, in turns: more if many happenings are unsettled.
    pub(crate) fn last_turn_cost(&self) -> u64 {
        self.last_turn_cost
    }

    /// Returns the work of all turns so far, including those that generated no state.
    pub(crate) fn total_work(&self) -> u64 {
        self.total_work
    }

    /// Returns `true` if it compresses actions. Its states then take less time than others if there
    /// are many actions.
    pub(crate) fn compresses(&self) -> bool {
        self.strategy.compresses.is_some()
    }

    /// Returns `true` if a better estimate was found recently: see
    /// [`Tuning::patience`](super::tuning::Tuning::patience). A search by the novelty of successors
    /// has no estimates.
    pub(crate) fn has_improved_recently(&self) -> bool {
        self.strategy.novelty != Some(NoveltyOf::Successors)
            && self.idle < self.compiled.tuning.patience
    }

    /// Returns the work except turns and estimates, in lookups of the stronger bound. Words of
    /// known facts, and successors generated to compute their novelty, count for some lookups.
    pub(crate) fn lookups(&self) -> u64 {
        let words = self.novelty.as_ref().map_or(0, Novelty::words);
        self.dead_ends.lookups() + words + SUCCESSOR_LOOKUPS * self.novelty_evaluations
    }

    /// Expands one more state.
    pub(crate) fn turn(&mut self) -> Expansion {
        self.last_turn_cost = 1;
        self.total_work += 1;
        if !self.is_started {
            let initial = root(self.compiled);
            if let Some(turn) = self.find_landmarks(&initial) {
                return turn;
            }
            self.is_started = true;
            if initial.earliest_end() > self.horizon {
                return Expansion::Over;
            }
            return self.visit(ROOT, Step::Timed, initial);
        }
        let entry = self.next_entry();
        let Some((parent, step)) = entry else {
            return Expansion::Over;
        };
        let before = self.states.get(parent);
        let latest_end = self.latest_end(&before);
        if !self.limit_end(latest_end) || self.is_pruned(parent, &before) {
            return Expansion::Nothing;
        }
        let unsettled = before.network.node_count() as u64;
        self.total_work += unsettled * unsettled / (1 + self.size());
        let Some((step, state)) = self.generate(&before, step) else {
            return Expansion::Nothing;
        };
        self.visit(parent, step, state)
    }

    /// Returns the next successor.
    fn next_entry(&mut self) -> Option<(u32, Step)> {
        self.dequeued += 1;
        if self
            .dequeued
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

    /// Returns `true` if no better estimate was found for some time, in a search that uses
    /// estimates only.
    fn is_on_plateau(&self) -> bool {
        let tuning = &self.compiled.tuning;
        self.strategy.alternates()
            && tuning.uses(Technique::Alternation)
            && self.idle >= tuning.alternation_after
    }

    fn visit(&mut self, parent: u32, step: Step, state: State) -> Expansion {
        let unsettled = state.network.node_count() as u64;
        self.last_turn_cost += unsettled * unsettled / (8 * (1 + self.size()));
        self.idle += self.last_turn_cost;
        if self.strategy.is_chronological && unsettled > self.compiled.tuning.most_unsettled {
            return Expansion::Nothing;
        }
        let latest_end = self.latest_end(&state);
        let is_in_time = latest_end.is_some_and(|latest| state.earliest_end() <= latest);
        if !is_in_time || !self.limit_end(latest_end) {
            return Expansion::Nothing;
        }
        let hash = state.discrete_hash();
        let projection = (self.strategy.compresses.is_none() && !state.network.is_empty())
            .then(|| Box::new(state.projection()));
        if self.is_known(hash, &state, projection.as_deref()) {
            return Expansion::Nothing;
        }
        if self
            .mutex_pairs
            .is_some_and(|known| known.is_dead_end(&state))
        {
            return Expansion::Nothing;
        }
        self.evaluated += 1;
        let (accepted, left) = self.remaining_landmarks(parent, &state);
        let Some((mut estimate, agenda, left)) = self.estimate(parent, &state, left) else {
            // Where actions are compressed, the relaxed plan may lack facts that hold only while an
            // action runs.
            self.is_lossy |= self.strategy.compresses.is_some();
            return Expansion::Nothing;
        };
        let steps = (&mut estimate.applicable, &mut estimate.preferred);
        self.symmetry.thin_out(&state, self.is_timeless, steps);
        let is_goal = is_goal(self.compiled, &state);
        let due = self.compiled.timed_until_goal.saturating_sub(state.timed);
        if state.symbolic.is_some() && !is_goal {
            // The estimate assumes that tests which depend on times hold. If only ends are left,
            // possibly no times satisfy them.
            let ends = u32::try_from(state.open.len()).unwrap_or(u32::MAX);
            let least = due.saturating_add(ends);
            if estimate.steps <= least && (ends == 0 || misses_goal(self.compiled, &state)) {
                estimate.steps = self.first_estimate.saturating_add(least).saturating_add(1);
            }
        }
        let drift = self.drift(parent, &state, estimate.steps);
        let may_be_better = is_goal && self.may_be_better(&state);
        let notes = Notes { projection, drift };
        let number = self.add(
            QueuedSuccessor::step(parent, step),
            (accepted, left),
            state,
            notes,
        );
        self.nodes[number as usize].agenda = agenda;
        self.closed_list.push(hash);
        // A goal state may still have useful successors: the validator can reject the plan, and
        // another plan can be better.
        self.expand(number, &estimate);
        if may_be_better {
            return Expansion::Goal(self.steps_to(number));
        }
        Expansion::Nothing
    }

    /// Adds a node, and returns its number. `left` are the accepted landmarks, and the number of
    /// remaining ones.
    fn add(
        &mut self,
        origin: QueuedSuccessor,
        left: (Vec<u64>, u32),
        state: State,
        notes: Notes,
    ) -> u32 {
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
            remaining: left,
            accepted,
            progress: NONE,
            agenda: NONE,
            dead_end: DeadEnd::Unchecked,
            notes,
        });
        number
    }

    /// Returns `true` if the stronger bound proves that no plan has this beginning. It is computed
    /// at the turn of the first successor of a state.
    fn is_pruned(&mut self, number: u32, state: &State) -> bool {
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

    /// Returns the latest time at which a plan with this beginning may end, or `None` if there is
    /// no such plan.
    fn latest_end(&self, state: &State) -> Option<Ticks> {
        let (Some(limit), Some(metric)) = (&self.limit, &self.compiled.metric) else {
            return Some(self.horizon);
        };
        let latest = limit.latest_end(metric, self.compiled.scale, state)?;
        Some(latest.min(self.horizon))
    }

    /// Sets the horizon for the successors of a state. Returns `false` if no plan can continue from
    /// it.
    fn limit_end(&mut self, latest_end: Option<Ticks>) -> bool {
        let Some(horizon) = latest_end else {
            return false;
        };
        self.stepper.horizon = horizon;
        self.relaxed.horizon = horizon;
        true
    }
}
