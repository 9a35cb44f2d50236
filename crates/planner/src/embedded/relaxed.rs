//! Heuristic: the number of steps of a plan if reached facts are never lost.
//!
//! Facts, their negations, numeric tests and the like are *propositions*. The cost of a proposition
//! is the sum over the preconditions of its cheapest achiever (`h_add`, Bonet & Geffner 2001). A
//! relaxed plan consists of the cheapest achievers (Keyder & Geffner 2008, "`FF(h_a)`"), and its
//! first steps are the preferred ones (Hoffmann & Nebel 2001). A numeric test that additive changes
//! can reach costs as many repetitions as its gap requires (Scala et al. 2016); other numeric
//! effects are assumed to reach any value at once. So a state without relaxed plan has no plan.

mod changes;
mod consumables;
mod cost_propagation;
mod deadlines;
mod graph;
mod labels;
mod numbers;
mod plan;
mod resources;
mod subgoal;
#[cfg(test)]
mod tests;

use std::ops::Range;

use elbowroom_num::Rational;

use super::apply::Step;
use super::compile::{Compiled, Compressibility};
use super::end_windows::EndWindows;
use super::formula::Literal;
use super::network::SETTLED;
use super::root::root;
use super::state::{OpenAction, State};
use super::step_costs::StepCosts;
use super::symbolic;
use super::time::{NEVER, Ticks};
use consumables::Consumables;
pub(crate) use consumables::{Consumable, consumables};
use deadlines::Deadlines;
pub(crate) use deadlines::in_windows;
pub(crate) use graph::Graph;
use graph::Operator;
pub(crate) use labels::Labels;
pub(crate) use plan::OVERDRAWN;
use resources::Resources;
pub(crate) use resources::reservoirs;
pub(crate) use subgoal::Subgoal;

/// Upper limit of costs.
const MOST: u32 = 1 << 15;

/// Cost of an unreached proposition.
const UNREACHED: u32 = u32::MAX;

/// Achiever of a proposition that is true in the state.
const NO_OPERATOR: u32 = u32::MAX;

/// The result of one heuristic evaluation.
#[derive(Clone, Debug, Default)]
pub(crate) struct Estimate {
    /// Number of steps of the relaxed plan, or their cost in a weighted search.
    pub(crate) steps: u32,
    /// The steps whose conditions hold in the state. They may still be impossible in time.
    pub(crate) applicable: Vec<Step>,
    /// Those among them that are in the relaxed plan.
    pub(crate) preferred: Vec<Step>,
    /// The literals that the relaxed plan achieves, if they were requested.
    pub(crate) subgoals: Vec<Literal>,
    /// The actions that start in the relaxed plan, if they were requested.
    pub(crate) actions: Vec<u32>,
}

/// An unreachable part of the goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Missing {
    Literal(Literal),
    /// A test or a choice.
    Other,
}

/// Evaluator of states. Reuses its tables from one state to the next.
#[derive(Debug)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "each is an independent setting"
)]
pub(crate) struct Relaxed<'a> {
    compiled: &'a Compiled,
    graph: Graph,
    cost: Vec<u32>,
    achiever: Vec<u32>,
    /// Number of times the achiever must be repeated.
    repetitions: Vec<u32>,
    /// Number of preconditions that an operator waits for.
    missing: Vec<u32>,
    operator_cost: Vec<u32>,
    /// Cost of each operator.
    own_cost: Vec<u32>,
    /// Cost of each operator in estimates for a subgoal.
    subgoal_cost: Vec<u32>,
    /// The effects of each operator.
    reaches: Vec<Reaches>,
    is_used: Vec<bool>,
    is_wanted: Vec<bool>,
    gaps: Vec<f64>,
    buckets: Vec<Vec<u32>>,
    /// The largest cost that propagation has reached.
    propagated_cost: usize,
    applicable: Vec<u32>,
    deadlines: Deadlines,
    resources: Resources,
    consumables: Consumables,
    /// Latest time of a happening.
    pub(crate) horizon: Ticks,
    /// `true` if later choices happen no earlier.
    pub(crate) is_chronological: bool,
    /// `true` if estimates list the literals that their relaxed plans achieve.
    pub(crate) lists_subgoals: bool,
    /// `true` if estimates list the actions of their relaxed plans.
    pub(crate) lists_actions: bool,
    /// `true` for repairs: an estimate stops when the whole goal is reached, so that not all
    /// applicable steps are listed.
    pub(crate) serves_repairs: bool,
}

