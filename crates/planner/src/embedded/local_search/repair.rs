//! Repair of a plan after the removal of actions, by a search that inserts actions into the
//! remaining plan.
//!
//! A node is a state and the position in the remaining plan. Its successors apply the next item of
//! the remaining plan, or a step of a relaxed plan in which the actions of the remaining plan cost
//! nothing. Items that are inapplicable or no longer needed can be skipped.
//!
//! Estimating a state takes much longer than generating it. So the actions of a relaxed plan are
//! inserted one after the other as soon as each is applicable, while the remaining plan continues.
//! A new estimate is made only after an item was skipped, or if no successor is applicable.

#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use super::super::apply::{Step, Stepper};
use super::super::compile::{Compiled, Compressibility, NONE};
use super::super::hash::Map;
use super::super::relaxed::Relaxed;
use super::super::search::is_goal;
use super::super::state::State;
use super::super::time::Ticks;
use super::WorkMeter;
use super::random::Random;
use super::sequence::{Item, Kind, SequenceState};

/// Maximum number of expanded nodes for each state that may be estimated.
const NODES_PER_STATE: u64 = 8;

/// Memory of a node in the queue and in the set of known nodes, in addition to its own size, in
/// bytes.
const PLACE_SIZE: usize = 96;

/// A search for a repair.
pub(super) struct Repair<'a, 'b> {
    pub(super) compiled: &'a Compiled,
    pub(super) stepper: &'b mut Stepper<'a>,
    pub(super) relaxed: &'b mut Relaxed<'a>,
    pub(super) random: &'b mut Random,
    /// The remaining plan.
    pub(super) remaining: &'b [Item],
    /// Costs of the actions outside of the remaining plan.
    pub(super) costs: &'b [u32],
    /// The block number of the next instance.
    pub(super) next_block: u32,
    pub(super) compresses: Option<Compressibility>,
    /// Maximum number of states.
    pub(super) most_states: u64,
    /// Memory limit for the nodes, in bytes.
    pub(super) most_memory: usize,
    pub(super) latest_end: &'b dyn Fn(&State) -> Option<Ticks>,
}

#[derive(Clone)]
struct Node {
    scene: SequenceState,
    /// Number of items of the remaining plan that were applied or skipped.
    place: usize,
    parent: usize,
    /// The item that led here, unless one was skipped.
    item: Option<Item>,
    /// The actions still to be inserted, if they are known from the previous nodes.
    intent: Option<InsertionPlan>,
}

impl Node {
    /// Returns an estimate of the memory, in bytes.
    fn size(&self) -> usize {
        let intent = self.intent.as_ref();
        size_of::<Self>()
            + PLACE_SIZE
            + self.scene.state.size()
            + size_of::<u32>()
                * (self.scene.open.len() + intent.map_or(0, |intent| intent.actions.len()))
    }
}

/// The actions that a relaxed plan inserts, without those of the remaining plan.
#[derive(Clone)]
struct InsertionPlan {
    needs: u32,
    actions: Rc<[u32]>,
}

impl InsertionPlan {
    /// Returns the intent without one of its actions.
    fn without_action(&self, action: u32, cost: u32) -> Self {
        let others = self.actions.iter().copied();
        Self {
            needs: self.needs.saturating_sub(cost),
            actions: others.filter(|&other| other != action).collect(),
        }
    }
}

/// State of a search.
#[derive(Default)]
struct Tree {
    /// For each expanded node, its parent and the item that led to it.
    nodes: Vec<(usize, Option<Item>)>,
    queue: BTreeMap<(u32, u64), Node>,
    known: Map<(u64, usize), Vec<Ticks>>,
    /// Memory of the queued nodes and of the data kept for expanded ones, in bytes.
    memory: usize,
    /// Number of occurrences of each action in the remaining plan, from the position `standing` of
    /// the estimates.
    remaining_counts: BTreeMap<u32, u32>,
    position: usize,
}

impl Tree {
    /// Adds a node to the queue.
    fn enqueue(&mut self, key: (u32, u64), node: Node) {
        self.memory += node.size();
        if let Some(other) = self.queue.insert(key, node) {
            self.memory -= other.size();
        }
    }

