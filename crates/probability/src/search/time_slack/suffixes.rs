//! Time windows of the suffixes of an order: [`Suffixes`].
//!
//! The same as [`TimeSlacks`](super::TimeSlacks), computed backwards from the end. When a suffix
//! begins, the past constrains only few of its time points: zero, its first happening, the ends of
//! running actions, and happenings that may come less than ε after the first one. The network of
//! each suffix, projected on these points, is computed once from that of the next shorter suffix.
//! Combined with the observed times, it gives the window of the first happening, in time
//! proportional to the number of running actions, whatever the length of the suffix.

use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, Node, NodeId};

use super::super::separations::Separations;
use super::{Point, TimeSlack};
use crate::model::Model;
use crate::search_state::SearchState;
use crate::total_order::Slot;

/// If a suffix has more points than this, it and all longer ones are not projected: a matrix for
/// each position in an order would cost more than it saves.
const MAX_POINTS: usize = 40;

/// The suffixes of a sequence, by their first position.
#[derive(Clone, Debug)]
pub(crate) struct Suffixes {
    /// First position.
    from: usize,
    /// By position, from `from` on.
    by_position: Vec<SuffixNetwork>,
    /// Number of timed initials that have passed before each position, and at the end.
    timed_before: Vec<usize>,
}

/// Network of a suffix.
#[derive(Clone, Debug)]
enum SuffixNetwork {
    /// It has no schedule at any time.
    Never,
    Projected(TimeSlack),
    /// Too many actions are running at once.
    TooManyRunning,
}

/// Time window of a first happening.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum FirstWindow {
    /// The window.
    In(Slot),
    /// There is no schedule.
    Never,
    /// The suffixes are for another number of passed timed initials, or are not projected.
    Unknown,
}

impl Suffixes {
    /// Computes the suffixes of `sequence` from position `from` on. `passed` is the number of
    /// relevant timed initials before it; `running` are the running actions after the sequence.
    pub(crate) fn of(
        model: &Model,
        separations: &Separations,
        (sequence, from): (&[NodeId], usize),
        passed: usize,
        running: &[InstanceId],
    ) -> Self {
        let mut timed_before = vec![passed];
        for node in &sequence[from..] {
            let is_timed = matches!(model.plan().nodes[node.index()], Node::Timed(_));
            timed_before.push(timed_before[timed_before.len() - 1] + usize::from(is_timed));
        }
        let mut room = TimeSlack {
            points: Vec::new(),
            distances: Vec::new(),
        };
        room.add(Point::Zero);
        for id in running {
            room.add(Point::End(*id));
        }
        let mut rest = SuffixNetwork::Projected(room);
        let mut rests = Vec::with_capacity(sequence.len() - from);
        for position in (from..sequence.len()).rev() {
            let behind = sequence.get(position + 1).copied();
            let next_timed = timed_before[position - from];
            rest = match &rest {
                SuffixNetwork::Projected(room) => {
                    match room.before(model, separations, (sequence[position], behind), next_timed)
                    {
                        None => SuffixNetwork::Never,
                        Some(room) if room.points.len() > MAX_POINTS => {
                            SuffixNetwork::TooManyRunning
                        }
                        Some(room) => SuffixNetwork::Projected(room),
                    }
                }
                // Earlier happenings only add constraints.
                SuffixNetwork::Never => SuffixNetwork::Never,
                SuffixNetwork::TooManyRunning => SuffixNetwork::TooManyRunning,
            };
            rests.push(rest.clone());
        }
        rests.reverse();
        Self {
            from,
            by_position: rests,
            timed_before,
        }
    }

    /// Returns `true` if the suffixes are for `passed` timed initials before this position.
    pub(crate) fn matches(&self, position: usize, passed: usize) -> bool {
        position >= self.from && self.timed_before[position - self.from] == passed
    }

    /// Returns `true` if timed initials are part of the suffix.
    pub(crate) fn has_timed(&self, position: usize) -> bool {
        let before = position.checked_sub(self.from);
        before.is_none_or(|before| Some(&self.timed_before[before]) != self.timed_before.last())
    }

