//! The plan as an ordering problem: the dependencies between its happenings.
//!
//! Two happenings that interfere come in one order or the other, with the least separation. Each
//! condition on a fact has a supporter, and each happening that breaks it comes before the
//! supporter or after the need (causal links and threats; `McAllester` & Rosenblitt, AAAI 1991; for
//! the reordering of plans: Siddiqui & Haslum, 2012; Muise, Beck & `McIlraith`, JAIR 57, 2016).

use std::collections::BTreeMap;

use super::super::super::apply::Stepper;
use super::super::super::compile::{Compiled, NONE};
use super::super::super::formula::Formula;
use super::super::super::hash::Map;
use super::super::super::root::root;
use super::super::super::state::State;
use super::super::super::time::{NEVER, Ticks};
use super::super::WorkMeter;
use super::super::sequence::{Item, Kind, SequenceState};
use super::clauses::{FALSE, Solver, TRUE, negated};
use super::numbers::{Demand, Sum};
use super::times::{Edge, UNBOUNDED};
use elbowroom_num::Rational;

/// Maximum number of interfering pairs, and of literals in clauses.
pub(super) const MOST: usize = 500_000;

/// An instance of an action, or the timed initials of one time.
#[derive(Clone, Debug, Default)]
pub(super) struct Block {
    /// Its happenings in order.
    pub(super) nodes: Vec<u32>,
    /// Bounds on the duration, if it has one.
    pub(super) least: Ticks,
    pub(super) most: Ticks,
    pub(super) duration: Option<Rational>,
    /// Start time of an action that was already running in the situation.
    pub(super) start: Option<Ticks>,
}

/// Time at which a condition must hold.
#[derive(Clone, Copy, Debug)]
pub(super) enum Need {
    /// Just before the happening.
    At(u32),
    /// From after the first happening, or from the beginning, until the second one.
    Throughout(Option<u32>, u32),
    /// At the end of the plan.
    Goal,
}

/// Ordering problem of a plan. A *node* is a happening, by its position in the plan.
pub(super) struct Model<'a> {
    pub(super) compiled: &'a Compiled,
    pub(super) solver: Solver,
    pub(super) items: Vec<Item>,
    /// The block of each node.
    pub(super) block_of: Vec<u32>,
    pub(super) blocks: Vec<Block>,
    /// For each pair, the literal which states that it is ordered as in the plan.
    pub(super) pairs: Map<(u32, u32), u32>,
    /// The pairs that interfere and keep their order.
    pub(super) kept: Vec<(u32, u32)>,
    /// For each fact, the nodes that add it and those that delete it.
    pub(super) changers: Map<u32, [Vec<u32>; 2]>,
    pub(super) root: State,
    pub(super) demands: Vec<Demand>,
    pub(super) sums: Vec<Sum>,
    pub(super) size: usize,
}

impl<'a> Model<'a> {
    /// Returns the model of these items, in which timed initials keep their order. Returns `None`
    /// if the model cannot express the plan.
    pub(super) fn of(
        compiled: &'a Compiled,
        items: &[Item],
        ticker: &mut WorkMeter<'_>,
    ) -> Option<Self> {
        if !compiled.strata.is_empty() || compiled.is_symbolic {
            return None;
        }
        let mut model = Self {
            compiled,
            solver: Solver::new(),
            items: items.to_vec(),
            block_of: Vec::new(),
            blocks: Vec::new(),
            pairs: Map::default(),
            kept: Vec::new(),
            changers: Map::default(),
            root: root(compiled),
            demands: Vec::new(),
            sums: Vec::new(),
            size: 0,
        };
        model.find_blocks(ticker)?;
        model.place()?;
        model.separate(ticker)?;
        model.keep_apart(ticker)?;
        model.note_changers();
        model.support_all(ticker)?;
        model.demand_all(ticker)?;
        (!ticker.is_stopped).then_some(model)
    }

