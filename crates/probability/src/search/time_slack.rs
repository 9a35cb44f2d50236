//! Time that an order leaves for later happenings.
//!
//! Only a few happenings of an order influence the timing of later ones: the last one, the ends of
//! running actions, time zero (if there are absolute times), and happenings less than ε ago that
//! must be ε apart from some other one. The network of the order, projected on these time points,
//! is a small matrix of greatest differences. It is kept closed: a happening is added by relaxing
//! the paths through its new bounds. Points that are no longer relevant are dropped with their rows
//! and columns.

mod suffixes;

use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, Node, NodeId};

use super::separations::Separations;
use crate::model::Model;
use crate::search_state::SearchState;

pub(crate) use suffixes::{FirstWindow, Suffixes};

/// Projected networks ([`TimeSlack`]) of an order, one after each of its happenings.
#[derive(Clone, Debug)]
pub(super) struct TimeSlacks<'s> {
    separations: &'s Separations,
    now: TimeSlack,
    after: Vec<TimeSlack>,
}

/// A time point that constraints of later happenings may mention.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Point {
    Zero,
    Last,
    End(InstanceId),
    /// A happening that may be less than ε ago, and that must be ε apart from some other one.
    Recent(NodeId),
}

/// Projection of an order's network on the time points that are relevant for later happenings.
#[derive(Clone, Debug)]
pub(super) struct TimeSlack {
    points: Vec<Point>,
    /// Greatest difference from point to point, row by row; `None` if it is unbounded.
    distances: Vec<Option<Rational>>,
}

impl<'s> TimeSlacks<'s> {
    /// Returns the projection at present; `None` if the running actions leave no schedule.
    pub(super) fn new(separations: &'s Separations, circumstances: &SearchState) -> Option<Self> {
        let now = &circumstances.now;
        let mut room = TimeSlack {
            points: Vec::new(),
            distances: Vec::new(),
        };
        let zero = room.add(Point::Zero);
        let last = room.add(Point::Last);
        room.fix(zero, last, now)?;
        for (node, time) in &circumstances.recent {
            if separations.keeps_distance(*node) && time + &separations.epsilon > *now {
                room.drop_point(Point::Recent(*node));
                let own = room.add(Point::Recent(*node));
                room.fix(zero, own, time)?;
            }
        }
        for running in &circumstances.running {
            let end = room.add(Point::End(running.instance));
            let (earliest, latest) = separations.end_of(running, now);
            room.at_least(zero, end, &earliest)?;
            if let Some(latest) = latest {
                room.at_most(zero, end, &latest)?;
            }
        }
        Some(Self {
            separations,
            now: room,
            after: Vec::new(),
        })
    }

    fn last(&self) -> &TimeSlack {
        self.after.last().unwrap_or(&self.now)
    }

    /// Adds a happening, unless there is no time for it. `next_timed` is the number of timed
    /// initials before it. With `is_joined`, it comes at the same moment as the last one.
    pub(super) fn push(
        &mut self,
        model: &Model,
        (node, is_joined): (NodeId, bool),
        next_timed: usize,
    ) -> bool {
        let next = self.after_next(model, (node, is_joined), next_timed);
        let has_time = next.is_some();
        self.after.extend(next);
        has_time
    }

    /// Removes the last happening.
    pub(super) fn pop(&mut self) {
        self.after.pop();
    }

    fn after_next(
        &self,
        model: &Model,
        (node, is_joined): (NodeId, bool),
        next_timed: usize,
    ) -> Option<TimeSlack> {
        let separations = self.separations;
        let mut room = self.last().clone();
        let what = model.plan().nodes[node.index()];
        let zero = room.place(Point::Zero)?;
        let last = room.place(Point::Last)?;
        let own = match what {
            Node::End(id) => room.place(Point::End(id))?,
            _ => room.add(Point::Recent(node)),
        };
        room.at_least(last, own, &Rational::ZERO)?;
        if is_joined {
            room.at_most(last, own, &Rational::ZERO)?;
        }
        for place in 0..room.points.len() {
            match room.points[place] {
                Point::Recent(other)
                    if place != own && separations.must_be_separated(other, node) =>
                {
                    room.at_least(place, own, &separations.epsilon)?;
                }
                Point::End(_) if place != own => room.at_least(own, place, &Rational::ZERO)?,
                _ => {}
            }
        }
        if matches!(what, Node::Timed(_)) {
            let time = separations.time_of_next(node, next_timed)?;
            room.fix(zero, own, time)?;
        } else if let Some(latest) = separations.latest_before_timed(node, next_timed) {
            room.at_most(zero, own, &latest)?;
        }
        if let Node::Start(id) = what {
            let end = room.add(Point::End(id));
            let (shortest, longest) = &separations.durations[id.index()];
            room.at_least(own, end, shortest)?;
            if let Some(longest) = longest {
                room.at_most(own, end, longest)?;
            }
        }
        room.set_last(own, node, separations);
        Some(room)
    }

    /// Returns the relevant part of the present projection, with or without absolute times, with
    /// its points sorted. `None` if no part is relevant.
    pub(super) fn relevant_slack(&self, has_deadlines: bool) -> Option<TimeSlack> {
        let room = self.last();
        let is_end = |point: &Point| matches!(point, Point::End(_));
        if !has_deadlines && !room.points.iter().any(is_end) {
            return None;
        }
        let matters = |place: &usize| has_deadlines || room.points[*place] != Point::Zero;
        let mut places: Vec<usize> = (0..room.points.len()).filter(matters).collect();
        places.sort_unstable_by_key(|&place| room.points[place]);
        let row = |&from: &usize| {
            let distance = move |&to: &usize| room.distance(from, to).cloned();
            places.iter().map(distance)
        };
        Some(TimeSlack {
            distances: places.iter().flat_map(row).collect(),
            points: places.iter().map(|&place| room.points[place]).collect(),
        })
    }
}

