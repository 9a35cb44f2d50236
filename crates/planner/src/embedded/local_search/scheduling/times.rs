//! Times of happenings under retractable distances: difference logic as the theory of a search over
//! orders, with the longest paths as explanations (Nieuwenhuis & Oliveras, "DPLL(T) with exhaustive
//! theory propagation and its application to difference logic", CAV 2005).
//!
//! Each happening has two *places*: one for its earliest time, and one for the negated latest time.
//! So both values only grow, and they contradict each other if their sum is positive.

use std::collections::VecDeque;

use super::super::super::time::{NEVER, Ticks};

/// No literal, change or place.
pub(super) const NONE: u32 = u32::MAX;

/// `to >= from + distance`, where `from` and `to` are happenings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Edge {
    pub(super) from: u32,
    pub(super) to: u32,
    pub(super) distance: Ticks,
}

impl Edge {
    /// Returns the places of the earliest time of `from` and of the latest one of `to`. The edge is
    /// impossible if their values and the distance sum up to more than zero.
    pub(super) fn places(self) -> [u32; 2] {
        [2 * self.from, 2 * self.to + 1]
    }
}

/// Propagation edge to a place, and the literal that asserts it.
#[derive(Clone, Copy, Debug)]
struct Link {
    to: u32,
    distance: Ticks,
    literal: u32,
}

/// A change of a place's value.
#[derive(Clone, Copy, Debug)]
struct Change {
    place: u32,
    value: Ticks,
    /// The place that caused the change; [`NONE`] for a bound.
    from: u32,
    distance: Ticks,
    literal: u32,
    /// The previous change of the same place.
    before: u32,
}

/// Bounds on the times of happenings under a set of edges.
#[derive(Debug, Default)]
pub(super) struct Times {
    /// The latest change of each place.
    newest: Vec<u32>,
    /// The value of each place.
    values: Vec<Ticks>,
    /// For each happening, `true` if it counts for the end.
    counts: Vec<bool>,
    changes: Vec<Change>,
    links: Vec<Vec<Link>>,
    waiting: VecDeque<u32>,
    is_waiting: Vec<bool>,
    /// The places that have changed since the list was last emptied.
    pub(super) changed: Vec<u32>,
    pub(super) work: u64,
}

/// Literals that cannot all be true.
pub(super) type Contradiction = Vec<u32>;

impl Times {
    /// Adds a happening with a time window. A happening with a fixed time does not count for the
    /// end of all.
    pub(super) fn add(&mut self, earliest: Ticks, latest: Ticks) {
        self.counts.push(earliest < latest);
        for value in [earliest, -latest] {
            let place = u32::try_from(self.newest.len()).unwrap_or(NONE);
            self.newest.push(NONE);
            self.values.push(value);
            self.links.push(Vec::new());
            self.is_waiting.push(false);
            self.set(place, value, (NONE, 0, NONE));
        }
    }

    /// Narrows the window of a happening, before any edges are added.
    pub(super) fn bound(&mut self, node: u32, earliest: Ticks, latest: Ticks) {
        for (place, value) in [(2 * node, earliest), (2 * node + 1, -latest)] {
            if value > self.value(place) {
                self.set(place, value, (NONE, 0, NONE));
            }
        }
    }

    /// Returns the value of a place.
    pub(super) fn value(&self, place: u32) -> Ticks {
        self.values[place as usize]
    }

    /// Returns the earliest time of a happening.
    pub(super) fn earliest(&self, node: u32) -> Ticks {
        self.value(2 * node)
    }

    /// Returns the earliest time at which all happenings are over.
    pub(super) fn earliest_end(&self) -> Ticks {
        let nodes = (0..).zip(&self.counts).filter(|node| *node.1);
        let times = nodes.map(|(node, _)| self.earliest(node));
        times.max().unwrap_or(-NEVER)
    }

    /// Returns the number of changes.
    pub(super) fn clock(&self) -> u32 {
        u32::try_from(self.changes.len()).unwrap_or(NONE)
    }

    fn set(&mut self, place: u32, value: Ticks, (from, distance, literal): (u32, Ticks, u32)) {
        let clock = self.clock();
        let before = std::mem::replace(&mut self.newest[place as usize], clock);
        self.values[place as usize] = value;
        self.changes.push(Change {
            place,
            value,
            from,
            distance,
            literal,
            before,
        });
        self.changed.push(place);
        if !std::mem::replace(&mut self.is_waiting[place as usize], true) {
            self.waiting.push_back(place);
        }
    }

    /// Adds an edge that holds as long as the literal does.
    pub(super) fn assert(&mut self, edge: Edge, literal: u32) -> Result<(), Contradiction> {
        let Edge { from, to, distance } = edge;
        self.begin();
        let pushes = [(2 * from, 2 * to), (2 * to + 1, 2 * from + 1)];
        for (source, target) in pushes {
            self.links[source as usize].push(Link {
                to: target,
                distance,
                literal,
            });
        }
        for (source, target) in pushes {
            self.raise(source, target, distance, literal, NONE)?;
            self.settle(source)?;
        }
        Ok(())
    }

