//! Margins of a valid plan's numeric conditions.

use std::collections::BTreeMap;

use elbowroom_num::Rational;

use super::polynomial::Polynomial;
use super::segment::Segment;
use super::state::Reading;
use super::violation::{ActionInstance, ConditionTime};
use crate::ground::{Condition, Expression};
use crate::problem::Comparison;

/// Margin of a comparison that an action or the goal needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Margin {
    /// The action; `None` for the goal.
    pub action: Option<ActionInstance>,
    /// Condition of the action that contains it.
    pub when: ConditionTime,
    /// The comparison in PDDL notation.
    pub condition: String,
    /// Difference of the greater and the smaller side at the tightest moment; 0 for equations. For
    /// over-all conditions, the limit at the ends counts.
    pub margin: Rational,
    /// Tightest moment.
    pub time: Rational,
    /// `true` if a margin of 0 would be a violation.
    pub is_strict: bool,
}

/// A comparison that must hold, with the side that must not be smaller first.
pub(super) struct Demand<'a> {
    pub(super) greater: &'a Expression,
    pub(super) smaller: &'a Expression,
    pub(super) is_strict: bool,
    pub(super) is_equation: bool,
}

impl<'a> Demand<'a> {
    /// Returns the demand of a conjunct; `None` if it is not a comparison, negated or not.
    pub(super) fn of(conjunct: &'a Condition) -> Option<Self> {
        let (comparison, left, right) = match conjunct {
            Condition::Compare(comparison, left, right) => (*comparison, left, right),
            Condition::Not(part) => match &**part {
                Condition::Compare(comparison, left, right) => {
                    (opposite(*comparison)?, left, right)
                }
                _ => return None,
            },
            _ => return None,
        };
        let (greater, smaller) = match comparison {
            Comparison::Less | Comparison::AtMost => (right, left),
            _ => (left, right),
        };
        Some(Self {
            greater,
            smaller,
            is_strict: matches!(comparison, Comparison::Less | Comparison::Greater),
            is_equation: comparison == Comparison::Equal,
        })
    }
}

/// Returns the comparison that holds when this one does not; `!=` has none.
fn opposite(comparison: Comparison) -> Option<Comparison> {
    match comparison {
        Comparison::Less => Some(Comparison::AtLeast),
        Comparison::AtMost => Some(Comparison::Greater),
        Comparison::AtLeast => Some(Comparison::Less),
        Comparison::Greater => Some(Comparison::AtMost),
        Comparison::Equal => None,
    }
}

/// Step (`None`: the goal), kind, and position among the conjuncts.
type Key = (Option<usize>, ConditionTime, usize);

/// Tightest margins until now.
#[derive(Debug, Default)]
pub(super) struct Margins(BTreeMap<Key, (Rational, Rational)>);

impl Margins {
    /// Records the margin of a demand that is read once, at `time`.
    pub(super) fn read(
        &mut self,
        key: Key,
        demand: &Demand<'_>,
        reading: &Reading<'_>,
        time: &Rational,
    ) {
        if let (Ok(greater), Ok(smaller)) =
            (reading.value(demand.greater), reading.value(demand.smaller))
        {
            let gap = if demand.is_equation {
                Rational::ZERO
            } else {
                greater - smaller
            };
            self.note(key, gap, time.clone());
        }
    }

    /// Records the tightest margin of a demand throughout a piece that began at `time`.
    pub(super) fn watch(
        &mut self,
        key: Key,
        demand: &Demand<'_>,
        piece: &Segment<'_>,
        duration: Option<&Rational>,
        time: &Rational,
    ) {
        if let Ok(gap) = piece.difference(demand.greater, demand.smaller, duration) {
            let gap = if demand.is_equation {
                gap.minus(&gap)
            } else {
                gap
            };
            for offset in extremes(&gap, piece) {
                self.note(key, gap.at(&offset), time + offset);
            }
        }
    }

    fn note(&mut self, key: Key, margin: Rational, time: Rational) {
        let entry = self
            .0
            .entry(key)
            .or_insert_with(|| (margin.clone(), time.clone()));
        if margin < entry.0 {
            *entry = (margin, time);
        }
    }

    /// Returns all margins with their keys, in the order of the plan's steps, the goal first.
    pub(super) fn into_entries(self) -> impl Iterator<Item = (Key, (Rational, Rational))> {
        self.0.into_iter()
    }
}

/// Returns the positions of possible minima of a polynomial on a piece. Beyond the second degree,
/// or if the piece has irrational ends, they are approximated within a millionth.
fn extremes(polynomial: &Polynomial, piece: &Segment<'_>) -> Vec<Rational> {
    let (from, to) = piece.ends();
    let mut offsets = vec![from.clone()];
    if polynomial.degree() > 0 {
        let derivative = polynomial.derivative();
        for root in derivative.roots_within(piece.length) {
            let narrow = derivative
                .square_free()
                .narrowed(&root, &Rational::new(1, 1_000_000));
            let offset = narrow.lower();
            if *offset > from && *offset < to {
                offsets.push(offset.clone());
            }
        }
        offsets.push(to);
    }
    offsets
}
