//! The time between two happening groups: facts are constant and numbers may move.
//!
//! To check a condition at every moment of such a piece, the piece is cut at the zeros of all
//! differences that the condition compares. No comparison changes between two cuts. So it is
//! sufficient to evaluate the condition at each cut and once between neighbouring cuts, whatever
//! its logical form.

use elbowroom_num::Rational;

use super::evaluate::{Fault, compare_signs, evaluate};
use super::instant::Instant;
use super::polynomial::{Polynomial, Root};
use super::sign_cells::{Position, ZeroSet, cells, product};
use super::state::{BasicState, Motion};
use crate::derivation::{Derivation, Moment, holds};
use crate::ground::{Condition, Expression, FactId};
use crate::problem::Comparison;

/// Moments from one happening group until just before the next.
pub(super) struct Segment<'a> {
    /// State right after the earlier group.
    pub(super) now: &'a BasicState,
    pub(super) motion: &'a Motion,
    pub(super) length: &'a Rational,
    pub(super) derivation: &'a Derivation,
    pub(super) slack: &'a Rational,
    /// Part of the piece to check; all of it if `None`.
    pub(super) part: Option<&'a SegmentPart>,
}

/// Part of a piece during which the same processes are active and no event happens.
#[derive(Clone, Debug)]
pub(super) struct SegmentPart {
    /// Its beginning, on the clock of the piece.
    pub(super) from: Instant,
    /// Its end, which does not belong to it; `None` if it consists of the beginning only.
    pub(super) to: Option<Instant>,
    /// `true` if the beginning does not belong to it, because an event happens right after that
    /// moment.
    pub(super) is_after: bool,
}

/// Moment at which a condition becomes false. Times count from the beginning of the piece.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Falsification {
    /// The earliest moment of falsehood, or an approximation from below.
    pub(super) at: Rational,
    /// `true` if the condition still holds at that moment, and fails right after it.
    pub(super) is_after: bool,
    /// `true` if `at` is the exact moment. Otherwise the moment is irrational, and `at` is within a
    /// millionth below it.
    pub(super) is_exact: bool,
    /// A moment at which the condition is false, or the end of the piece, if it stays false.
    pub(super) witness: Rational,
}

impl Falsification {
    /// Returns `true` if this moment comes first.
    pub(super) fn is_before(&self, other: &Self) -> bool {
        (&self.at, self.is_after) < (&other.at, other.is_after)
    }
}

/// Truth values of some conditions from a moment of a piece on.
pub(super) struct KnownTruths {
    /// The moment, since the beginning of the piece. If it is irrational, it is up to a millionth
    /// later.
    pub(super) at: Rational,
    /// `true` if `at` is the exact moment.
    pub(super) is_exact: bool,
    /// `true` if the values hold only right after that moment.
    pub(super) is_open: bool,
    /// Truth value of each condition.
    pub(super) holds: Vec<bool>,
}