    /// Requires that all happenings end by `latest`, as long as the literal holds.
    pub(super) fn limit_end(&mut self, latest: Ticks, literal: u32) -> Result<(), Contradiction> {
        self.begin();
        for place in (1..).step_by(2).take(self.newest.len() / 2) {
            if self.counts[place as usize / 2] && -latest > self.value(place) {
                self.set(place, -latest, (NONE, 0, literal));
                self.meet(place)?;
            }
        }
        self.settle(NONE)
    }

    /// Empties the queue, which a contradiction may have left non-empty.
    fn begin(&mut self) {
        for place in self.waiting.drain(..) {
            self.is_waiting[place as usize] = false;
        }
    }

    /// Propagates until no value changes. A change of `origin` closes a positive cycle.
    fn settle(&mut self, origin: u32) -> Result<(), Contradiction> {
        while let Some(place) = self.waiting.pop_front() {
            self.is_waiting[place as usize] = false;
            for number in 0..self.links[place as usize].len() {
                let link = self.links[place as usize][number];
                self.work += 1;
                self.raise(place, link.to, link.distance, link.literal, origin)?;
            }
        }
        Ok(())
    }

    fn raise(
        &mut self,
        from: u32,
        to: u32,
        distance: Ticks,
        literal: u32,
        origin: u32,
    ) -> Result<(), Contradiction> {
        let value = self.value(from) + distance;
        if value <= self.value(to) {
            return Ok(());
        }
        self.work += 1;
        self.set(to, value, (from, distance, literal));
        if to == origin {
            return Err(self.cycle(to));
        }
        self.meet(to)
    }

    /// Checks that the earliest time of a happening is no later than its latest one.
    fn meet(&self, place: u32) -> Result<(), Contradiction> {
        let other = self.value(place ^ 1);
        if self.value(place) + other <= 0 {
            return Ok(());
        }
        let mut reasons = Vec::new();
        self.explain(place, 1 - other, NONE, &mut reasons);
        self.explain(place ^ 1, other, NONE, &mut reasons);
        Err(reasons)
    }

    /// Returns the literals of the cycle that has just changed its origin.
    fn cycle(&self, origin: u32) -> Contradiction {
        let mut reasons = Vec::new();
        let mut place = origin;
        let mut clock = self.clock();
        loop {
            let number = self.at(place, clock);
            let change = self.changes[number as usize];
            if change.from == NONE {
                break;
            }
            if change.literal != NONE {
                reasons.push(change.literal);
            }
            (place, clock) = (change.from, number);
            if place == origin {
                break;
            }
        }
        reasons
    }

    /// Returns the latest change of a place before this clock value.
    fn at(&self, place: u32, clock: u32) -> u32 {
        let mut number = self.newest[place as usize];
        while number >= clock {
            number = self.changes[number as usize].before;
        }
        number
    }

    /// Returns the value of a place before this clock value.
    pub(super) fn value_at(&self, place: u32, clock: u32) -> Ticks {
        self.changes[self.at(place, clock) as usize].value
    }

    /// Adds the literals because of which a place had at least this value before this clock value.
    /// Uses the path that reached the value first, so that the explanation is more general.
    pub(super) fn explain(&self, place: u32, needed: Ticks, clock: u32, reasons: &mut Vec<u32>) {
        let (mut place, mut needed, mut clock) = (place, needed, clock);
        loop {
            let mut number = self.at(place, clock);
            loop {
                let before = self.changes[number as usize].before;
                if before == NONE || self.changes[before as usize].value < needed {
                    break;
                }
                number = before;
            }
            let change = self.changes[number as usize];
            if change.literal != NONE {
                reasons.push(change.literal);
            }
            if change.from == NONE {
                return;
            }
            (place, needed, clock) = (change.from, needed - change.distance, number);
        }
    }

    /// Reverts the changes since this clock value.
    pub(super) fn undo(&mut self, clock: u32) {
        for number in (clock as usize..self.changes.len()).rev() {
            let change = self.changes[number];
            let place = change.place as usize;
            self.newest[place] = change.before;
            self.values[place] = self.changes[change.before as usize].value;
        }
        self.changes.truncate(clock as usize);
        self.changed.clear();
    }

    /// Removes an edge; edges are removed in reverse order.
    pub(super) fn retract(&mut self, edge: Edge) {
        self.links[2 * edge.from as usize].pop();
        self.links[2 * edge.to as usize + 1].pop();
    }
}

/// No bound on a time.
pub(super) const UNBOUNDED: Ticks = NEVER;