impl<'a> Relaxed<'a> {
    /// Creates an evaluator. Actions that are at least as safe to compress as `compresses` count as
    /// one step.
    pub(crate) fn new(compiled: &'a Compiled, compresses: Option<Compressibility>) -> Self {
        Self::from_graph(compiled, Graph::of(compiled, compresses, &[]))
    }

    /// As [`new`](Self::new), with macro-operators in place of the starts of their envelopes.
    /// Returns `None` if the goal is then unreachable.
    pub(crate) fn with_macros(
        compiled: &'a Compiled,
        compresses: Option<Compressibility>,
    ) -> Option<Self> {
        let graph = Graph::of(compiled, compresses, &compiled.macros);
        let mut relaxed = Self::from_graph(compiled, graph);
        relaxed.evaluate(&root(compiled))?;
        Some(relaxed)
    }

    fn from_graph(compiled: &'a Compiled, graph: Graph) -> Self {
        let (propositions, operators) = (graph.proposition_count, graph.operators.len());
        Self {
            compiled,
            resources: Resources::default(),
            consumables: Consumables::default(),
            cost: vec![UNREACHED; propositions],
            achiever: vec![NO_OPERATOR; propositions],
            repetitions: vec![1; propositions],
            missing: Vec::with_capacity(operators),
            operator_cost: vec![0; operators],
            own_cost: own_costs(&graph),
            subgoal_cost: Vec::new(),
            reaches: graph.operators.iter().map(Reaches::of).collect(),
            is_used: vec![false; operators],
            is_wanted: vec![false; propositions],
            gaps: vec![0.0; compiled.tests.len()],
            buckets: Vec::new(),
            propagated_cost: 0,
            applicable: Vec::new(),
            deadlines: Deadlines::default(),
            horizon: NEVER,
            is_chronological: false,
            lists_subgoals: false,
            lists_actions: false,
            serves_repairs: false,
            graph,
        }
    }

    /// Weights each step by its cost instead of one.
    pub(crate) fn set_step_costs(&mut self, step_costs: &StepCosts) {
        self.graph.set_step_costs(step_costs);
        self.own_cost = own_costs(&self.graph);
    }

    /// Sets the costs of the starts and ends of these actions.
    pub(crate) fn set_costs(&mut self, costs: impl Iterator<Item = (u32, u32)>) {
        for (action, cost) in costs {
            let (start, end) = self.graph.operators_of(action);
            for operator in [start, end] {
                if let Some(own) = self.own_cost.get_mut(operator as usize) {
                    *own = cost;
                }
            }
        }
    }

    /// Returns the own cost of an action, start and end.
    pub(crate) fn cost_of(&self, action: u32) -> u32 {
        let (start, end) = self.graph.operators_of(action);
        let cost = |operator: u32| {
            let operator = self.graph.operators.get(operator as usize);
            operator.map_or(0, |operator| operator.cost)
        };
        cost(start).max(cost(end))
    }

    /// Excludes the starts of these actions, by action number.
    pub(crate) fn exclude_starts(&mut self, is_left_out: &[bool]) {
        self.graph.exclude_starts(self.compiled, is_left_out);
    }

    /// Enables the accounting of resources: relaxed plans replenish the resources that they use up.
    pub(crate) fn count_resources(&mut self) {
        self.resources = Resources::of(self.compiled, &self.graph);
    }

    /// Enables the accounting of consumables: relaxed plans use resources that are never
    /// replenished.
    pub(crate) fn count_consumables(&mut self) {
        self.consumables = Consumables::of(self.compiled, &self.graph);
    }

    /// Returns the number of operators.
    pub(crate) fn size(&self) -> u64 {
        self.graph.operators.len() as u64
    }

    /// Returns the number of operators and of their effects.
    pub(crate) fn weight(&self) -> u64 {
        let graph = &self.graph;
        (graph.operators.len() + graph.effects.len() + graph.gains.len()) as u64
    }

    /// Returns `true` if exactly one instance of the action is running, and no fact that its end
    /// adds is true or can become true before it.
    pub(crate) fn is_end_unavoidable(&mut self, state: &State, action: u32) -> bool {
        let instances = state.open.iter().filter(|open| open.action == action);
        if instances.count() != 1 {
            return false;
        }
        self.prepare(state, None);
        let end = self.compiled.snap(self.compiled.action(action).end);
        let is_true = |cost: &[u32]| end.adds.iter().any(|&f| cost[2 * f as usize] != UNREACHED);
        if is_true(&self.cost) {
            self.buckets.iter_mut().for_each(Vec::clear);
            return false;
        }
        self.missing[self.graph.end_of[action as usize] as usize] += 1;
        self.propagate_costs(state, self.serves_repairs, None);
        self.buckets.iter_mut().for_each(Vec::clear);
        !is_true(&self.cost)
    }

