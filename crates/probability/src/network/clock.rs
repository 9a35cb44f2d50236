//! When the happenings of an order are, and what becomes of facts between them.
//!
//! An order says nothing of times. Where facts change with time, each happening is taken to be as
//! early as it can after the one before it: an end when its action has lasted as long as it must,
//! timed initials at their time, a start at once. That is how an executor that follows the order
//! gets along if nothing deviates; what is kept ε apart is at the same time here.

use elbowroom_num::Rational;
use elbowroom_plan::{Node, NodeId};

use super::{LossCause, PrunedNetwork, Reading, TooCoupled};

/// See the module.
#[derive(Clone, Debug)]
pub(super) struct Clock {
    /// In seconds: the time of the last happening.
    pub(super) now: f64,
    /// When the actions under way end, in the order in which they stand there.
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

/// Times closer than this, in seconds, are the same to those who compare orders.
const SAME: f64 = 1e-9;

impl PrunedNetwork<'_> {
    /// Time passes until a happening. What is under way may fail, and what is required throughout
    /// it must last: a fact that changes and changes back has not. Other facts change by themselves.
    pub(super) fn pass(&mut self, node: NodeId) -> Result<(), TooCoupled> {
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
                let lasts = model.rates[fact].lasting(truth, seconds);
                let fact = model.facts[fact];
                self.multiply(lasts, (node, Reading::Throughout(id)), || LossCause::Fact {
                    fact,
                    truth,
                });
            }
        }
        self.facts.pass(seconds, &held);
        self.require_throughout(node)
    }

    /// All that can matter to the times of what follows, for comparison with another order that has
    /// done the same: how long the actions under way still take, and, where `is_on_the_clock`, now.
    pub(crate) fn times_to_come(&self, is_on_the_clock: bool) -> Vec<i64> {
        if !self.model.has_rates() {
            return Vec::new();
        }
        #[allow(
            clippy::cast_possible_truncation,
            reason = "casts saturate, and nobody waits for centuries"
        )]
        let rounded = |seconds: f64| (seconds / SAME).round() as i64;
        let mut ends: Vec<_> = self.running.iter().zip(&self.clock.ends).collect();
        ends.sort_by_key(|(id, _)| **id);
        let rests = ends.iter().map(|(_, end)| (*end - self.clock.now).max(0.0));
        let now = is_on_the_clock.then_some(self.clock.now);
        rests.chain(now).map(rounded).collect()
    }
}
