//! Conditions on numbers that the happenings of a plan change by constants: cumulative resources,
//! reservoirs, counters.
//!
//! Conflicts of two instances become clauses at once. Other clauses are learnt from schedules in
//! which a condition fails. Such a clause states that a consuming happening comes later, or its
//! action has already ended, or a producing happening comes earlier (precedence constraint posting;
//! Cesta, Oddi & Smith, Journal of Heuristics 8, 2002; Laborie, AIJ 143, 2003).

use std::cmp::Reverse;

use elbowroom_model::problem::{Comparison, UpdateOperator};
use elbowroom_num::{CommonDenominator, Rational};

use super::super::super::formula::{Linear, Numeric};
use super::super::super::hash::Map;
use super::super::WorkMeter;
use super::clauses::negated;
use super::model::{Model, Need, snap_of};

/// For each block that changes a sum: the happenings of the block that change it, in order, with
/// the amounts.
pub(super) type Sum = Vec<(u32, Vec<(u32, i64)>)>;

/// A sum that must not be negative (nor zero, if the test is strict) while it is needed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Demand {
    need: Need,
    base: i64,
    is_strict: bool,
    sum: usize,
}

impl Demand {
    fn fails(&self, value: i64) -> bool {
        value < i64::from(self.is_strict)
    }
}

/// A moment: just before or just after a happening.
#[derive(Clone, Copy, Debug)]
struct Point {
    node: u32,
    is_after: bool,
}

/// For each fluent, the happenings that change it, with the amounts.
type Changes = Map<u32, Vec<(u32, Rational)>>;

/// Returns the sums after each happening of a block, beginning with zero.
fn prefixes(deltas: &[(u32, i64)]) -> impl Iterator<Item = i64> + Clone + '_ {
    let sums = deltas.iter().scan(0, |sum, (_, delta)| {
        *sum += delta;
        Some(*sum)
    });
    std::iter::once(0).chain(sums)
}

fn most(deltas: &[(u32, i64)]) -> i64 {
    prefixes(deltas).max().unwrap_or(0)
}

