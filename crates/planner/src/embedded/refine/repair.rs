//! What was taken out of a plan is done otherwise: a search among what is left of the plan.
//!
//! A node is a state and how much of the rest of the plan has been carried out. What follows is the
//! next of the rest, or a step of a relaxed plan in which what is left costs nothing; what has
//! become impossible, or is no longer wanted, can be passed over.

use std::collections::{BTreeMap, BTreeSet};

use super::super::apply::{Step, Stepper};
use super::super::compile::{Compiled, Compressibility, NONE};
use super::super::hash::Map;
use super::super::relaxed::{Estimate, Relaxed};
use super::super::search::is_goal;
use super::super::state::State;
use super::super::time::Ticks;
use super::Ticker;
use super::random::Random;
use super::sequence::{Item, Kind, Scene};

/// A search for a repair.
pub(super) struct Repair<'a, 'b> {
    pub(super) compiled: &'a Compiled,
    pub(super) stepper: &'b mut Stepper<'a>,
    pub(super) relaxed: &'b mut Relaxed<'a>,
    pub(super) random: &'b mut Random,
    /// What is left of the plan.
    pub(super) rest: &'b [Item],
    /// What an action costs that is not left of the plan.
    pub(super) costs: &'b [u32],
    /// The number of the next instance.
    pub(super) next_block: u32,
    pub(super) compresses: Option<Compressibility>,
    /// How many states are looked at.
    pub(super) most_states: u64,
    pub(super) latest_end: &'b dyn Fn(&State) -> Option<Ticks>,
}

#[derive(Clone)]
struct Node {
    scene: Scene,
    /// How much of the rest is behind it.
    place: usize,
    parent: usize,
    /// The item that led here, unless one was passed over.
    item: Option<Item>,
}

/// What a search knows.
#[derive(Default)]
struct Tree {
    nodes: Vec<Node>,
    queue: BTreeMap<(u32, u64), Node>,
    known: Map<(u64, usize), Vec<Ticks>>,
    /// How often each action is among what is left, from where the estimates stand on.
    left: BTreeMap<u32, u32>,
    standing: usize,
}

impl Tree {
    /// Whether a node differs from all before it, as far as that is looked at.
    fn is_new(&mut self, node: &Node) -> bool {
        let state = &node.scene.state;
        let times = self.known.entry((state.discrete_hash(), node.place));
        let times = times.or_default();
        let end = state.earliest_end();
        let is_new = !times.contains(&end);
        if is_new {
            times.push(end);
        }
        is_new
    }

    /// The items that lead to a node.
    fn items_to(&self, mut number: usize) -> Vec<Item> {
        let mut items = Vec::new();
        while let Some(node) = self.nodes.get(number) {
            items.extend(node.item);
            number = node.parent;
        }
        items.reverse();
        items
    }
}

impl Repair<'_, '_> {
    /// The items from `begin` on, of a plan that reaches the goal in time.
    pub(super) fn run(&mut self, begin: &Scene, ticker: &mut Ticker<'_>) -> Option<Vec<Item>> {
        let mut tree = Tree::default();
        for item in self.rest.iter().filter(|item| item.block != NONE) {
            *tree.left.entry(item.action).or_default() += 1;
        }
        self.relaxed
            .set_costs(tree.left.keys().map(|&action| (action, 0)));
        let root = Node {
            scene: begin.clone(),
            place: 0,
            parent: usize::MAX,
            item: None,
        };
        tree.queue.insert((0, 0), root);
        let mut evaluated = 0;
        while evaluated < self.most_states
            && let Some((_, node)) = tree.queue.pop_first()
        {
            let latest = (self.latest_end)(&node.scene.state);
            let is_in_time = latest.is_some_and(|l| node.scene.state.earliest_end() <= l);
            let Some(latest) = latest.filter(|_| is_in_time && tree.is_new(&node)) else {
                continue;
            };
            self.move_to(node.place, &mut tree.standing, &mut tree.left);
            self.relaxed.horizon = latest;
            self.stepper.horizon = latest;
            evaluated += 1;
            if !ticker.evaluated() {
                return None;
            }
            let Some(estimate) = self.relaxed.evaluate(&node.scene.state) else {
                continue;
            };
            if estimate.steps == 0
                && let Some(tail) = self.follow(&node, ticker)
            {
                tree.nodes.push(node);
                let mut items = tree.items_to(tree.nodes.len() - 1);
                items.extend(tail);
                return Some(items);
            }
            self.put_in(&node, &estimate, &mut tree);
            self.go_on(&node, estimate.steps, &mut tree);
            tree.nodes.push(node);
        }
        None
    }

