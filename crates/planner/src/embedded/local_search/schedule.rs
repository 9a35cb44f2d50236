//! Search for another order of the same actions.
//!
//! An order of priorities becomes a plan by a schedule generation scheme (Kolisch, EJOR 90, 1996).
//! The *serial* scheme applies choices in the given order, each as soon as it is applicable. The
//! *parallel* scheme advances through time: the start with the highest priority is applied unless a
//! running action ends before; then that end is applied. Both are changed at the critical path, by
//! exchanging an item with the one that delays it (van Laarhoven, Aarts & Lenstra, Operations
//! Research 40, 1992).

use super::super::apply::Stepper;
use super::super::compile::Compiled;
use super::super::network::SETTLED;
use super::super::search::is_goal;
use super::super::time::Ticks;
use super::WorkMeter;
use super::incumbent::Incumbent;
use super::random::Random;
use super::sequence::{Item, Kind, SequenceState};

/// Maximum number of items that wait for their conditions at the same time.
const MAX_WAITING: usize = 24;

/// Neighbourhood of reordered plans.
pub(super) struct Schedule<'a, 'b> {
    pub(super) compiled: &'a Compiled,
    pub(super) stepper: &'b mut Stepper<'a>,
    pub(super) random: &'b mut Random,
    pub(super) incumbent: &'b Incumbent,
}

impl Schedule<'_, '_> {
    /// Returns the items in another order, if they form a plan.
    pub(super) fn next(&mut self, ticker: &mut WorkMeter<'_>) -> Option<Vec<Item>> {
        if self.random.once_in(2) {
            let (items, first) = self.exchanged()?;
            return self.serial(&items, first, ticker);
        }
        let is_start = |item: &&Item| item.kind != Kind::End && item.kind != Kind::Timed;
        let items = self.incumbent.items.iter().filter(is_start);
        let mut starts: Vec<Item> = items.copied().collect();
        self.change_priorities(&mut starts);
        let window = [1, 2, 4, 8, 16, 64][self.random.below(6)];
        self.parallel(starts, window, ticker)
    }

    /// Returns an item of the critical path and the item of another instance that delays it.
    fn critical_pair(&mut self) -> Option<(Item, Item)> {
        let critical = &self.incumbent.critical;
        let pairs = critical.windows(2);
        let differ = |pair: &&[Item]| pair[0].block != pair[1].block;
        let pairs: Vec<&[Item]> = pairs.filter(differ).collect();
        let pair = self.random.of(&pairs)?;
        Some((pair[0], pair[1]))
    }

    /// Returns the items with one of the critical path moved before the one that delays it, and its
    /// new position.
    fn exchanged(&mut self) -> Option<(Vec<Item>, usize)> {
        let (later, earlier) = self.critical_pair()?;
        let mut items = self.incumbent.items.clone();
        let from = items.iter().position(|item| *item == later)?;
        let to = items.iter().position(|item| *item == earlier)?;
        if from < to {
            return None;
        }
        if self.random.once_in(2) {
            items.remove(from);
            items.insert(to, later);
        } else {
            items.remove(to);
            items.insert(from, earlier);
        }
        Some((items, to))
    }

    fn change_priorities(&mut self, starts: &mut Vec<Item>) {
        if self.random.once_in(8) {
            return;
        }
        let place = |starts: &[Item], block: u32| starts.iter().position(|s| s.block == block);
        let changes = 1 + self.random.below(3);
        for _ in 0..changes {
            let pair = self.critical_pair().and_then(|(later, earlier)| {
                Some((place(starts, later.block)?, place(starts, earlier.block)?))
            });
            let (from, to) = match pair.filter(|_| !self.random.once_in(4)) {
                Some(pair) => pair,
                None if starts.is_empty() => return,
                None => {
                    let from = self.random.below(starts.len());
                    (
                        from,
                        (from + 8).min(starts.len() - 1) - self.random.below(8).min(from),
                    )
                }
            };
            let moved = starts.remove(from);
            starts.insert(to, moved);
        }
    }

