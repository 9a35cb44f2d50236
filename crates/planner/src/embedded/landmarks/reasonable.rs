//! Reasonable orders: one landmark is made true before another if the other would otherwise have to
//! be made true again.
//!
//! A landmark B *interferes* with A if A cannot be made true while B stays true: they are mutex, or
//! B is mutex with something that comes with A, or that A needs. Then A comes reasonably before B
//! if B is a goal, or if B must be true just before some landmark that comes after A anyway
//! (Hoffmann, Porteous & Sebastia, JAIR 22, 2004; Richter & Westphal, JAIR 39, 2010). A plan may
//! violate such an order.

use super::super::formula::{Literal, is_set, set};
use super::super::mutex::Mutexes;
use super::super::relaxed::{Graph, Labels};
use super::Landmarks;

/// Maximum number of landmarks for reasonable orders, whose computation takes quadratic time.
const MAX_ORDERED: usize = 1_000;

impl Landmarks {
    /// Adds reasonable orders between landmarks unless they form cycles, and sorts the landmarks
    /// accordingly.
    pub(crate) fn order_reasonably(&mut self, graph: &Graph, labels: &Labels, mutexes: &Mutexes) {
        if self.list.len() > MAX_ORDERED {
            return;
        }
        self.close();
        let around = self.context_literals(graph, labels);
        let count = u32::try_from(self.list.len()).unwrap_or(u32::MAX);
        for later in 0..count {
            let landmark = &self.list[later as usize];
            let Some(own) = self.literal(landmark.proposition) else {
                continue;
            };
            let mut candidates = vec![0_u64; landmark.after.len()];
            if landmark.is_goal {
                candidates.fill(u64::MAX);
            } else {
                for &by in &landmark.needed_by {
                    let after = &self.list[by as usize].after;
                    candidates
                        .iter_mut()
                        .zip(after)
                        .for_each(|(to, from)| *to |= from);
                }
            }
            for earlier in 0..count {
                let interferes = |literal: &Literal| mutexes.exclude(*literal, own);
                if earlier != later
                    && is_set(&candidates, earlier)
                    && !is_set(&self.list[earlier as usize].after, later)
                    && !is_set(&self.list[later as usize].after, earlier)
                    && around[earlier as usize].iter().any(interferes)
                {
                    self.order(earlier, later);
                }
            }
        }
        self.sort();
    }

    /// Computes the transitive closure of the orders.
    fn close(&mut self) {
        for number in 0..self.list.len() {
            let (before, rest) = self.list.split_at_mut(number);
            let after = &mut rest[0].after;
            for (earlier, other) in (0..).zip(before.iter()) {
                if is_set(after, earlier) {
                    after
                        .iter_mut()
                        .zip(&other.after)
                        .for_each(|(to, from)| *to |= from);
                }
            }
        }
    }

    fn literal(&self, proposition: u32) -> Option<Literal> {
        (proposition < self.first_test).then_some(Literal(proposition))
    }

    /// Returns for each landmark the literals that are true when it becomes true, or just before:
    /// the landmark, its preconditions, and the literals that become true together with it.
    fn context_literals(&self, graph: &Graph, labels: &Labels) -> Vec<Vec<Literal>> {
        let mut place = vec![None; graph.proposition_count];
        for (number, landmark) in self.list.iter().enumerate() {
            place[landmark.proposition as usize] = Some(number);
        }
        let mut with: Vec<Option<Vec<Literal>>> = vec![None; self.list.len()];
        labels.visit_achievers(graph, &mut |operator, proposition| {
            let Some(place) = place[proposition as usize] else {
                return;
            };
            let effects = &graph.effects[graph.operators[operator as usize].effects.clone()];
            match &mut with[place] {
                Some(with) => with.retain(|literal| effects.contains(&literal.0)),
                none => {
                    let literals = effects.iter().filter_map(|&effect| self.literal(effect));
                    *none = Some(literals.collect());
                }
            }
        });
        let mut around: Vec<Vec<Literal>> = with
            .into_iter()
            .map(Option::unwrap_or_default)
            .zip(&self.list)
            .map(|(mut with, landmark)| {
                // A fact that becomes false and true again in one step is true afterwards.
                let both = |one: &Literal, with: &[Literal]| {
                    with.contains(&Literal::new(one.fact(), !one.truth()))
                };
                let all = with.clone();
                with.retain(|literal| !both(literal, &all));
                with.extend(self.literal(landmark.proposition));
                with
            })
            .collect();
        for landmark in &self.list {
            for &by in &landmark.needed_by {
                around[by as usize].extend(self.literal(landmark.proposition));
            }
        }
        around
    }

    /// Orders one landmark, and all that precede it, before the other.
    fn order(&mut self, earlier: u32, later: u32) {
        let mut before = self.list[earlier as usize].after.clone();
        set(&mut before, earlier, true);
        for number in 0..self.list.len() {
            let landmark = &mut self.list[number];
            if number == later as usize || is_set(&landmark.after, later) {
                landmark
                    .after
                    .iter_mut()
                    .zip(&before)
                    .for_each(|(to, from)| *to |= from);
            }
        }
    }

    /// Sorts by the number of preceding landmarks.
    fn sort(&mut self) {
        let mut order: Vec<usize> = (0..self.list.len()).collect();
        let before = |number: &usize| -> u32 {
            let after = self.list[*number].after.iter();
            after.map(|word| word.count_ones()).sum()
        };
        order.sort_by_key(before);
        let mut place = vec![0; self.list.len()];
        for (new, &old) in (0..).zip(&order) {
            place[old] = new;
        }
        let sorted = order.iter().map(|&old| {
            let mut landmark = self.list[old].clone();
            landmark.after.fill(0);
            for (number, &new) in (0..).zip(&place) {
                if is_set(&self.list[old].after, number) {
                    set(&mut landmark.after, new, true);
                }
            }
            for by in &mut landmark.needed_by {
                *by = place[*by as usize];
            }
            landmark
        });
        self.list = sorted.collect();
    }
}
