//! Later starts in an order, where its probability stays the same.

use elbowroom_plan::{InstanceId, Node, NodeId};

use super::OrderSearch;
use super::run::TIE;
use crate::circumstances::Circumstances;
use crate::model::Event;
use crate::network::{Happenings, PrunedNetwork, TooCoupled};

impl OrderSearch {
    /// Moves starts behind ends that may go wrong and on whose effects the end of the started action depends.
    ///
    /// The probability of an order does not count retries, so an order that starts both actions first is as likely. But
    /// when the first end goes wrong there, the second action fails with it, and its failure may be beyond repair. A
    /// start stays where the order would be less likely or have no time otherwise.
    pub(super) fn postponed(
        &self,
        circumstances: &Circumstances,
        (sequence, probability): (Vec<NodeId>, f64),
    ) -> Result<Vec<NodeId>, TooCoupled> {
        let mut sequence = sequence;
        let mut position = 0;
        while position < sequence.len() {
            let moved = match self.last_end_awaited(&sequence, position) {
                Some(end) => self.moved(&sequence, position, end),
                None => None,
            };
            match moved {
                Some(moved) if self.is_as_likely(circumstances, &moved, probability)? => {
                    // Another happening is here now.
                    sequence = moved;
                }
                _ => position += 1,
            }
        }
        Ok(sequence)
    }

    /// The position of the last uncertain end that the end of the action needs which starts at `position`.
    fn last_end_awaited(&self, sequence: &[NodeId], position: usize) -> Option<usize> {
        let Node::Start(own) = self.model.plan().nodes[sequence[position].index()] else {
            return None;
        };
        let own_end = self.model.end(own);
        let until = sequence.iter().position(|node| *node == own_end)?;
        let needed = &self.model.event(own_end).condition.literals;
        (position + 1..until).rev().find(|&at| {
            let Node::End(other) = self.model.plan().nodes[sequence[at].index()] else {
                return false;
            };
            let event = self.model.event(sequence[at]);
            let mut supporting = event.effects.iter();
            supporting.any(|effect| {
                needed.contains(&(effect.fact, effect.makes_true))
                    && (effect.probability < 1.0 || self.may_fail(other, event))
            })
        })
    }

    /// Returns `true` if an action may fail after its start.
    fn may_fail(&self, id: InstanceId, end: &Event) -> bool {
        let start = self.model.event(self.model.start(id));
        end.success < 1.0 || start.failures_per_second > 0.0
    }

    /// The sequence with the happening at `from` right behind the one at `to`; `None` where the plan's links forbid it.
    fn moved(&self, sequence: &[NodeId], from: usize, to: usize) -> Option<Vec<NodeId>> {
        let start = sequence[from];
        let mut passed = sequence[from + 1..=to].iter();
        if !passed.all(|node| self.separations.may_precede(*node, start)) {
            return None;
        }
        let mut moved = sequence.to_vec();
        moved[from..=to].rotate_left(1);
        Some(moved)
    }

    /// Returns `true` if a sequence has time and at least this probability.
    fn is_as_likely(
        &self,
        circumstances: &Circumstances,
        sequence: &[NodeId],
        probability: f64,
    ) -> Result<bool, TooCoupled> {
        if self
            .windows_of(circumstances, Happenings::from(sequence))
            .is_none()
        {
            return Ok(false);
        }
        let mut network = PrunedNetwork::new(&self.model, circumstances)?;
        network.push_all(Happenings::from(sequence))?;
        Ok(network.success_probability()? >= probability * (1.0 - TIE))
    }
}