    /// Applies the items in order; inapplicable ones wait until they are applicable. Items that
    /// stay inapplicable are dropped if the goal is reached without them. Items before `first` are
    /// as in the plan.
    fn serial(
        &mut self,
        items: &[Item],
        first: usize,
        ticker: &mut WorkMeter<'_>,
    ) -> Option<Vec<Item>> {
        let mut scene =
            super::sequence_state_at(self.compiled, self.stepper, &items[..first], ticker)?;
        let mut order = items[..first].to_vec();
        let mut waiting: Vec<Item> = Vec::new();
        for &item in &items[first..] {
            ticker.count_step();
            let is_in_turn = waiting.iter().all(|other| other.block != item.block);
            let next = is_in_turn
                .then(|| scene.after(self.stepper, item))
                .flatten();
            let Some(next) = next else {
                waiting.push(item);
                if waiting.len() > MAX_WAITING {
                    return None;
                }
                continue;
            };
            scene = next;
            order.push(item);
            let mut place = 0;
            while place < waiting.len() {
                ticker.count_trial();
                if let Some(next) = scene.after(self.stepper, waiting[place]) {
                    scene = next;
                    order.push(waiting.remove(place));
                    place = 0;
                } else {
                    place += 1;
                }
            }
        }
        is_goal(self.compiled, &scene.state).then_some(order)
    }

    /// Advances through time. Of the first `window` waiting starts, it applies the first one that
    /// can start before an action ends.
    fn parallel(
        &mut self,
        mut starts: Vec<Item>,
        window: usize,
        ticker: &mut WorkMeter<'_>,
    ) -> Option<Vec<Item>> {
        let mut scene = SequenceState::initial(self.compiled);
        let mut order = Vec::new();
        loop {
            let mut ends = ends(&scene);
            let next_timed = self.compiled.timed.get(scene.state.timed as usize);
            let until = ends.first().map_or(Ticks::MAX, |end| end.0);
            let until = next_timed.map_or(until, |timed| until.min(timed.time));
            let mut chosen = None;
            for place in 0..starts.len().min(window) {
                ticker.count_trial();
                let Some(next) = scene.after(self.stepper, starts[place]) else {
                    continue;
                };
                // An action that starts while another one ends would delay that end.
                if start_time(&scene, &next) <= until - self.compiled.epsilon
                    && !prevents_end(self.compiled, &scene, &next)
                {
                    chosen = Some((starts.remove(place), next));
                    break;
                }
            }
            if chosen.is_none()
                && let Some(timed) = next_timed
                && ends.first().is_none_or(|end| timed.time <= end.0)
            {
                let item = Item::TIMED;
                chosen = scene.after(self.stepper, item).map(|next| (item, next));
            }
            while chosen.is_none() && !ends.is_empty() {
                ticker.count_step();
                let (_, item) = ends.remove(0);
                chosen = scene.after(self.stepper, item).map(|next| (item, next));
            }
            let Some((item, next)) = chosen else {
                break;
            };
            order.push(item);
            ticker.count_step();
            scene = next;
        }
        is_goal(self.compiled, &scene.state).then_some(order)
    }
}

/// Returns the ends of the running actions, the earliest first.
fn ends(scene: &SequenceState) -> Vec<(Ticks, Item)> {
    let open = scene.state.open.iter().zip(&scene.open);
    let mut ends: Vec<(Ticks, Item)> = open
        .map(|(open, &block)| {
            let start = if open.node == SETTLED {
                open.start
            } else {
                scene.state.network.earliest(open.node)
            };
            let item = Item {
                kind: Kind::End,
                action: open.action,
                block,
            };
            (start + open.least, item)
        })
        .collect();
    ends.sort_by_key(|(time, item)| (*time, item.block));
    ends
}

/// Returns `true` if the conditions allow some running action to end before the step, but not after
/// it.
fn prevents_end(compiled: &Compiled, before: &SequenceState, after: &SequenceState) -> bool {
    let can_end = |scene: &SequenceState, action: u32| {
        let condition = &compiled.snap(compiled.action(action).end).condition;
        let state = &scene.state;
        condition.holds(&state.facts, &mut |test| {
            let test_data = &compiled.tests[test as usize];
            test_data.difference.reads_duration() || state.test_holds(compiled, test, None)
        })
    };
    let mut open = before.state.open.iter();
    open.any(|open| can_end(before, open.action) && !can_end(after, open.action))
}

/// Returns the start time of the newly started action, as far as it is known.
fn start_time(before: &SequenceState, after: &SequenceState) -> Ticks {
    let new = after.open.iter().zip(&after.state.open);
    let mut new = new.filter(|(block, _)| !before.open.contains(block));
    match new.next() {
        Some((_, open)) if open.node == SETTLED => open.start,
        Some((_, open)) => after.state.network.earliest(open.node),
        // It is instantaneous.
        None => Ticks::MIN,
    }
}