    /// Replays the plan to determine the durations of its actions.
    fn find_blocks(&mut self, ticker: &mut WorkMeter<'_>) -> Option<()> {
        let compiled = self.compiled;
        let mut scene = SequenceState::initial(compiled);
        let mut stepper = Stepper::new(compiled);
        let mut names: Map<u32, u32> = Map::default();
        for (node, item) in (0..).zip(self.items.clone()) {
            let next = u32::try_from(self.blocks.len()).ok()?;
            let is_new = item.kind != Kind::End || !names.contains_key(&item.block);
            let block = if item.kind == Kind::Timed {
                next
            } else {
                *names.entry(item.block).or_insert(next)
            };
            if is_new {
                self.blocks.push(Block::default());
            }
            let data = self.blocks.get_mut(block as usize)?;
            let running = |scene: &SequenceState| {
                let place = scene.open.iter().position(|&open| open == item.block)?;
                scene.state.open.get(place).cloned()
            };
            let before = running(&scene).filter(|_| item.kind == Kind::End && is_new);
            ticker.count_step();
            scene = scene.after(&mut stepper, item)?;
            let open = match item.kind {
                Kind::Start => running(&scene),
                _ => before,
            };
            if let Some(open) = open {
                (data.least, data.most) = (open.least, open.most);
                data.duration.clone_from(&open.duration);
                data.start = (item.kind == Kind::End).then_some(open.start);
            }
            data.nodes.push(node);
            self.block_of.push(block);
        }
        ticker.poll().then_some(())
    }

    /// Adds the window of each happening, and the distances between starts and ends.
    fn place(&mut self) -> Option<()> {
        let compiled = self.compiled;
        let mut timed = 0;
        for item in &self.items {
            let (earliest, latest) = if item.kind == Kind::Timed {
                timed += 1;
                let time = compiled.timed[timed - 1].time;
                (time, time)
            } else {
                (compiled.now, UNBOUNDED)
            };
            self.solver.times.add(earliest, latest);
        }
        // Bounds come before the edges that they are propagated along.
        self.keep_windows()?;
        for block in &self.blocks {
            match (block.start, &block.nodes[..]) {
                (None, &[from, to]) => {
                    let mut always = |from, to, distance| {
                        self.solver.always(Edge { from, to, distance });
                    };
                    always(from, to, block.least);
                    if block.most < NEVER {
                        always(to, from, -block.most);
                    }
                }
                (Some(start), &[end]) => {
                    self.solver
                        .times
                        .bound(end, start + block.least, start + block.most);
                }
                _ => {}
            }
        }
        self.precede_later_timed(timed);
        Some(())
    }

    /// Bounds the happenings that must precede timed initials after the end of the plan.
    fn precede_later_timed(&mut self, taken: usize) {
        let compiled = self.compiled;
        for (node, item) in (0..).zip(&self.items) {
            let Some(snap) = snap_of(compiled, *item) else {
                continue;
            };
            let mut latest = UNBOUNDED;
            for &(timed, distance) in &compiled.snap(snap).before_timed {
                if timed as usize >= taken {
                    latest = latest.min(compiled.timed[timed as usize].time - distance);
                }
            }
            if item.kind == Kind::End {
                for &timed in &compiled.action(item.action).breaking_timed {
                    if timed as usize >= taken {
                        latest = latest.min(compiled.timed[timed as usize].time);
                    }
                }
            }
            self.solver.times.bound(node, -UNBOUNDED, latest);
        }
    }

    /// Finds the pairs that must be separated by some distance.
    fn separate(&mut self, ticker: &mut WorkMeter<'_>) -> Option<()> {
        let compiled = self.compiled;
        let mut marking: Map<u32, Vec<u32>> = Map::default();
        let mut timed_node = Vec::new();
        for (node, item) in (0..).zip(&self.items) {
            let marks = if let Some(snap) = snap_of(compiled, *item) {
                &compiled.snap(snap).marks
            } else {
                timed_node.push(node);
                &compiled.timed[timed_node.len() - 1].marks
            };
            for &mark in marks {
                marking.entry(mark).or_default().push(node);
            }
        }
        let mut distances: Map<(u32, u32), [Option<Ticks>; 2]> = Map::default();
        let mut note = |from: u32, to: u32, distance: Ticks| {
            let key = (from.min(to), from.max(to));
            let known = &mut distances.entry(key).or_default()[usize::from(from > to)];
            *known = (*known).max(Some(distance));
        };
        for (node, item) in (0..).zip(&self.items) {
            let Some(snap) = snap_of(compiled, *item) else {
                continue;
            };
            let snap = compiled.snap(snap);
            let before = self.size;
            for &(annotation, distance) in &snap.after {
                for &other in marking.get(&annotation).into_iter().flatten() {
                    self.size += 1;
                    note(other, node, distance);
                }
            }
            for &(timed, distance) in &snap.before_timed {
                if let Some(&other) = timed_node.get(timed as usize) {
                    note(node, other, distance);
                }
            }
            ticker.work += 20 + (self.size - before) as u64;
            if self.size > MOST || !ticker.poll() {
                return None;
            }
        }
        for ((first, second), distances) in distances {
            if self.block_of[first as usize] != self.block_of[second as usize] {
                self.pair(first, second, distances);
            }
        }
        ticker.poll().then_some(())
    }