    /// Lets what may be put in after the node wait for its turn: it is estimated to save what it
    /// costs. Of the same estimate, most of it comes before what is left.
    fn put_in(&mut self, node: &Node, estimate: &Estimate, tree: &mut Tree) {
        let rest = &self.rest[node.place..];
        for &step in &estimate.preferred {
            let (is_left, cost) = match step {
                Step::Start(action) | Step::Compressed(action) => {
                    let is_left = tree.left.contains_key(&action);
                    (is_left, self.costs[action as usize])
                }
                Step::End(at) => {
                    let block = node.scene.open.get(at as usize);
                    let is_due = |item: &Item| Some(&item.block) == block;
                    (rest.iter().any(is_due), 1)
                }
                Step::Timed => (true, 0),
            };
            if is_left {
                continue;
            }
            if let Some((item, scene)) = self.make(&node.scene, step) {
                let order = u64::from(self.random.once_in(4));
                let next = Node {
                    scene,
                    place: node.place,
                    parent: tree.nodes.len(),
                    item: Some(item),
                };
                let key = self.key(estimate.steps.saturating_sub(cost), order);
                tree.queue.insert(key, next);
            }
        }
    }

    /// Lets the next of what is left wait for its turn, and what comes of passing it over.
    fn go_on(&mut self, node: &Node, needs: u32, tree: &mut Tree) {
        let Some(&next) = self.rest.get(node.place) else {
            return;
        };
        let after = node.scene.after(self.stepper, next);
        let is_possible = after.is_some();
        if let Some(scene) = after {
            let key = self.key(needs, 1);
            let next = Node {
                scene,
                place: node.place + 1,
                parent: tree.nodes.len(),
                item: Some(next),
            };
            tree.queue.insert(key, next);
        }
        let is_due = match next.kind {
            Kind::Timed => true,
            Kind::End => node.scene.open.contains(&next.block),
            Kind::Start | Kind::Whole => false,
        };
        if is_due {
            return;
        }
        let cost = match next.kind {
            Kind::End => 0,
            _ if is_possible => self.costs[next.action as usize],
            _ => self.costs[next.action as usize] / 2,
        };
        let key = self.key(needs + cost, 2);
        let next = Node {
            scene: node.scene.clone(),
            place: node.place + 1,
            parent: tree.nodes.len(),
            item: None,
        };
        tree.queue.insert(key, next);
    }

    /// A place in the queue: by estimate, then by order, then by chance.
    fn key(&mut self, estimate: u32, order: u64) -> (u32, u64) {
        (estimate, order << 32 | self.random.next() >> 32)
    }

    /// Lets the estimates stand at a place of the rest: what is behind it costs what it costs.
    fn move_to(&mut self, place: usize, standing: &mut usize, left: &mut BTreeMap<u32, u32>) {
        while *standing < place {
            let item = self.rest[*standing];
            *standing += 1;
            if let Some(count) = left.get_mut(&item.action) {
                *count -= 1;
                if *count == 0 {
                    left.remove(&item.action);
                    let cost = self.costs[item.action as usize];
                    self.relaxed.set_costs(std::iter::once((item.action, cost)));
                }
            }
        }
        while *standing > place {
            *standing -= 1;
            let item = self.rest[*standing];
            if item.block != NONE {
                *left.entry(item.action).or_default() += 1;
                self.relaxed.set_costs(std::iter::once((item.action, 0)));
            }
        }
    }

    /// Carries out what is left, without what is not possible; the items, if that is a plan.
    fn follow(&mut self, node: &Node, ticker: &mut Ticker<'_>) -> Option<Vec<Item>> {
        let mut scene = node.scene.clone();
        let mut items = Vec::new();
        let mut passed: BTreeSet<u32> = BTreeSet::new();
        for &item in &self.rest[node.place..] {
            if passed.contains(&item.block) && item.kind == Kind::End {
                continue;
            }
            ticker.stepped();
            if let Some(next) = scene.after(self.stepper, item) {
                scene = next;
                items.push(item);
            } else if item.kind == Kind::Start || item.kind == Kind::Whole {
                passed.insert(item.block);
            } else if item.kind == Kind::Timed || scene.open.contains(&item.block) {
                return None;
            }
        }
        let is_in_time = (self.latest_end)(&scene.state)
            .is_some_and(|latest| scene.state.earliest_end() <= latest);
        (is_in_time && is_goal(self.compiled, &scene.state)).then_some(items)
    }

    /// A new step, compressed if that is possible and the actions of the plan are.
    fn make(&mut self, scene: &Scene, step: Step) -> Option<(Item, Scene)> {
        let block = self.next_block;
        self.next_block += 1;
        let mut attempt = |step| {
            let item = scene.item(self.compiled, step, block)?;
            Some((item, scene.after(self.stepper, item)?))
        };
        if let Step::Start(action) | Step::Compressed(action) = step {
            let data = self.compiled.action(action);
            let is_compressed = self
                .compresses
                .is_some_and(|least| data.compressibility >= least);
            if data.end != NONE
                && is_compressed
                && let Some(made) = attempt(Step::Compressed(action))
            {
                return Some(made);
            }
            return attempt(Step::Start(action));
        }
        attempt(step)
    }
}