    /// Removes the best node from the queue.
    fn next(&mut self) -> Option<Node> {
        let (_, node) = self.queue.pop_first()?;
        self.memory -= node.size();
        Some(node)
    }

    /// Keeps the data of a node that is needed to reconstruct a plan.
    fn retain_node(&mut self, node: &Node) {
        self.memory += PLACE_SIZE;
        self.nodes.push((node.parent, node.item));
    }

    /// Returns `true` if a node differs from all earlier ones in its state, position or earliest
    /// end.
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

    /// Returns the items that lead to a node, followed by `tail`.
    fn plan_to(&self, number: usize, tail: Vec<Item>) -> Vec<Item> {
        let mut items = self.items_to(number);
        items.extend(tail);
        items
    }

    /// Returns the items that lead to a node.
    fn items_to(&self, mut number: usize) -> Vec<Item> {
        let mut items = Vec::new();
        while let Some(&(parent, item)) = self.nodes.get(number) {
            items.extend(item);
            number = parent;
        }
        items.reverse();
        items
    }
}

impl Repair<'_, '_> {
    /// Searches for a repair. Returns the items from `begin` of a plan that reaches the goal in
    /// time.
    pub(super) fn run(
        &mut self,
        begin: &SequenceState,
        ticker: &mut WorkMeter<'_>,
    ) -> Option<Vec<Item>> {
        self.search(begin, &mut Tree::default(), ticker)
    }

    fn search(
        &mut self,
        begin: &SequenceState,
        tree: &mut Tree,
        ticker: &mut WorkMeter<'_>,
    ) -> Option<Vec<Item>> {
        for item in self.remaining.iter().filter(|item| item.block != NONE) {
            *tree.remaining_counts.entry(item.action).or_default() += 1;
        }
        self.relaxed
            .set_costs(tree.remaining_counts.keys().map(|&action| (action, 0)));
        let root = Node {
            scene: begin.clone(),
            place: 0,
            parent: usize::MAX,
            item: None,
            intent: None,
        };
        tree.enqueue((0, 0), root);
        let (mut evaluated, mut seen) = (0, 0);
        while evaluated < self.most_states
            && seen < NODES_PER_STATE * self.most_states
            && tree.memory <= self.most_memory
            && let Some(mut node) = tree.next()
        {
            let latest = (self.latest_end)(&node.scene.state);
            let is_in_time = latest.is_some_and(|l| node.scene.state.earliest_end() <= l);
            let Some(latest) = latest.filter(|_| is_in_time && tree.is_new(&node)) else {
                continue;
            };
            self.stepper.horizon = latest;
            seen += 1;
            ticker.count_step();
            let number = tree.nodes.len();
            if let Some(intent) = node.intent.clone() {
                if intent.actions.is_empty() {
                    if let Some(tail) = self.apply_remaining(&node, ticker) {
                        tree.retain_node(&node);
                        return Some(tree.plan_to(number, tail));
                    }
                } else {
                    self.queue_insertions(&node, &intent, &[], tree);
                    if self.queue_next_item(&node, &intent, tree) {
                        tree.retain_node(&node);
                        continue;
                    }
                }
            }
            evaluated += 1;
            if !ticker.evaluated() {
                return None;
            }
            self.move_to(node.place, tree);
            self.relaxed.horizon = latest;
            let Some(estimate) = self.relaxed.evaluate(&node.scene.state) else {
                continue;
            };
            let is_done = estimate.steps == 0;
            let actions = estimate.actions.iter().copied();
            let intent = InsertionPlan {
                needs: estimate.steps,
                actions: actions
                    .filter(|action| !tree.remaining_counts.contains_key(action))
                    .collect(),
            };
            node.intent = Some(intent.clone());
            if is_done && let Some(tail) = self.apply_remaining(&node, ticker) {
                tree.retain_node(&node);
                return Some(tree.plan_to(number, tail));
            }
            self.queue_insertions(&node, &intent, &estimate.preferred, tree);
            self.queue_next_item(&node, &intent, tree);
            tree.retain_node(&node);
        }
        None
    }