    /// Returns the window of the happening at this position, if the suffix begins now. The running
    /// actions must be those of the order there.
    pub(crate) fn first(
        &self,
        separations: &Separations,
        (sequence, position): (&[NodeId], usize),
        circumstances: &SearchState,
    ) -> FirstWindow {
        let Some(rest) = position.checked_sub(self.from) else {
            return FirstWindow::Unknown;
        };
        match &self.by_position[rest] {
            SuffixNetwork::Never => FirstWindow::Never,
            SuffixNetwork::TooManyRunning => FirstWindow::Unknown,
            SuffixNetwork::Projected(room) => {
                let first =
                    room.clone()
                        .first_window_at(separations, sequence[position], circumstances);
                first.map_or(FirstWindow::Never, FirstWindow::In)
            }
        }
    }
}

impl TimeSlack {
    /// Returns the network of a suffix with one more happening in front; `behind` is the previous
    /// first one. Returns `None` if it has no schedule.
    fn before(
        &self,
        model: &Model,
        separations: &Separations,
        (node, behind): (NodeId, Option<NodeId>),
        next_timed: usize,
    ) -> Option<Self> {
        let mut room = self.clone();
        let what = model.plan().nodes[node.index()];
        let zero = room.place(Point::Zero)?;
        if let (Some(behind), Some(place)) = (behind, room.place(Point::Last)) {
            room.points[place] = Point::Recent(behind);
        }
        let own = room.add(Point::Last);
        for place in 0..own {
            match room.points[place] {
                Point::Recent(other) if separations.must_be_separated(node, other) => {
                    room.at_least(own, place, &separations.epsilon)?;
                }
                Point::Recent(other) if Some(other) == behind => {
                    room.at_least(own, place, &Rational::ZERO)?;
                }
                Point::End(_) => room.at_least(own, place, &Rational::ZERO)?,
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
            if let Some(end) = room.place(Point::End(id)) {
                let (shortest, longest) = &separations.durations[id.index()];
                room.at_least(own, end, shortest)?;
                if let Some(longest) = longest {
                    room.at_most(own, end, longest)?;
                }
            }
            room.drop_point(Point::End(id));
        }
        room.drop_distant(separations);
        if let Node::End(id) = what {
            room.duplicate_point(Point::Last, Point::End(id));
        }
        Some(room)
    }

    /// Drops happenings that are always at least ε after the first one, and those that need no
    /// separation from any other one.
    fn drop_distant(&mut self, separations: &Separations) {
        let Some(first) = self.place(Point::Last) else {
            return;
        };
        let nearest = -&separations.epsilon;
        let is_near: Vec<bool> = (0..self.points.len())
            .map(|place| match self.points[place] {
                Point::Recent(other) => {
                    let back = self.distance(place, first);
                    separations.keeps_distance(other) && back.is_none_or(|back| *back > nearest)
                }
                Point::Zero | Point::Last | Point::End(_) => true,
            })
            .collect();
        self.retain(|place| is_near[place]);
    }

    /// Returns the window of the first happening of a suffix that begins in these circumstances.
    fn first_window_at(
        mut self,
        separations: &Separations,
        node: NodeId,
        circumstances: &SearchState,
    ) -> Option<Slot> {
        let (zero, first) = (self.place(Point::Zero)?, self.place(Point::Last)?);
        let now = &circumstances.now;
        self.at_least(zero, first, now)?;
        // Points that are not near come at least ε after the present time.
        for (recent, time) in &circumstances.recent {
            let apart = time + &separations.epsilon;
            for place in 0..self.points.len() {
                let other = match self.points[place] {
                    Point::Last => node,
                    Point::Recent(other) => other,
                    Point::Zero | Point::End(_) => continue,
                };
                if separations.must_be_separated(*recent, other) {
                    self.at_least(zero, place, &apart)?;
                }
            }
        }
        for running in &circumstances.running {
            let end = self.place(Point::End(running.instance))?;
            let (earliest, latest) = separations.end_of(running, now);
            self.at_least(zero, end, &earliest)?;
            if let Some(latest) = latest {
                self.at_most(zero, end, &latest)?;
            }
        }
        Some(Slot {
            node,
            earliest: self
                .distance(first, zero)
                .map(|back| -back)
                .unwrap_or_default(),
            latest: self.distance(zero, first).cloned(),
        })
    }
}
