//! Known reasons that refuse wider boxes: [`Known`].

use std::cmp::Ordering;
use std::collections::BTreeSet;
use std::ops::Range;

use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope};

use crate::cut::{Cut, Ground};
use crate::row::Row;

/// The cuts that a search has come across, and how much room each leaves to a box inside the
/// envelope, the present one.
///
/// Only wider boxes are asked about, so a cut that stands against a box with one end moved has that
/// end in one of its rows: an index by end, and the room left in each row, make the question cheap
/// however many parameters a cut is about.
#[derive(Clone, Debug, Default)]
pub(crate) struct Known {
    cuts: Vec<KnownCut>,
    rows: Vec<Row>,
    /// For each row, the room that it leaves; `None` if it does not hold because an infinite end counts.
    room: Vec<Option<Rational>>,
    /// By end ([`place`]), and then by cut: where it counts.
    mentions: Vec<Vec<Mention>>,
    /// Ends that cannot be infinite.
    finite: BTreeSet<BoxEnd>,
    /// The present box, if it is known.
    looked_at: Option<DecoupledEnvelope>,
    /// The room of rows in the box that was settled, where it has changed since.
    before: Vec<(usize, Option<Rational>)>,
    /// For each row, whether it has.
    has_changed: Vec<bool>,
}

/// Rows, at least one of which has to hold.
#[derive(Clone, Debug)]
struct KnownCut {
    rows: Range<usize>,
    /// Proof of the cut; `None` if the condition is only wanted.
    ground: Option<Ground>,
}

/// A row that an end counts in.
#[derive(Clone, Debug)]
struct Mention {
    cut: usize,
    row: usize,
    factor: Rational,
}

impl Known {
    /// One more cut. The present box, which is settled, is this one.
    pub(crate) fn add(&mut self, cut: Cut, envelope: &DecoupledEnvelope) {
        self.add_rows(cut.rows, Some(cut.ground), envelope);
    }

    /// One more condition that boxes are wanted to meet, though those inside the envelope need not.
    pub(crate) fn want(&mut self, row: Row, envelope: &DecoupledEnvelope) {
        self.add_rows(vec![row], None, envelope);
    }

    fn add_rows(&mut self, rows: Vec<Row>, ground: Option<Ground>, envelope: &DecoupledEnvelope) {
        self.looked_at = None;
        let (cut, first) = (self.cuts.len(), self.rows.len());
        for (offset, row) in rows.iter().enumerate() {
            for (end, factor) in &row.factors {
                let place = place(*end);
                if place >= self.mentions.len() {
                    self.mentions.resize_with(place + 1, Vec::new);
                }
                let mentions = &mut self.mentions[place];
                // Most ends count in one row or two.
                if mentions.len() == mentions.capacity() {
                    mentions.reserve_exact(mentions.len().max(1));
                }
                mentions.push(Mention {
                    cut,
                    row: first + offset,
                    factor: factor.clone(),
                });
            }
            self.room.push(room(row, envelope));
            self.has_changed.push(false);
        }
        self.rows.extend(rows);
        let rows = first..self.rows.len();
        self.cuts.push(KnownCut { rows, ground });
    }

    /// The end was refused to be infinite, and will be in all wider boxes.
    pub(crate) fn set_finite(&mut self, end: BoxEnd) {
        self.finite.insert(end);
    }

    /// The present box is this one, if it was another.
    pub(crate) fn look_at(&mut self, envelope: &DecoupledEnvelope) {
        if self.looked_at.as_ref() != Some(envelope) {
            self.settle();
            self.room = self.rows.iter().map(|row| room(row, envelope)).collect();
            self.looked_at = Some(envelope.clone());
        }
    }

    /// The present box is the one to come back to.
    pub(crate) fn settle(&mut self) {
        for (row, _) in self.before.drain(..) {
            self.has_changed[row] = false;
        }
    }

    /// The present box is the one that was settled last; at first, that of the cut that was added
    /// first.
    pub(crate) fn undo(&mut self) {
        self.looked_at = None;
        for (row, room) in self.before.drain(..) {
            self.room[row] = room;
            self.has_changed[row] = false;
        }
    }

    /// Returns `true` if the present box with an end moved out from `from` to `to` is known to be
    /// outside the envelope, or is not wanted. `None` is infinitely far.
    pub(crate) fn refuses(&self, end: BoxEnd, from: &Rational, to: Option<&Rational>) -> bool {
        to.is_none() && self.finite.contains(&end) || self.against(end, from, to).is_some()
    }

    /// The rows that stand against that box, and why one of them has to hold.
    pub(crate) fn against(
        &self,
        end: BoxEnd,
        from: &Rational,
        to: Option<&Rational>,
    ) -> Option<(&[Row], Option<&Ground>)> {
        let mentions = self.mentions.get(place(end))?;
        let farther = to.map(|to| to - from);
        let mut cuts = mentions.chunk_by(|one, other| one.cut == other.cut);
        let found = cuts.find(|mentions| {
            let mut rows = self.cuts[mentions[0].cut].rows.clone();
            !rows.any(|row| {
                let mention = mentions.iter().find(|mention| mention.row == row);
                let left = match (&self.room[row], mention, &farther) {
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

    /// The present box is the one with this end moved out.
    pub(crate) fn moved(&mut self, end: BoxEnd, from: &Rational, to: Option<&Rational>) {
        self.looked_at = None;
        let farther = to.map(|to| to - from);
        for mention in self.mentions.get(place(end)).into_iter().flatten() {
            let room = &mut self.room[mention.row];
            let less = match (&*room, &farther) {
                (Some(room), Some(farther)) => Some(room - &(&mention.factor * farther)),
                _ => None,
            };
            let before = std::mem::replace(room, less);
            if !std::mem::replace(&mut self.has_changed[mention.row], true) {
                self.before.push((mention.row, before));
            }
        }
    }
}

fn place(end: BoxEnd) -> usize {
    2 * end.parameter.index() + end.side.index()
}

fn room(row: &Row, envelope: &DecoupledEnvelope) -> Option<Rational> {
    Some(&row.bound - &row.value(envelope)?)
}
