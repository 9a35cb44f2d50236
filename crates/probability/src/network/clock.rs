//! Times of the happenings of an order, and changes of facts between them.
//!
//! An order does not contain times. If facts change with time, each happening is assumed to be as
//! early as possible after the previous one: an end after the least duration of its action, timed
//! initials at their time, a start at once. These are the times of an executor that follows the
//! order without deviations, except that separations of ε are ignored.

use elbowroom_num::Rational;
use elbowroom_plan::{Node, NodeId};

use super::{LossCause, PrunedNetwork, Reading, TooCoupled};

/// Present time and ends of running actions.
#[derive(Clone, Debug)]
pub(super) struct Clock {
    /// Time of the last happening, in seconds.
    pub(super) now: f64,
    /// Ends of the running actions, in the same order.
    pub(super) ends: Vec<f64>,
}

impl Clock {
    pub(super) fn at(now: &Rational) -> Self {
        Self {
            now: now.to_f64(),
            ends: Vec::new(),
        }
    }
}

/// Times closer than this, in seconds, count as equal in comparisons of orders.
const TIME_TOLERANCE: f64 = 1e-9;

impl PrunedNetwork<'_> {
    /// Advances the time to a happening. Running actions may fail, and their over-all conditions
    /// must hold without interruption: a fact must not change and change back. Other facts change
    /// by themselves.
    pub(super) fn advance_to(&mut self, node: NodeId) -> Result<(), TooCoupled> {
        let model = self.model;
        if !model.has_rates() {
            return Ok(());
        }
        let due = match model.plan().nodes[node.index()] {
            Node::End(id) => {
                let place = self.running.iter().position(|running| *running == id);
                place.map_or(self.clock.now, |place| self.clock.ends[place])
            }
            Node::Timed(index) => model.task().timed()[index].time.to_f64(),
            Node::Start(_) | Node::Instant(_) | Node::Zero => self.clock.now,
        };
        let seconds = due - self.clock.now;
        if seconds <= 0.0 {
            return Ok(());
        }
        self.clock.now = due;
        let mut held: Vec<(usize, bool)> = Vec::new();
        for place in 0..self.running.len() {
            let id = self.running[place];
            let failures = model.event(model.start(id)).failures_per_second;
            if failures > 0.0 {
                let lasts = (-failures * seconds).exp();
                let reading = Reading::Throughout(id);
                self.multiply(lasts, (node, reading), || LossCause::During);
            }
            for &(fact, truth) in &model.event(model.start(id)).over_all.literals {
                if held.iter().any(|(other, _)| *other == fact) {
                    continue;
                }
                held.push((fact, truth));
                let lasts = model.rates[fact].unchanged_probability(truth, seconds);
                let fact = model.facts[fact];
                self.multiply(lasts, (node, Reading::Throughout(id)), || LossCause::Fact {
                    fact,
                    truth,
                });
            }
        }
        self.facts.advance(seconds, &held);
        self.require_throughout(node)
    }

    /// Returns the data that determines the times of later happenings, for comparison with another
    /// order that has the same happenings: the remaining durations of running actions, and, if
    /// `is_on_the_clock`, the present time.
    pub(crate) fn pending_times(&self, is_on_the_clock: bool) -> Vec<i64> {
        if !self.model.has_rates() {
            return Vec::new();
        }
        #[allow(
            clippy::cast_possible_truncation,
            reason = "casts saturate, and nobody waits for centuries"
        )]
        let rounded = |seconds: f64| (seconds / TIME_TOLERANCE).round() as i64;
        let mut ends: Vec<_> = self.running.iter().zip(&self.clock.ends).collect();
        ends.sort_by_key(|(id, _)| **id);
        let rests = ends.iter().map(|(_, end)| (*end - self.clock.now).max(0.0));
        let now = is_on_the_clock.then_some(self.clock.now);
        rests.chain(now).map(rounded).collect()
    }
}