impl Model<'_> {
    /// Records all conditions on numbers that the order of happenings can break.
    pub(super) fn demand_all(&mut self, ticker: &mut WorkMeter<'_>) -> Option<()> {
        let mut needs: Vec<(Need, u32)> = Vec::new();
        self.visit_needs(ticker, &mut |_, need, formula| {
            // At the end, the sum of all changes does not depend on the order.
            if !matches!(need, Need::Goal) {
                needs.extend(formula.tests.iter().map(|&test| (need, test)));
            }
            Some(())
        })?;
        let changes = self.changes(&needs)?;
        let mut known: Map<(u32, bool), usize> = Map::default();
        for (need, number) in needs {
            let test = &self.compiled.tests[number as usize];
            let mut is_changed = false;
            test.difference
                .visit_fluents(&mut |fluent| is_changed |= changes.contains_key(&fluent));
            if !is_changed {
                continue;
            }
            let base = |block: u32| {
                let duration = self.blocks[block as usize].duration.as_ref();
                test.difference.value(&self.root.values, duration)
            };
            let (Numeric::Linear(linear), Some(base)) = (&test.difference, base(self.block(need)))
            else {
                return None;
            };
            let (sides, is_strict): (&[bool], bool) = match test.comparison {
                Comparison::AtLeast => (&[false], false),
                Comparison::Greater => (&[false], true),
                Comparison::AtMost => (&[true], false),
                Comparison::Less => (&[true], true),
                Comparison::Equal => (&[false, true], false),
            };
            for &is_turned in sides {
                let key = (number, is_turned);
                self.demand(
                    (need, is_strict),
                    (linear, &base),
                    key,
                    &mut known,
                    &changes,
                )?;
            }
            ticker.work += 50;
            if !ticker.poll() {
                return None;
            }
        }
        let total: usize = self.sums.iter().map(Vec::len).sum();
        ticker.work += total as u64;
        for number in 0..self.demands.len() {
            ticker.work += self.add_instance_clauses(self.demands[number])?;
            if !ticker.poll() {
                return None;
            }
        }
        Some(())
    }

    /// Returns the block that has the need.
    fn block(&self, need: Need) -> u32 {
        match need {
            Need::At(node) | Need::Throughout(_, node) => self.block_of[node as usize],
            Need::Goal => 0,
        }
    }

    /// Returns the changes of the fluents that conditions read, or `None` if they are not constant.
    fn changes(&self, needs: &[(Need, u32)]) -> Option<Changes> {
        let compiled = self.compiled;
        let mut is_read = vec![false; compiled.fluents.len()];
        for (_, test) in needs {
            let test = &compiled.tests[*test as usize];
            test.difference
                .visit_fluents(&mut |fluent| is_read[fluent as usize] = true);
        }
        let snaps = || {
            let items = (0..).zip(&self.items);
            items.filter_map(|(node, item)| Some((node, compiled.snap(snap_of(compiled, *item)?))))
        };
        let mut is_written = vec![false; compiled.fluents.len()];
        for update in snaps().flat_map(|(_, snap)| &snap.updates) {
            is_written[update.fluent as usize] = true;
        }
        let assigned = compiled.timed.iter().flat_map(|timed| &timed.assigns);
        for (fluent, _) in assigned {
            if is_read[*fluent as usize] {
                return None;
            }
            is_written[*fluent as usize] = true;
        }
        let is_constant = |value: &Numeric| {
            let mut is_constant = true;
            value.visit_fluents(&mut |fluent| is_constant &= !is_written[fluent as usize]);
            is_constant
        };
        let actions = self
            .items
            .iter()
            .filter_map(|item| compiled.actions.get(item.action as usize));
        let mut bounds = actions.flat_map(|action| &action.duration.bounds);
        if !bounds.all(|bound| is_constant(&bound.value)) {
            return None;
        }
        let mut changes = Changes::default();
        for (node, snap) in snaps() {
            let block = &self.blocks[self.block_of[node as usize] as usize];
            for update in snap.updates.iter().filter(|u| is_read[u.fluent as usize]) {
                let value = update
                    .value
                    .value(&self.root.values, block.duration.as_ref())?;
                let value = match update.operator {
                    UpdateOperator::Increase => value,
                    UpdateOperator::Decrease => -value,
                    _ => return None,
                };
                if !is_constant(&update.value) {
                    return None;
                }
                changes
                    .entry(update.fluent)
                    .or_default()
                    .push((node, value));
            }
        }
        Some(changes)
    }

    /// Records a condition, unless it holds in every order.
    fn demand(
        &mut self,
        (need, is_strict): (Need, bool),
        (linear, base): (&Linear, &Rational),
        (test, is_turned): (u32, bool),
        known: &mut Map<(u32, bool), usize>,
        changes: &Changes,
    ) -> Option<()> {
        let sign = Rational::from(if is_turned { -1 } else { 1 });
        let base = base * &sign;
        let mut by_node: Map<u32, Rational> = Map::default();
        for (fluent, coefficient) in &linear.terms {
            for (node, value) in changes.get(fluent).into_iter().flatten() {
                *by_node.entry(*node).or_default() += coefficient * value * &sign;
            }
        }
        let common = CommonDenominator::of(by_node.values().chain([&base]))?;
        let reads_duration = !linear.duration.is_zero();
        let sum = match known.get(&(test, is_turned)) {
            Some(&sum) if !reads_duration => sum,
            _ => {
                let mut sum: Map<u32, Vec<(u32, i64)>> = Map::default();
                for (&node, value) in &by_node {
                    let delta = common.to_integer(value)?;
                    sum.entry(self.block_of[node as usize])
                        .or_default()
                        .push((node, delta));
                }
                let mut sum: Sum = sum.into_iter().collect();
                for (_, deltas) in &mut sum {
                    deltas.sort_unstable();
                }
                known.insert((test, is_turned), self.sums.len());
                self.sums.push(sum);
                self.sums.len() - 1
            }
        };
        let demand = Demand {
            need,
            base: common.to_integer(&base)?,
            is_strict,
            sum,
        };
        let least = |deltas: &Vec<(u32, i64)>| prefixes(deltas).min().unwrap_or(0);
        let least: i64 = self.sums[sum].iter().map(|(_, deltas)| least(deltas)).sum();
        if demand.fails(demand.base + least) {
            self.demands.push(demand);
        }
        Some(())
    }

    /// Returns the moments at which a condition may begin to fail, each with the literals that must
    /// be true for it to matter.
    fn points(&mut self, demand: Demand) -> Vec<(Point, Vec<u32>)> {
        let point = |node: u32, is_after: bool| Point { node, is_after };
        match demand.need {
            Need::At(node) => vec![(point(node, false), Vec::new())],
            Need::Goal => Vec::new(),
            Need::Throughout(start, end) => {
                let start_of = start.map(|start| (point(start, true), Vec::new()));
                let mut points: Vec<_> = start_of.into_iter().collect();
                let block = self.block_of[end as usize];
                let others = self.sums[demand.sum]
                    .iter()
                    .filter(|other| other.0 != block);
                let lowering = others.flat_map(|(_, deltas)| deltas);
                let lowering: Vec<u32> = lowering
                    .filter(|(_, delta)| *delta < 0)
                    .map(|d| d.0)
                    .collect();
                for node in lowering {
                    let mut known = vec![self.before(node, end)];
                    known.extend(start.map(|start| self.before(start, node)));
                    points.push((point(node, true), known));
                }
                points
            }
        }
    }

    /// Adds clauses for single instances: the phases in which an instance must not be at a moment.
    /// Returns the work, or `None` if the condition can never hold.
    fn add_instance_clauses(&mut self, demand: Demand) -> Option<u64> {
        let mut work = 0;
        for (point, known) in self.points(demand) {
            let sum = self.sums[demand.sum].clone();
            work += sum.len() as u64;
            let mut top = demand.base;
            for (block, deltas) in &sum {
                top += self
                    .fixed(demand, point, *block, deltas)
                    .unwrap_or(most(deltas));
            }
            let refuted = |literals: &[u32]| literals.iter().map(|&l| negated(l)).collect();
            if demand.fails(top) {
                let clause: Vec<u32> = refuted(&known);
                if clause.is_empty() {
                    return None;
                }
                self.solver.add(&clause);
                continue;
            }
            for (block, deltas) in &sum {
                if self.fixed(demand, point, *block, deltas).is_some() {
                    continue;
                }
                for (passed, value) in prefixes(deltas).enumerate() {
                    if demand.fails(top - most(deltas) + value) {
                        let mut literals = known.clone();
                        self.position_literals(point, deltas, passed, &mut literals);
                        let clause: Vec<u32> = refuted(&literals);
                        self.solver.add(&clause);
                    }
                }
            }
        }
        Some(work)
    }

    /// Returns the amount that a block has added by a moment, if it is known: the block is that of
    /// the moment, or of the condition.
    fn fixed(
        &self,
        demand: Demand,
        point: Point,
        block: u32,
        deltas: &[(u32, i64)],
    ) -> Option<i64> {
        let sum = |is_over: &dyn Fn(u32) -> bool| {
            let over = deltas.iter().filter(|(node, _)| is_over(*node));
            Some(over.map(|(_, delta)| delta).sum())
        };
        if self.block_of[point.node as usize] == block {
            return sum(&|node| node < point.node || point.is_after && node == point.node);
        }
        match demand.need {
            Need::Throughout(_, end) if self.block_of[end as usize] == block => {
                sum(&|node| node < end)
            }
            _ => None,
        }
    }

    /// Adds the literals which state that exactly the first `passed` happenings are over at a
    /// moment.
    fn position_literals(
        &mut self,
        point: Point,
        deltas: &[(u32, i64)],
        passed: usize,
        literals: &mut Vec<u32>,
    ) {
        if passed > 0 {
            literals.push(self.before(deltas[passed - 1].0, point.node));
        }
        if let Some(next) = deltas.get(passed) {
            literals.push(self.before(point.node, next.0));
        }
    }

    /// Returns the clauses that an order violates because a condition on numbers fails. `rank` is
    /// the position of each happening.
    pub(super) fn violated_clauses(&mut self, rank: &[usize]) -> Vec<Vec<u32>> {
        let mut clauses = Vec::new();
        for number in 0..self.demands.len() {
            let demand = self.demands[number];
            for (point, known) in self.points(demand) {
                let place = rank[point.node as usize];
                if let Need::Throughout(start, end) = demand.need
                    && (place >= rank[end as usize]
                        || start.is_some_and(|start| place < rank[start as usize]))
                {
                    continue;
                }
                clauses.extend(self.failure(demand, point, known, rank));
            }
        }
        clauses
    }

    fn failure(
        &mut self,
        demand: Demand,
        point: Point,
        known: Vec<u32>,
        rank: &[usize],
    ) -> Option<Vec<u32>> {
        let place = rank[point.node as usize];
        let (mut value, mut top) = (demand.base, demand.base);
        // The blocks that add less than they could: the difference, the block, and the number of
        // its happenings that are over.
        let mut less: Vec<(i64, usize, usize)> = Vec::new();
        self.solver.work += self.sums[demand.sum].len() as u64;
        for (number, (block, deltas)) in self.sums[demand.sum].iter().enumerate() {
            if let Some(fixed) = self.fixed(demand, point, *block, deltas) {
                value += fixed;
                top += fixed;
                continue;
            }
            let passed = deltas
                .iter()
                .filter(|(node, _)| rank[*node as usize] < place);
            let passed = passed.count();
            let own = prefixes(deltas).nth(passed).unwrap_or(0);
            value += own;
            top += most(deltas);
            if own < most(deltas) {
                less.push((most(deltas) - own, number, passed));
            }
        }
        if !demand.fails(value) {
            return None;
        }
        less.sort_unstable_by_key(|&(gap, number, _)| (Reverse(gap), number));
        let mut literals = known;
        for (gap, number, passed) in less {
            if demand.fails(top) {
                break;
            }
            top -= gap;
            let deltas = self.sums[demand.sum][number].1.clone();
            self.position_literals(point, &deltas, passed, &mut literals);
        }
        Some(literals.into_iter().map(negated).collect())
    }
}