    /// Returns the unreachable parts of the goal, and the unreachable ends of running actions.
    /// Valid after an evaluation that returned `None`.
    pub(crate) fn missing_goals(&self) -> Vec<Missing> {
        let goals = self.graph.goal.iter();
        let goals = goals.filter(|&&goal| self.cost[goal as usize] == UNREACHED);
        let facts = 2 * self.compiled.facts.len();
        goals
            .map(|&goal| {
                if (goal as usize) < facts {
                    Missing::Literal(Literal(goal))
                } else {
                    Missing::Other
                }
            })
            .collect()
    }

    /// Returns a literal of the goal that changes at fixed times only and is false at the end, and
    /// the time at which it last becomes false.
    pub(crate) fn expired_goal(&self) -> Option<(Literal, Ticks)> {
        let mut goals = self.compiled.goal.literals.iter();
        goals.find_map(|&literal| {
            let (_, end) = self.graph.spans_of(literal)?.last()?;
            (*end < NEVER).then_some((literal, *end))
        })
    }

    /// Returns the number of timetables: literals that change at fixed times only.
    pub(crate) fn timetable_count(&self) -> usize {
        self.graph.timetable.len()
    }

    /// Assumes that the literal of a timetable is always true. Returns the literal and the time at
    /// which it last becomes false.
    pub(crate) fn ignore_timetable(&mut self, number: usize) -> Option<(Literal, Ticks)> {
        let spans = self.graph.forget_timetable(number);
        let end = last_end(&spans)?;
        Some((self.graph.timetable_literal(number)?, end))
    }

    /// Returns the estimate, or `None` if even the relaxed goal is unreachable.
    pub(crate) fn evaluate(&mut self, state: &State) -> Option<Estimate> {
        let estimate = self.evaluate_goals(state, None);
        self.buckets.iter_mut().for_each(Vec::clear);
        estimate
    }

    fn evaluate_goals(&mut self, state: &State, subgoal: Option<&Subgoal>) -> Option<Estimate> {
        if !self.prepare(state, subgoal) {
            return None;
        }
        // Without separate ends, costs above those of the goal do not change the relaxed plan.
        // Consumables need the costs of other operators.
        let asks_for_others =
            self.graph.has_single_starts && subgoal.is_none() || !self.consumables.is_empty();
        let stops_early = self.serves_repairs || !asks_for_others;
        self.propagate_costs(state, stops_early, subgoal);
        let mut estimate = Estimate::default();
        for open in &state.open {
            let end = self.graph.end_of[open.action as usize];
            if self.missing[end as usize] > 0 {
                return None;
            }
        }
        let wanted = self.wanted_goals(subgoal)?;
        self.extract(state, wanted, &mut estimate);
        if state.timed < self.compiled.timed_until_goal && subgoal.is_none() {
            self.await_timed(state, &mut estimate);
        }
        self.list_applicable(state, &mut estimate);
        Some(estimate)
    }

    /// Returns the applicable steps without an estimate, or `None` if the running actions cannot
    /// end in time, according to incomplete checks.
    pub(crate) fn list(&mut self, state: &State) -> Option<Estimate> {
        let is_in_time = self.prepare(state, None);
        if is_in_time {
            self.propagate_zero_costs(state);
        }
        self.buckets.iter_mut().for_each(Vec::clear);
        let mut estimate = Estimate::default();
        self.list_applicable(state, &mut estimate);
        is_in_time.then_some(estimate)
    }

