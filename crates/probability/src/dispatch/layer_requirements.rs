//! Index of the layers of an order that fit, updated incrementally: [`LayerRequirements`].

use std::collections::BTreeMap;

use elbowroom_model::ground::FactId;
use elbowroom_plan::InstanceId;

use crate::search_state::SearchState;
use crate::total_order::TotalOrderPlan;

/// Boolean demands of the layers of an order, with the number of unmet demands of each layer.
/// Consecutive layers mostly have the same demands, so these are stored once for all of them. An
/// update takes time proportional to the logarithm of the order's length.
#[derive(Clone, Debug)]
pub(super) struct LayerRequirements {
    by_subject: BTreeMap<Subject, SubjectRequirement>,
    unmet: Counts,
    /// Actions that were running at the last update.
    running: Vec<InstanceId>,
}

/// Subject of a demand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Subject {
    /// The fact is more likely true than false.
    Fact(FactId),
    /// The action is running.
    Running(InstanceId),
}

#[derive(Clone, Debug, Default)]
struct SubjectRequirement {
    /// Present truth value.
    current: bool,
    /// Layers that demand `false`, and layers that demand `true`, as ranges from the first layer to
    /// before the last one.
    layers: [Vec<(usize, usize)>; 2],
}

impl LayerRequirements {
    /// Collects the demands of an order's layers before its happenings. Initially all facts are
    /// false and no action is running.
    pub(super) fn of(order: &TotalOrderPlan) -> Self {
        let count = order.sequence.len();
        let mut demands = Self {
            by_subject: BTreeMap::new(),
            unmet: Counts::new(count),
            running: Vec::new(),
        };
        for (position, layer) in order.layers.iter().take(count).enumerate() {
            for &(fact, truth) in &layer.literals {
                demands.add_requirement(Subject::Fact(fact), truth, position);
            }
            for &id in &layer.running {
                demands.add_requirement(Subject::Running(id), true, position);
            }
        }
        for (subject, demand) in &mut demands.by_subject {
            if let Subject::Running(_) = subject {
                demand.layers[0] = gaps(&demand.layers[1], count);
            }
            for &(from, to) in &demand.layers[1] {
                demands.unmet.add(from, to, 1);
            }
        }
        demands
    }

    fn add_requirement(&mut self, subject: Subject, truth: bool, position: usize) {
        let demand = self.by_subject.entry(subject).or_default();
        let wanted = &mut demand.layers[usize::from(truth)];
        match wanted.last_mut() {
            Some((_, to)) if *to == position => *to += 1,
            _ => wanted.push((position, position + 1)),
        }
    }

    /// Updates the truth values. Returns `true` if all running actions occur in the order.
    pub(super) fn observe(&mut self, circumstances: &SearchState) -> bool {
        let running = circumstances.running.iter();
        let running: Vec<InstanceId> = running.map(|running| running.instance).collect();
        for id in std::mem::replace(&mut self.running, running.clone()) {
            if !running.contains(&id) {
                self.set(Subject::Running(id), false);
            }
        }
        let mut knows_all = true;
        for id in running {
            knows_all &= self.set(Subject::Running(id), true);
        }
        for (subject, demand) in &mut self.by_subject {
            let Subject::Fact(fact) = *subject else {
                break;
            };
            let is_likely = circumstances.belief.probability(fact) >= 0.5;
            demand.set_current(is_likely, &mut self.unmet);
        }
        knows_all
    }

    /// Updates one truth value. Returns `true` if any layer has a requirement on the subject.
    fn set(&mut self, subject: Subject, is: bool) -> bool {
        let demand = self.by_subject.get_mut(&subject);
        if let Some(demand) = demand {
            demand.set_current(is, &mut self.unmet);
            return true;
        }
        false
    }

    /// Returns the position of the last layer before `before` with all these demands met.
    pub(super) fn last_met(&self, before: usize) -> Option<usize> {
        self.unmet.last_zero(before)
    }
}

impl SubjectRequirement {
    fn set_current(&mut self, is: bool, unmet: &mut Counts) {
        if std::mem::replace(&mut self.current, is) == is {
            return;
        }
        for &(from, to) in &self.layers[usize::from(!is)] {
            unmet.add(from, to, 1);
        }
        for &(from, to) in &self.layers[usize::from(is)] {
            unmet.add(from, to, -1);
        }
    }
}