impl Segment<'_> {
    /// Returns the first moment at which `condition`, of an action with this duration, fails. The
    /// beginning of the piece counts only if `includes_start`.
    pub(super) fn first_falsification(
        &self,
        condition: &Condition,
        duration: Option<&Rational>,
        includes_start: bool,
    ) -> Result<Option<Falsification>, Fault> {
        let reads_derived = self.derivation.is_read_by(condition);
        let includes_start = includes_start && !self.part.is_some_and(|part| part.is_after);
        if !includes_start && self.part.is_some_and(|part| part.to.is_none()) {
            return Ok(None);
        }
        if !self.is_time_dependent(condition, reads_derived) {
            let view = self.view(duration, Position::Point(Rational::ZERO));
            let is_broken = !self.evaluate_condition(condition, &view, reads_derived)?;
            let (from, to) = self.ends();
            return Ok(is_broken.then(|| Falsification {
                at: from,
                is_after: !includes_start,
                is_exact: self.is_start_exact(),
                witness: to,
            }));
        }
        let cuts = self.zeros(condition, duration, reads_derived);
        for cell in cells(&cuts, self.length, self.part, includes_start) {
            let view = self.view(duration, cell.place);
            if self.evaluate_condition(condition, &view, reads_derived)? {
                continue;
            }
            let narrow =
                product(&cuts.polynomials).narrowed(&cell.from, &Rational::new(1, 1_000_000));
            let sample = view.place.near();
            return Ok(Some(Falsification {
                at: narrow.lower().clone(),
                is_after: cell.is_open,
                is_exact: matches!(narrow, Root::Exact(_)),
                witness: if cell.is_last { self.ends().1 } else { sample },
            }));
        }
        Ok(None)
    }

    /// Returns the truth values of several conditions, without `?duration`, in each cell between
    /// their common cuts, in order from the beginning of the piece.
    pub(super) fn course(&self, conditions: &[&Condition]) -> Result<Vec<KnownTruths>, Fault> {
        let all = Condition::And(conditions.iter().copied().cloned().collect());
        let reads_derived = self.derivation.is_read_by(&all);
        if !self.is_time_dependent(&all, reads_derived) {
            // The state at the beginning of a piece is known. At the beginning of a part, facts may
            // have changed.
            let Some(part) = self.part else {
                return Ok(Vec::new());
            };
            let view = self.view(None, Position::Point(Rational::ZERO));
            let looks = conditions
                .iter()
                .map(|condition| self.evaluate_condition(condition, &view, reads_derived));
            return Ok(vec![KnownTruths {
                at: part.from.near(),
                is_exact: self.is_start_exact(),
                is_open: part.is_after,
                holds: looks.collect::<Result<_, _>>()?,
            }]);
        }
        let cuts = self.zeros(&all, None, reads_derived);
        let polynomial = product(&cuts.polynomials);
        let mut known = Vec::new();
        let includes_start = !self.part.is_some_and(|part| part.is_after);
        for cell in cells(&cuts, self.length, self.part, includes_start) {
            let view = self.view(None, cell.place);
            let looks = conditions
                .iter()
                .map(|condition| self.evaluate_condition(condition, &view, reads_derived));
            let narrow = polynomial.narrowed(&cell.from, &Rational::new(1, 1_000_000));
            known.push(KnownTruths {
                at: narrow.lower().clone(),
                is_exact: matches!(narrow, Root::Exact(_)),
                is_open: cell.is_open,
                holds: looks.collect::<Result<_, _>>()?,
            });
        }
        Ok(known)
    }

    /// Returns `true` if the condition holds at a moment of the piece.
    pub(super) fn holds_at(&self, condition: &Condition, at: &Instant) -> Result<bool, Fault> {
        let reads_derived = self.derivation.is_read_by(condition);
        let view = self.view(None, Position::Instant(at.clone()));
        self.evaluate_condition(condition, &view, reads_derived)
    }

    /// Returns the truth value of the condition right after the beginning of the part, and the
    /// first moment after that at which, or right after which, it changes.
    pub(super) fn next_change(
        &self,
        condition: &Condition,
    ) -> Result<(bool, Option<Instant>), Fault> {
        let reads_derived = self.derivation.is_read_by(condition);
        if !self.is_time_dependent(condition, reads_derived) {
            let view = self.view(None, Position::Point(Rational::ZERO));
            return Ok((
                self.evaluate_condition(condition, &view, reads_derived)?,
                None,
            ));
        }
        let cuts = self.zeros(condition, None, reads_derived);
        let polynomial = product(&cuts.polynomials);
        let mut first = None;
        for cell in cells(&cuts, self.length, self.part, false) {
            let holds =
                self.evaluate_condition(condition, &self.view(None, cell.place), reads_derived)?;
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

    /// Returns the beginning and the end of the part. Irrational ends are approximated within a
    /// millionth from below.
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

    /// Returns `left - right` as a function of the time since the piece began.
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

    fn view<'b>(&'b self, duration: Option<&'b Rational>, place: Position) -> View<'b> {
        View {
            piece: self,
            duration,
            place,
        }
    }

    fn evaluate_condition(
        &self,
        condition: &Condition,
        view: &View<'_>,
        derive: bool,
    ) -> Result<bool, Fault> {
        if derive {
            // Rules cannot read `?duration`.
            let plain = self.view(None, view.place.clone());
            let derived = self.derivation.derive(&plain);
            holds(
                condition,
                &self.derivation.with_derived_facts(view, &derived),
            )
        } else {
            holds(condition, view)
        }
    }

    /// Returns `true` if a number that the condition compares moves.
    fn is_time_dependent(&self, condition: &Condition, reads_derived: bool) -> bool {
        if self.motion.is_constant() {
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

    /// Returns the zeros of all differences that the condition compares.
    fn zeros(
        &self,
        condition: &Condition,
        duration: Option<&Rational>,
        reads_derived: bool,
    ) -> ZeroSet {
        let mut polynomials = Vec::new();
        let mut add = |left: &Expression, right: &Expression, duration: Option<&Rational>| {
            // An undefined comparison has no zeros. It is undefined in each cell, and the other
            // parts of the condition decide whether that matters.
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
        // The cells have to begin and end with the part.
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
        ZeroSet {
            roots: product(&polynomials).roots_with(self.length, exact),
            polynomials,
        }
    }
}

/// The piece at one place.
struct View<'a> {
    piece: &'a Segment<'a>,
    duration: Option<&'a Rational>,
    place: Position,
}

impl View<'_> {
    fn sign(&self, polynomial: &Polynomial) -> i32 {
        match &self.place {
            Position::Point(at) => polynomial.at(at).signum(),
            Position::Instant(at) => at.sign(polynomial),
            Position::Root(low, high) => {
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