    /// Initializes the costs of the propositions that hold in the state. Returns `false` if some
    /// running action cannot end in time, according to incomplete checks.
    fn prepare(&mut self, state: &State, subgoal: Option<&Subgoal>) -> bool {
        let mut is_in_time = true;
        let spans = self
            .is_chronological
            .then(|| EndWindows::of(self.compiled, state));
        self.cost.fill(UNREACHED);
        self.missing.clone_from(&self.graph.precondition_counts);
        self.operator_cost.clone_from(&self.own_cost);
        self.applicable.clear();
        for open in &state.open {
            for &operator in &self.graph.excluded_operators[open.action as usize] {
                self.missing[operator as usize] += 1;
            }
        }
        let outlasts = |open: &OpenAction| {
            open.most < NEVER && (open.node == SETTLED || self.is_chronological)
        };
        if let Some(subgoal) = subgoal {
            for &operator in &subgoal.late_operators {
                self.missing[operator as usize] += 1;
            }
        } else if self.horizon < NEVER
            || !self.graph.windows.is_empty()
            || state.open.iter().any(outlasts)
        {
            is_in_time = self.deadlines.exclude_late_operators(
                self.compiled,
                &self.graph,
                state,
                self.horizon,
                spans.as_ref(),
                &mut self.missing,
            );
        }
        let graph = &self.graph;
        let reach = |proposition: u32, cost: &mut Vec<u32>, buckets: &mut Vec<Vec<u32>>| {
            if cost[proposition as usize] != 0 {
                cost[proposition as usize] = 0;
                if graph.dependents(proposition).is_empty() {
                    return;
                }
                if buckets.is_empty() {
                    buckets.push(Vec::new());
                }
                buckets[0].push(proposition);
            }
        };
        let (cost, buckets) = (&mut self.cost, &mut self.buckets);
        for fact in 0..self.compiled.facts.len() {
            let truth = state.facts[fact / 64] >> (fact % 64) & 1;
            let proposition = 2 * fact + usize::from(truth == 0);
            #[allow(clippy::cast_possible_truncation, reason = "facts are numbered by u32")]
            reach(proposition as u32, cost, buckets);
        }
        let levels = highest_levels(self.compiled, state);
        for (number, gap) in self.gaps.iter_mut().enumerate() {
            #[allow(clippy::cast_possible_truncation, reason = "tests are numbered by u32")]
            let test = number as u32;
            let missing = if self.graph.is_free_test[number] {
                None
            } else if depends_on_times(self.compiled, test, state) {
                numbers::gap_of_levels(self.compiled, test, &levels)
            } else if state.test_holds(self.compiled, test, None) {
                None
            } else {
                Some(numbers::gap(self.compiled, test, state))
            };
            match missing {
                None => reach(self.graph.test(test), cost, buckets),
                Some(missing) => *gap = missing,
            }
        }
        for stay in &graph.stays {
            if stay.holds(state, spans.as_ref()) {
                reach(stay.proposition, cost, buckets);
            }
        }
        for open in &state.open {
            reach(self.graph.running(open.action), cost, buckets);
        }
        is_in_time
    }
}

/// The effects of an operator, by their positions in the graph, with the data needed when it is
/// reached.
#[derive(Clone, Copy, Debug)]
struct Reaches {
    effects: [u32; 2],
    gains: [u32; 2],
}

impl Reaches {
    fn of(operator: &Operator) -> Self {
        let places = |range: &Range<usize>| [range.start, range.end].map(graph::narrow);
        Self {
            effects: places(&operator.effects),
            gains: places(&operator.gains),
        }
    }

    fn range([start, end]: [u32; 2]) -> Range<usize> {
        start as usize..end as usize
    }
}

fn own_costs(graph: &Graph) -> Vec<u32> {
    graph
        .operators
        .iter()
        .map(|operator| operator.cost)
        .collect()
}

/// Returns the time at which the literal of a timetable last becomes false.
pub(crate) fn last_end(spans: &[(Ticks, Ticks)]) -> Option<Ticks> {
    let ends = spans.iter().map(|span| span.1);
    ends.filter(|&end| end < NEVER).max()
}

/// Returns the highest levels of exclusive fluents whose values depend on times. No other action
/// reads them before the ends of the running ones.
fn highest_levels(compiled: &Compiled, state: &State) -> Vec<(u32, Rational)> {
    let courses = state
        .symbolic
        .iter()
        .flat_map(|symbolic| &symbolic.functions);
    let exclusive = courses.filter(|(fluent, _)| compiled.exclusive_fluents[*fluent as usize]);
    let levels = exclusive.filter_map(|(fluent, _)| {
        let level = symbolic::highest_level(compiled, state, *fluent)?;
        Some((*fluent, level))
    });
    levels.collect()
}

/// Returns `true` if the test depends on times. It is then assumed to hold.
fn depends_on_times(compiled: &Compiled, test: u32, state: &State) -> bool {
    let Some(symbolic) = &state.symbolic else {
        return false;
    };
    let mut depends = false;
    let difference = &compiled.tests[test as usize].difference;
    difference.visit_fluents(&mut |fluent| depends |= symbolic.is_time_dependent(fluent));
    depends
}
