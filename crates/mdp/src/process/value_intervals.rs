//! Numbers that actions change, represented by intervals of their values.
//!
//! A condition that compares a number is an additional fact. In the upper bound it holds if some of
//! the values satisfy it, in the lower bound if all do. Amounts drawn at an action's end are
//! divided into intervals where they decide a condition (`numbers`).

use elbowroom_model::ground::FluentId;
use elbowroom_model::problem::Comparison;
use elbowroom_num::Rational;
use elbowroom_sim::Rule;

use crate::settings::Side;

/// Units per 1: numbers are stored in millionths.
pub(super) const UNIT: i64 = 1_000_000;

/// Bound, in millionths, beyond which a number counts as infinite.
pub(super) const INFINITE: i64 = 1 << 60;

/// A closed interval of values, in millionths.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct Span {
    pub(crate) low: i64,
    pub(crate) high: i64,
}

/// A number that actions change.
#[derive(Clone, Debug)]
pub(crate) struct Number {
    pub(crate) fluent: FluentId,
    pub(crate) initial: Span,
    /// Values that are distinguished from larger ones, in order.
    pub(super) edges: Vec<i64>,
    /// Values that are represented exactly: only constant amounts lead to them.
    pub(super) known: Vec<i64>,
}

/// A comparison, represented as a fact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Test {
    pub(crate) number: usize,
    pub(crate) comparison: ComparisonOperator,
    /// The bound in millionths.
    pub(crate) bound: i64,
}

/// Comparison of a number with a bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ComparisonOperator {
    AtMost,
    AtLeast,
    Equal,
    Unequal,
}

/// Change of a number by a happening.
#[derive(Clone, Debug)]
pub(crate) struct Amount {
    pub(crate) number: usize,
    pub(crate) change: ChangeOperator,
    pub(crate) by: ChangeValue,
}

/// The operator of a change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ChangeOperator {
    /// The value is assigned.
    Set,
    /// The value is added.
    Add,
    /// The value is subtracted.
    Subtract,
}

/// The value of a change.
#[derive(Clone, Debug)]
pub(crate) enum ChangeValue {
    /// A constant, in millionths.
    Constant(i64),
    /// A random value: drawn by a rule of the world file that applies to a planned value.
    Random { rule: Rule, planned: f64 },
}

/// Returns a number in millionths; `None` if that is not a whole number.
pub(crate) fn units(value: &Rational) -> Option<i64> {
    let (whole, one) = (value * &Rational::from(UNIT)).as_small()?;
    (one == 1 && whole.abs() < INFINITE).then_some(whole)
}

impl Span {
    pub(crate) fn point(value: i64) -> Self {
        Self {
            low: value,
            high: value,
        }
    }

    /// Returns the smallest interval around a value that may lie between two whole numbers of
    /// millionths.
    pub(super) fn around(value: &Rational) -> Option<Self> {
        let all = value * &Rational::from(UNIT);
        let (low, _) = all.floor().as_small()?;
        let (high, _) = all.ceil().as_small()?;
        Some(Self { low, high })
    }

    fn plus(self, other: Self) -> Self {
        Self {
            low: sum(self.low, other.low),
            high: sum(self.high, other.high),
        }
    }

    fn negated(self) -> Self {
        Self {
            low: -self.high,
            high: -self.low,
        }
    }
}

/// Adds two lower or two upper ends; values beyond [`INFINITE`] are infinite.
fn sum(left: i64, right: i64) -> i64 {
    if left.abs() >= INFINITE {
        left
    } else {
        left.saturating_add(right).clamp(-INFINITE, INFINITE)
    }
}

impl Test {
    /// Creates a comparison with a bound in millionths.
    pub(crate) fn new(number: usize, comparison: Comparison, bound: i64) -> Self {
        let (comparison, bound) = match comparison {
            // In whole millionths, a value is below a bound if it is at most the bound minus 1.
            Comparison::Less => (ComparisonOperator::AtMost, bound - 1),
            Comparison::AtMost => (ComparisonOperator::AtMost, bound),
            Comparison::Equal => (ComparisonOperator::Equal, bound),
            Comparison::AtLeast => (ComparisonOperator::AtLeast, bound),
            Comparison::Greater => (ComparisonOperator::AtLeast, bound + 1),
        };
        Self {
            number,
            comparison,
            bound,
        }
    }

