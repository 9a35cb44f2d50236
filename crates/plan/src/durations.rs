//! Which durations a domain allows.

use elbowroom_model::ground::{DurationConstraint, Expression};
use elbowroom_model::problem::Comparison;
use elbowroom_num::{End, Interval, Rational};

/// The durations that all these constraints allow, or `None` where `value` knows no value for
/// something that a bound mentions.
pub(crate) fn allowed<'a>(
    constraints: impl IntoIterator<Item = &'a DurationConstraint>,
    value: &mut impl FnMut(&Expression) -> Option<Rational>,
) -> Option<Interval> {
    let mut allowed = Interval::at_least(Rational::ZERO);
    for constraint in constraints {
        let bound = constraint.bound.evaluate(value)?;
        let upto = |upper| Interval {
            lower: End::Infinite,
            upper,
        };
        let from = |lower| Interval {
            lower,
            upper: End::Infinite,
        };
        allowed = allowed.intersection(&match constraint.comparison {
            Comparison::Equal => Interval::point(bound),
            Comparison::AtMost => Interval::at_most(bound),
            Comparison::AtLeast => Interval::at_least(bound),
            Comparison::Less => upto(End::Open(bound)),
            Comparison::Greater => from(End::Open(bound)),
        });
    }
    Some(allowed)
}