/// Returns the gaps between these ranges, up to `count`.
fn gaps(ranges: &[(usize, usize)], count: usize) -> Vec<(usize, usize)> {
    let begins = std::iter::once(0).chain(ranges.iter().map(|(_, to)| *to));
    let ends = ranges.iter().map(|(from, _)| *from).chain([count]);
    begins.zip(ends).filter(|(from, to)| from < to).collect()
}

/// Segment tree over a sequence of non-negative numbers; adds to ranges.
#[derive(Clone, Debug)]
struct Counts {
    count: usize,
    /// The leaves are the last `width` nodes; the children of node `n` are `2 n` and `2 n + 1`.
    width: usize,
    /// By node: the amount added to all numbers below it, and the least sum below it, including
    /// this amount.
    added: Vec<i32>,
    least: Vec<i32>,
}

impl Counts {
    fn new(count: usize) -> Self {
        let width = count.next_power_of_two();
        Self {
            count,
            width,
            added: vec![0; 2 * width],
            least: vec![0; 2 * width],
        }
    }

    /// Adds to the numbers from `from` to before `to`.
    fn add(&mut self, from: usize, to: usize, amount: i32) {
        self.add_below(1, (0, self.width), (from, to), amount);
    }

    fn add_below(&mut self, node: usize, own: (usize, usize), range: (usize, usize), amount: i32) {
        if range.1 <= own.0 || own.1 <= range.0 {
            return;
        }
        if range.0 <= own.0 && own.1 <= range.1 {
            self.added[node] += amount;
            self.least[node] += amount;
            return;
        }
        let middle = usize::midpoint(own.0, own.1);
        self.add_below(2 * node, (own.0, middle), range, amount);
        self.add_below(2 * node + 1, (middle, own.1), range, amount);
        self.least[node] = self.added[node] + self.least[2 * node].min(self.least[2 * node + 1]);
    }

    /// Returns the position of the last 0 before `before`.
    fn last_zero(&self, before: usize) -> Option<usize> {
        self.zero_below(1, (0, self.width), before.min(self.count), 0)
    }

    fn zero_below(
        &self,
        node: usize,
        (from, to): (usize, usize),
        before: usize,
        added_above: i32,
    ) -> Option<usize> {
        if from >= before || added_above + self.least[node] > 0 {
            return None;
        }
        if to - from == 1 {
            return Some(from);
        }
        let added = added_above + self.added[node];
        let middle = usize::midpoint(from, to);
        let right = self.zero_below(2 * node + 1, (middle, to), before, added);
        right.or_else(|| self.zero_below(2 * node, (from, middle), before, added))
    }
}

#[cfg(test)]
mod tests {
    use super::{Counts, gaps};

    #[test]
    fn last_zero_matches_plain_list() {
        let mut seed: u32 = 7;
        let mut draw = |below: usize| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            usize::try_from(seed >> 8).unwrap() % below
        };
        for count in [1, 2, 3, 7, 8, 13] {
            let (mut counts, mut plain) = (Counts::new(count), vec![0; count]);
            let mut ranges: Vec<(usize, usize)> = Vec::new();
            for _ in 0..300 {
                let amount = if ranges.len() < 3 || draw(2) == 0 {
                    let from = draw(count);
                    ranges.push((from, from + 1 + draw(count - from)));
                    1
                } else {
                    let at = draw(ranges.len());
                    let last = ranges.len() - 1;
                    ranges.swap(at, last);
                    -1
                };
                let (from, to) = ranges[ranges.len() - 1];
                counts.add(from, to, amount);
                plain[from..to]
                    .iter_mut()
                    .for_each(|number| *number += amount);
                if amount < 0 {
                    ranges.pop();
                }
                for before in 0..=count + 1 {
                    let expected = (0..before.min(count)).rev().find(|&at| plain[at] == 0);
                    assert_eq!(counts.last_zero(before), expected, "{plain:?} {before}");
                }
            }
        }
    }

    #[test]
    fn gaps_are_complement_of_ranges() {
        assert_eq!(gaps(&[], 3), [(0, 3)]);
        assert_eq!(gaps(&[(0, 1), (2, 3)], 3), [(1, 2)]);
        assert_eq!(gaps(&[(1, 2)], 4), [(0, 1), (2, 4)]);
    }
}
