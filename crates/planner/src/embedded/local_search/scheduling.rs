//! Exact search for a better order of the same actions, which proves when there is none
//! (constraint-based scheduling; Baptiste, Le Pape & Nuijten, 2001).
//!
//! - `model`: the dependencies between the plan's happenings, as clauses over orders of pairs.
//! - `numbers`: the same for conditions on numbers, as far as they are known before the search.
//! - `clauses` and `times`: the search, by learning clauses from conflicts with the bound on the
//!   makespan. It begins with the order of the plan (solution-guided search; Beck, JAIR 29, 2007).
//!
//! An order that it finds becomes a plan in the same way as others: through the states of the
//! search and the validator.

mod clauses;
mod links;
mod model;
mod numbers;
mod rescheduling;
#[cfg(test)]
mod tests;
mod times;
mod windows;

use std::collections::BTreeSet;

use super::super::compile::Compiled;
use super::super::time::Ticks;
use super::WorkMeter;
use super::sequence::{Item, Kind};
use clauses::Outcome;
use model::Model;
use times::Edge;

/// Work between two checks whether to continue.
const SLICE: u64 = 20_000;
/// Weight of a work unit: visiting a clause or a pair takes longer than visiting an operator.
const UNIT_WORK: u64 = 4;
/// Number of restarts after which a smaller improvement is requested.
const RESTARTS: u64 = 12;
/// If more clauses than this were learnt from orders in which a condition on numbers fails, the
/// obstacles to a better order are mostly learnt one order at a time, which is slow.
const FEW_FAILURES: usize = 100;
/// Binary exponent of the smallest relative improvement that is requested at first.
const MAX_IMPROVEMENT_EXPONENT: u32 = 8;

/// Search for better orders of a plan's actions.
pub(super) struct Scheduling<'a> {
    model: Model<'a>,
    /// The pairs of happenings that interfere: the literal which states that they keep their order,
    /// and both edges.
    pairs: Vec<(u32, [Edge; 2])>,
    /// Start position of the search for an undecided pair.
    cursor: usize,
    /// Lower bound on the end of every order, and the end of the best known one.
    least: Ticks,
    end: Ticks,
    /// Binary exponent of the requested improvement, as a part of the gap between `least` and
    /// `end`.
    improvement_exponent: u32,
    /// Number of clauses learnt from orders in which a condition on numbers fails.
    failures: usize,
    /// `true` if no better order exists.
    pub(super) is_over: bool,
}

impl<'a> Scheduling<'a> {
    /// Returns a search for orders of these items that end before `end`, or `None` if the model
    /// cannot express the plan.
    pub(super) fn of(
        compiled: &'a Compiled,
        items: &[Item],
        end: Ticks,
        ticker: &mut WorkMeter<'_>,
    ) -> Option<Self> {
        let model = Model::of(compiled, items, ticker)?;
        let mut scheduling = Self {
            model,
            pairs: Vec::new(),
            cursor: 0,
            least: 0,
            end,
            improvement_exponent: 1,
            failures: 0,
            is_over: false,
        };
        scheduling.least = scheduling.model.solver.times.earliest_end();
        scheduling.demand(items, end);
        Some(scheduling)
    }

    /// Returns `true` if the items are the same actions.
    pub(super) fn is_of(&self, items: &[Item]) -> bool {
        let what = |items: &[Item]| {
            let sorted = sorted(items).into_iter();
            sorted.map(|item| (item.0, item.1)).collect::<Vec<_>>()
        };
        what(&self.model.items) == what(items)
    }

    /// Requires that orders end before this one, which ends at `end`.
    pub(super) fn demand(&mut self, items: &[Item], end: Ticks) {
        self.end = self.end.min(end);
        let model = &mut self.model;
        model.solver.limit_end(self.end - 1);
        let mut rank = vec![0; items.len()];
        for (own, place) in sorted(&model.items).into_iter().zip(sorted(items)) {
            rank[own.2] = place.2;
        }
        for (&(first, second), &literal) in &model.pairs {
            let is_kept = rank[first as usize] < rank[second as usize];
            model.solver.prefer(literal ^ u32::from(!is_kept));
        }
        self.set_target();
    }

    /// Sets the target for the next order, a large or a small improvement.
    fn set_target(&mut self) {
        let gap = self.end - self.least;
        if gap <= 0 {
            self.is_over = true;
            return;
        }
        let step = if self.improvement_exponent > MAX_IMPROVEMENT_EXPONENT {
            1
        } else {
            gap >> self.improvement_exponent
        };
        self.model.solver.aim(self.end - step.max(1));
    }

    /// Continues for at most `most` work. Returns a better order if one is found.
    pub(super) fn next(&mut self, most: u64, ticker: &mut WorkMeter<'_>) -> Option<Vec<Item>> {
        let last = ticker.work.saturating_add(most);
        while ticker.work < last && ticker.poll() {
            let before = self.model.solver.spent();
            let restarts = if self.improvement_exponent > MAX_IMPROVEMENT_EXPONENT {
                u64::MAX
            } else {
                RESTARTS
            };
            let outcome = self.model.solver.run(SLICE, restarts);
            let mut order = None;
            match outcome {
                Outcome::WorkDone => {}
                Outcome::TooHard => {
                    self.improvement_exponent += 1;
                    self.set_target();
                }
                Outcome::TooEarly => {
                    self.least = self
                        .model
                        .solver
                        .target()
                        .map_or(self.end, |latest| latest + 1);
                    self.set_target();
                }
                Outcome::Contradiction => self.is_over = true,
                Outcome::Consistent => order = self.conclude(),
            }
            ticker.work += UNIT_WORK * (1 + self.model.solver.spent() - before);
            if self.is_over || order.is_some() {
                let items = &self.model.items;
                return order.map(|order| order.iter().map(|&node| items[node]).collect());
            }
        }
        None
    }

