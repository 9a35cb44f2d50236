//! Known reasons for rejecting wider boxes: [`CutPool`].

use std::cmp::Ordering;
use std::collections::BTreeSet;
use std::ops::Range;

use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope};

use crate::cut::{Cut, Ground};
use crate::row::Row;

/// The cuts that a search has found, and the slack of each in the present box, which is inside the
/// envelope.
///
/// Queries are about wider boxes only, so a cut that rejects a box with one end moved contains that
/// end in one of its rows. An index by end and the slack of each row make a query cheap, whatever
/// the number of parameters in a cut.
#[derive(Clone, Debug, Default)]
pub(crate) struct CutPool {
    cuts: Vec<PooledCut>,
    rows: Vec<Row>,
    /// The slack of each row; `None` if the row does not hold because it contains an infinite end.
    slack: Vec<Option<Rational>>,
    /// By end ([`place`]), and then by cut: the rows that contain it.
    mentions: Vec<Vec<EndOccurrence>>,
    /// Ends that cannot be infinite.
    finite: BTreeSet<BoxEnd>,
    /// The present box, if it is known.
    current_box: Option<DecoupledEnvelope>,
    /// The slack in the settled box of those rows that have changed since the box was settled.
    settled_slack: Vec<(usize, Option<Rational>)>,
    /// For each row, `true` if it has changed since the box was settled.
    has_changed: Vec<bool>,
}

/// Rows, at least one of which has to hold.
#[derive(Clone, Debug)]
struct PooledCut {
    rows: Range<usize>,
    /// Proof of the cut; `None` if the condition is only wanted.
    ground: Option<Ground>,
}

/// Row that contains an end.
#[derive(Clone, Debug)]
struct EndOccurrence {
    cut: usize,
    row: usize,
    factor: Rational,
}

impl CutPool {
    /// Adds a cut. `envelope` is the present box, which is settled.
    pub(crate) fn add(&mut self, cut: Cut, envelope: &DecoupledEnvelope) {
        self.add_rows(cut.rows, Some(cut.ground), envelope);
    }

    /// Adds a condition that the search wants boxes to satisfy, although boxes inside the envelope
    /// need not.
    pub(crate) fn add_condition(&mut self, row: Row, envelope: &DecoupledEnvelope) {
        self.add_rows(vec![row], None, envelope);
    }

    fn add_rows(&mut self, rows: Vec<Row>, ground: Option<Ground>, envelope: &DecoupledEnvelope) {
        self.current_box = None;
        let (cut, first) = (self.cuts.len(), self.rows.len());
        for (offset, row) in rows.iter().enumerate() {
            for (end, factor) in &row.factors {
                let place = end_index(*end);
                if place >= self.mentions.len() {
                    self.mentions.resize_with(place + 1, Vec::new);
                }
                let mentions = &mut self.mentions[place];
                // Most ends occur in one row or two.
                if mentions.len() == mentions.capacity() {
                    mentions.reserve_exact(mentions.len().max(1));
                }
                mentions.push(EndOccurrence {
                    cut,
                    row: first + offset,
                    factor: factor.clone(),
                });
            }
            self.slack.push(row_slack(row, envelope));
            self.has_changed.push(false);
        }
        self.rows.extend(rows);
        let rows = first..self.rows.len();
        self.cuts.push(PooledCut { rows, ground });
    }

    /// Records that the end cannot be infinite, in this box and in all wider ones.
    pub(crate) fn set_finite(&mut self, end: BoxEnd) {
        self.finite.insert(end);
    }

    /// Makes this the present box, if it was another.
    pub(crate) fn set_current_box(&mut self, envelope: &DecoupledEnvelope) {
        if self.current_box.as_ref() != Some(envelope) {
            self.commit();
            self.slack = self
                .rows
                .iter()
                .map(|row| row_slack(row, envelope))
                .collect();
            self.current_box = Some(envelope.clone());
        }
    }

    /// Settles the present box: [`undo`](Self::undo) returns to it.
    pub(crate) fn commit(&mut self) {
        for (row, _) in self.settled_slack.drain(..) {
            self.has_changed[row] = false;
        }
    }

    /// Returns to the box that was settled last; initially that of the first cut.
    pub(crate) fn rollback(&mut self) {
        self.current_box = None;
        for (row, room) in self.settled_slack.drain(..) {
            self.slack[row] = room;
            self.has_changed[row] = false;
        }
    }

    /// Returns `true` if the present box with an end moved out from `from` to `to` is known to be
    /// outside the envelope, or is not wanted. `None` is infinitely far.
    pub(crate) fn refuses(&self, end: BoxEnd, from: &Rational, to: Option<&Rational>) -> bool {
        to.is_none() && self.finite.contains(&end) || self.refusing_rows(end, from, to).is_some()
    }

    /// Returns the rows that reject that box, and the proof that one of them has to hold.
    pub(crate) fn refusing_rows(
        &self,
        end: BoxEnd,
        from: &Rational,
        to: Option<&Rational>,
    ) -> Option<(&[Row], Option<&Ground>)> {
        let mentions = self.mentions.get(end_index(end))?;
        let farther = to.map(|to| to - from);
        let mut cuts = mentions.chunk_by(|one, other| one.cut == other.cut);
        let found = cuts.find(|mentions| {
            let mut rows = self.cuts[mentions[0].cut].rows.clone();
            !rows.any(|row| {
                let mention = mentions.iter().find(|mention| mention.row == row);
                let left = match (&self.slack[row], mention, &farther) {
                    (None, ..) | (_, Some(_), None) => return false,
                    (Some(room), None, _) => room.cmp(&Rational::ZERO),
                    (Some(room), Some(mention), Some(farther)) => {
                        room.cmp(&(&mention.factor * farther))
                    }
                };
                left == Ordering::Greater || left == Ordering::Equal && !self.rows[row].is_strict
            })
        });
        let cut = &self.cuts[found?[0].cut];
        Some((&self.rows[cut.rows.clone()], cut.ground.as_ref()))
    }

    /// Moves this end of the present box out.
    pub(crate) fn apply_move(&mut self, end: BoxEnd, from: &Rational, to: Option<&Rational>) {
        self.current_box = None;
        let farther = to.map(|to| to - from);
        for mention in self.mentions.get(end_index(end)).into_iter().flatten() {
            let room = &mut self.slack[mention.row];
            let less = match (&*room, &farther) {
                (Some(room), Some(farther)) => Some(room - &(&mention.factor * farther)),
                _ => None,
            };
            let before = std::mem::replace(room, less);
            if !std::mem::replace(&mut self.has_changed[mention.row], true) {
                self.settled_slack.push((mention.row, before));
            }
        }
    }
}

fn end_index(end: BoxEnd) -> usize {
    2 * end.parameter.index() + end.side.index()
}

fn row_slack(row: &Row, envelope: &DecoupledEnvelope) -> Option<Rational> {
    Some(&row.bound - &row.value(envelope)?)
}
