//! The current plan of the improvement, and data derived from it.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_num::Rational;

use super::super::apply::Step;
use super::super::compile::{Compiled, NONE};
use super::super::formula::{Formula, Literal};
use super::super::time::Ticks;
use super::sequence::{AppliedSequence, Item, Kind, split};

/// Worth of a plan; smaller is better.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct PlanCost {
    /// The value of the metric, if it is not the makespan; otherwise zero.
    pub(super) metric: Rational,
    pub(super) end: Ticks,
    /// The sum of the ends of its actions. Among equally good plans, those with more slack are
    /// easier to improve.
    pub(super) ends: Ticks,
}

impl PlanCost {
    /// Returns a worth that is worse by one part in `parts`, in its metric and in its end. Time is
    /// counted from `now`.
    pub(super) fn worse_by(&self, parts: u32, now: Ticks) -> Self {
        let parts = i64::from(parts.max(1));
        let part = self.metric.abs() / Rational::from(parts);
        Self {
            metric: &self.metric + part,
            end: self.end + (self.end - now) / parts,
            ends: Ticks::MAX,
        }
    }
}

/// A plan with its worth, blocks and critical path.
#[derive(Debug)]
pub(super) struct Incumbent {
    pub(super) items: Vec<Item>,
    pub(super) steps: Vec<Step>,
    pub(super) cost: PlanCost,
    /// The action instances, by block number.
    pub(super) blocks: BTreeMap<u32, Block>,
    /// The items of the critical path, which determine the end of the plan; the latest first.
    pub(super) critical: Vec<Item>,
}

/// An instance of an action.
#[derive(Clone, Debug)]
pub(super) struct Block {
    pub(super) action: u32,
    /// Index of its first item; `None` if the action was already running in the situation.
    pub(super) first: Option<usize>,
    pub(super) last: usize,
    /// The literals of the goal that it contributes to, as a bit set.
    pub(super) goals: Vec<u64>,
}

impl Incumbent {
    /// Returns the plan of these items, or `None` if they are not a plan or its worth is unknown.
    pub(super) fn of(compiled: &Compiled, items: &[Item]) -> Option<Self> {
        let items = split(compiled, items);
        let course = AppliedSequence::of(compiled, &items)?;
        let worth = plan_cost(compiled, &items, &course)?;
        let (order, critical) = order_of_time(&items, &course);
        let mut incumbent = Self {
            items,
            steps: course.steps,
            cost: worth,
            blocks: BTreeMap::new(),
            critical,
        };
        let sorted: Vec<Item> = order.iter().map(|&n| incumbent.items[n]).collect();
        // Only non-interfering items have changed their order.
        if let Some(course) = AppliedSequence::of(compiled, &sorted) {
            incumbent.items = sorted;
            incumbent.steps = course.steps;
        }
        incumbent.find_blocks(compiled);
        Some(incumbent)
    }

    fn find_blocks(&mut self, compiled: &Compiled) {
        let goals = compiled.goal.literals.len();
        for (place, item) in self.items.iter().enumerate() {
            if item.block == NONE {
                continue;
            }
            let begins = item.kind != Kind::End;
            let block = self.blocks.entry(item.block).or_insert_with(|| Block {
                action: item.action,
                first: begins.then_some(place),
                last: place,
                goals: vec![0; goals.div_ceil(64)],
            });
            block.last = place;
        }
        self.find_goals_served(compiled);
    }

    /// Determines the goals that each block serves, by following the links back from the goal.
    fn find_goals_served(&mut self, compiled: &Compiled) {
        let links = links(compiled, &self.items);
        for (number, literal) in compiled.goal.literals.iter().enumerate() {
            let mut waiting: Vec<u32> = links.last.get(literal).copied().into_iter().collect();
            while let Some(block) = waiting.pop() {
                let Some(data) = self.blocks.get_mut(&block) else {
                    continue;
                };
                let word = &mut data.goals[number / 64];
                if *word >> (number % 64) & 1 == 1 {
                    continue;
                }
                *word |= 1 << (number % 64);
                waiting.extend(links.suppliers.get(&block).into_iter().flatten());
            }
        }
    }
}

/// Causal links between blocks.
#[derive(Debug, Default)]
struct Links {
    /// For each block, the blocks that supply its conditions.
    suppliers: BTreeMap<u32, BTreeSet<u32>>,
    /// The block that last made a literal true.
    last: BTreeMap<Literal, u32>,
}