    /// Decides an undecided pair whose distance the other constraints do not ensure. If there is
    /// none, returns the order, or learns from its failure.
    fn conclude(&mut self) -> Option<Vec<usize>> {
        if let Some(literal) = self.too_close() {
            self.model.solver.decide(literal);
            return None;
        }
        let order = match self.sequence() {
            Ok(order) => order,
            Err(circle) => {
                self.model.solver.add(&circle);
                return None;
            }
        };
        let mut rank = vec![0; order.len()];
        for (place, &node) in order.iter().enumerate() {
            rank[node] = place;
        }
        let broken = self.model.violated_clauses(&rank);
        if broken.is_empty() {
            return Some(order);
        }
        self.failures += broken.len();
        for clause in broken {
            self.model.solver.add(&clause);
        }
        None
    }

    /// Returns `true` if the search is likely to take long, because it learns from one order after
    /// the other.
    fn is_slow(&self) -> bool {
        self.failures > FEW_FAILURES
    }

    /// Returns the literal of two unordered happenings that are too close to each other. The
    /// literal states the order that they have in time.
    fn too_close(&mut self) -> Option<u32> {
        let Self { model, pairs, .. } = self;
        let solver = &mut model.solver;
        if pairs.len() < model.pairs.len() {
            let (edges, known) = (&solver.edges, pairs.len());
            pairs.extend(model.pairs.values().skip(known).filter_map(|&literal| {
                let edge = |literal: u32| edges[literal as usize];
                Some((literal, [edge(literal)?, edge(literal ^ 1)?]))
            }));
        }
        solver.work += 1 + pairs.len() as u64 / 8;
        for step in 0..pairs.len() {
            let place = (self.cursor + step) % pairs.len();
            let (literal, edges) = pairs[place];
            let keeps = |edge: Edge| {
                let times = &solver.times;
                times.earliest(edge.from) + edge.distance <= times.earliest(edge.to)
            };
            if !solver.is_open(literal) || keeps(edges[0]) || keeps(edges[1]) {
                continue;
            }
            self.cursor = place;
            let first = solver.times.earliest(edges[0].from);
            let second = solver.times.earliest(edges[0].to);
            return Some(literal + u32::from(second < first));
        }
        None
    }

    /// Returns the happenings in the order of time and of the decisions, or a clause that breaks a
    /// cycle of happenings of one time.
    fn sequence(&self) -> Result<Vec<usize>, Vec<u32>> {
        let model = &self.model;
        let solver = &model.solver;
        let count = model.items.len();
        let mut before: Vec<Vec<(usize, Option<u32>)>> = vec![Vec::new(); count];
        for (literal, edge) in solver.all_edges() {
            // Windows are not orders of happenings.
            let is_pair = (edge.from.max(edge.to) as usize) < count;
            if is_pair && solver.is_true(literal) {
                before[edge.to as usize].push((edge.from as usize, Some(literal)));
            }
        }
        for block in &model.blocks {
            for pair in block.nodes.windows(2) {
                before[pair[1] as usize].push((pair[0] as usize, None));
            }
        }
        for &(from, to) in &model.kept {
            before[to as usize].push((from as usize, None));
        }
        let mut after = vec![Vec::new(); count];
        let mut missing: Vec<usize> = before.iter().map(Vec::len).collect();
        for (node, before) in before.iter().enumerate() {
            for &(earlier, _) in before {
                after[earlier].push(node);
            }
        }
        let key = |node: usize| {
            let number = u32::try_from(node).unwrap_or(u32::MAX);
            (solver.times.earliest(number), node)
        };
        let is_ready = |node: &usize| missing[*node] == 0;
        let mut ready: BTreeSet<_> = (0..count).filter(is_ready).map(key).collect();
        let mut order = Vec::with_capacity(count);
        while let Some((_, node)) = ready.pop_first() {
            order.push(node);
            for &later in &after[node] {
                missing[later] -= 1;
                if missing[later] == 0 {
                    ready.insert(key(later));
                }
            }
        }
        if order.len() == count {
            return Ok(order);
        }
        Err(cycle_clause(&before, &missing))
    }
}

/// Returns the items as (action, is end, position), sorted so that instances of the same action are
/// adjacent.
fn sorted(items: &[Item]) -> Vec<(u32, bool, usize)> {
    let items = items.iter().enumerate();
    let mut sorted: Vec<_> = items
        .map(|(place, item)| (item.action, item.kind == Kind::End, place))
        .collect();
    sorted.sort_unstable();
    sorted
}

/// Returns a clause that breaks a cycle among the nodes with missing predecessors.
fn cycle_clause(before: &[Vec<(usize, Option<u32>)>], missing: &[usize]) -> Vec<u32> {
    let is_left = |node: usize| missing[node] > 0;
    let Some(mut node) = (0..missing.len()).find(|&node| is_left(node)) else {
        return Vec::new();
    };
    let mut path: Vec<(usize, Option<u32>)> = Vec::new();
    let mut place = vec![usize::MAX; missing.len()];
    while place[node] == usize::MAX {
        place[node] = path.len();
        let Some(&(earlier, literal)) = before[node].iter().find(|(other, _)| is_left(*other))
        else {
            return Vec::new();
        };
        path.push((earlier, literal));
        node = earlier;
    }
    let literals = path[place[node]..].iter().filter_map(|step| step.1);
    literals.map(|literal| literal ^ 1).collect()
}
