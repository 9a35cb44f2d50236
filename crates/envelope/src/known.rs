//! What is known to stand against wider boxes: [`Known`].

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope};

use crate::cut::Cut;

/// The cuts that a search has come across, and how much room each leaves to a box inside the
/// envelope, the present one.
///
/// Only wider boxes are asked about, so a cut that stands against a box with one end moved has that
/// end in one of its rows: an index by end, and the room left in each row, make the question cheap
/// however many parameters a cut is about.
#[derive(Clone, Debug, Default)]
pub(crate) struct Known {
    cuts: Vec<Cut>,
    /// For each cut, the room that each of its rows leaves; `None` if the row does not hold because
    /// an infinite end counts.
    room: Vec<Vec<Option<Rational>>>,
    /// By end: where it counts.
    mentions: BTreeMap<BoxEnd, Vec<Mention>>,
    /// Ends that cannot be infinite.
    finite: BTreeSet<BoxEnd>,
    /// The present box, if it is known.
    looked_at: Option<DecoupledEnvelope>,
    /// The room of rows before it was changed, in order, since the present box was settled.
    before: Vec<(usize, usize, Option<Rational>)>,
}

/// A cut that an end counts in.
#[derive(Clone, Debug)]
struct Mention {
    cut: usize,
    /// The rows with the end, and its factor in each.
    rows: Vec<(usize, Rational)>,
}

impl Known {
    /// One more cut. The present box, which is settled, is this one.
    pub(crate) fn add(&mut self, cut: Cut, envelope: &DecoupledEnvelope) {
        self.looked_at = None;
        let index = self.cuts.len();
        let mut rows: BTreeMap<BoxEnd, Vec<(usize, Rational)>> = BTreeMap::new();
        for (place, row) in cut.rows.iter().enumerate() {
            for (end, factor) in &row.factors {
                rows.entry(*end).or_default().push((place, factor.clone()));
            }
        }
        for (end, rows) in rows {
            let mention = Mention { cut: index, rows };
            self.mentions.entry(end).or_default().push(mention);
        }
        self.room.push(room(&cut, envelope));
        self.cuts.push(cut);
    }

    /// The end was refused to be infinite, and will be in all wider boxes.
    pub(crate) fn set_finite(&mut self, end: BoxEnd) {
        self.finite.insert(end);
    }

    /// The present box is this one, if it was another.
    pub(crate) fn look_at(&mut self, envelope: &DecoupledEnvelope) {
        if self.looked_at.as_ref() != Some(envelope) {
            self.reset(envelope);
            self.looked_at = Some(envelope.clone());
        }
    }

    /// The present box is this one.
    fn reset(&mut self, envelope: &DecoupledEnvelope) {
        self.before.clear();
        for (cut, left) in self.cuts.iter().zip(&mut self.room) {
            *left = room(cut, envelope);
        }
    }

    /// The present box is the one to come back to.
    pub(crate) fn settle(&mut self) {
        self.before.clear();
    }

    /// The present box is the one that was settled last; at first, that of the cut that was added
    /// first.
    pub(crate) fn undo(&mut self) {
        self.looked_at = None;
        for (cut, place, room) in self.before.drain(..).rev() {
            self.room[cut][place] = room;
        }
    }

    /// Whether the present box with an end moved out from `from` to `to` is known not to be inside
    /// the envelope. `None` is infinitely far.
    pub(crate) fn refuses(&self, end: BoxEnd, from: &Rational, to: Option<&Rational>) -> bool {
        to.is_none() && self.finite.contains(&end) || self.against(end, from, to).is_some()
    }

    /// A cut that stands against that box.
    pub(crate) fn against(
        &self,
        end: BoxEnd,
        from: &Rational,
        to: Option<&Rational>,
    ) -> Option<&Cut> {
        let mut mentions = self.mentions.get(&end)?.iter();
        let found = mentions.find(|mention| {
            let cut = &self.cuts[mention.cut];
            let mut rows = cut.rows.iter().zip(&self.room[mention.cut]).enumerate();
            !rows.any(|(place, (row, room))| {
                let factor = mention.rows.iter().find(|(own, _)| *own == place);
                let left = match (room, factor, to) {
                    (None, ..) | (_, Some(_), None) => return false,
                    (Some(room), None, _) => room.clone(),
                    (Some(room), Some((_, factor)), Some(to)) => room - &(factor * &(to - from)),
                };
                left.is_positive() || left.is_zero() && !row.is_strict
            })
        });
        found.map(|mention| &self.cuts[mention.cut])
    }

    /// The present box is the one with this end moved out.
    pub(crate) fn moved(&mut self, end: BoxEnd, from: &Rational, to: Option<&Rational>) {
        self.looked_at = None;
        for mention in self.mentions.get(&end).into_iter().flatten() {
            for (place, factor) in &mention.rows {
                let room = &mut self.room[mention.cut][*place];
                let less = match (&*room, to) {
                    (Some(room), Some(to)) => Some(room - &(factor * &(to - from))),
                    _ => None,
                };
                let before = std::mem::replace(room, less);
                self.before.push((mention.cut, *place, before));
            }
        }
    }
}

fn room(cut: &Cut, envelope: &DecoupledEnvelope) -> Vec<Option<Rational>> {
    let room = |row: &crate::row::Row| Some(&row.bound - &row.value(envelope)?);
    cut.rows.iter().map(room).collect()
}