    /// Queues the successors that insert an action of the intent. Each is estimated to reduce the
    /// remaining cost by the cost of its action.
    fn queue_insertions(
        &mut self,
        node: &Node,
        intent: &InsertionPlan,
        preferred: &[Step],
        tree: &mut Tree,
    ) {
        let starts = intent.actions.iter().map(|&action| Step::Start(action));
        let ends = preferred
            .iter()
            .copied()
            .filter(|step| matches!(step, Step::End(_)));
        for step in starts.chain(ends) {
            // Each step creates a state, and a relaxed plan may have thousands of them.
            if tree.memory > self.most_memory {
                return;
            }
            let next = match step {
                Step::Start(action) | Step::Compressed(action) => {
                    intent.without_action(action, self.costs[action as usize])
                }
                Step::End(at) => {
                    let block = node.scene.open.get(at as usize);
                    let mut rest = self.remaining[node.place..].iter();
                    if rest.any(|item| Some(&item.block) == block) {
                        continue;
                    }
                    intent.clone()
                }
                Step::Macro(_) | Step::Timed => continue,
            };
            if let Some((item, scene)) = self.make_item(&node.scene, step) {
                let order = u64::from(self.random.once_in(4));
                let key = self.key(next.needs, order);
                let next = Node {
                    scene,
                    place: node.place,
                    parent: tree.nodes.len(),
                    // A started action must end; a new estimate determines when.
                    intent: (item.kind == Kind::Whole).then_some(next),
                    item: Some(item),
                };
                tree.enqueue(key, next);
            }
        }
    }

    /// Queues the successor that applies the next item of the remaining plan, and the one that
    /// skips it. Returns `true` if the next item is applicable, or is the end of a skipped action.
    fn queue_next_item(&mut self, node: &Node, intent: &InsertionPlan, tree: &mut Tree) -> bool {
        let Some(&next) = self.remaining.get(node.place) else {
            return false;
        };
        let needs = intent.needs;
        let after = node.scene.after(self.stepper, next);
        let is_possible = after.is_some();
        if let Some(scene) = after {
            let key = self.key(needs, 1);
            let next = Node {
                scene,
                place: node.place + 1,
                parent: tree.nodes.len(),
                item: Some(next),
                intent: Some(intent.clone()),
            };
            tree.enqueue(key, next);
        }
        let is_end = next.kind == Kind::End;
        let is_due = match next.kind {
            Kind::Timed => true,
            Kind::End => node.scene.open.contains(&next.block),
            Kind::Start | Kind::Whole => false,
        };
        if is_due {
            return is_possible;
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
            // Skipping the end of a skipped action changes nothing.
            intent: is_end.then(|| intent.clone()),
        };
        tree.enqueue(key, next);
        is_possible || is_end
    }

    /// Returns a priority in the queue: by estimate, then by order, then at random.
    fn key(&mut self, estimate: u32, order: u64) -> (u32, u64) {
        (estimate, order << 32 | self.random.next() >> 32)
    }

    /// Moves the position of the estimates to `place`. Actions before it have their own costs;
    /// actions of the remaining plan cost nothing.
    fn move_to(&mut self, place: usize, tree: &mut Tree) {
        let Tree {
            position: standing,
            remaining_counts: left,
            ..
        } = tree;
        while *standing < place {
            let item = self.remaining[*standing];
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
            let item = self.remaining[*standing];
            if item.block != NONE {
                *left.entry(item.action).or_default() += 1;
                self.relaxed.set_costs(std::iter::once((item.action, 0)));
            }
        }
    }

    /// Applies the remaining items without the inapplicable ones. Returns the items if they form a
    /// plan.
    fn apply_remaining(&mut self, node: &Node, ticker: &mut WorkMeter<'_>) -> Option<Vec<Item>> {
        let mut scene = node.scene.clone();
        let mut items = Vec::new();
        let mut passed: BTreeSet<u32> = BTreeSet::new();
        for &item in &self.remaining[node.place..] {
            if passed.contains(&item.block) && item.kind == Kind::End {
                continue;
            }
            ticker.count_step();
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

    /// Creates a new step. It is compressed if possible and if the plan's actions are.
    fn make_item(&mut self, scene: &SequenceState, step: Step) -> Option<(Item, SequenceState)> {
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
