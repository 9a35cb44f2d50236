//! The time between two happening groups, where facts stand still and numbers may move.
//!
//! A condition is checked at every moment of such a piece by cutting the piece at the zeros of all
//! differences that the condition compares: between two cuts no comparison changes, so one look
//! at each cut and one between each two decide, whatever the condition's logical form.

use elbowroom_num::Rational;

use super::cells::{Cuts, Place, cells, product};
use super::instant::Instant;
use super::polynomial::{Polynomial, Root};
use super::reading::{Fault, compare_signs, evaluate};
use super::state::{Motion, Now};
use crate::derivation::{Derivation, Moment, holds};
use crate::ground::{Condition, Expression, FactId};
use crate::problem::Comparison;

/// The moments from one happening group until just before the next.
pub(super) struct Piece<'a> {
    /// The state right after the earlier group.
    pub(super) now: &'a Now,
    pub(super) motion: &'a Motion,
    pub(super) length: &'a Rational,
    pub(super) derivation: &'a Derivation,
    pub(super) slack: &'a Rational,
    /// The part of the piece that is looked at; all of it if `None`.
    pub(super) part: Option<&'a Stretch>,
}

/// A part of a piece, throughout which the same processes are at work and no event happens.
#[derive(Clone, Debug)]
pub(super) struct Stretch {
    /// Its beginning, by the clock of the piece.
    pub(super) from: Instant,
    /// Its end, which does not belong to it; `None` if there is nothing but the beginning.
    pub(super) to: Option<Instant>,
    /// Whether the beginning does not belong to it: something happens right after that moment.
    pub(super) is_after: bool,
}

/// The moment at which a condition stops being true; times count from the beginning of the piece.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Break {
    /// The earliest moment of falsehood, or the latest number known not to be above it.
    pub(super) at: Rational,
    /// Whether the condition still holds at that very moment, and fails right after it.
    pub(super) is_after: bool,
    /// Whether `at` is that moment itself; else the moment is irrational, and `at` within a
    /// millionth below it.
    pub(super) is_exact: bool,
    /// A moment at which the condition is false, or the end of the piece, if it stays false.
    pub(super) witness: Rational,
}

impl Break {
    /// Whether this one comes first.
    pub(super) fn is_before(&self, other: &Self) -> bool {
        (&self.at, self.is_after) < (&other.at, other.is_after)
    }
}

/// What is known about some conditions from a moment of a piece on.
pub(super) struct Known {
    /// The moment, since the beginning of the piece; if it is irrational, up to a millionth less.
    pub(super) at: Rational,
    /// Whether `at` is that moment itself.
    pub(super) is_exact: bool,
    /// Whether it is so only right after that moment.
    pub(super) is_open: bool,
    /// The truth of each condition.
    pub(super) holds: Vec<bool>,
}

