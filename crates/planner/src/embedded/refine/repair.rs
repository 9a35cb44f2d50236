//! What was taken out of a plan is done otherwise: a search among what is left of the plan.
//!
//! A node is a state and how much of the rest of the plan has been carried out. What follows is the
//! next of the rest, or a step of a relaxed plan in which what is left costs nothing; what has
//! become impossible, or is no longer wanted, can be passed over.

use std::collections::{BTreeMap, BTreeSet};

use super::super::apply::{Step, Stepper};
use super::super::compile::{Compiled, Compressibility, NONE};
use super::super::hash::Map;
use super::super::relaxed::Relaxed;
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

struct Node {
    scene: Scene,
    /// How much of the rest is behind it.
    place: usize,
    parent: usize,
    /// The item that led here, unless one was passed over.
    item: Option<Item>,
}

/// A node that waits for its turn.
struct Waiting {
    scene: Scene,
    place: usize,
    parent: usize,
    item: Option<Item>,
}

impl Repair<'_, '_> {
    /// The items from `begin` on, of a plan that reaches the goal in time.
    pub(super) fn run(&mut self, begin: &Scene, ticker: &mut Ticker<'_>) -> Option<Vec<Item>> {
        let mut nodes: Vec<Node> = Vec::new();
        let mut queue: BTreeMap<(u32, u64), Waiting> = BTreeMap::new();
        let mut known: Map<(u64, usize), Vec<Ticks>> = Map::default();
        // How often each action is among what is left, from where the estimates stand on.
        let mut left: BTreeMap<u32, u32> = BTreeMap::new();
        for item in self.rest.iter().filter(|item| item.block != NONE) {
            *left.entry(item.action).or_default() += 1;
        }
        let mut standing = 0;
        self.relaxed
            .set_costs(left.keys().map(|&action| (action, 0)));
        queue.insert(
            (0, 0),
            Waiting {
                scene: begin.clone(),
                place: 0,
                parent: usize::MAX,
                item: None,
            },
        );
        let mut evaluated = 0;
        let mut found = None;
        while let Some((_, waiting)) = queue.pop_first() {
            if evaluated >= self.most_states {
                break;
            }
            let Waiting {
                scene,
                place,
                parent,
                item,
            } = waiting;
            let Some(latest) = (self.latest_end)(&scene.state) else {
                continue;
            };
            if scene.state.earliest_end() > latest {
                continue;
            }
            let times = known
                .entry((scene.state.discrete_hash(), place))
                .or_default();
            let end = scene.state.earliest_end();
            if times.contains(&end) {
                continue;
            }
            times.push(end);
            self.move_to(place, &mut standing, &mut left);
            self.relaxed.horizon = latest;
            self.stepper.horizon = latest;
            evaluated += 1;
            if !ticker.evaluated() {
                break;
            }
            let Some(estimate) = self.relaxed.evaluate(&scene.state) else {
                continue;
            };
            let number = nodes.len();
            let needs = estimate.steps;
            nodes.push(Node {
                scene,
                place,
                parent,
                item,
            });
            if needs == 0
                && let Some(tail) = self.follow(&nodes[number], ticker)
            {
                found = Some((number, tail));
                break;
            }
            let rank = |random: &mut Random, cost: u32, order: u64| {
                (cost, order << 32 | random.next() >> 32)
            };
            // What is new comes first or last, by chance; what is left is taken as it stands.
            for &step in &estimate.preferred {
                let is_left = match step {
                    Step::Start(action) | Step::Compressed(action) => left.contains_key(&action),
                    Step::End(at) => {
                        let block = nodes[number].scene.open.get(at as usize);
                        let rest = &self.rest[place..];
                        block.is_some_and(|block| rest.iter().any(|item| item.block == *block))
                    }
                    Step::Timed => true,
                };
                if is_left {
                    continue;
                }
                if let Some((item, scene)) = self.make(&nodes[number].scene, step) {
                    let order = u64::from(self.random.once_in(4));
                    let cost = match step {
                        Step::Start(action) | Step::Compressed(action) => {
                            self.costs[action as usize]
                        }
                        _ => 1,
                    };
                    let key = rank(self.random, needs.saturating_sub(cost), order);
                    queue.insert(
                        key,
                        Waiting {
                            scene,
                            place,
                            parent: number,
                            item: Some(item),
                        },
                    );
                }
            }
            let Some(&next) = self.rest.get(place) else {
                continue;
            };
            let after = nodes[number].scene.after(self.stepper, next);
            let is_possible = after.is_some();
            if let Some(scene) = after {
                let key = rank(self.random, needs, 1);
                queue.insert(
                    key,
                    Waiting {
                        scene,
                        place: place + 1,
                        parent: number,
                        item: Some(next),
                    },
                );
            }
            let is_due = next.kind == Kind::Timed
                || next.kind == Kind::End && nodes[number].scene.open.contains(&next.block);
            if !is_due {
                let cost = if next.kind == Kind::End {
                    0
                } else {
                    self.costs[next.action as usize] / if is_possible { 1 } else { 2 }
                };
                let key = rank(self.random, needs + cost, 2);
                queue.insert(
                    key,
                    Waiting {
                        scene: nodes[number].scene.clone(),
                        place: place + 1,
                        parent: number,
                        item: None,
                    },
                );
            }
        }
        self.relaxed.set_costs(
            left.keys()
                .map(|&action| (action, self.costs[action as usize])),
        );
        let (mut number, tail) = found?;
        let mut items = Vec::new();
        while number != usize::MAX {
            items.extend(nodes[number].item);
            number = nodes[number].parent;
        }
        items.reverse();
        items.extend(tail);
        Some(items)
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