impl TimeSlack {
    fn place(&self, point: Point) -> Option<usize> {
        self.points.iter().position(|own| *own == point)
    }

    fn distance(&self, from: usize, to: usize) -> Option<&Rational> {
        self.distances[from * self.points.len() + to].as_ref()
    }

    /// Adds an unconstrained point.
    fn add(&mut self, point: Point) -> usize {
        let old = self.points.len();
        self.points.push(point);
        let mut distances = Vec::with_capacity((old + 1) * (old + 1));
        let mut rest = std::mem::take(&mut self.distances).into_iter();
        for _ in 0..old {
            distances.extend(rest.by_ref().take(old));
            distances.push(None);
        }
        distances.extend((0..old).map(|_| None));
        distances.push(Some(Rational::ZERO));
        self.distances = distances;
        old
    }

    /// Drops all other points.
    fn retain(&mut self, keeps: impl Fn(usize) -> bool) {
        let count = self.points.len();
        let mut at = 0;
        self.distances.retain(|_| {
            let (from, to) = (at / count, at % count);
            at += 1;
            keeps(from) && keeps(to)
        });
        let mut at = 0;
        self.points.retain(|_| {
            at += 1;
            keeps(at - 1)
        });
    }

    /// Drops a point, if it is there.
    fn drop_point(&mut self, point: Point) {
        if let Some(place) = self.place(point) {
            self.retain(|other| other != place);
        }
    }

    fn fix(&mut self, from: usize, to: usize, difference: &Rational) -> Option<()> {
        self.at_most(from, to, difference)?;
        self.at_least(from, to, difference)
    }

    fn at_least(&mut self, from: usize, to: usize, difference: &Rational) -> Option<()> {
        self.at_most(to, from, &-difference)
    }

    /// Adds the bound `to - from <= difference`, and all implied ones. Returns `None` if it is
    /// inconsistent.
    fn at_most(&mut self, from: usize, to: usize, difference: &Rational) -> Option<()> {
        if self.distance(from, to).is_some_and(|old| old <= difference) {
            return Some(());
        }
        if let Some(back) = self.distance(to, from)
            && (back + difference).is_negative()
        {
            return None;
        }
        let count = self.points.len();
        // Only distances between points with a shorter path to `to` and points with a shorter path
        // from `from` can change.
        let before = |place: usize| {
            let sum = self.distance(place, from)? + difference;
            let old = self.distance(place, to);
            old.is_none_or(|old| sum < *old).then_some((place, sum))
        };
        let comes: Vec<(usize, Rational)> = (0..count).filter_map(before).collect();
        let after = |place: usize| {
            let rest = self.distance(to, place)?;
            let old = self.distance(from, place);
            let is_shorter = old.is_none_or(|old| difference + rest < *old);
            is_shorter.then(|| (place, rest.clone()))
        };
        let goes: Vec<(usize, Rational)> = (0..count).filter_map(after).collect();
        for (place, sum) in &comes {
            for (end, rest) in &goes {
                let length = sum + rest;
                let known = &mut self.distances[place * count + end];
                if known.as_ref().is_none_or(|known| length < *known) {
                    *known = Some(length);
                }
            }
        }
        Some(())
    }

    /// Makes a point the last happening, and drops irrelevant points.
    fn set_last(&mut self, own: usize, node: NodeId, separations: &Separations) {
        let nearest = -&separations.epsilon;
        let is_close: Vec<bool> = (0..self.points.len())
            .map(|place| match self.points[place] {
                Point::Zero | Point::End(_) => true,
                Point::Last => false,
                // A repeated happening replaces its previous occurrence.
                Point::Recent(other) if other == node => false,
                Point::Recent(_) => {
                    let latest = self.distance(own, place);
                    latest.is_none_or(|latest| *latest > nearest)
                }
            })
            .collect();
        self.points[own] = Point::Last;
        self.retain(|place| place == own || is_close[place]);
        if separations.keeps_distance(node) {
            self.duplicate_point(Point::Last, Point::Recent(node));
        }
    }

    /// Adds a point at the same time as another one.
    fn duplicate_point(&mut self, point: Point, again: Point) {
        let Some(place) = self.place(point) else {
            return;
        };
        let own = self.add(again);
        let count = self.points.len();
        for other in 0..own {
            self.distances[own * count + other] = self.distances[place * count + other].clone();
            self.distances[other * count + own] = self.distances[other * count + place].clone();
        }
    }

    /// Returns `true` if every continuation with a schedule in `other` has one here as well. The
    /// points of both are sorted.
    pub(super) fn contains(&self, other: &Self) -> bool {
        let is_wider = |own: &Option<Rational>, its: &Option<Rational>| match (own, its) {
            (None, _) => true,
            (Some(_), None) => false,
            (Some(own), Some(its)) => own >= its,
        };
        if self.points == other.points {
            let mut pairs = self.distances.iter().zip(&other.distances);
            return pairs.all(|(own, its)| is_wider(own, its));
        }
        let mut to_come = other.points.iter().enumerate();
        let mut place = |point: &Point| to_come.find(|(_, its)| *its == point).map(|(at, _)| at);
        let Some(places) = self
            .points
            .iter()
            .map(&mut place)
            .collect::<Option<Vec<_>>>()
        else {
            return false;
        };
        let count = other.points.len();
        let its = |&from: &usize| {
            let distance = move |&to: &usize| &other.distances[from * count + to];
            places.iter().map(distance)
        };
        let mut pairs = self.distances.iter().zip(places.iter().flat_map(its));
        pairs.all(|(own, its)| is_wider(own, its))
    }
}