impl Piece<'_> {
    /// Where `condition`, of an action with this duration, first fails. The very beginning counts
    /// only if `includes_start`.
    pub(super) fn first_break(
        &self,
        condition: &Condition,
        duration: Option<&Rational>,
        includes_start: bool,
    ) -> Result<Option<Break>, Fault> {
        let reads_derived = self.derivation.is_read_by(condition);
        let includes_start = includes_start && !self.part.is_some_and(|part| part.is_after);
        if !includes_start && self.part.is_some_and(|part| part.to.is_none()) {
            return Ok(None);
        }
        if !self.concerns(condition, reads_derived) {
            let view = self.view(duration, Place::Point(Rational::ZERO));
            let is_broken = !self.look(condition, &view, reads_derived)?;
            let (from, to) = self.ends();
            return Ok(is_broken.then(|| Break {
                at: from,
                is_after: !includes_start,
                is_exact: self.is_start_exact(),
                witness: to,
            }));
        }
        let cuts = self.cuts(condition, duration, reads_derived);
        for cell in cells(&cuts, self.length, self.part, includes_start) {
            let view = self.view(duration, cell.place);
            if self.look(condition, &view, reads_derived)? {
                continue;
            }
            let narrow =
                product(&cuts.polynomials).narrowed(&cell.from, &Rational::new(1, 1_000_000));
            let sample = view.place.near();
            return Ok(Some(Break {
                at: narrow.lower().clone(),
                is_after: cell.is_open,
                is_exact: matches!(narrow, Root::Exact(_)),
                witness: if cell.is_last { self.ends().1 } else { sample },
            }));
        }
        Ok(None)
    }

    /// The truth of several conditions, read by nobody in particular, in each cell between their
    /// common cuts; in order, from the very beginning of the piece on.
    pub(super) fn course(&self, conditions: &[&Condition]) -> Result<Vec<Known>, Fault> {
        let all = Condition::And(conditions.iter().copied().cloned().collect());
        let reads_derived = self.derivation.is_read_by(&all);
        if !self.concerns(&all, reads_derived) {
            // The state at the beginning of a piece is known; at that of a part, facts may have
            // changed.
            let Some(part) = self.part else {
                return Ok(Vec::new());
            };
            let view = self.view(None, Place::Point(Rational::ZERO));
            let looks = conditions
                .iter()
                .map(|condition| self.look(condition, &view, reads_derived));
            return Ok(vec![Known {
                at: part.from.near(),
                is_exact: self.is_start_exact(),
                is_open: part.is_after,
                holds: looks.collect::<Result<_, _>>()?,
            }]);
        }
        let cuts = self.cuts(&all, None, reads_derived);
        let polynomial = product(&cuts.polynomials);
        let mut known = Vec::new();
        let includes_start = !self.part.is_some_and(|part| part.is_after);
        for cell in cells(&cuts, self.length, self.part, includes_start) {
            let view = self.view(None, cell.place);
            let looks = conditions
                .iter()
                .map(|condition| self.look(condition, &view, reads_derived));
            let narrow = polynomial.narrowed(&cell.from, &Rational::new(1, 1_000_000));
            known.push(Known {
                at: narrow.lower().clone(),
                is_exact: matches!(narrow, Root::Exact(_)),
                is_open: cell.is_open,
                holds: looks.collect::<Result<_, _>>()?,
            });
        }
        Ok(known)
    }

    /// Whether the condition holds at a moment of the piece.
    pub(super) fn holds_at(&self, condition: &Condition, at: &Instant) -> Result<bool, Fault> {
        let reads_derived = self.derivation.is_read_by(condition);
        let view = self.view(None, Place::Instant(at.clone()));
        self.look(condition, &view, reads_derived)
    }

    /// Whether the condition holds right after the beginning of the part, and the first moment
    /// after that at which, or right after which, it is otherwise.
    pub(super) fn turn(&self, condition: &Condition) -> Result<(bool, Option<Instant>), Fault> {
        let reads_derived = self.derivation.is_read_by(condition);
        if !self.concerns(condition, reads_derived) {
            let view = self.view(None, Place::Point(Rational::ZERO));
            return Ok((self.look(condition, &view, reads_derived)?, None));
        }
        let cuts = self.cuts(condition, None, reads_derived);
        let polynomial = product(&cuts.polynomials);
        let mut first = None;
        for cell in cells(&cuts, self.length, self.part, false) {
            let holds = self.look(condition, &self.view(None, cell.place), reads_derived)?;
            let first = *first.get_or_insert(holds);
            if holds != first {
                let at = Instant::of(cell.from, &polynomial);
                let exact = cuts.roots.iter().filter_map(|root| match root {
                    Root::Exact(value) => Some(value.clone()),
                    Root::Between(..) => None,
                });
                let ends = [Rational::ZERO, self.length.clone()];
                let others: Vec<_> = exact.chain(ends).collect();
                return Ok((first, Some(at.zero_of_one(&cuts.polynomials, &others))));
            }
        }
        Ok((first.unwrap_or(false), None))
    }

    /// Beginning and end of the part; where they are irrational, within a millionth below them.
    pub(super) fn ends(&self) -> (Rational, Rational) {
        match self.part {
            None => (Rational::ZERO, self.length.clone()),
            Some(part) => {
                let from = part.from.near();
                let to = part.to.as_ref().map(Instant::near);
                (from.clone(), to.unwrap_or(from))
            }
        }
    }

    fn is_start_exact(&self) -> bool {
        self.part.is_none_or(|part| part.from.as_exact().is_some())
    }

    /// `left - right` as a function of the time since the piece began.
    pub(super) fn difference(
        &self,
        left: &Expression,
        right: &Expression,
        duration: Option<&Rational>,
    ) -> Result<Polynomial, Fault> {
        let value = |part| {
            evaluate(part, duration, &|fluent| {
                self.motion.value(self.now, fluent)
            })
        };
        Ok(value(left)?.minus(&value(right)?))
    }

    fn view<'b>(&'b self, duration: Option<&'b Rational>, place: Place) -> View<'b> {
        View {
            piece: self,
            duration,
            place,
        }
    }

    fn look(&self, condition: &Condition, view: &View<'_>, derive: bool) -> Result<bool, Fault> {
        if derive {
            // Rules know no `?duration`.
            let plain = self.view(None, view.place.clone());
            let derived = self.derivation.derive(&plain);
            holds(condition, &self.derivation.on_top_of(view, &derived))
        } else {
            holds(condition, view)
        }
    }

    /// Whether anything that the condition compares moves.
    fn concerns(&self, condition: &Condition, reads_derived: bool) -> bool {
        if self.motion.is_still() {
            return false;
        }
        let mut concerns = false;
        let mut visit = |fluent| concerns |= self.motion.moves(fluent);
        condition.visit_fluents(&mut visit);
        if reads_derived {
            self.derivation
                .visit_bodies(&mut |body| body.visit_fluents(&mut visit));
        }
        concerns
    }

    /// The zeros of everything that the condition compares.
    fn cuts(
        &self,
        condition: &Condition,
        duration: Option<&Rational>,
        reads_derived: bool,
    ) -> Cuts {
        let mut polynomials = Vec::new();
        let mut add = |left: &Expression, right: &Expression, duration: Option<&Rational>| {
            // A comparison that says nothing cuts nothing: it says nothing in each cell, where the
            // other parts of the condition decide whether that matters.
            let Ok(difference) = self.difference(left, right, duration) else {
                return;
            };
            for slack in [self.slack.clone(), -self.slack] {
                let shifted = difference.plus(&Polynomial::constant(slack));
                if shifted.degree() > 0 && !polynomials.contains(&shifted) {
                    polynomials.push(shifted);
                }
            }
        };
        condition.visit_comparisons(&mut |left, right| add(left, right, duration));
        if reads_derived {
            self.derivation.visit_bodies(&mut |body| {
                body.visit_comparisons(&mut |left, right| add(left, right, None));
            });
        }
        // So that the cells begin and end with the part.
        if let Some(part) = self.part {
            for end in [Some(&part.from), part.to.as_ref()].into_iter().flatten() {
                polynomials.push(end.zero().clone());
            }
        }
        // Most zeros are those of lines, or of parabolas through the beginning.
        let plain = polynomials.iter();
        let mut exact: Vec<_> = plain
            .filter_map(|one| one.plain_root_within(self.length))
            .collect();
        exact.sort();
        exact.dedup();
        Cuts {
            roots: product(&polynomials).roots_with(self.length, exact),
            polynomials,
        }
    }
}

/// The piece seen at one place.
struct View<'a> {
    piece: &'a Piece<'a>,
    duration: Option<&'a Rational>,
    place: Place,
}

impl View<'_> {
    fn sign(&self, polynomial: &Polynomial) -> i32 {
        match &self.place {
            Place::Point(at) => polynomial.at(at).signum(),
            Place::Instant(at) => at.sign(polynomial),
            Place::Root(low, high) => {
                if polynomial.degree() > 0 && polynomial.count_roots_between(low, high) > 0 {
                    0
                } else {
                    polynomial.at(low).signum()
                }
            }
        }
    }
}

impl Moment<Fault> for View<'_> {
    fn fact(&self, fact: FactId) -> Result<bool, Fault> {
        Ok(self.piece.now.facts[fact.index()])
    }

    fn compare(
        &self,
        comparison: Comparison,
        left: &Expression,
        right: &Expression,
    ) -> Result<bool, Fault> {
        let difference = self.piece.difference(left, right, self.duration)?;
        let slack = Polynomial::constant(self.piece.slack.clone());
        let raised = self.sign(&difference.plus(&slack));
        let lowered = self.sign(&difference.minus(&slack));
        Ok(compare_signs(comparison, raised, lowered))
    }
}
