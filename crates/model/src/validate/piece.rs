//! The time between two happening groups, where facts stand still and numbers may move.
//!
//! A condition is checked at every moment of such a piece by cutting the piece at the zeros of all
//! differences that the condition compares: between two cuts no comparison changes, so one look
//! at each cut and one between each two decide, whatever the condition's logical form.

use elbowroom_num::Rational;

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
        if !self.concerns(condition, reads_derived) {
            let view = self.view(duration, Place::Point(Rational::ZERO));
            let is_broken = !self.look(condition, &view, reads_derived)?;
            return Ok(is_broken.then(|| Break {
                at: Rational::ZERO,
                is_after: !includes_start,
                is_exact: true,
                witness: self.length.clone(),
            }));
        }
        let cuts = self.cuts(condition, duration, reads_derived);
        for cell in cells(&cuts, self.length, includes_start) {
            let view = self.view(duration, cell.place);
            if self.look(condition, &view, reads_derived)? {
                continue;
            }
            let narrow =
                product(&cuts.polynomials).narrowed(&cell.from, &Rational::new(1, 1_000_000));
            let sample = match view.place {
                Place::Point(sample) | Place::Root(sample, _) => sample,
            };
            return Ok(Some(Break {
                at: narrow.lower().clone(),
                is_after: cell.is_open,
                is_exact: matches!(narrow, Root::Exact(_)),
                witness: if cell.is_last {
                    self.length.clone()
                } else {
                    sample
                },
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
            return Ok(Vec::new());
        }
        let cuts = self.cuts(&all, None, reads_derived);
        let polynomial = product(&cuts.polynomials);
        let mut known = Vec::new();
        for cell in cells(&cuts, self.length, true) {
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
        Cuts {
            roots: product(&polynomials).roots_within(self.length),
            polynomials,
        }
    }
}

struct Cuts {
    polynomials: Vec<Polynomial>,
    roots: Vec<Root>,
}

fn product(polynomials: &[Polynomial]) -> Polynomial {
    let one = Polynomial::constant(Rational::ONE);
    polynomials
        .iter()
        .fold(one, |product, polynomial| product.times(polynomial))
        .square_free()
}

/// One cut, or the moments strictly between two neighbouring cuts.
struct Cell {
    /// Where to look.
    place: Place,
    /// The cut itself, or the one on the left.
    from: Root,
    /// Whether these are moments between cuts.
    is_open: bool,
    /// Whether the cell reaches the end of the piece.
    is_last: bool,
}

/// A position within a piece.
#[derive(Clone)]
enum Place {
    Point(Rational),
    /// At the only zero, of any difference, between these two numbers.
    Root(Rational, Rational),
}

/// The cells of `[0, length)`, or of `(0, length)`, in order.
fn cells(cuts: &Cuts, length: &Rational, includes_start: bool) -> Vec<Cell> {
    let mut cells = Vec::new();
    let mut left = Root::Exact(Rational::ZERO);
    if includes_start {
        cells.push(Cell {
            place: Place::Point(Rational::ZERO),
            from: left.clone(),
            is_open: false,
            is_last: false,
        });
    }
    let end = Root::Exact(length.clone());
    for right in cuts.roots.iter().chain([&end]) {
        let is_last = *right == end;
        // Brackets share no point with other cuts, so the middle lies strictly between the two,
        // or at the common end of two brackets, which is no zero.
        let middle = (left.upper() + right.lower()) / Rational::from(2);
        cells.push(Cell {
            place: Place::Point(middle),
            from: left,
            is_open: true,
            is_last,
        });
        if !is_last {
            let place = match right {
                Root::Exact(value) => Place::Point(value.clone()),
                Root::Between(low, high) => Place::Root(low.clone(), high.clone()),
            };
            cells.push(Cell {
                place,
                from: right.clone(),
                is_open: false,
                is_last: false,
            });
        }
        left = right.clone();
    }
    cells
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