    /// Returns the complementary comparison.
    pub(crate) fn negated(self) -> Self {
        let (comparison, bound) = match self.comparison {
            ComparisonOperator::AtMost => (ComparisonOperator::AtLeast, self.bound + 1),
            ComparisonOperator::AtLeast => (ComparisonOperator::AtMost, self.bound - 1),
            ComparisonOperator::Equal => (ComparisonOperator::Unequal, self.bound),
            ComparisonOperator::Unequal => (ComparisonOperator::Equal, self.bound),
        };
        Self {
            comparison,
            bound,
            ..self
        }
    }

    /// Returns `true` if it holds for some of the values (above), or for all (below).
    pub(super) fn holds(self, span: Span, side: Side) -> bool {
        let bound = self.bound;
        match side {
            Side::Above => match self.comparison {
                ComparisonOperator::AtMost => span.low <= bound,
                ComparisonOperator::AtLeast => span.high >= bound,
                ComparisonOperator::Equal => span.low <= bound && bound <= span.high,
                ComparisonOperator::Unequal => span != Span::point(bound),
            },
            Side::Below => !self.negated().holds(span, Side::Above),
        }
    }

    /// Returns the values after which its truth changes.
    pub(super) fn edges(self) -> Vec<i64> {
        match self.comparison {
            ComparisonOperator::AtMost => vec![self.bound],
            ComparisonOperator::AtLeast => vec![self.bound - 1],
            ComparisonOperator::Equal | ComparisonOperator::Unequal => {
                vec![self.bound - 1, self.bound]
            }
        }
    }
}

impl Number {
    pub(crate) fn new(fluent: FluentId, initial: i64) -> Self {
        Self {
            fluent,
            initial: Span::point(initial),
            edges: Vec::new(),
            known: Vec::new(),
        }
    }

    /// Widens an interval to all values that need not be distinguished from it. A single value that
    /// is represented exactly stays.
    pub(super) fn widened(&self, span: Span) -> Span {
        if span.low == span.high && self.known.binary_search(&span.low).is_ok() {
            return span;
        }
        let below = self.edges.partition_point(|edge| *edge < span.low);
        let above = self.edges.partition_point(|edge| *edge < span.high);
        Span {
            low: below
                .checked_sub(1)
                .map_or(-INFINITE, |place| self.edges[place] + 1),
            high: self.edges.get(above).copied().unwrap_or(INFINITE),
        }
    }
}

impl Amount {
    /// Returns the position of the number.
    pub(crate) fn number(&self) -> usize {
        self.number
    }

    /// Returns `true` if the change may make a false comparison true.
    pub(crate) fn may_help(&self, test: &Test) -> bool {
        let rises = match (self.change, &self.by) {
            (ChangeOperator::Set, _) | (_, ChangeValue::Random { .. }) => None,
            (ChangeOperator::Add, ChangeValue::Constant(value)) => Some(*value > 0),
            (ChangeOperator::Subtract, ChangeValue::Constant(value)) => Some(*value < 0),
        };
        let wanted = match test.comparison {
            ComparisonOperator::AtLeast => Some(true),
            ComparisonOperator::AtMost => Some(false),
            ComparisonOperator::Equal | ComparisonOperator::Unequal => None,
        };
        self.number == test.number && (rises.is_none() || wanted.is_none() || rises == wanted)
    }

    /// Returns `true` if it assigns the number.
    pub(crate) fn sets(&self) -> bool {
        self.change == ChangeOperator::Set
    }

    pub(crate) fn is_drawn(&self) -> bool {
        matches!(self.by, ChangeValue::Random { .. })
    }

    pub(super) fn apply_to(&self, number: &Number, before: Span, by: Span) -> Span {
        let after = match self.change {
            ChangeOperator::Set => by,
            ChangeOperator::Add => before.plus(by),
            ChangeOperator::Subtract => before.plus(by.negated()),
        };
        number.widened(after)
    }
}