fn links(compiled: &Compiled, items: &[Item]) -> Links {
    let mut links = Links::default();
    let need = |links: &mut Links, block: u32, condition: &Formula| {
        condition.visit_literals(&mut |literal| {
            if let Some(&supplier) = links.last.get(&literal)
                && supplier != block
            {
                links.suppliers.entry(block).or_default().insert(supplier);
            }
        });
    };
    let change = |links: &mut Links, block: u32, snap: u32| {
        let snap = compiled.snap(snap);
        for &fact in &snap.deletes {
            links.last.insert(Literal::new(fact, false), block);
            links.last.remove(&Literal::new(fact, true));
        }
        for &fact in &snap.adds {
            links.last.insert(Literal::new(fact, true), block);
            links.last.remove(&Literal::new(fact, false));
        }
    };
    for item in items.iter().filter(|item| item.block != NONE) {
        let action = compiled.action(item.action);
        let has_end = action.end != NONE;
        if item.kind != Kind::End {
            need(
                &mut links,
                item.block,
                &compiled.snap(action.start).condition,
            );
            change(&mut links, item.block, action.start);
            if has_end {
                need(&mut links, item.block, &action.over_all);
            }
        }
        if item.kind != Kind::Start && has_end {
            need(&mut links, item.block, &compiled.snap(action.end).condition);
            change(&mut links, item.block, action.end);
        }
    }
    links
}

/// Returns the worth of a plan after the application of all its items, with the goal reached.
fn plan_cost(compiled: &Compiled, items: &[Item], course: &AppliedSequence) -> Option<PlanCost> {
    let (state, network) = (&course.state, course.network());
    let end = state.earliest_end();
    let metric = match &compiled.metric {
        None => Rational::ZERO,
        Some(metric) => {
            let time = &metric.time * compiled.scale.units(end);
            state.spent(metric)? + time
        }
    };
    let ends = items.iter().zip(&course.nodes);
    let ends = ends.filter(|(item, _)| matches!(item.kind, Kind::End | Kind::Whole));
    let ends = ends.map(|(_, nodes)| network.earliest(nodes.1) - compiled.now);
    Some(PlanCost {
        metric,
        end,
        ends: ends.sum(),
    })
}

/// Returns the items in chronological order, where the network leaves the order open, and those on
/// the critical path.
fn order_of_time(items: &[Item], course: &AppliedSequence) -> (Vec<usize>, Vec<Item>) {
    let network = course.network();
    let count = network.node_count();
    let mut item_of = vec![usize::MAX; count];
    for (number, (item, nodes)) in items.iter().zip(&course.nodes).enumerate() {
        if item.kind != Kind::Timed {
            item_of[nodes.0 as usize] = number;
            item_of[nodes.1 as usize] = number;
        }
    }
    let mut before = vec![0_usize; items.len()];
    let mut followers = vec![Vec::new(); items.len()];
    // For each node, the node that delays it.
    let mut pushed_by: Vec<Option<usize>> = vec![None; count];
    let mut link = |from: usize, to: usize| {
        if from != to {
            before[to] += 1;
            followers[from].push(to);
        }
    };
    for (from, to, distance) in network.edges() {
        let pushes = network.earliest(from) + distance == network.earliest(to);
        let (from, to) = (from as usize, to as usize);
        if distance >= 0 {
            link(item_of[from], item_of[to]);
            if pushes {
                pushed_by[to] = Some(from);
            }
        }
    }
    // Timed initials keep their position.
    let mut segment = 0;
    let segments: Vec<usize> = items
        .iter()
        .map(|item| {
            segment += usize::from(item.kind == Kind::Timed);
            let own = segment;
            segment += usize::from(item.kind == Kind::Timed);
            own
        })
        .collect();
    let time = |number: usize| {
        let node = course.nodes[number].0;
        let time = if (node as usize) < count {
            network.earliest(node)
        } else {
            Ticks::MAX
        };
        (segments[number], time, number)
    };
    let free = |before: &[usize], number: usize| before[number] == 0;
    let mut ready: BTreeSet<(usize, Ticks, usize)> = (0..items.len())
        .filter(|&number| free(&before, number))
        .map(time)
        .collect();
    let mut order = Vec::with_capacity(items.len());
    while let Some((_, _, number)) = ready.pop_first() {
        order.push(number);
        for &follower in &followers[number] {
            before[follower] -= 1;
            if free(&before, follower) {
                ready.insert(time(follower));
            }
        }
    }
    let latest = (0..count).max_by_key(|&node| {
        (
            network.earliest(u16::try_from(node).unwrap_or(u16::MAX)),
            node,
        )
    });
    let mut critical = Vec::new();
    let mut at = latest;
    let mut steps = 0;
    while let Some(node) = at.filter(|_| steps <= count) {
        steps += 1;
        if let Some(item) = items.get(item_of[node])
            && critical.last() != Some(item)
        {
            critical.push(*item);
        }
        at = pushed_by[node];
    }
    if order.len() < items.len() {
        order = (0..items.len()).collect();
    }
    (order, critical)
}