    /// Requires that instances of an action that must not overlap itself follow each other: one
    /// ends before the other one starts.
    fn keep_apart(&mut self, ticker: &mut WorkMeter<'_>) -> Option<()> {
        let mut instances: BTreeMap<u32, Vec<Block>> = BTreeMap::new();
        for block in &self.blocks {
            let Some(&first) = block.nodes.first() else {
                continue;
            };
            let item = self.items[first as usize];
            if item.kind == Kind::Timed {
                continue;
            }
            let exclusion = self.compiled.action(item.action).exclusion;
            if exclusion != NONE {
                instances.entry(exclusion).or_default().push(block.clone());
            }
        }
        for blocks in instances.values() {
            self.size += blocks.len() * blocks.len();
            ticker.work += 20 * (blocks.len() * blocks.len()) as u64;
            if self.size > MOST || !ticker.poll() {
                return None;
            }
            for (place, one) in blocks.iter().enumerate() {
                for other in &blocks[..place] {
                    if one.start.is_some() && other.start.is_some() {
                        continue;
                    }
                    let clause = [self.follows(one, other), self.follows(other, one)];
                    self.solver.add(&clause);
                }
            }
        }
        Some(())
    }

    /// Returns the literal which states that one instance starts after the end of the other one.
    fn follows(&mut self, later: &Block, earlier: &Block) -> u32 {
        match (earlier.nodes.last(), later.nodes.first(), later.start) {
            (Some(&end), Some(&start), None) => self.before(end, start),
            // It was running in the initial situation.
            _ => FALSE,
        }
    }

    /// Adds a pair that may be ordered either way, with the distances to keep (zero if `None`). A
    /// pair of timed initials keeps its order.
    fn pair(&mut self, first: u32, second: u32, distances: [Option<Ticks>; 2]) -> u32 {
        let edge = |from, to, distance: Option<Ticks>| Edge {
            from,
            to,
            distance: distance.unwrap_or(0),
        };
        if !self.may_differ(first, second) {
            self.kept.push((first, second));
            if distances[0].is_some() {
                self.solver.always(edge(first, second, distances[0]));
            }
            return TRUE;
        }
        let edges = [
            Some(edge(first, second, distances[0])),
            Some(edge(second, first, distances[1])),
        ];
        let literal = self.solver.variable(true, edges);
        self.pairs.insert((first, second), literal);
        literal
    }

    fn may_differ(&self, first: u32, second: u32) -> bool {
        let is_timed = |node: u32| self.items[node as usize].kind == Kind::Timed;
        !(is_timed(first) && is_timed(second))
    }

    /// Returns the literal which states that one happening precedes another one.
    pub(super) fn before(&mut self, first: u32, second: u32) -> u32 {
        if first == second {
            return FALSE;
        }
        if first > second {
            return negated(self.before(second, first));
        }
        if self.block_of[first as usize] == self.block_of[second as usize] {
            return TRUE;
        }
        match self.pairs.get(&(first, second)) {
            Some(&literal) => literal,
            None => self.pair(first, second, [None, None]),
        }
    }

    /// Calls `visit` for each condition of the plan. Returns `None` as soon as `visit` does.
    pub(super) fn visit_needs(
        &mut self,
        ticker: &mut WorkMeter<'_>,
        visit: &mut dyn FnMut(&mut Self, Need, &'a Formula) -> Option<()>,
    ) -> Option<()> {
        let compiled = self.compiled;
        for (node, item) in (0..).zip(self.items.clone()) {
            let Some(snap) = snap_of(compiled, item) else {
                continue;
            };
            let snap = compiled.snap(snap);
            if !snap.conditional.is_empty() {
                return None;
            }
            visit(self, Need::At(node), &snap.condition)?;
            let nodes = &self.blocks[self.block_of[node as usize] as usize].nodes;
            if item.kind == Kind::End {
                let start = nodes.iter().copied().find(|&other| other != node);
                let over_all = &compiled.action(item.action).over_all;
                visit(self, Need::Throughout(start, node), over_all)?;
            }
            ticker.work += 20;
            if !ticker.poll() {
                return None;
            }
        }
        visit(self, Need::Goal, &compiled.goal)
    }
}

/// Returns the snap of the item, or `None` for timed initials.
pub(super) fn snap_of(compiled: &Compiled, item: Item) -> Option<u32> {
    match item.kind {
        Kind::Timed => None,
        Kind::End => Some(compiled.action(item.action).end),
        Kind::Start | Kind::Whole => Some(compiled.action(item.action).start),
    }
    .filter(|&snap| snap != NONE)
}
